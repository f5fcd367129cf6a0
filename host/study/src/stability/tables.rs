//! The tables and the picture of the study.

use super::{Account, Case, Family, Report, Verdict};
use crate::Results;
use host::plot::{self, Panel, Picture, Series};

impl Results for Report {
    fn tables(&self) -> String {
        let mut text = String::new();
        put_families(&mut text, self);
        put_recovery(&mut text, self);
        put_failures(&mut text, self);
        text
    }

    fn picture(&self) -> Option<Picture> {
        Some(chart(self))
    }
}

fn put_families(text: &mut String, report: &Report) {
    put!(
        text,
        "| family | cases | pass | reported | fail | refused | damped | figure | worst | allowed | where |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|---|---|---|");
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
        put!(
            text,
            "| {} | {} | {pass} | {reported} | {fail} | {refused} | {damped} | {} | {} | {allowed} | {at} |",
            family.name,
            family.cases.len(),
            family.figure,
            worst.trim_end(),
        );
    }
    put!(
        text,
        "\nRefused: steps that ended in a typed error. Damped: steps that would have created energy.\n"
    );
    for family in &report.families {
        put!(text, "- {}: {}.", family.name, family.stress);
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

fn put_recovery(text: &mut String, report: &Report) {
    for family in starts(report) {
        put!(text, "\nRecovery, {}:\n", family.name);
        put!(
            text,
            "| law | body | starts | elements not inverted at the end | starts without inverted elements | back at rest | refused |"
        );
        put!(text, "|---|---|---|---|---|---|---|");
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
                put!(
                    text,
                    "| {law} | {body} | {count} | {right:.1} % | {all_right} | {recovered} | {refused} |"
                );
            }
        }
    }
}

fn put_failures(text: &mut String, report: &Report) {
    for (family, case) in report.failures() {
        let reason = case.reason.as_deref().unwrap_or_default();
        put!(text, "\nFAIL {}: {}: {reason}", family.name, describe(case));
    }
}

/// The fraction of elements that are not inverted, over time and by law, as a mean over all scrambled starts.
fn chart(report: &Report) -> Picture {
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

fn page(series: Vec<Series>) -> Picture {
    let panel = Panel {
        x_label: "Time (s)".to_owned(),
        y_label: "Fraction of elements not inverted".to_owned(),
        y_covers: vec![0.0, 1.0],
        series,
        ..Panel::default()
    };
    let subtitle = "mean over all starts, by law";
    plot::panels("Recovery from scrambled starts", subtitle, 1, &[panel])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axis_of_a_fraction_covers_zero_and_one() {
        let picture = page(vec![Series {
            name: "stable neo-Hookean".to_owned(),
            points: vec![(0.0, 0.45), (0.1, 0.5), (12.0, 0.55)],
            ..Series::default()
        }]);
        let svg = picture.svg();
        assert_eq!(plot::collisions(&picture), [""; 0]);
        assert!(svg.contains("\n0.0\n") && svg.contains("\n1.0\n"));
    }
}
