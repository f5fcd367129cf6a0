//! A table of expected counts, and the definition of a regression.

use crate::callgrind::Count;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::Command;

/// Largest relative growth of a count that is no regression.
const TOLERANCE: f64 = 0.05;

/// By case: instructions, then calls of memory copies.
type Counts = BTreeMap<String, [u64; 2]>;

/// Counts by toolchain, because another compiler generates other code.
type Expected = BTreeMap<String, Counts>;

/// A committed table.
pub(crate) struct Table {
    /// The name of its file in `tests/instructions`.
    pub(crate) file: &'static str,
    /// The comment at its beginning.
    pub(crate) head: &'static str,
    /// Largest relative growth of the number of copies that is no regression.
    pub(crate) more_copies: f64,
}

impl Table {
    fn path(&self) -> PathBuf {
        PathBuf::from(env!("CARGO_MANIFEST_DIR"))
            .join("instructions")
            .join(self.file)
    }

    /// Reads the table; empty if there is none yet.
    fn read(&self) -> Result<Expected, String> {
        let path = self.path();
        if !path.exists() {
            return Ok(Expected::new());
        }
        let text =
            std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        toml::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
    }

    /// Writes these counts into the table for the present compiler. The counts of other compilers are kept.
    ///
    /// # Errors
    /// A message that states the failure.
    pub(crate) fn refresh(&self, counts: &[(String, Count)]) -> Result<(), String> {
        let mut expected = self.read()?;
        let entries = counts
            .iter()
            .map(|(case, count)| (case.clone(), [count.instructions, count.copies]));
        expected.insert(toolchain()?, entries.collect());
        let mut text = self.head.to_owned();
        for (toolchain, counts) in &expected {
            let _ = writeln!(text, "\n[\"{toolchain}\"]");
            for (case, [instructions, copies]) in counts {
                let _ = writeln!(text, "\"{case}\" = [{instructions}, {copies}]");
            }
        }
        let path = self.path();
        std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
        println!("Written to {}.", path.display());
        Ok(())
    }

    /// Compares counts with the table, and prints that all are within it or that the table has no counts for the
    /// compiler.
    ///
    /// # Errors
    /// A message that states the counts above the table, or the failure.
    pub(crate) fn judge(&self, counts: &[(String, Count)]) -> Result<(), String> {
        let toolchain = toolchain()?;
        let expected = self.read()?;
        let Some(expected) = expected.get(&toolchain) else {
            println!(
                "!! SKIPPED: the comparison: the table has no counts for {toolchain}; add them with --refresh"
            );
            return Ok(());
        };
        let worse: Vec<String> = counts
            .iter()
            .filter_map(|(case, count)| regression(case, *count, expected, self.more_copies))
            .collect();
        if worse.is_empty() {
            println!("None is more than 5 % above the table for {toolchain}.");
            return Ok(());
        }
        Err(format!(
            "More than the table for {toolchain} allows (if on purpose: --refresh):\n{}",
            worse.join("\n")
        ))
    }
}

/// The name of the compiler in the table.
fn toolchain() -> Result<String, String> {
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

/// The regression of a count, if there is one.
fn regression(case: &str, found: Count, expected: &Counts, more_copies: f64) -> Option<String> {
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
    if found.copies as f64 > copies as f64 * (1.0 + more_copies) {
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
    fn more_than_five_percent_or_more_copies_than_allowed_are_a_regression() {
        let expected = Counts::from([("a tick".to_owned(), [1000, 20])]);
        let judge = |instructions, copies, more| {
            let found = Count {
                instructions,
                copies,
            };
            regression("a tick", found, &expected, more).is_some()
        };
        assert!(!judge(1000, 20, 0.0) && !judge(1050, 20, 0.0) && !judge(900, 19, 0.0));
        assert!(judge(1051, 20, 0.0));
        assert!(judge(1000, 21, 0.0) && !judge(1000, 21, 0.05) && judge(1000, 22, 0.05));
        assert!(regression("another", Count::default(), &expected, 0.0).is_some());
    }
}
