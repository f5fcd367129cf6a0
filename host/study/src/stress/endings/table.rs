//! The table of the ways out of commands.

use super::Outcome;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The worst of the runs of each way out of each command.
pub(super) fn of(cells: &BTreeMap<u64, Outcome>) -> String {
    let mut text = String::from(
        "| command | ended by | runs | force before (N) | no force at the device after (ms) | force left by the command (N) \
         | ended after (ms) | exit code | failed |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    let mut rows: Vec<(&str, &str, Vec<&Outcome>)> = Vec::new();
    for cell in cells.values() {
        let of = (cell.command.as_str(), cell.way.as_str());
        match rows.iter_mut().find(|row| (row.0, row.1) == of) {
            Some(row) => row.2.push(cell),
            None => rows.push((of.0, of.1, vec![cell])),
        }
    }
    for (command, way, cells) in &rows {
        let most = |of: &dyn Fn(&Outcome) -> Option<f64>| {
            let most = cells.iter().filter_map(|cell| of(cell)).reduce(f64::max);
            move |unit: f64, digits: usize| {
                most.map_or("-".to_owned(), |most| format!("{:.digits$}", unit * most))
            }
        };
        let code = cells.first().and_then(|cell| cell.code);
        // A text takes every line.
        let _ = writeln!(
            text,
            "| {command} | {way} | {} | {} | {} | {} | {} | {} | {} |",
            cells.len(),
            most(&|cell| cell.before)(1.0, 2),
            most(&|cell| cell.released)(1e3, 1),
            most(&|cell| cell.left)(1.0, 2),
            most(&|cell| Some(cell.ended))(1e3, 0),
            code.map_or("killed".to_owned(), |code| code.to_string()),
            cells
                .iter()
                .filter(|cell| !cell.failures.is_empty())
                .count(),
        );
    }
    text
}
