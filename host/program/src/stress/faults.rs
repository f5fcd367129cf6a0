//! `palpate stress faults`: runs the tick on invalid input of devices, host and clock.

use super::{CommandError, Common, Declared, progress_bar, show};
use std::collections::BTreeMap;
use study::stress::faults::{self, Outcome};
use study::stress::jobs;

/// Arguments of `palpate stress faults`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct FaultsArguments {
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(arguments: &FaultsArguments) -> Result<(), CommandError> {
    let common = &arguments.common;
    let _held = common.declare(Declared::default()).check()?;
    let header = faults::header(common.seed, common.quick);
    let bar = progress_bar();
    let cells = jobs::run(
        &header,
        &common.options(),
        |cell| faults::run(common.seed, cell),
        |at| show(&bar, at),
    );
    bar.finish_and_clear();
    let cells: BTreeMap<u64, Outcome> = cells?;
    print(&cells);
    let failed = cells.values().filter(|cell| !cell.passed()).count();
    if failed > 0 {
        return Err(CommandError::Stressed {
            failed,
            of: cells.len(),
        });
    }
    Ok(())
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
