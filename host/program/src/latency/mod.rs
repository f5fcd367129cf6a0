//! `palpate latency`: how late the loop is, how often, and where from; alone, and beside a load.

mod compare;
mod cyclictest;
mod load;

pub(super) use load::served;

use super::outputs::{Declared, Format};
use super::run::seconds;
use super::settings::{self, MachineArguments};
use super::signals::Ending;
use super::{COMMIT, CommandError, SceneArgument, build, progress_bar};
use host::atomic_file::{write_atomically, write_json};
use host::plot::write_picture;
use host::run::{Clock, Progress, RunOptions};
use host::scene::{Field, Override};
use load::{Kind, Load};
use runner::{Cores, Reserved};
use std::path::PathBuf;
use std::sync::Arc;
use study::latency::chart::{chart, table};
use study::latency::measure;
use study::latency::result::Latency;

const EXAMPLES: &str = "\
Examples:
  palpate latency                                        a minute of the idle machine, and a minute under load
  palpate latency --duration 300 --report latency.md     the table and the paragraph for a methods section
  palpate latency scene.toml --device right=hid:1209:c0de --square-wave right=0,0,1
                                                         edges of force on a real device, for an oscilloscope
  palpate latency --load none --plot idle.svg            the idle machine only, as a chart";

/// Arguments of `palpate latency`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct LatencyArguments {
    #[command(flatten)]
    scene: SceneArgument,
    /// Time of each measurement in seconds. The percentile 99.999 % takes 300 s at 1 kHz, or more
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = seconds)]
    duration: f64,
    /// The load beside the second measurement
    #[arg(long, value_name = "KIND", value_enum, value_delimiter = ',', num_args = 1..,
          default_values_t = [Kind::Cpu, Kind::Memory, Kind::Faults, Kind::Disk])]
    load: Vec<Kind>,
    /// The folder in which the load `disk` writes. Default: the folder for temporary files
    #[arg(long, value_name = "FOLDER")]
    load_folder: Option<PathBuf>,
    /// Command a device this force (N, scene axes) beside the forces of the scene, with the opposite sign after each
    /// quarter of a second: right=0,0,1. The edges are in known ticks. May be given several times
    #[arg(long, value_name = "NAME=X,Y,Z", value_parser = square_wave)]
    square_wave: Vec<(String, [f64; 3])>,
    /// Arm the devices at the start. A real device that waits to be armed renders no force
    #[arg(long)]
    armed: bool,
    #[command(flatten)]
    machine: MachineArguments,
    /// Compare the wake-up with that of cyclictest (package rt-tests) on the same core, with the same priority and period, in
    /// this many pairs of slices of ten seconds. Host, log and load run throughout
    #[arg(long, value_name = "PAIRS", value_parser = clap::value_parser!(u32).range(2..=1000),
          conflicts_with_all = ["duration", "square_wave", "plot", "csv", "report"])]
    cyclictest: Option<u32>,
    /// Draw the lateness under each load: microseconds against the number of deadlines (SVG or PNG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Write every histogram as a table (CSV)
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the result as JSON, with every histogram and the worst ticks
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the paragraph and the tables that the methods section of a paper needs (Markdown)
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// Parses `NAME=X,Y,Z`.
fn square_wave(text: &str) -> Result<(String, [f64; 3]), String> {
    let parse = || {
        let (name, force) = text.split_once('=')?;
        let parts: Option<Vec<f64>> = force
            .split(',')
            .map(|part| part.trim().parse().ok())
            .collect();
        let force: [f64; 3] = parts?.try_into().ok()?;
        let finite = force.iter().all(|part| part.is_finite());
        (!name.is_empty() && finite).then(|| (name.to_owned(), force))
    };
    parse().ok_or_else(|| {
        format!("found {text}, allowed: the name of a device and a force in N, such as right=0,0,1")
    })
}

/// A load under which a part of the command measures.
struct Part {
    kinds: Vec<Kind>,
    processes: Load,
}

impl Part {
    /// The name of the load, for people.
    fn name(&self) -> String {
        if self.kinds.is_empty() {
            return "idle".to_owned();
        }
        let names: Vec<_> = self.kinds.iter().map(|kind| kind.name()).collect();
        format!("under load ({})", names.join(", "))
    }
}

impl LatencyArguments {
    /// Calls `measure` for the idle machine, and then under the load, with a function that turns the fraction of a part into the
    /// fraction of the command. A signal leaves out the parts that have not begun.
    fn under_each_load(
        &self,
        ending: &Ending,
        mut measure: impl FnMut(&mut Part, &dyn Fn(f64) -> f64) -> Result<(), CommandError>,
    ) -> Result<(), CommandError> {
        let folder = self.load_folder.clone().unwrap_or_else(std::env::temp_dir);
        let kinds = self.load.iter().copied().filter(|kind| *kind != Kind::None);
        let mut parts = vec![Vec::new(), kinds.collect()];
        parts.dedup();
        let count = parts.len() as f64;
        for (index, kinds) in parts.into_iter().enumerate() {
            if ending.stop().is_requested() {
                break;
            }
            // Before the run reserves its core: other programs know no such reservation.
            let cores = Cores::of_this_machine().online.len().max(1);
            let processes = Load::begin(&kinds, cores, &folder).map_err(CommandError::Load)?;
            let mut part = Part { kinds, processes };
            measure(&mut part, &|fraction| (index as f64 + fraction) / count)?;
        }
        Ok(())
    }

    /// The values of the scene that `--square-wave` and `--armed` replace.
    fn replaced(&self) -> Result<Vec<(String, Override)>, CommandError> {
        let each = self.square_wave.iter().map(|(name, [x, y, z])| {
            let flag = format!("--square-wave {name}={x},{y},{z}");
            let field = format!("device[{name}].square_wave").parse::<Field>();
            let field = field.map_err(|error| CommandError::SquareWave(error.to_string()))?;
            let value = format!("{{ force = [{x:?}, {y:?}, {z:?}] }}");
            Ok((flag, Override::value(field, &value)))
        });
        let armed = self
            .armed
            .then(|| Ok(("--armed".to_owned(), Override::armed())));
        each.chain(armed).collect()
    }
}

pub(super) fn run(arguments: &LatencyArguments) -> Result<(), CommandError> {
    let loaded = arguments
        .scene
        .values
        .load(arguments.scene.scene.as_deref(), arguments.replaced()?)?;
    let settings = arguments.machine.resolve(Some(&loaded))?;
    // The thread that starts here leaves the core of the tick free, as the threads of the run do.
    let (core, idle) = (settings.core.value, settings.idle_sibling.value);
    let reserved = Reserved::new(core, idle, &Cores::of_this_machine());
    let ending = Ending::begin(false)?;
    drop(reserved);
    let _held = Declared::default()
        .scene(arguments.scene.scene.as_deref(), &loaded)
        .file("--plot", arguments.plot.as_ref(), Format::Picture)
        .file("--csv", arguments.csv.as_ref(), Format::Csv)
        .file("--json", arguments.json.as_ref(), Format::Json)
        .file("--report", arguments.report.as_ref(), Format::Text)
        .check()?;
    let mut options = RunOptions {
        duration: Some(arguments.duration),
        stop: Arc::clone(ending.stop()),
        commit: COMMIT,
        ..RunOptions::new(Clock::Real)
    };
    settings::apply(&settings, &mut options);
    if let Some(pairs) = arguments.cyclictest {
        return compare::run(arguments, pairs, &options, &loaded, &ending);
    }
    let bar = progress_bar();
    let world = build(&loaded, &bar)?;
    let mut measured = Vec::new();
    arguments.under_each_load(&ending, |part, fraction_of| {
        let mut shown = |progress: Progress| match progress.preparation {
            Some(preparation) => bar.preparing(preparation),
            None => bar.draw_here((1000.0 * fraction_of(progress.fraction())) as u64),
        };
        let (gathered, mut summary) = measure(&world, &options, &mut shown)?;
        summary.failures.extend(part.processes.ended());
        measured.push((part.name(), gathered, summary));
        Ok(())
    })?;
    bar.finish_and_clear();
    let Some(latency) = Latency::new(&loaded.scene, &measured) else {
        return ending.result();
    };
    out!("{latency}");
    let text = |path: &PathBuf, text: String| write_atomically(path, text.as_bytes());
    if let Some(path) = &arguments.plot {
        write_picture(path, &chart(&latency))?;
    }
    if let Some(path) = &arguments.csv {
        text(path, table(&latency))?;
    }
    if let Some(path) = &arguments.json {
        write_json(path, &latency)?;
    }
    if let Some(path) = &arguments.report {
        text(path, latency.report())?;
    }
    for (output, path) in [
        ("plot", &arguments.plot),
        ("csv", &arguments.csv),
        ("json", &arguments.json),
        ("report", &arguments.report),
    ] {
        if let Some(path) = path {
            outln!("  {output:<10} {}", path.display());
        }
    }
    ending.result()?;
    if latency.loads.iter().any(|load| !load.failures.is_empty()) {
        return Err(CommandError::Incomplete);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_wave_names_its_device_and_its_force() {
        assert_eq!(
            square_wave("right=0,-1.5,2e-1"),
            Ok(("right".to_owned(), [0.0, -1.5, 0.2]))
        );
        for wrong in [
            "",
            "right",
            "=0,0,1",
            "right=",
            "right=1",
            "right=0,0",
            "right=0,0,1,2",
            "right=0,0,nan",
            "right=a,b,c",
        ] {
            let error = square_wave(wrong).expect_err(wrong);
            assert!(
                error.starts_with(&format!("found {wrong}, allowed:")),
                "{error}"
            );
        }
    }
}
