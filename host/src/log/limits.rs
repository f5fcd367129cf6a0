//! The limits of the devices as they were driven, in the header of a log.
//!
//! A driver may drive a device below its profile: a Falcon is asked for 5 N at most, and a plug-in states its own limits.
//! The control law depends on these limits, so a replay needs them. Each device has a metadata record of its own, in the
//! order of the scene. A log of a version before these records has none; its replay uses the profiles.
//!
//! A later version may add keys; unknown keys are ignored.

use super::LogError;
use crate::scene::source::cut;
use rt_core::{Axes, Capabilities, Freedom, MAX_DEVICES};
use std::collections::BTreeMap;

/// Name of the metadata record of a device.
pub(super) const NAME: &str = "palpate.device";

/// The names of the fields.
const DEVICE: &str = "device";
const SENSED: &str = "sensed";
const ACTUATED: &str = "actuated";
const MAX_FORCE: &str = "max_force";
const MAX_MOMENT: &str = "max_moment";
const WORKSPACE_RADIUS: &str = "workspace_radius";
const POSITION_STEP: &str = "position_step";

/// Added to the axes of a device with six degrees of freedom.
const TURNS: &str = "+rotation";
const AXES: [char; 3] = ['x', 'y', 'z'];

/// The metadata of the device of this index in the scene. Numbers are in SI units, with all their digits.
pub(super) fn facts(index: usize, limits: &Capabilities) -> BTreeMap<String, String> {
    let Capabilities {
        sensed,
        actuated,
        max_force,
        max_moment,
        workspace_radius,
        position_step,
    } = limits;
    let facts = [
        (DEVICE, index.to_string()),
        (SENSED, name(*sensed)),
        (ACTUATED, name(*actuated)),
        (MAX_FORCE, format!("{max_force:?}")),
        (MAX_MOMENT, format!("{max_moment:?}")),
        (WORKSPACE_RADIUS, format!("{workspace_radius:?}")),
        (POSITION_STEP, format!("{position_step:?}")),
    ];
    facts.map(|(key, fact)| (key.to_owned(), fact)).into()
}

/// Reads the metadata of the device of this index.
///
/// # Errors
/// [`LogError::Limits`] if a field is missing, or has a value that no device has.
pub(super) fn parse(
    index: usize,
    facts: &BTreeMap<String, String>,
) -> Result<Capabilities, LogError> {
    let refused = |field: &'static str, allowed: &'static str| LogError::Limits {
        index,
        field,
        found: facts
            .get(field)
            .map_or_else(|| "nothing".to_owned(), |found| cut(found, 60)),
        allowed,
    };
    let fact = |field| facts.get(field).map(String::as_str);
    let number = |field| fact(field).and_then(|text| text.parse::<f64>().ok());
    let positive = |field| {
        let number = number(field).filter(|x| x.is_finite() && *x > 0.0);
        number.ok_or_else(|| refused(field, "a finite number above zero"))
    };
    let freedom = |field| {
        let freedom = fact(field).and_then(freedom);
        freedom.ok_or_else(|| refused(field, "some of the axes xyz, or xyz+rotation"))
    };
    let here = fact(DEVICE).and_then(|text| text.parse().ok());
    if here != Some(index) || index >= MAX_DEVICES {
        return Err(refused(
            DEVICE,
            "the devices in order, from zero, at most 8",
        ));
    }
    let moment = number(MAX_MOMENT).filter(|x| x.is_finite() && *x >= 0.0);
    Ok(Capabilities {
        sensed: freedom(SENSED)?,
        actuated: freedom(ACTUATED)?,
        max_force: positive(MAX_FORCE)?,
        max_moment: moment.ok_or_else(|| refused(MAX_MOMENT, "a finite number from zero on"))?,
        workspace_radius: positive(WORKSPACE_RADIUS)?,
        position_step: positive(POSITION_STEP)?,
    })
}

/// The axes along which a device moves, such as `xz`.
fn name(freedom: Freedom) -> String {
    let free = match freedom {
        Freedom::Along(axes) => axes.free(),
        Freedom::Three | Freedom::Six => [true; 3],
    };
    let axes = AXES.iter().zip(free).filter(|(_, free)| *free);
    let mut name: String = axes.map(|(axis, _)| axis).collect();
    if freedom.turns() {
        name.push_str(TURNS);
    }
    name
}

fn freedom(text: &str) -> Option<Freedom> {
    let found = match text.strip_suffix(TURNS) {
        Some("xyz") => Freedom::Six,
        Some(_) => return None,
        None if text == "xyz" => Freedom::Three,
        None => Freedom::Along(Axes::new(AXES.map(|axis| text.contains(axis)))?),
    };
    // Each axis once, in order, and nothing else.
    (name(found) == text).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits(freedom: Freedom) -> Capabilities {
        Capabilities {
            sensed: freedom,
            actuated: freedom,
            max_force: 0.1,
            max_moment: if freedom.turns() { 1.0 / 3.0 } else { 0.0 },
            workspace_radius: 1e300,
            position_step: f64::MIN_POSITIVE,
        }
    }

    #[test]
    fn limits_are_read_back_bit_for_bit() {
        let mut all = vec![limits(Freedom::Three), limits(Freedom::Six)];
        for free in 1..7 {
            let axes = Axes::new([0, 1, 2].map(|axis| free >> axis & 1 == 1)).expect("some axes");
            all.push(limits(Freedom::Along(axes)));
        }
        for (index, limits) in all.iter().enumerate() {
            assert_eq!(parse(index, &facts(index, limits)).expect("sound"), *limits);
        }
    }

    #[test]
    fn what_no_device_states_is_refused_with_its_field() {
        let sound = facts(1, &limits(Freedom::Six));
        let wrong = [
            (DEVICE, "0"),
            (DEVICE, "-1"),
            (SENSED, ""),
            (SENSED, "zx"),
            (SENSED, "xx"),
            (ACTUATED, "xy+rotation"),
            (ACTUATED, "xyz+"),
            (MAX_FORCE, "NaN"),
            (MAX_FORCE, "0.0"),
            (MAX_FORCE, "inf"),
            (MAX_FORCE, "-1.0"),
            (MAX_MOMENT, "-0.1"),
            (WORKSPACE_RADIUS, "wide"),
            (POSITION_STEP, "1e-5 \u{1b}]0;m"),
        ];
        for (field, value) in wrong {
            let mut facts = sound.clone();
            facts.insert(field.to_owned(), value.to_owned());
            let error = parse(1, &facts).expect_err("refused").to_string();
            assert!(error.contains(field), "{error}");
            assert!(!error.chars().any(char::is_control), "{error}");
            facts.remove(field);
            assert!(parse(1, &facts).is_err(), "{field} is missing");
        }
        let last = facts(MAX_DEVICES, &limits(Freedom::Three));
        assert!(parse(MAX_DEVICES, &last).is_err());
    }
}
