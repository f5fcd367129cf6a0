//! The tables of `palpate stress scene`, at most 120 columns wide.

use std::collections::BTreeMap;
use study::stress::scene::draw::Trouble;
use study::stress::scene::summary::{Band, FEW, Row, row};
use study::stress::scene::{CellResult, SCHEMES};

/// Prints the tables by publication rate, and the tables by trouble.
pub(super) fn print(cells: &BTreeMap<u64, CellResult>) {
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
    outln!();
    tables(
        cells,
        "trouble",
        "trouble, at 60 Hz and more",
        "trouble",
        &troubles,
    );
}

/// Prints the rows of each band: whether the hands come to rest, and the errors of their forces.
fn tables(
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
    outln!("By {title}:\n");
    head(
        first,
        "runs | bounded % | net energy mJ (cell) | ripple N: median, most (cell) | capped %: median, most",
    );
    for (name, row) in rows() {
        outln!(
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
    outln!(
        "\nErrors of the force by {short}, in %: median, 90 % (of fewer than {FEW} worlds, the most):\n"
    );
    head(
        first,
        "force | current model | without faults, below 10 % | stiffness | run | ripple of the run N: 90 %, most",
    );
    for (name, row) in rows() {
        outln!(
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

fn head(first: &str, others: &str) {
    let head = format!("| {first} | scheme | {others} |");
    outln!("{head}\n|{}", "---|".repeat(head.matches('|').count() - 1));
}

fn percent(fraction: f64) -> String {
    format!("{:.1}", 100.0 * fraction)
}

/// Two quantiles of the worlds of a row, or of few worlds the largest value.
fn two(row: &Row, [low, high]: [f64; 2], shown: impl Fn(f64) -> String) -> String {
    if row.runs < FEW {
        format!("most {}", shown(high))
    } else {
        format!("{}, {}", shown(low), shown(high))
    }
}
