//! `palpate run`: a scene from beginning to end.

use super::{CommandError, SceneArgument, load, signals};
use crate::run::{Clock, RunOptions};
use indicatif::{ProgressBar, ProgressStyle};
use runner::CallPolicy;
use std::path::PathBuf;

/// Arguments of `palpate run`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct RunArguments {
    #[command(flatten)]
    scene: SceneArgument,
    /// Which clock: virtual time is exact and repeatable, real time is the machine's
    #[arg(long, value_enum, default_value_t = ClockName::Virtual)]
    clock: ClockName,
    /// Length of the run in seconds, if not the scene's
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    duration: Option<f64>,
    /// Fixes every random choice, in place of the scene's seed
    #[arg(long)]
    seed: Option<u64>,
    /// Log every tick (MCAP, for Foxglove, PlotJuggler and others)
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Draw force and position over time (SVG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Write the summary as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Real clock: do not start without the realtime privileges, and end at a system call that the tick may
    /// not make; or one of the two
    #[arg(long, value_name = "WHAT", value_enum, num_args = 0..=1, require_equals = true,
          default_missing_value = "all")]
    strict: Option<Strict>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Strict {
    /// End the run, without force, at the first system call that the tick may not make
    Syscalls,
    /// Do not start unless core, priority, locked memory and a wakeful processor are granted
    Privileges,
    /// Both
    All,
}

impl Default for RunArguments {
    fn default() -> Self {
        Self {
            scene: SceneArgument::default(),
            clock: ClockName::Virtual,
            duration: None,
            seed: None,
            log: None,
            plot: None,
            json: None,
            strict: None,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum ClockName {
    Virtual,
    Real,
}

/// A positive, finite number of seconds, a day at most.
fn seconds(text: &str) -> Result<f64, String> {
    let refused = || format!("found {text}, allowed: a number above 0 and up to 86400 (s)");
    let value: f64 = text.parse().map_err(|_| refused())?;
    if value > 0.0 && value <= 86_400.0 {
        Ok(value)
    } else {
        Err(refused())
    }
}

pub(super) fn run(arguments: &RunArguments) -> Result<(), CommandError> {
    let loaded = load(arguments.scene.scene.as_deref())?;
    let mut options = RunOptions {
        duration: arguments.duration,
        seed: arguments.seed,
        log: arguments.log.clone(),
        plot: arguments.plot.clone(),
        json: arguments.json.clone(),
        ..RunOptions::new(match arguments.clock {
            ClockName::Virtual => Clock::Virtual,
            ClockName::Real => Clock::Real,
        })
    };
    options.runner.insist = matches!(arguments.strict, Some(Strict::Privileges | Strict::All));
    // Scenes have simulated devices only.
    let watched = matches!(arguments.strict, Some(Strict::Syscalls | Strict::All));
    options.runner.calls = watched.then_some(CallPolicy::Simulated);
    if arguments.strict.is_some() && arguments.clock == ClockName::Virtual {
        return Err(CommandError::StrictWithoutRealClock);
    }
    // Virtual time commands no device: there a signal may end the program as it always does.
    let signal = match options.clock {
        Clock::Real => Some(signals::end_in_order(&options.stop).map_err(CommandError::Signals)?),
        Clock::Virtual => None,
    };
    // Drawn only where a person looks: on a terminal.
    let bar = ProgressBar::new(1000);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {percent:>3} %  {eta} left") {
        bar.set_style(style);
    }
    let result = crate::run::run(&loaded, &options, |share| {
        bar.set_position((1000.0 * share) as u64);
    });
    bar.finish_and_clear();
    let summary = result?;
    print!("{summary}");
    for (what, path) in [
        ("log", &options.log),
        ("plot", &options.plot),
        ("json", &options.json),
    ] {
        if let Some(path) = path {
            println!("  {what:<10} {}", path.display());
        }
    }
    if !summary.failures.is_empty() {
        return Err(CommandError::Incomplete);
    }
    match signal.and_then(|signal| signal.number()) {
        Some(number) if summary.tick.stopped => Err(CommandError::Signal(number)),
        _ => Ok(()),
    }
}
