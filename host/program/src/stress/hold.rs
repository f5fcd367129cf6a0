//! `palpate stress hold`: presses, holds, slow rubs and tremors on bodies of every kind.

use super::scene::{cell, log, picture, write_scene};
use super::{CommandError, Common, Declared, Format, Shown, Values, Written, scheme_of};
use host::atomic_file::write_atomically;
use host::plot::write_picture;
use host::scene::spec::SchemeName;
use sim::DeviceModel;
use std::collections::BTreeMap;
use std::path::PathBuf;
use study::stress::hold::summary::{row, worst};
use study::stress::hold::verdict::{Failure, failures};
use study::stress::hold::{CASES, CellResult, SCHEMES, Study, judge};
use study::stress::jobs::{self, Cells, Header};
use study::stress::specimen::{Cause, Kind};

/// Arguments of `palpate stress hold`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct HoldArguments {
    /// Judge this scene file (TOML) with its own hands, instead of the cells of the study
    #[arg(conflicts_with_all = ["runs", "cell", "quick", "seed", "shard", "json", "plot"])]
    file: Option<PathBuf>,
    #[command(flatten)]
    values: Values,
    /// Number of cells: the fixed cases first, then random draws. Each cell is run under linear and capped
    #[arg(long, value_name = "N", value_parser = super::cells)]
    runs: Option<u64>,
    /// Run one cell again and print its outcome: --plot draws the cell, --log writes every tick, --write writes its
    /// scene file
    #[arg(long, value_name = "N", conflicts_with_all = ["runs", "quick", "shard", "json"])]
    cell: Option<u64>,
    /// Scheme of the cell: linear or capped. Default: capped
    #[arg(long, value_name = "NAME", requires = "cell", value_parser = scheme)]
    scheme: Option<SchemeName>,
    /// Write every tick of the cell (CSV)
    #[arg(long, value_name = "FILE", requires = "cell")]
    log: Option<PathBuf>,
    /// Write the scene of the cell, which `palpate run` repeats (TOML)
    #[arg(long, value_name = "FILE", requires = "cell")]
    write: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

/// Default number of cells.
const RUNS: u64 = 2000;
/// Number of cells of a quick study: the cases, and each specimen on each device.
const QUICK: u64 = 84;
/// Largest number of cells that are listed one by one.
const MOST_PRINTED: usize = 12;

fn scheme(text: &str) -> Result<SchemeName, String> {
    scheme_of(text, &SCHEMES)
}

pub(super) fn run(arguments: &HoldArguments) -> Result<(), CommandError> {
    let common = &arguments.common;
    if let Some(path) = &arguments.file {
        let cell = judge(arguments.values.load(Some(path), Vec::new())?)?;
        if cell.moves {
            outln!("a hand moves in the last second; the hold is not judged");
        }
        return finish(&BTreeMap::from([(0, cell)]));
    }
    let declared = Declared::default()
        .file("--log", arguments.log.as_ref(), Format::Csv)
        .file("--write", arguments.write.as_ref(), Format::Toml);
    let _held = common.declare(declared).check()?;
    let study = Study::new(common.cells.seed);
    if let Some(cell) = arguments.cell {
        return show_cell(arguments, study, cell);
    }
    let default = if common.quick { QUICK } else { RUNS };
    let header = Header {
        study: "hold".to_owned(),
        schema: 2,
        seed: common.cells.seed,
        cells: arguments.runs.unwrap_or(default),
        settings: serde_json::json!({ "cases": CASES.map(|(name, text, _)| (name, text)) }),
    };
    let shown = Shown::new();
    let work = |cell| study.cell(cell, &SCHEMES);
    let cells = jobs::run(&header, &common.cells.options(), &work, &mut |at| {
        shown.show(at);
    });
    let Cells { cells, unwritten } = shown.end(cells)?;
    outln!("{} cells, seed {}\n", cells.len(), common.cells.seed);
    print(&cells);
    let mut written = Written::default();
    written.write(common.plot.as_ref(), |path| {
        write_picture(path, &picture::holds(&cells))
    });
    written.and(unwritten).end_with(finish(&cells))
}

/// Lists the cases and the worst of the cells in which `capped` fails. Fails if there is such a cell.
fn finish(cells: &BTreeMap<u64, CellResult>) -> Result<(), CommandError> {
    let failing = worst(cells, "capped");
    print_failures(cells, &failing);
    for (number, cell) in cells {
        if let Some(why) = &cell.failed {
            errln!("cell {number}: {why}");
        }
    }
    if failing.is_empty() {
        return Ok(());
    }
    Err(CommandError::Stressed {
        failed: failing.len(),
        of: cells.len(),
    })
}

/// Prints a table by specimen, by device and by rate, and the worst cells.
fn print(cells: &BTreeMap<u64, CellResult>) {
    outln!("By specimen:\n");
    head("specimen");
    rows("all", cells, |_| true);
    rows("cases", cells, |cell| cell.case.is_some());
    for kind in Kind::ALL {
        rows(kind.name(), cells, |cell| {
            cell.draw.as_ref().is_some_and(|draw| draw.kind == kind)
        });
    }
    outln!("\nBy number of hands:\n");
    head("hands");
    for hands in 1..=3 {
        rows(&hands.to_string(), cells, |cell| {
            let draw = cell.draw.as_ref();
            draw.is_some_and(|draw| draw.hands.len() == hands)
        });
    }
    outln!("\nBy the stiffest motion, as a multiple of what the devices render:\n");
    head("multiple");
    for (name, low, high) in [
        ("up to 1", 0.0, 1.0),
        ("1 to 10", 1.0, 10.0),
        ("more", 10.0, f64::INFINITY),
    ] {
        rows(name, cells, |cell| {
            let draw = cell.draw.as_ref();
            draw.is_some_and(|draw| (low..high).contains(&draw.ratio))
        });
    }
    outln!("\nBy what takes a part of the force away:\n");
    head("cause");
    for cause in Cause::ALL {
        rows(cause.name(), cells, |cell| {
            let draw = cell.draw.as_ref();
            draw.is_some_and(|draw| draw.cause == cause)
        });
    }
    outln!("\nBy device of the first hand:\n");
    head("device");
    for (name, _) in DeviceModel::spatial() {
        rows(name, cells, |cell| {
            let draw = cell.draw.as_ref();
            draw.is_some_and(|draw| draw.hands[0].device == name)
        });
    }
    outln!("\nBy publication rate:\n");
    head("Hz");
    for (name, low, high) in [
        ("30 to 60", 0.0, 60.0),
        ("60 to 125", 60.0, 125.0),
        ("125 to 250", 125.0, 250.0),
        ("250 to 1000", 250.0, f64::INFINITY),
    ] {
        rows(name, cells, |cell| {
            cell.draw.is_some() && (low..high).contains(&cell.rate)
        });
    }
}

/// Prints the cases and the worst of the failing cells, one row per scheme.
fn print_failures(cells: &BTreeMap<u64, CellResult>, failing: &[(u64, &CellResult, Vec<Failure>)]) {
    outln!("\nCases and worst cells:\n");
    outln!(
        "| cell | case or specimen | Hz | scheme | fails | hold error % | leaves % | run error % | ripple N | in the hold | jump, in frictions | capped % | net energy mJ |"
    );
    outln!("|{}", "---|".repeat(13));
    let cases = cells.iter().filter(|(_, cell)| cell.case.is_some());
    let cases = cases.map(|(number, cell)| (*number, cell));
    let drawn = failing.iter().filter(|(_, cell, _)| cell.case.is_none());
    let drawn = drawn.map(|(number, cell, _)| (*number, *cell));
    for (number, cell) in cases.chain(drawn.take(MOST_PRINTED)) {
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
            outln!(
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

fn head(first: &str) {
    let failures = Failure::ALL.map(Failure::name).join(" | ");
    outln!(
        "| {first} | scheme | runs | pass | {failures} | hold error %: median, 90 % | run error % | ripple N | capped %, most | net energy mJ, most |"
    );
    outln!("|{}", "---|".repeat(9 + Failure::ALL.len()));
}

fn rows(first: &str, cells: &BTreeMap<u64, CellResult>, which: impl Fn(&CellResult) -> bool) {
    for (_, scheme) in SCHEMES {
        let Some(row) = row(cells.values().filter(|cell| which(cell)), scheme) else {
            continue;
        };
        let failed = row.failed.map(|count| count.to_string()).join(" | ");
        let percent = |[a, b]: [f64; 2]| format!("{:.2}, {:.2}", 100.0 * a, 100.0 * b);
        outln!(
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

/// Runs one cell under one scheme and prints its outcome.
fn show_cell(arguments: &HoldArguments, study: Study, cell: u64) -> Result<(), CommandError> {
    let wanted = arguments.scheme.unwrap_or(SchemeName::Capped);
    if let Some(path) = &arguments.write {
        write_scene(path, &study.written(cell, wanted)?)?;
    }
    // The verdict compares with `linear`.
    let mut schemes: Vec<_> = SCHEMES.into_iter().collect();
    schemes.retain(|(name, _)| *name == wanted || *name == SchemeName::Linear);
    schemes.sort_by_key(|(name, _)| *name != wanted);
    let names: Vec<_> = schemes.iter().map(|(scheme, _)| *scheme).collect();
    let traces = study.traces(cell, &names)?;
    let result = study.result(cell, &traces, &schemes);
    let title = match (&result.draw, &result.case) {
        (Some(draw), _) => {
            cell::print_specimen(cell, arguments.common.cells.seed, draw);
            format!(
                "Cell {cell}: {}, {}",
                draw.kind.name(),
                draw.hands[0].device
            )
        }
        (None, case) => {
            let title = format!("Cell {cell}: {}", case.as_deref().unwrap_or_default());
            outln!("{title}");
            title
        }
    };
    if let (Some(run), Some((_, scheme))) = (traces.runs.first(), schemes.first()) {
        let outcome = &result.schemes[*scheme];
        let failed: Vec<_> = failures(&result, scheme)
            .into_iter()
            .map(Failure::name)
            .collect();
        let verdict = if failed.is_empty() {
            "within all limits".to_owned()
        } else {
            format!("beyond the limits of {}", failed.join(", "))
        };
        cell::print_outcome(&format!("{scheme}: {verdict}"), outcome, &traces.reference);
        outln!("  one count  changes the force by {:.3} N", traces.count);
        let mut written = Written::default();
        written.write(arguments.common.plot.as_ref(), |path| {
            let subtitle = format!(
                "\"{scheme}\": hold error {:.1} %, run error {:.1} % of the peak, ripple {:.3} N, capped {:.1} %",
                100.0 * outcome.force_errors.hold_error,
                100.0 * outcome.force_errors.run_error,
                outcome.force_errors.worst_ripple,
                100.0 * outcome.capped
            );
            let svg = picture::cell(&title, &subtitle, run, &traces.reference);
            write_picture(path, &svg)
        });
        written.write(arguments.log.as_ref(), |path| {
            write_atomically(path, log(run, &traces.reference).as_bytes())
        });
        written.end()?;
    }
    Ok(())
}
