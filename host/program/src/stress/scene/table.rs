//! The tables of `palpate stress scene`.

use std::collections::BTreeMap;
use study::stress::scene::draw::Trouble;
use study::stress::scene::summary::{Band, Row, row};
use study::stress::scene::{CellResult, SCHEMES};

/// Prints a table by publication rate, and a table by trouble.
pub(super) fn print(cells: &BTreeMap<u64, CellResult>) {
    outln!("By publication rate, over all troubles:\n");
    head("Hz");
    let mut rates: Vec<f64> = cells.values().map(|cell| cell.draw.rate).collect();
    rates.sort_unstable_by(f64::total_cmp);
    rates.dedup();
    let late = ("20 and 30", Band::of(20.0, 30.0));
    let others = [
        ("60 and more", Band::of(60.0, f64::INFINITY)),
        ("all", Band::of(0.0, f64::INFINITY)),
    ];
    let each = rates.iter();
    let each: Vec<_> = each
        .map(|rate| (rate.to_string(), Band::of(*rate, *rate)))
        .collect();
    let each = each.iter().map(|(name, band)| (name.as_str(), *band));
    for (name, band) in each.chain([late]).chain(others) {
        rows(cells, name, band);
    }
    if rates.last().is_none_or(|fastest| *fastest < 60.0) {
        return;
    }
    outln!("\nBy trouble, at 60 Hz and more:\n");
    head("trouble");
    for trouble in Trouble::ALL {
        let band = Band {
            trouble: Some(trouble),
            ..Band::of(60.0, f64::INFINITY)
        };
        rows(cells, trouble.name(), band);
    }
}

fn head(first: &str) {
    outln!(
        "| {first} | scheme | runs | bounded % | net energy mJ: 99 %, most (cell) | ripple N: median, most (cell) \
         | error %: median, 90 % | with a current model | without faults: median, 90 %, below 10 % | stiffness error %: median, 90 % \
         | run error %: median, 90 % | ripple of the run N: 90 %, most | capped %: median, most |"
    );
    outln!("|{}", "---|".repeat(13));
}

fn rows(cells: &BTreeMap<u64, CellResult>, first: &str, band: Band) {
    for (_, scheme) in SCHEMES {
        if let Some(row) = row(cells.iter(), scheme, band) {
            print_row(first, &row);
        }
    }
}

fn print_row(first: &str, row: &Row) {
    let two = |[a, b]: [f64; 2]| format!("{:.1}, {:.1}", 100.0 * a, 100.0 * b);
    outln!(
        "| {first} | {} | {} | {:.1} | {:.2}, {:.2} ({}) | {:.3}, {:.2} ({}) | {} | {} | {}, {:.0} % | {} | {} | {:.3}, {:.2} | {} |",
        row.scheme,
        row.runs,
        100.0 * row.bounded,
        1e3 * row.net_energy[0],
        1e3 * row.net_energy[1],
        row.worst[0],
        row.ripple[0],
        row.ripple[1],
        row.worst[1],
        two(row.error),
        two(row.aware),
        two(row.untroubled),
        100.0 * row.unnoticed,
        two(row.stiffness),
        two(row.run_error),
        row.worst_ripple[0],
        row.worst_ripple[1],
        two(row.capped),
    );
}
