//! `palpate sweep`: a scene with several values of its fields, side by side.

use super::outputs::{Declared, Format};
use super::run::AxisName;
use super::sets::{Assignment, assignment};
use super::stress::{run_study, threads};
use super::{CommandError, load};
use host::plot::Component;
use std::num::NonZero;
use std::path::PathBuf;
use study::stress::jobs::{Options, Shard};
use study::sweep::{Axis, Sweep};

/// Arguments of `palpate sweep`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct SweepArguments {
    /// Scene file (TOML). Default: the built-in scene
    scene: Option<PathBuf>,
    /// A field of the scene and its values: `body[0].tear.toughness=300,450,600` or `loop.scheme=hold,capped`. Given several
    /// times, every combination of the values is run
    #[arg(long = "set", value_name = "FIELD=VALUES", value_parser = assignment, required = true)]
    sets: Vec<Assignment>,
    /// Seed of every random choice, the same for all runs. Default: the seed of the scene
    #[arg(long, value_parser = crate::seed)]
    seed: Option<u64>,
    /// Duration of each run in seconds. Default: the duration of the scene
    #[arg(long, value_name = "SECONDS", value_parser = super::run::seconds)]
    duration: Option<f64>,
    /// Number of threads. Default: all cores
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZero<usize>>,
    /// Append each completed run as a line of JSON, with its forces over time. A sweep that is begun again skips the
    /// completed runs
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw the forces of all runs over time, a panel for each device (SVG or PNG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Keep and draw the forces along this axis of the scene, or their norm
    #[arg(long, value_name = "AXIS", value_enum, default_value_t = AxisName::Norm)]
    axis: AxisName,
}

const EXAMPLES: &str = "\
Examples:
  palpate sweep --set body[0].material.young=1e5,2e5,4e5     the built-in scene with three stiffnesses
  palpate sweep my_scene.toml --set body[0].tear.toughness=300,450,600 --plot forces.svg --json forces.jsonl
                                                             three toughnesses in one figure; begun again, the sweep
                                                             goes on where it stopped
  palpate sweep my_scene.toml --set loop.scheme=linear,capped --set host.publish_rate=50,125
                                                             every combination";

pub(super) fn run(arguments: &SweepArguments) -> Result<(), CommandError> {
    let scene = arguments.scene.as_deref();
    let loaded = load(scene, &super::sets::Sets::default())?;
    let _held = Declared::default()
        .scene(scene, &loaded)
        .file("--json", arguments.json.as_ref(), Format::JsonLines)
        .file("--plot", arguments.plot.as_ref(), Format::Picture)
        .check()?;
    let axes = arguments.sets.iter().map(|set| Axis {
        field: set.field.clone(),
        values: set.values.clone(),
    });
    let component = Component::from(arguments.axis);
    let sweep = Sweep::new(&loaded, &axes.collect::<Vec<_>>(), component)?;
    let sweep = sweep.with(arguments.seed, arguments.duration);
    let options = Options {
        shard: Shard::default(),
        threads: arguments.threads,
        file: arguments.json.clone(),
    };
    run_study(&sweep, &options, arguments.plot.as_ref())
}
