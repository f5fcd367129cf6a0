//! The study: its cells, and the verdict on them.

use super::summary::{row, worst};
use super::{CASES, CellResult, SCHEMES, Study, table};
use crate::stress::scene::picture;
use crate::stress::study::quantities;
use crate::stress::{self, Done, Quantity, Verdict};
use host::plot::Picture;
use std::collections::BTreeMap;

/// The study of many cells, each under all of [`SCHEMES`].
#[derive(Clone, Copy, Debug)]
pub struct Holds {
    /// The cells.
    pub study: Study,
    /// Number of cells.
    pub cells: u64,
}

/// The cases and the worst of the cells, in words.
pub fn listed(cells: &BTreeMap<u64, CellResult>) -> String {
    let mut text = String::new();
    table::write_failures(&mut text, cells);
    text
}

/// The cells in which `capped` fails, and the cells that could not be run.
pub fn verdict(cells: &BTreeMap<u64, CellResult>) -> Verdict {
    let lines = cells.iter().filter_map(|(number, cell)| {
        let why = cell.failed.as_ref()?;
        Some(format!("cell {number}: {why}"))
    });
    Verdict {
        failed: worst(cells, "capped").len(),
        lines: lines.collect(),
        ..Verdict::default()
    }
}

impl stress::Study for Holds {
    type Outcome = CellResult;
    const NAME: &'static str = "hold";
    const SCHEMA: u32 = 2;
    const COMPARED: bool = true;

    fn seed(&self) -> u64 {
        self.study.seed
    }

    fn cells(&self) -> u64 {
        self.cells
    }

    fn settings(&self) -> serde_json::Value {
        serde_json::json!({ "cases": CASES.map(|(name, text, _)| (name, text)) })
    }

    fn cell(&self, cell: u64, _: &Done<'_>) -> CellResult {
        self.study.cell(cell, &SCHEMES)
    }

    fn summary(&self, cells: &BTreeMap<u64, CellResult>) -> String {
        let mut text = String::new();
        put!(text, "{} cells, seed {}\n", cells.len(), self.study.seed);
        table::write(&mut text, cells);
        table::write_failures(&mut text, cells);
        text
    }

    fn verdict(&self, cells: &BTreeMap<u64, CellResult>) -> Verdict {
        verdict(cells)
    }

    fn draw(&self, cells: &BTreeMap<u64, CellResult>) -> Option<Picture> {
        Some(picture::holds(cells))
    }

    fn quantities(cells: &BTreeMap<u64, CellResult>) -> Vec<Quantity> {
        quantities_of(cells)
    }
}

fn quantities_of(cells: &BTreeMap<u64, CellResult>) -> Vec<Quantity> {
    let rows = SCHEMES.iter();
    let rows = rows.filter_map(|(_, scheme)| Some((scheme, row(cells.values(), scheme)?)));
    rows.flat_map(|(scheme, row)| {
        quantities(
            scheme,
            [
                (
                    "cells that pass (%)",
                    100.0 * row.passed as f64 / row.runs.max(1) as f64,
                ),
                ("hold error, 90 % (%)", 100.0 * row.hold[1]),
                ("run error, median (%)", 100.0 * row.run[0]),
                ("run error, 90 % (%)", 100.0 * row.run[1]),
                ("ripple, 90 % (N)", row.ripple[1]),
                ("capped, most (%)", 100.0 * row.capped),
                ("net energy, most (mJ)", 1e3 * row.net_energy),
            ],
        )
    })
    .collect()
}
