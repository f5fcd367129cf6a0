//! A fault of the host as `--fault` names it: `stall@1.5+0.5`, `nan@T+D`, `topology@T+D`, `panic@T`.

use host::engine::faults::{FaultKind, HostFault};

/// The kinds of fault by their names on the command line.
const NAMES: [(&str, FaultKind); 4] = [
    ("stall", FaultKind::Stall),
    ("panic", FaultKind::Panic),
    ("nan", FaultKind::NotANumber),
    ("topology", FaultKind::Topology),
];

/// The fault that `text` names.
///
/// # Errors
/// The text that was found, and the allowed texts.
pub(super) fn fault(text: &str) -> Result<HostFault, String> {
    let fault = parse(text);
    fault.ok_or_else(|| {
        format!(
            "found \"{text}\", allowed: stall@TIME+DURATION, nan@TIME+DURATION, topology@TIME+DURATION or \
             panic@TIME, in seconds, such as stall@1.5+0.5"
        )
    })
}

fn parse(text: &str) -> Option<HostFault> {
    let (name, when) = text.split_once('@')?;
    let (_, kind) = *NAMES.iter().find(|(known, _)| *known == name)?;
    let (at, duration) = match (kind, when.split_once('+')) {
        (FaultKind::Panic, None) => (seconds(when)?, 0.0),
        (FaultKind::Panic, Some(_)) | (_, None) => return None,
        (_, Some((at, duration))) => (seconds(at)?, seconds(duration)?),
    };
    Some(HostFault { kind, at, duration })
}

fn seconds(text: &str) -> Option<f64> {
    let value = text.parse::<f64>().ok();
    value.filter(|value| value.is_finite() && *value >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_read_as_the_help_says() {
        let of = |kind, at, duration| HostFault { kind, at, duration };
        for (text, expected) in [
            ("stall@1.5+0.5", of(FaultKind::Stall, 1.5, 0.5)),
            ("nan@0+1", of(FaultKind::NotANumber, 0.0, 1.0)),
            ("topology@2+1e-1", of(FaultKind::Topology, 2.0, 0.1)),
            ("panic@2", of(FaultKind::Panic, 2.0, 0.0)),
        ] {
            assert_eq!(fault(text), Ok(expected));
        }
        for wrong in [
            "",
            "stall",
            "stall@1",
            "panic@1+2",
            "stall@x+1",
            "stall@-1+1",
            "nan@inf+1",
            "flood@1+1",
        ] {
            let error = fault(wrong).expect_err(wrong);
            assert!(
                error.starts_with(&format!("found \"{wrong}\", allowed: stall@")),
                "{error}"
            );
        }
    }
}
