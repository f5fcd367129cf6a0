//! `palpate stress`: studies to run before a person touches a device. They run in virtual time, on all cores and in
//! shards.

mod contact;
mod faults;
mod hold;
mod scene;
mod seeds;
mod tearing;
mod wall;

use super::outputs::{Declared, Format};
use super::written::Written;
use super::{CommandError, progress_bar};
use crate::progress::ProgressBar;
use crate::sets::Values;
use host::plot::write_picture;
use host::scene::NamedDevice;
use host::scene::spec::SchemeName;
use std::num::NonZero;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use study::stress::jobs::{Cells, JobError, Options, Progress, Shard};
use study::stress::{self, Verdict, connections, endings};

/// Arguments of `palpate stress`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct StressArguments {
    #[command(subcommand)]
    study: Study,
}

#[derive(Clone, Debug, clap::Subcommand)]
enum Study {
    /// Find the stiffest passive and stable wall of each device, under each scheme, and compare with theory
    Wall(wall::WallArguments),
    /// Run a hundred million ticks on invalid input of devices, host and clock
    Faults(faults::FaultsArguments),
    /// Cut, flood, corrupt and delay the connection of each kind of device at random times, in a hand that pushes
    #[command(
        mut_arg("runs", |runs| runs.help("Number of runs of each fault on each protocol. Default: 100, or 1 with --quick")),
        mut_arg("quick", |quick| quick.help("Run each fault on each protocol once"))
    )]
    Connections(Plain),
    /// Let random bodies touch each other and obstacles in two hands under all faults, and check energy, crossings and repetition
    Contact(contact::ContactArguments),
    /// End commands that hold a device by signals and closed terminals, and watch the force of the device
    #[command(
        mut_arg("runs", |runs| runs.help("Number of runs of each way out of each command. Default: 3, or 1 with --quick")),
        mut_arg("quick", |quick| quick.help("Run a few ways out of a few commands once"))
    )]
    Endings(Plain),
    /// Press, hold, rub and shake every kind of body without faults, and compare the force with that of the body
    Hold(hold::HoldArguments),
    /// Run a scene with many kinds of hands, rates and faults, under each scheme
    Scene(scene::SceneArguments),
    /// Print results of several seeds of a study side by side, with their spread over the seeds
    Seeds(seeds::SeedsArguments),
    /// Tear random sheets under random hands, rates and stalls, and check energy, edits and repetition
    Tearing(tearing::TearingArguments),
}

/// The arguments of studies that draw a result.
#[derive(Clone, Debug, clap::Args)]
struct Common {
    /// Run only the corner cases, in seconds instead of minutes
    #[arg(long)]
    quick: bool,
    #[command(flatten)]
    cells: CellArguments,
    /// Draw the result (SVG or PNG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

/// How the cells of a study are drawn and run.
#[derive(Clone, Debug, clap::Args)]
struct CellArguments {
    /// Seed of every random choice
    #[arg(long, default_value_t = 1, value_parser = crate::seed)]
    seed: u64,
    /// Run only shard I of N; cat merges the files of all shards
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<Shard>,
    /// Number of threads. Default: all cores
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZero<usize>>,
    /// Append each completed cell as a line of JSON. Completed cells are skipped
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// The arguments of a study that has no others.
#[derive(Clone, Debug, clap::Args)]
struct Plain {
    /// Number of runs
    #[arg(long, value_name = "N", value_parser = cells)]
    runs: Option<u64>,
    /// Make few runs
    #[arg(long)]
    quick: bool,
    #[command(flatten)]
    cells: CellArguments,
}

impl Plain {
    /// Runs the study that `new` makes of a seed and a number of runs: one of the `numbers` of a whole study and of a quick
    /// one, if the person gives no number.
    fn run<S: stress::Study>(
        &self,
        numbers: [u64; 2],
        new: impl FnOnce(u64, u64) -> S,
    ) -> Result<(), CommandError> {
        let _held = self.cells.declare(Declared::default()).check()?;
        let runs = number(self.runs, self.quick, numbers);
        self.cells.run(&new(self.cells.seed, runs))
    }
}

/// The number that a person asks for, or else that of a whole study or of a quick one.
fn number(asked: Option<u64>, quick: bool, [whole, few]: [u64; 2]) -> u64 {
    asked.unwrap_or(if quick { few } else { whole })
}

impl CellArguments {
    /// The options by which the cells are run.
    fn options(&self) -> Options {
        Options {
            shard: self.shard.unwrap_or_default(),
            threads: self.threads,
            file: self.json.clone(),
        }
    }

    /// Runs a study that is not drawn.
    fn run<S: stress::Study>(&self, study: &S) -> Result<(), CommandError> {
        run_study(study, &self.options(), None)
    }

    /// Declares the file of the cells.
    fn declare(&self, declared: Declared) -> Declared {
        declared.file("--json", self.json.as_ref(), Format::JsonLines)
    }
}

impl Common {
    /// Runs the study.
    fn run<S: stress::Study>(&self, study: &S) -> Result<(), CommandError> {
        run_study(study, &self.cells.options(), self.plot.as_ref())
    }

    /// Declares the outputs of the study.
    fn declare(&self, declared: Declared) -> Declared {
        self.cells
            .declare(declared)
            .file("--plot", self.plot.as_ref(), Format::Picture)
    }
}

pub(super) fn run(arguments: &StressArguments) -> Result<(), CommandError> {
    match &arguments.study {
        Study::Wall(arguments) => wall::run(arguments),
        Study::Faults(arguments) => faults::run(arguments),
        Study::Connections(asked) => asked.run(connections::RUNS, |seed, runs| {
            connections::Study { seed, runs }
        }),
        Study::Contact(arguments) => contact::run(arguments),
        Study::Endings(asked) => asked.run(endings::RUNS, |seed, runs| {
            endings::Study::new(seed, runs, asked.quick)
        }),
        Study::Hold(arguments) => hold::run(arguments),
        Study::Scene(arguments) => scene::run(arguments),
        Study::Seeds(arguments) => seeds::run(arguments),
        Study::Tearing(arguments) => tearing::run(arguments),
    }
}

/// Runs the cells of a study, prints the results, and writes the picture.
pub(super) fn run_study<S: stress::Study>(
    study: &S,
    options: &Options,
    plot: Option<&PathBuf>,
) -> Result<(), CommandError> {
    let shown = Shown::new();
    if let Some(line) = study.announcement() {
        shown.say(&line);
    }
    let found = study.run(options, &|part| shown.part(part), &mut |at| shown.show(at));
    let Cells { cells, unwritten } = shown.end(found)?;
    out!("{}", study.summary(&cells));
    let mut written = Written::default();
    if let Some(picture) = plot.and_then(|_| study.draw(&cells)) {
        written.write(plot, |path| write_picture(path, &picture));
    }
    let outcome = judged(&study.verdict(&cells), cells.len());
    written.and(unwritten).end_with(outcome)
}

/// Prints what failed in a study of `of` cells.
///
/// # Errors
/// If a cell failed, or could not be run.
fn judged(verdict: &Verdict, of: usize) -> Result<(), CommandError> {
    for line in &verdict.lines {
        errln!("{line}");
    }
    match verdict.failed {
        0 if verdict.incomplete => Err(CommandError::Incomplete),
        0 => Ok(()),
        failed => Err(CommandError::Stressed { failed, of }),
    }
}

/// The scheme of this name among the schemes of a study.
pub(super) fn scheme_of(text: &str, known: &[(SchemeName, &str)]) -> Result<SchemeName, String> {
    let found = known.iter().find(|(_, name)| *name == text);
    found.map(|(scheme, _)| *scheme).ok_or_else(|| {
        let names: Vec<_> = known.iter().map(|(_, name)| *name).collect();
        format!("allowed: {}", names.join(", "))
    })
}

/// Parses a shard: `3/8` is the third of eight.
fn shard(text: &str) -> Result<Shard, String> {
    let parts = text.split_once('/');
    let numbers = parts.and_then(|(i, n)| i.parse().ok().zip(n.parse().ok()));
    let shard = numbers.and_then(|(index, count)| Shard::new(index, count));
    shard.ok_or_else(|| format!("found {text}, allowed: I/N with I from 1 to N, such as 3/8"))
}

/// Parses a number of threads.
pub(crate) fn threads(text: &str) -> Result<NonZero<usize>, String> {
    text.parse()
        .map_err(|_| format!("found {text}, allowed: a whole number, 1 or above"))
}

/// Parses a number of cells.
fn cells(text: &str) -> Result<u64, String> {
    let number = text.parse().ok().filter(|&number| number > 0);
    number.ok_or_else(|| format!("found {text}, allowed: a whole number, 1 or above"))
}

/// The progress of the cells, on a bar of a thousand parts.
struct Shown {
    bar: ProgressBar,
    /// Whether the person has been told that the file of results cannot be written.
    warned: AtomicBool,
    /// Number of cells; of those that are done; of those that were done before.
    of: AtomicU64,
    done: AtomicU64,
    before: AtomicU64,
    /// The work of this run, in millionths of a cell, if the cells tell their parts.
    millionths: AtomicU64,
}

/// Parts of a cell in which its progress is counted.
const MILLION: f64 = 1e6;

impl Shown {
    fn new() -> Self {
        Self {
            bar: progress_bar(),
            warned: AtomicBool::new(false),
            of: AtomicU64::new(u64::MAX),
            done: AtomicU64::new(0),
            before: AtomicU64::new(0),
            millionths: AtomicU64::new(0),
        }
    }

    fn show(&self, at: &Progress<'_>) {
        if self.of.swap(at.of.max(1), Ordering::Relaxed) == u64::MAX {
            self.before.store(at.done, Ordering::Relaxed);
        }
        self.done.store(at.done, Ordering::Relaxed);
        self.draw();
        if let Some(error) = at.unwritten
            && !self.warned.swap(true, Ordering::Relaxed)
        {
            self.bar.say(&format!(
                "warning: {error}; the study continues, and tries again after each cell"
            ));
        }
    }

    /// A part of a cell is done, on any thread: this fraction of the cell.
    fn part(&self, fraction: f64) {
        let part = (MILLION * fraction) as u64;
        self.millionths.fetch_add(part, Ordering::Relaxed);
        self.draw();
    }

    /// Writes a line to the standard error, above the bar.
    fn say(&self, text: &str) {
        self.bar.say(text);
    }

    fn draw(&self) {
        let number = |counter: &AtomicU64| counter.load(Ordering::Relaxed) as f64;
        let parts = number(&self.before) + number(&self.millionths) / MILLION;
        // A cell that failed has not told all of its parts.
        let cells = parts.max(number(&self.done));
        self.bar
            .set_position((1000.0 * cells / number(&self.of)) as u64);
    }

    /// Ends the display of a run with the result `cells`.
    fn end<R>(&self, cells: Result<Cells<R>, JobError>) -> Result<Cells<R>, CommandError> {
        self.bar.finish_and_clear();
        Ok(cells?)
    }
}

/// The devices that the arguments name. Prints the warnings about their files.
fn devices(arguments: &[String]) -> Result<Vec<NamedDevice>, CommandError> {
    let devices = arguments.iter().map(|text| NamedDevice::load(text));
    let devices = devices.collect::<Result<Vec<_>, _>>()?;
    for warning in devices.iter().flat_map(|device| &device.warnings) {
        errln!("warning: {warning}");
    }
    Ok(devices)
}

/// Declares the files of devices, which a command reads.
fn declare_devices(mut declared: Declared, devices: &[NamedDevice]) -> Declared {
    for device in devices {
        declared = declared.input("a device file", device.path.as_deref());
    }
    declared
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_read_and_bad_ones_refused() {
        assert_eq!(shard("2/3").ok(), Shard::new(2, 3));
        for bad in ["", "3", "0/3", "4/3", "1/0", "a/b", "1/3/5", "-1/3"] {
            let expected = format!("found {bad}, allowed: I/N with I from 1 to N, such as 3/8");
            assert_eq!(shard(bad), Err(expected));
        }
    }
}
