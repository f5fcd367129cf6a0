//! The cells of the study, summarized.

use super::CellResult;
use super::verdict::{Failure, failures, ratios};
use crate::stress::scene::measure::Outcome;
use crate::stress::scene::summary::quantile;
use std::collections::BTreeMap;

/// Some cells under one scheme.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Number of cells.
    pub runs: usize,
    /// Number of cells that are within all limits.
    pub passed: usize,
    /// Number of cells that are beyond each limit, in the order of [`Failure::ALL`].
    pub failed: [usize; Failure::ALL.len()],
    /// Error of the hold, a fraction: median and 90th percentile.
    pub hold: [f64; 2],
    /// Error of the run, a fraction: median and 90th percentile.
    pub run: [f64; 2],
    /// Ripple beyond that of the reference (N): median and 90th percentile.
    pub ripple: [f64; 2],
    /// Largest fraction of ticks in which the cap acted.
    pub capped: f64,
    /// Largest net energy (J).
    pub net_energy: f64,
}

/// The row of `scheme` over `cells`; none if there are no cells.
pub fn row<'a>(cells: impl Iterator<Item = &'a CellResult>, scheme: &str) -> Option<Row> {
    let cells: Vec<_> = cells.collect();
    let each: Vec<_> = cells.iter().map(|cell| failures(cell, scheme)).collect();
    let found: Vec<&Outcome> = cells
        .iter()
        .filter_map(|cell| cell.schemes.get(scheme))
        .collect();
    let two = |value: &dyn Fn(&Outcome) -> f64| {
        let mut all: Vec<f64> = found.iter().map(|outcome| value(outcome)).collect();
        all.sort_unstable_by(f64::total_cmp);
        [0.5, 0.9].map(|fraction| quantile(&all, fraction))
    };
    let most = |value: &dyn Fn(&Outcome) -> f64| found.iter().map(|o| value(o)).fold(0.0, f64::max);
    (!cells.is_empty()).then(|| Row {
        runs: cells.len(),
        passed: each.iter().filter(|failures| failures.is_empty()).count(),
        failed: Failure::ALL.map(|what| each.iter().filter(|f| f.contains(&what)).count()),
        hold: two(&|o| o.force_errors.hold_error),
        run: two(&|o| o.force_errors.run_error),
        ripple: two(&|o| o.force_errors.worst_ripple),
        capped: most(&|o| o.capped),
        net_energy: most(&|o| o.net_energy),
    })
}

/// The cells in which `scheme` fails, the largest excess over a limit first.
pub fn worst<'a>(
    cells: &'a BTreeMap<u64, CellResult>,
    scheme: &str,
) -> Vec<(u64, &'a CellResult, Vec<Failure>)> {
    let each = cells.iter().map(|(number, cell)| {
        let most = cell.schemes.get(scheme).map_or(f64::INFINITY, |outcome| {
            ratios(cell, outcome).into_iter().fold(0.0, f64::max)
        });
        (most, *number, cell, failures(cell, scheme))
    });
    let mut failing: Vec<_> = each.filter(|(.., failures)| !failures.is_empty()).collect();
    failing.sort_by(|a, b| b.0.total_cmp(&a.0));
    let all = failing.into_iter();
    all.map(|(_, number, cell, failures)| (number, cell, failures))
        .collect()
}
