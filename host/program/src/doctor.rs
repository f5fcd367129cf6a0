//! `palpate doctor`: what this machine lacks for a steady tick.

use super::CommandError;
use super::outputs::{Declared, Format};
use super::settings::MachineArguments;
use doctor::{Asked, Check, Report, Verdict};
use host::atomic_file::{write_atomically, write_json};
use host::scene::settings::Settings;
use runner::CoreChoice;
use serde::Serialize;
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
Examples:
  palpate doctor                                       print what this machine lacks, and how to mend it
  palpate doctor --core 3 --priority 90                judge the machine for another core and priority
  palpate doctor --script tune.sh                      write a script that mends (sudo sh tune.sh mend) and undoes

Exit codes: 0 if all is as wanted, 1 if something is lacking, 2 if nothing is lacking and something is unknown. Wrong \
arguments give 2 as well, but print no table and write no --json.";

/// Arguments of `palpate doctor`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct DoctorArguments {
    #[command(flatten)]
    machine: MachineArguments,
    /// Write the checks as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a script for the shell with two modes, mend and undo. The command itself changes nothing
    #[arg(long, value_name = "FILE")]
    script: Option<PathBuf>,
}

/// The JSON that `--json` writes.
#[derive(Serialize)]
pub(super) struct DoctorJson {
    /// Version of this layout.
    schema: &'static str,
    /// The core of the tick for which the machine was judged.
    core: usize,
    /// The priority of the tick under SCHED_FIFO for which the machine was judged.
    priority: u8,
    /// The checks.
    checks: Vec<CheckJson>,
}

impl From<Report> for DoctorJson {
    fn from(report: Report) -> Self {
        Self {
            schema: "palpate.doctor/1",
            core: report.core,
            priority: report.priority,
            checks: report.checks.into_iter().map(CheckJson::from).collect(),
        }
    }
}

/// A check of `palpate doctor`.
#[derive(Serialize)]
struct CheckJson {
    /// Identifier, which stays from version to version.
    id: &'static str,
    /// Name.
    name: &'static str,
    /// Connection of the device that the check is about; `None` for a check of the machine.
    device: Option<String>,
    /// The judgement.
    verdict: Verdict,
    /// What the machine has.
    found: String,
    /// What a steady tick wants.
    wanted: String,
    /// The cost to the tick if the machine lacks it.
    cost: &'static str,
    /// The commands and the work by hand that mend it, in order; none unless the machine lacks it.
    mend: Vec<String>,
    /// The commands that undo these, in order.
    undo: Vec<String>,
}

impl From<Check> for CheckJson {
    fn from(check: Check) -> Self {
        let steps = &check.steps;
        Self {
            mend: steps.iter().map(doctor::Step::mend).collect(),
            undo: steps.iter().rev().filter_map(doctor::Step::undo).collect(),
            id: check.id,
            name: check.name,
            device: check.device,
            verdict: check.verdict,
            found: check.found,
            wanted: check.wanted,
            cost: check.cost,
        }
    }
}

pub(super) fn run(arguments: &DoctorArguments) -> Result<(), CommandError> {
    let settings = arguments.machine.resolve(None)?;
    let _held = Declared::default()
        .file("--json", arguments.json.as_ref(), Format::Json)
        .file("--script", arguments.script.as_ref(), Format::Script)
        .check()?;
    let report = doctor::examine(Path::new("/"), &asked(&settings));
    print(&report);
    if let Some(path) = &arguments.script {
        write_atomically(path, doctor::script::script(&report).as_bytes())?;
        outln!("\n  {:<10} {}", "script", path.display());
    }
    let (lacking, unknown) = (
        report.count(Verdict::Lacking),
        report.count(Verdict::Unknown),
    );
    if let Some(path) = &arguments.json {
        write_json(path, &DoctorJson::from(report))?;
    }
    match (lacking, unknown) {
        (0, 0) => Ok(()),
        (0, count) => Err(CommandError::Undetermined { count }),
        (count, _) => Err(CommandError::Lacking { count }),
    }
}

/// The checks of this machine.
pub(super) fn examined(asked: &Asked) -> DoctorJson {
    doctor::examine(Path::new("/"), asked).into()
}

/// The line at the start of a run under the real clock.
pub(super) fn line(settings: &Settings) -> String {
    doctor::examine(Path::new("/"), &asked(settings)).line()
}

/// The core and the priority for which the machine is judged.
pub(super) fn asked(settings: &Settings) -> Asked {
    let core = match settings.core.value {
        CoreChoice::Id(core) => Some(core),
        // The choice of a run.
        CoreChoice::Isolated | CoreChoice::Last | CoreChoice::Anywhere => None,
    };
    Asked {
        core,
        priority: Some(settings.priority.value),
    }
}

/// Prints the table, and for each lacking condition its cost and its commands.
fn print(report: &Report) {
    outln!(
        "this machine, for a tick on core {} with priority {}:\n",
        report.core,
        report.priority
    );
    let mut device = None;
    for check in &report.checks {
        if check.device != device {
            device.clone_from(&check.device);
            outln!("\n  {}", device.as_deref().unwrap_or_default());
        }
        outln!(
            "  {:<8} {:<22} {}",
            sign(check.verdict),
            check.name,
            check.found
        );
        if matches!(check.verdict, Verdict::Lacking | Verdict::Unknown) {
            outln!("  {:<8} {:<22} wanted: {}", "", "", check.wanted);
        }
    }
    for check in report.with(Verdict::Lacking) {
        let of = check.device.as_ref().map(|device| format!(" of {device}"));
        outln!("\n{}{}", check.name, of.unwrap_or_default());
        outln!("  {:<8} {}", "cost", check.cost);
        for step in &check.steps {
            outln!("  {:<8} {}", "mend", step.mend());
        }
        for undo in check.steps.iter().rev().filter_map(doctor::Step::undo) {
            outln!("  {:<8} {undo}", "undo");
        }
    }
    outln!(
        "\n{} as wanted, {} lacking, {} unknown, {} not applicable",
        report.count(Verdict::Met),
        report.count(Verdict::Lacking),
        report.count(Verdict::Unknown),
        report.count(Verdict::NotApplicable)
    );
}

/// The word at the beginning of a line of the table.
fn sign(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Met => "ok",
        Verdict::Lacking => "LACKING",
        Verdict::Unknown => "unknown",
        Verdict::NotApplicable => "-",
    }
}
