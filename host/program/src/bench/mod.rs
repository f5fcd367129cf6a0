//! `palpate bench`: measurements that the book quotes.

mod accuracy;
mod extrapolation;
mod speed;
mod stability;
mod velocity;

use super::{CommandError, progress_bar};

/// Arguments of `palpate bench`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct BenchArguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Clone, Debug, clap::Subcommand)]
enum What {
    /// Error of sheets and solids against exact solutions and independent programs
    Accuracy(accuracy::AccuracyArguments),
    /// Force error of each scheme against the rate at which the host publishes
    Extrapolation(extrapolation::ExtrapolationArguments),
    /// Processor time of a step against the error of its force, on every path; other programs' beside it
    Speed(speed::SpeedArguments),
    /// Stress every law, element and scheme; fails if a number is not finite or energy comes from nowhere
    Stability(stability::StabilityArguments),
    /// Error, noise and delay of every way to estimate velocity from encoder counts, and what damping it bears
    Velocity(velocity::VelocityArguments),
}

pub(super) fn run(arguments: &BenchArguments) -> Result<(), CommandError> {
    match &arguments.what {
        What::Accuracy(arguments) => accuracy::run(arguments),
        What::Extrapolation(arguments) => extrapolation::run(arguments),
        What::Speed(arguments) => speed::run(arguments),
        What::Stability(arguments) => stability::run(arguments),
        What::Velocity(arguments) => velocity::run(arguments),
    }
}
