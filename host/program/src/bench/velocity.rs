//! `palpate bench velocity`: the error of velocity estimates from encoder counts.

use super::super::CommandError;
use super::super::outputs::{Declared, Format};
use super::with_bar;
use host::atomic_file::write_json;
use std::path::PathBuf;
use study::velocity::{self, DAMPING, Motion, RATES, VelocityStudy};

/// Arguments of `palpate bench velocity`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct VelocityArguments {
    /// Write all figures as JSON as well
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(super) fn run(arguments: &VelocityArguments) -> Result<(), CommandError> {
    let _held = Declared::default()
        .file("--json", arguments.json.as_ref(), Format::Json)
        .check()?;
    let found = with_bar(|progress| velocity::run(&mut |done| progress(done)));
    print_means(&found);
    print_devices(&found);
    if let Some(path) = &arguments.json {
        write_json(path, &found)?;
    }
    Ok(())
}

fn print_means(found: &VelocityStudy) {
    outln!(
        "RMS error of the velocity (mm/s), chatter under {DAMPING} N s/m in a slow press (N), largest damping that \
         stops the bare device (N s/m);\ngeometric means over all devices at {} Hz\n",
        RATES.map(|rate| rate.to_string()).join(" and ")
    );
    outln!(
        "| method | longest delay ms | press | rub | hand | tap | hold | all | chatter | stable |"
    );
    outln!("|---|---|---|---|---|---|---|---|---|---|");
    for mean in &found.means {
        out!("| {} | {:.1} ", mean.method, 1e3 * mean.delay);
        for rms in mean.rms.iter().chain([&mean.all]) {
            out!("| {:.1} ", 1e3 * rms);
        }
        outln!("| {:.3} | {:.1} |", mean.chatter, mean.stable);
    }
}

fn print_devices(found: &VelocityStudy) {
    outln!("\nBy device: error and lag in the motion of a hand, error in a hold\n");
    outln!("| device | Hz | method | hand mm/s | lag ms | hold mm/s | chatter | stable |");
    outln!("|---|---|---|---|---|---|---|---|");
    for row in &found.rows {
        let of = |motion| row.errors.iter().find(|e| e.motion == motion);
        let (Some(hand), Some(hold)) = (of(Motion::Hand), of(Motion::Hold)) else {
            continue;
        };
        outln!(
            "| {} | {} | {} | {:.1} | {:.2} | {:.1} | {:.3} | {:.1} |",
            row.device,
            row.rate,
            row.method,
            1e3 * hand.rms,
            1e3 * hand.lag,
            1e3 * hold.rms,
            row.chatter,
            row.stable
        );
    }
}
