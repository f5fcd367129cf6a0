//! `palpate stress connections`: faults between the program and a device.

use super::{CellArguments, CommandError, Declared, Shown, Written};
use std::collections::BTreeMap;
use study::stress::connections::{self, Outcome};
use study::stress::jobs::{self, Cells};

/// Arguments of `palpate stress connections`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ConnectionsArguments {
    /// Number of runs of each fault on each protocol. Default: 100, or 1 with --quick
    #[arg(long, value_name = "N", value_parser = super::cells)]
    runs: Option<u64>,
    /// Run each fault on each protocol once
    #[arg(long)]
    quick: bool,
    #[command(flatten)]
    cells: CellArguments,
}

/// Default number of runs, and that of a quick study.
const RUNS: u64 = 100;
const QUICK: u64 = 1;

pub(super) fn run(arguments: &ConnectionsArguments) -> Result<(), CommandError> {
    let _held = arguments.cells.declare(Declared::default()).check()?;
    let seed = arguments.cells.seed;
    let default = if arguments.quick { QUICK } else { RUNS };
    let header = connections::header(seed, arguments.runs.unwrap_or(default));
    let shown = Shown::new();
    let work = |cell| connections::cell(seed, cell);
    let options = arguments.cells.options();
    let cells = jobs::run(&header, &options, &work, &mut |at| shown.show(at));
    let Cells { cells, unwritten } = shown.end(cells)?;
    print(&cells);
    let failed = cells.values().filter(|cell| !cell.failures.is_empty());
    let outcome = match failed.count() {
        0 => Ok(()),
        failed => Err(CommandError::Stressed {
            failed,
            of: cells.len(),
        }),
    };
    Written::default().and(unwritten).end_with(outcome)
}

/// Prints the largest number of each fault on each protocol, and each failure.
fn print(cells: &BTreeMap<u64, Outcome>) {
    outln!(
        "| device | fault | runs | force at the device (ms) | force commanded (ms) | jump commanded (N) | \
         jump at the device (N) | net energy (mJ) | ticks without a state | failed |"
    );
    outln!("|---|---|---|---|---|---|---|---|---|---|");
    for worst in connections::worst(cells.values()) {
        let most = &worst.most;
        let [device, commanded] =
            [most.device_force, most.commanded_force].map(|time| match time {
                Some(time) => format!("{:.2}", 1e3 * time),
                None => "-".to_owned(),
            });
        let failed = if most.detectable {
            worst.failed.to_string()
        } else {
            "not detectable".to_owned()
        };
        outln!(
            "| {} | {} | {} | {device} | {commanded} | {:.3} | {:.3} | {:.3} | {} | {failed} |",
            most.protocol,
            most.fault,
            worst.runs,
            most.commanded_jump,
            most.device_jump,
            // Without the sign of a zero.
            1e3 * most.energy + 0.0,
            most.missed,
        );
    }
    for (number, cell) in cells {
        for failure in &cell.failures {
            errln!(
                "cell {number}: {}, {}: {failure}",
                cell.protocol,
                cell.fault
            );
        }
    }
}
