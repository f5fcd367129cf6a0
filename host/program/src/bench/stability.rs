//! `palpate bench stability`: the numerical stress suite, with a verdict and the worst figure for each family.

use super::super::CommandError;
use super::super::outputs::{Declared, Format};
use super::super::written::Written;
use super::{level, with_bar};
use host::atomic_file::write_json;
use host::plot::{self, Panel, Series};
use std::path::PathBuf;
use study::stability::{self, Account, Case, Family, Report, Verdict};

/// Arguments of `palpate bench stability`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct StabilityArguments {
    /// Run only the corner cases of each family, in seconds instead of minutes
    #[arg(long)]
    quick: bool,
    /// Run only the family of this name
    #[arg(long, value_name = "NAME", value_parser = clap::builder::PossibleValuesParser::new(stability::names()))]
    family: Option<String>,
    /// Write every case as JSON as well
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw the recovery of bodies from scrambled starts (SVG or PNG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

pub(super) fn run(arguments: &StabilityArguments) -> Result<(), CommandError> {
    let _held = Declared::default()
        .file("--json", arguments.json.as_ref(), Format::Json)
        .file("--plot", arguments.plot.as_ref(), Format::Picture)
        .check()?;
    let level = level(arguments.quick);
    let report = with_bar(|progress| {
        stability::run(level, arguments.family.as_deref(), &mut |done| {
            progress(done);
        })
    });
    print_families(&report);
    print_recovery(&report);
    print_failures(&report);
    let mut written = Written::default();
    written.write(arguments.json.as_ref(), |path| write_json(path, &report));
    written.write(arguments.plot.as_ref(), |path| {
        plot::write_picture(path, &chart(&report))
    });
    written.end()?;
    match report.failures().count() {
        0 => Ok(()),
        failed => Err(CommandError::Unstable { failed }),
    }
}

fn print_families(report: &Report) {
    outln!(
        "| family | cases | pass | reported | fail | refused | damped | figure | worst | allowed | where |"
    );
    outln!("|---|---|---|---|---|---|---|---|---|---|---|");
    for family in &report.families {
        let [pass, reported, fail] =
            [Verdict::Pass, Verdict::Reported, Verdict::Fail].map(|verdict| family.count(verdict));
        let sum = |count: fn(&Account) -> usize| -> usize {
            family.cases.iter().map(|case| count(&case.account)).sum()
        };
        let refused = sum(|account| account.refused);
        let damped = sum(|account| account.damped);
        let (worst, allowed, at) = family.worst().map_or_else(Default::default, |case| {
            let allowed = case
                .limit
                .map_or_else(|| "-".to_owned(), |limit| format!("{limit:.0e}"));
            (
                format!("{:.1e} {}", case.figure, family.unit),
                allowed,
                describe(case),
            )
        });
        outln!(
            "| {} | {} | {pass} | {reported} | {fail} | {refused} | {damped} | {} | {} | {allowed} | {at} |",
            family.name,
            family.cases.len(),
            family.figure,
            worst.trim_end(),
        );
    }
    outln!(
        "\nRefused: steps that ended in a typed error. Damped: steps that would have created energy.\n"
    );
    for family in &report.families {
        outln!("- {}: {}.", family.name, family.stress);
    }
}

fn describe(case: &Case) -> String {
    let Case {
        body,
        law,
        scheme,
        name,
        ..
    } = case;
    format!("{body}, {law}, {scheme}: {name}")
}

/// The families whose cases record a recovery over time.
fn starts(report: &Report) -> impl Iterator<Item = &Family> {
    let followed = |family: &&Family| family.cases.iter().any(|case| !case.recovery.is_empty());
    report.families.iter().filter(followed)
}

/// The bodies' laws, in the order of the suite.
fn laws(family: &Family) -> Vec<&'static str> {
    let mut laws = Vec::new();
    for case in &family.cases {
        if !laws.contains(&case.law) {
            laws.push(case.law);
        }
    }
    laws
}

fn print_recovery(report: &Report) {
    for family in starts(report) {
        outln!("\nRecovery, {}:\n", family.name);
        outln!(
            "| law | body | starts | elements not inverted at the end | starts without inverted elements | back at rest | refused |"
        );
        outln!("|---|---|---|---|---|---|---|");
        for law in laws(family) {
            for body in ["linear tetrahedra", "quadratic tetrahedra"] {
                let these = || {
                    family
                        .cases
                        .iter()
                        .filter(|case| case.law == law && case.body == body)
                };
                let count = these().count();
                let right: f64 = these().map(|case| 1.0 - case.figure).sum::<f64>() / count as f64;
                let all_right = these().filter(|case| case.figure == 0.0).count();
                let recovered = these().filter(|case| case.recovered()).count();
                let refused = these().filter(|case| case.account.refused > 0).count();
                let right = 100.0 * right;
                outln!(
                    "| {law} | {body} | {count} | {right:.1} % | {all_right} | {recovered} | {refused} |"
                );
            }
        }
    }
}

fn print_failures(report: &Report) {
    for (family, case) in report.failures() {
        let reason = case.reason.as_deref().unwrap_or_default();
        outln!("\nFAIL {}: {}: {reason}", family.name, describe(case));
    }
}

/// The fraction of elements that are not inverted, over time and by law, as a mean over all scrambled starts.
fn chart(report: &Report) -> String {
    let mut series = Vec::new();
    if let Some(family) = starts(report).last() {
        for law in laws(family) {
            let these: Vec<_> = family.cases.iter().filter(|case| case.law == law).collect();
            let samples = these
                .iter()
                .map(|case| case.recovery.len())
                .min()
                .unwrap_or(0);
            let mean = |sample: usize| {
                let sum: f64 = these.iter().map(|case| case.recovery[sample].1).sum();
                (these[0].recovery[sample].0, sum / these.len() as f64)
            };
            series.push(Series {
                name: law.to_owned(),
                points: (0..samples).map(mean).collect(),
                ..Series::default()
            });
        }
    }
    page(series)
}

fn page(series: Vec<Series>) -> String {
    let panel = Panel {
        x_label: "Time (s)".to_owned(),
        y_label: "Fraction of elements not inverted".to_owned(),
        y_covers: vec![0.0, 1.0],
        series,
        ..Panel::default()
    };
    let subtitle = "mean over all starts, by law";
    plot::panels_svg("Recovery from scrambled starts", subtitle, 1, &[panel])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axis_of_a_fraction_covers_zero_and_one() {
        let svg = page(vec![Series {
            name: "stable neo-Hookean".to_owned(),
            points: vec![(0.0, 0.45), (0.1, 0.5), (12.0, 0.55)],
            ..Series::default()
        }]);
        assert_eq!(plot::collisions(&svg), [""; 0]);
        assert!(svg.contains("\n0.0\n") && svg.contains("\n1.0\n"));
    }
}
