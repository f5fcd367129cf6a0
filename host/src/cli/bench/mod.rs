//! `palpate bench`: measurements that the book quotes.

mod extrapolation;
mod stability;

use super::CommandError;
use indicatif::{ProgressBar, ProgressStyle};

/// Arguments of `palpate bench`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct BenchArguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Clone, Debug, clap::Subcommand)]
enum What {
    /// Force error of each scheme against the rate at which the host publishes
    Extrapolation(extrapolation::ExtrapolationArguments),
    /// Stress every law, element and scheme; fails if a number is not finite or energy comes from nowhere
    Stability(stability::StabilityArguments),
}

pub(super) fn run(arguments: &BenchArguments) -> Result<(), CommandError> {
    match &arguments.what {
        What::Extrapolation(arguments) => extrapolation::run(arguments),
        What::Stability(arguments) => stability::run(arguments),
    }
}

/// A bar of a thousand parts, drawn only where a person looks: on a terminal.
fn progress_bar() -> ProgressBar {
    let bar = ProgressBar::new(1000);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {percent:>3} %  {eta} left") {
        bar.set_style(style);
    }
    bar
}
