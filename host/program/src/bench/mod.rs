//! `palpate bench`: the measurements that the book quotes.

mod accuracy;
mod contact;
mod extrapolation;
mod speed;
mod stability;
mod tearing;
mod velocity;

use super::written::Written;
use super::{CommandError, progress_bar};
use host::atomic_file::write_json;
use host::plot::write_picture;
use std::path::PathBuf;
use study::{Level, Results};

/// Arguments of `palpate bench`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct BenchArguments {
    #[command(subcommand)]
    benchmark: Benchmark,
}

#[derive(Clone, Debug, clap::Subcommand)]
enum Benchmark {
    /// Measure the error of sheets and solids against exact solutions and independent programs
    Accuracy(accuracy::AccuracyArguments),
    /// Measure contact against the aims of its design: rest, sliding, energy, detection, throws and times
    Contact(contact::ContactArguments),
    /// Measure the force error of each scheme against the publication rate of the host
    Extrapolation(extrapolation::ExtrapolationArguments),
    /// Measure the processor time of a step against the error of its force, on every path, and compare other programs
    Speed(speed::SpeedArguments),
    /// Stress every law, element and scheme. Fails if a number is not finite or a step creates energy
    Stability(stability::StabilityArguments),
    /// Tear sheets, and compare onset, force, path and energy with fracture mechanics
    Tearing(tearing::TearingArguments),
    /// Measure error, noise and delay of each velocity estimator for encoder counts, and the damping that it allows
    Velocity(velocity::VelocityArguments),
}

pub(super) fn run(arguments: &BenchArguments) -> Result<(), CommandError> {
    match &arguments.benchmark {
        Benchmark::Accuracy(arguments) => accuracy::run(arguments),
        Benchmark::Contact(arguments) => contact::run(arguments),
        Benchmark::Extrapolation(arguments) => extrapolation::run(arguments),
        Benchmark::Speed(arguments) => speed::run(arguments),
        Benchmark::Stability(arguments) => stability::run(arguments),
        Benchmark::Tearing(arguments) => tearing::run(arguments),
        Benchmark::Velocity(arguments) => velocity::run(arguments),
    }
}

/// The extent of a study.
fn level(quick: bool) -> Level {
    if quick { Level::Quick } else { Level::Full }
}

/// Prints the tables of a study, and writes its results and its picture if the person wants them.
fn tell(
    results: &impl Results,
    json: Option<&PathBuf>,
    plot: Option<&PathBuf>,
) -> Result<(), CommandError> {
    out!("{}", results.tables());
    let mut written = Written::default();
    written.write(json, |path| write_json(path, results));
    if let Some(picture) = plot.and_then(|_| results.picture()) {
        written.write(plot, |path| write_picture(path, &picture));
    }
    written.end()
}

/// Runs `study` and shows the fraction that is done on a bar.
fn with_bar<R>(study: impl FnOnce(&dyn Fn(f64)) -> R) -> R {
    let bar = progress_bar();
    let found = study(&|fraction| bar.set_position((1000.0 * fraction) as u64));
    bar.finish_and_clear();
    found
}
