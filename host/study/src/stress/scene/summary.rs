//! The cells of a study, summarized by scheme and by band of rates.

use super::CellResult;
use super::draw::{RATES, Trouble};
use super::measure::Outcome;
use serde::Serialize;

/// Largest force error that nobody notices: the just-noticeable difference of a force is about a tenth.
pub const JUST_NOTICEABLE: f64 = 0.1;

/// A row of fewer cells has the largest value in place of a high quantile, which would be the value of a single cell.
pub const FEW: usize = 10;

/// Some cells under one scheme. Of fewer than ten cells, the higher of two quantiles is the largest value.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The scheme.
    pub scheme: String,
    /// Number of cells.
    pub runs: usize,
    /// Fraction of the cells whose hold is bounded.
    pub bounded: f64,
    /// Net energy (J): 99th percentile and largest.
    pub net_energy: [f64; 2],
    /// Ripple (N): median and largest.
    pub ripple: [f64; 2],
    /// Force error, a fraction: median and 90th percentile.
    pub error: [f64; 2],
    /// The same without the times at which the tick had not yet received a model of the softened body.
    pub aware: [f64; 2],
    /// The same without the times of faults.
    pub untroubled: [f64; 2],
    /// Fraction of the cells whose error without the times of faults is below [`JUST_NOTICEABLE`].
    pub unnoticed: f64,
    /// Stiffness error of the hold, a fraction: median and 90th percentile.
    pub stiffness: [f64; 2],
    /// Error of the force over the whole run, a fraction of the peak: median and 90th percentile.
    #[serde(rename = "felt")]
    pub run_error: [f64; 2],
    /// Ripple in the worst half second beyond that of the reference (N): 90th percentile and largest.
    pub worst_ripple: [f64; 2],
    /// Fraction of the ticks in which a cap acted: median and largest.
    pub capped: [f64; 2],
    /// The cell of the largest net energy, and that of the largest ripple.
    pub worst: [u64; 2],
}

/// The cells that a row summarizes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// Publication rates (Hz), both ends included.
    pub rates: [f64; 2],
    /// The kind of fault; all kinds if none.
    pub trouble: Option<Trouble>,
}

impl Band {
    /// All cells with a rate from `low` to `high` (Hz).
    pub fn of(low: f64, high: f64) -> Self {
        Self {
            rates: [low, high],
            trouble: None,
        }
    }

    /// The bands of the tables: each rate by itself.
    pub fn all() -> Vec<Self> {
        RATES.iter().map(|rate| Self::of(*rate, *rate)).collect()
    }

    fn holds(&self, cell: &CellResult) -> bool {
        (self.rates[0]..=self.rates[1]).contains(&cell.draw.rate)
            && self
                .trouble
                .is_none_or(|trouble| cell.draw.trouble == trouble)
    }
}

/// The outcomes of `scheme` in the cells of `band`, by number.
pub fn outcomes<'a>(
    cells: impl Iterator<Item = (&'a u64, &'a CellResult)>,
    scheme: &str,
    band: Band,
) -> Vec<(u64, &'a Outcome)> {
    cells
        .filter(|(_, cell)| band.holds(cell))
        .filter_map(|(number, cell)| Some((*number, cell.schemes.get(scheme)?)))
        .collect()
}

/// The row of `scheme` over the cells of `band`; none if there are no cells.
pub fn row<'a>(
    cells: impl Iterator<Item = (&'a u64, &'a CellResult)>,
    scheme: &str,
    band: Band,
) -> Option<Row> {
    let found = outcomes(cells, scheme, band);
    let count = found.len() as f64;
    let sorted = |value: &dyn Fn(&Outcome) -> Option<f64>| {
        let mut all: Vec<f64> = found.iter().filter_map(|(_, o)| value(o)).collect();
        all.sort_unstable_by(f64::total_cmp);
        all
    };
    let fraction = |holds: &dyn Fn(&Outcome) -> bool| {
        found.iter().filter(|(_, o)| holds(o)).count() as f64 / count
    };
    let worst = |value: &dyn Fn(&Outcome) -> f64| {
        let each = found
            .iter()
            .max_by(|a, b| value(a.1).total_cmp(&value(b.1)));
        each.map_or(0, |(number, _)| *number)
    };
    let at = |all: &[f64], [low, high]: [f64; 2]| {
        let high = if all.len() < FEW { 1.0 } else { high };
        [low, high].map(|fraction| quantile(all, fraction))
    };
    (!found.is_empty()).then(|| {
        let untroubled = sorted(&|o| o.error_untroubled);
        let unnoticed = untroubled.iter().filter(|e| **e < JUST_NOTICEABLE).count();
        Row {
            scheme: scheme.to_owned(),
            runs: found.len(),
            bounded: fraction(&|o| o.bounded),
            net_energy: at(&sorted(&|o| Some(o.net_energy)), [0.99, 1.0]),
            ripple: at(&sorted(&|o| Some(o.stillness.ripple)), [0.5, 1.0]),
            error: at(&sorted(&|o| Some(o.error)), [0.5, 0.9]),
            aware: at(&sorted(&|o| o.error_aware), [0.5, 0.9]),
            unnoticed: unnoticed as f64 / untroubled.len().max(1) as f64,
            untroubled: at(&untroubled, [0.5, 0.9]),
            stiffness: at(&sorted(&|o| Some(o.stiffness_error)), [0.5, 0.9]),
            run_error: at(&sorted(&|o| Some(o.force_errors.run_error)), [0.5, 0.9]),
            worst_ripple: at(&sorted(&|o| Some(o.force_errors.worst_ripple)), [0.9, 1.0]),
            capped: at(&sorted(&|o| Some(o.capped)), [0.5, 1.0]),
            worst: [worst(&|o| o.net_energy), worst(&|o| o.stillness.ripple)],
        }
    })
}

/// The quantile of `sorted` at the fraction `fraction`: the nearest value. Not a number if `sorted` is empty.
pub fn quantile(sorted: &[f64], fraction: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    let at = (fraction * last as f64).round() as usize;
    sorted.get(at).copied().unwrap_or(f64::NAN)
}
