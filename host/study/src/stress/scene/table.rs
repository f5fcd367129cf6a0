//! The tables of the study, at most 120 columns wide.

use super::draw::Trouble;
use super::summary::{Band, FEW, Row, row};
use super::{CellResult, SCHEMES};
use std::collections::BTreeMap;

/// Writes the tables by publication rate, and the tables by trouble.
pub(super) fn write(text: &mut String, cells: &BTreeMap<u64, CellResult>) {
    let mut rates: Vec<f64> = cells.values().map(|cell| cell.draw.rate).collect();
    rates.sort_unstable_by(f64::total_cmp);
    rates.dedup();
    let mut bands: Vec<(String, Band)> = (rates.iter())
        .map(|rate| (rate.to_string(), Band::of(*rate, *rate)))
        .collect();
    // Bands that repeat the row of one rate say nothing.
    if rates.len() > 1 {
        let late = ("20 and 30", Band::of(20.0, 30.0));
        let others = ("60 and more", Band::of(60.0, f64::INFINITY));
        let all = ("all", Band::of(0.0, f64::INFINITY));
        let further = [late, others, all].map(|(name, band)| (name.to_owned(), band));
        bands.extend(further);
    }
    tables(
        text,
        cells,
        "Hz",
        "publication rate, over all troubles",
        "publication rate",
        &bands,
    );
    if rates.last().is_none_or(|fastest| *fastest < 60.0) {
        return;
    }
    let troubles = Trouble::ALL.map(|trouble| {
        let band = Band {
            trouble: Some(trouble),
            ..Band::of(60.0, f64::INFINITY)
        };
        (trouble.name().to_owned(), band)
    });
    put!(text);
    tables(
        text,
        cells,
        "trouble",
        "trouble, at 60 Hz and more",
        "trouble",
        &troubles,
    );
}

/// Writes the rows of each band: whether the hands come to rest, and the errors of their forces.
fn tables(
    text: &mut String,
    cells: &BTreeMap<u64, CellResult>,
    first: &str,
    title: &str,
    short: &str,
    bands: &[(String, Band)],
) {
    let rows = || {
        let each = bands.iter().flat_map(|(name, band)| {
            let rows = SCHEMES.iter();
            rows.filter_map(move |(_, scheme)| Some((name, row(cells.iter(), scheme, *band)?)))
        });
        each.collect::<Vec<_>>()
    };
    put!(text, "By {title}:\n");
    head(
        text,
        first,
        "runs | bounded % | net energy mJ (cell) | ripple N: median, most (cell) | capped %: median, most",
    );
    for (name, row) in rows() {
        put!(
            text,
            "| {name} | {} | {} | {:.1} | {:.2} ({}) | {} ({}) | {} |",
            row.scheme,
            row.runs,
            100.0 * row.bounded,
            1e3 * row.net_energy[1],
            row.worst[0],
            two(&row, row.ripple, |x| format!("{x:.3}")),
            row.worst[1],
            two(&row, row.capped, percent),
        );
    }
    put!(
        text,
        "\nErrors of the force by {short}, in %: median, 90 % (of fewer than {FEW} trials, the most):\n"
    );
    head(
        text,
        first,
        "force | current model | without faults, below 10 % | stiffness | run | ripple of the run N: 90 %, most",
    );
    for (name, row) in rows() {
        put!(
            text,
            "| {name} | {} | {} | {} | {}, {:.0} % | {} | {} | {} |",
            row.scheme,
            two(&row, row.error, percent),
            two(&row, row.aware, percent),
            two(&row, row.untroubled, percent),
            100.0 * row.unnoticed,
            two(&row, row.stiffness, percent),
            two(&row, row.run_error, percent),
            two(&row, row.worst_ripple, |x| format!("{x:.3}")),
        );
    }
}

fn head(text: &mut String, first: &str, others: &str) {
    let head = format!("| {first} | scheme | {others} |");
    put!(
        text,
        "{head}\n|{}",
        "---|".repeat(head.matches('|').count() - 1)
    );
}

fn percent(fraction: f64) -> String {
    format!("{:.1}", 100.0 * fraction)
}

/// Two quantiles of the trials of a row, or of few trials the largest value.
fn two(row: &Row, [low, high]: [f64; 2], shown: impl Fn(f64) -> String) -> String {
    if row.runs < FEW {
        format!("most {}", shown(high))
    } else {
        format!("{}, {}", shown(low), shown(high))
    }
}
