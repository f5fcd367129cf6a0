//! The tables of the study.

use super::summary::{row, worst};
use super::verdict::{Failure, failures};
use super::{CellResult, SCHEMES};
use crate::stress::specimen::{Cause, Kind};
use sim::DeviceModel;
use std::collections::BTreeMap;

/// Largest number of cells that are listed one by one.
const MOST_LISTED: usize = 12;

/// Writes a table by specimen, by device and by rate.
pub(super) fn write(text: &mut String, cells: &BTreeMap<u64, CellResult>) {
    put!(text, "By specimen:\n");
    head(text, "specimen");
    rows(text, "all", cells, |_| true);
    rows(text, "cases", cells, |cell| cell.case.is_some());
    for kind in Kind::ALL {
        rows(text, kind.name(), cells, |cell| {
            cell.draw.as_ref().is_some_and(|draw| draw.kind == kind)
        });
    }
    put!(text, "\nBy number of hands:\n");
    head(text, "hands");
    for hands in 1..=3 {
        rows(text, &hands.to_string(), cells, |cell| {
            let draw = cell.draw.as_ref();
            draw.is_some_and(|draw| draw.hands.len() == hands)
        });
    }
    put!(
        text,
        "\nBy the stiffest motion, as a multiple of what the devices render:\n"
    );
    head(text, "multiple");
    for (name, low, high) in [
        ("up to 1", 0.0, 1.0),
        ("1 to 10", 1.0, 10.0),
        ("more", 10.0, f64::INFINITY),
    ] {
        rows(text, name, cells, |cell| {
            let draw = cell.draw.as_ref();
            draw.is_some_and(|draw| (low..high).contains(&draw.ratio))
        });
    }
    put!(text, "\nBy what takes a part of the force away:\n");
    head(text, "cause");
    for cause in Cause::ALL {
        rows(text, cause.name(), cells, |cell| {
            let draw = cell.draw.as_ref();
            draw.is_some_and(|draw| draw.cause == cause)
        });
    }
    put!(text, "\nBy device of the first hand:\n");
    head(text, "device");
    for (name, _) in DeviceModel::spatial() {
        rows(text, name, cells, |cell| {
            let draw = cell.draw.as_ref();
            draw.is_some_and(|draw| draw.hands[0].device == name)
        });
    }
    put!(text, "\nBy publication rate:\n");
    head(text, "Hz");
    for (name, low, high) in [
        ("30 to 60", 0.0, 60.0),
        ("60 to 125", 60.0, 125.0),
        ("125 to 250", 125.0, 250.0),
        ("250 to 1000", 250.0, f64::INFINITY),
    ] {
        rows(text, name, cells, |cell| {
            cell.draw.is_some() && (low..high).contains(&cell.rate)
        });
    }
}

/// Writes the cases and the worst of the cells in which `capped` fails, one row per scheme.
pub(super) fn write_failures(text: &mut String, cells: &BTreeMap<u64, CellResult>) {
    let failing = worst(cells, "capped");
    put!(text, "\nCases and worst cells:\n");
    put!(
        text,
        "| cell | case or specimen | Hz | scheme | fails | hold error % | leaves % | run error % | ripple N | in the hold | jump, in frictions | capped % | net energy mJ |"
    );
    put!(text, "|{}", "---|".repeat(13));
    let cases = cells.iter().filter(|(_, cell)| cell.case.is_some());
    let cases = cases.map(|(number, cell)| (*number, cell));
    let drawn = failing.iter().filter(|(_, cell, _)| cell.case.is_none());
    let drawn = drawn.map(|(number, cell, _)| (*number, *cell));
    for (number, cell) in cases.chain(drawn.take(MOST_LISTED)) {
        let name = cell.draw.as_ref().map_or_else(
            || cell.case.clone().unwrap_or_default(),
            |draw| {
                let devices: Vec<_> = draw.hands.iter().map(|hand| &hand.device[..]).collect();
                let cause = draw.cause.name();
                format!(
                    "{}, {}, {:.1}, {cause}",
                    draw.kind.name(),
                    devices.join(" + "),
                    draw.ratio
                )
            },
        );
        for (scheme, outcome) in &cell.schemes {
            let held = |fraction: f64| {
                let percent = format!("{:.2}", 100.0 * fraction);
                if cell.moves { "-".to_owned() } else { percent }
            };
            let names = failures(cell, scheme).into_iter().map(Failure::name);
            put!(
                text,
                "| {number} | {name} | {:.0} | {scheme} | {} | {} | {} | {:.1} | {:.3} | {:.3} | {:.2} | {:.1} | {:.2} |",
                cell.rate,
                names.collect::<Vec<_>>().join(", "),
                held(outcome.force_errors.hold_error),
                held(outcome.force_errors.leaves),
                100.0 * outcome.force_errors.run_error,
                outcome.force_errors.worst_ripple,
                outcome.stillness.ripple,
                outcome.force_errors.jump,
                100.0 * outcome.capped,
                1e3 * outcome.net_energy,
            );
        }
    }
}

fn head(text: &mut String, first: &str) {
    let failures = Failure::ALL.map(Failure::name).join(" | ");
    put!(
        text,
        "| {first} | scheme | runs | pass | {failures} | hold error %: median, 90 % | run error % | ripple N | capped %, most | net energy mJ, most |"
    );
    put!(text, "|{}", "---|".repeat(9 + Failure::ALL.len()));
}

fn rows(
    text: &mut String,
    first: &str,
    cells: &BTreeMap<u64, CellResult>,
    which: impl Fn(&CellResult) -> bool,
) {
    for (_, scheme) in SCHEMES {
        let Some(row) = row(cells.values().filter(|cell| which(cell)), scheme) else {
            continue;
        };
        let failed = row.failed.map(|count| count.to_string()).join(" | ");
        let percent = |[a, b]: [f64; 2]| format!("{:.2}, {:.2}", 100.0 * a, 100.0 * b);
        put!(
            text,
            "| {first} | {scheme} | {} | {} | {failed} | {} | {} | {:.3}, {:.3} | {:.2} | {:.2} |",
            row.runs,
            row.passed,
            percent(row.hold),
            percent(row.run),
            row.ripple[0],
            row.ripple[1],
            100.0 * row.capped,
            1e3 * row.net_energy,
        );
    }
}
