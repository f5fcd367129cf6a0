//! The table of expected counts, and what is a regression.

use crate::callgrind::Count;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::Command;

/// How much a count may grow before it is a regression.
const TOLERANCE: f64 = 0.05;

/// By case: instructions, then calls of memory copies.
pub(crate) type Counts = BTreeMap<String, [u64; 2]>;

/// By toolchain: another compiler makes other code.
pub(crate) type Expected = BTreeMap<String, Counts>;

const HEAD: &str = "\
# What one tick of the control law takes: [instructions, calls of the C library's memory copies], by
# compiler and by case (scheme, handles, situation). The instructions inside those copies are left out:
# they depend on the processor. Made by
#
#     cargo run --release -p palpate-tests --example instructions -- --refresh
#
# and compared by the same command without `--refresh`.
";

/// Where the table is.
pub(crate) fn path() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("instructions/expected.toml")
}

/// The compiler, as the table calls it.
///
/// # Errors
/// What went wrong, in words.
pub(crate) fn toolchain() -> Result<String, String> {
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    let output = Command::new(rustc)
        .arg("-vV")
        .output()
        .map_err(|e| format!("rustc does not say its version: {e}"))?;
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let field = |name: &str| {
        said.lines()
            .find_map(|line| line.strip_prefix(name))
            .unwrap_or("unknown")
            .to_owned()
    };
    Ok(format!("rustc {}, {}", field("release: "), field("host: ")))
}

/// Reads the table; empty where there is none yet.
///
/// # Errors
/// What cannot be read in it, and where.
pub(crate) fn read() -> Result<Expected, String> {
    let path = path();
    if !path.exists() {
        return Ok(Expected::new());
    }
    let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    toml::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
}

/// Writes the table.
///
/// # Errors
/// Why it cannot be written.
pub(crate) fn write(expected: &Expected) -> Result<(), String> {
    let mut text = HEAD.to_owned();
    for (toolchain, counts) in expected {
        let _ = writeln!(text, "\n[\"{toolchain}\"]");
        for (case, [instructions, copies]) in counts {
            let _ = writeln!(text, "\"{case}\" = [{instructions}, {copies}]");
        }
    }
    let path = path();
    std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))
}

/// What is wrong with a count, if anything.
pub(crate) fn regression(case: &str, found: Count, expected: &Counts) -> Option<String> {
    let Some(&[instructions, copies]) = expected.get(case) else {
        return Some(format!("{case}: not in the table"));
    };
    let most = instructions as f64 * (1.0 + TOLERANCE);
    if found.instructions as f64 > most {
        let growth = 100.0 * (found.instructions as f64 / instructions as f64 - 1.0);
        return Some(format!(
            "{case}: {} instructions, {growth:.1} % above the {instructions} expected",
            found.instructions
        ));
    }
    if found.copies > copies {
        return Some(format!(
            "{case}: {} copies of memory, {copies} expected",
            found.copies
        ));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_than_five_percent_or_one_more_copy_is_a_regression() {
        let expected = Counts::from([("a tick".to_owned(), [1000, 3])]);
        let judge = |instructions, copies| {
            let found = Count {
                instructions,
                copies,
            };
            regression("a tick", found, &expected).is_some()
        };
        assert!(!judge(1000, 3) && !judge(1050, 3) && !judge(900, 2));
        assert!(judge(1051, 3));
        assert!(judge(1000, 4));
        assert!(regression("another", Count::default(), &expected).is_some());
    }
}
