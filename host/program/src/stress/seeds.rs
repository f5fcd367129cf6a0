//! `palpate stress seeds`: results of several seeds of a study, side by side.

use super::{CommandError, Declared, Format};
use host::atomic_file::write_json;
use std::path::PathBuf;
use study::stress::seeds::{Seeds, compare};

/// Arguments of `palpate stress seeds`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct SeedsArguments {
    /// Files that a study wrote with --json, one for each seed
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Write the comparison as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  for seed in 1 2 3; do palpate stress scene my_scene.toml --seed $seed --json seed-$seed.jsonl; done
  palpate stress seeds seed-1.jsonl seed-2.jsonl seed-3.jsonl";

pub(super) fn run(arguments: &SeedsArguments) -> Result<(), CommandError> {
    let mut declared = Declared::default().file("--json", arguments.json.as_ref(), Format::Json);
    for file in &arguments.files {
        declared = declared.input("a file of results", Some(file));
    }
    let _held = declared.check()?;
    let found = compare(&arguments.files)?;
    print(&found);
    if let Some(path) = &arguments.json {
        write_json(path, &found)?;
    }
    Ok(())
}

/// Prints one row for each quantity: its value for each seed, then the spread.
fn print(found: &Seeds) {
    let cells: Vec<_> = found.cells.iter().map(u64::to_string).collect();
    outln!(
        "{}: {} seeds; cells of each: {}\n",
        found.study,
        found.seeds.len(),
        cells.join(", ")
    );
    let seeds: Vec<_> = found
        .seeds
        .iter()
        .map(|seed| format!("seed {seed}"))
        .collect();
    outln!(
        "| of | quantity | {} | mean | standard deviation | least | most |",
        seeds.join(" | ")
    );
    outln!("|{}", "---|".repeat(6 + seeds.len()));
    for spread in &found.quantities {
        let values: Vec<_> = spread.values.iter().copied().map(number).collect();
        let summary = [spread.mean, spread.deviation, spread.least, spread.most].map(number);
        outln!(
            "| {} | {} | {} | {} |",
            spread.of,
            spread.quantity,
            values.join(" | "),
            summary.join(" | ")
        );
    }
}

/// A number with four significant digits; nothing if there is no value.
fn number(value: Option<f64>) -> String {
    let Some(value) = value else {
        return String::new();
    };
    if value == 0.0 {
        return "0".to_owned();
    }
    let before = value.abs().log10().floor() as i32 + 1;
    let decimals = usize::try_from(4 - before).unwrap_or(0).min(9);
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_significant_digits() {
        for (value, text) in [
            (0.0, "0"),
            (98.765_43, "98.77"),
            (1234.56, "1235"),
            (123_456.0, "123456"),
            (0.001_234_56, "0.001235"),
            (-2.0, "-2.000"),
            (1e-12, "0.000000000"),
        ] {
            assert_eq!(number(Some(value)), text);
        }
        assert_eq!(number(None), "");
    }
}
