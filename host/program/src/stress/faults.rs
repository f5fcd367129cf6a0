//! `palpate stress faults`: runs the tick on invalid input of devices, host and clock.

use super::{CommandError, Common, Declared, Shown, Written, declare_devices, devices};
use std::collections::BTreeMap;
use study::stress::devices::StudyDevice;
use study::stress::faults::{self, CELLS, Outcome, QUICK_CELLS};
use study::stress::jobs::{self, Cells};

/// Arguments of `palpate stress faults`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct FaultsArguments {
    /// Devices with whose rate, limits, friction and counts the controllers run, in turn: device files (TOML) or names
    /// of built-in devices. Default: devices of random limits
    #[arg(value_name = "DEVICE")]
    devices: Vec<String>,
    /// Number of controllers. Default: 1000, of a hundred thousand ticks each; 10 with --quick
    #[arg(long, value_name = "N", value_parser = super::cells)]
    runs: Option<u64>,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(arguments: &FaultsArguments) -> Result<(), CommandError> {
    let common = &arguments.common;
    let named = devices(&arguments.devices)?;
    let declared = declare_devices(Declared::default(), &named);
    let _held = common.declare(declared).check()?;
    let devices = StudyDevice::chosen(&named)?;
    let default = if common.quick { QUICK_CELLS } else { CELLS };
    let header = faults::header(
        common.cells.seed,
        arguments.runs.unwrap_or(default),
        &devices,
    );
    let shown = Shown::new();
    let work = |cell| faults::run(common.cells.seed, cell, &devices);
    let cells = jobs::run(&header, &common.cells.options(), &work, &mut |at| {
        shown.show(at);
    });
    let Cells { cells, unwritten } = shown.end(cells)?;
    print(&cells);
    let failed = cells.values().filter(|cell| !cell.passed()).count();
    let outcome = match failed {
        0 => Ok(()),
        _ => Err(CommandError::Stressed {
            failed,
            of: cells.len(),
        }),
    };
    Written::default().and(unwritten).end_with(outcome)
}

fn print(cells: &BTreeMap<u64, Outcome>) {
    let mut by_scheme: BTreeMap<&str, [u64; 7]> = BTreeMap::new();
    let mut met: BTreeMap<&str, u64> = BTreeMap::new();
    for cell in cells.values() {
        let sums = by_scheme.entry(&cell.scheme).or_default();
        let counts = [
            1,
            cell.ticks,
            cell.not_finite,
            cell.beyond,
            cell.lost_account,
            cell.not_back,
            u64::from(cell.panic.is_some()),
        ];
        for (sum, count) in sums.iter_mut().zip(counts) {
            *sum += count;
        }
        for (event, count) in &cell.met {
            *met.entry(event).or_default() += count;
        }
    }
    outln!(
        "| scheme | cells | ticks | not finite | beyond limits | account lost | not recovered | panics |"
    );
    outln!("|---|---|---|---|---|---|---|---|");
    for (scheme, sums) in by_scheme {
        let columns: Vec<_> = sums.iter().map(u64::to_string).collect();
        outln!("| {scheme} | {} |", columns.join(" | "));
    }
    outln!("\nEvents that occurred:");
    for (event, count) in met {
        outln!("  {count:>12}  {event}");
    }
    for (number, cell) in cells {
        if let Some(panic) = &cell.panic {
            outln!("  cell {number} panicked: {panic}");
        }
    }
}
