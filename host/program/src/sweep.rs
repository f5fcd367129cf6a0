//! `palpate sweep`: a scene with several values of its fields, side by side.

use super::outputs::{Declared, Format};
use super::run::AxisName;
use super::sets::{Assignment, assignment};
use super::stress::{Shown, threads};
use super::written::Written;
use super::{CommandError, load};
use host::plot::{self, Panel, Part, Role, Series, write_picture};
use std::num::NonZero;
use std::path::PathBuf;
use study::stress::jobs::{Cells, Options, Shard};
use study::sweep::{Axis, Sweep, Swept};

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
    let part = Part::from(arguments.axis);
    let sweep = Sweep::new(&loaded, &axes.collect::<Vec<_>>(), part)?;
    let options = Options {
        shard: Shard::default(),
        threads: arguments.threads,
        file: arguments.json.clone(),
    };
    let shown = Shown::new();
    let done = |fraction| shown.part(fraction);
    let found = sweep.run(
        arguments.seed,
        arguments.duration,
        &options,
        &done,
        &mut |at| {
            shown.show(at);
        },
    );
    let Cells { cells, unwritten } = shown.end(found)?;
    let runs: Vec<&Swept> = cells.values().collect();
    print(&loaded.scene.name, sweep.fields(), &runs);
    let mut written = Written::default();
    written.write(arguments.plot.as_ref(), |path| {
        write_picture(
            path,
            &picture(&loaded.scene.name, sweep.fields(), &runs, part),
        )
    });
    written.end()?;
    if let Some(error) = unwritten {
        return Err(error.into());
    }
    if runs.iter().any(|run| !run.failures.is_empty()) {
        return Err(CommandError::Incomplete);
    }
    Ok(())
}

/// The part of a field's name that tells it from the other fields of a table: the last one.
fn short(field: &str) -> &str {
    field.rsplit('.').next().unwrap_or(field)
}

/// Prints one row for each run.
fn print(scene: &str, fields: &[String], runs: &[&Swept]) {
    outln!("{scene}: {} runs in virtual time\n", runs.len());
    let mut heads: Vec<String> = fields.iter().map(|field| short(field).to_owned()).collect();
    let first = runs.iter().max_by_key(|run| run.devices.len());
    let devices = first.map_or(&[][..], |run| &run.devices);
    heads.extend((devices.iter()).map(|device| format!("{} peak N (at s)", device.name)));
    heads.push("net energy mJ".to_owned());
    let tears = runs.iter().any(|run| !run.tears.is_empty());
    if tears {
        heads.push("tear: start N (at s), peak N, plateau N, mm2, mJ".to_owned());
    }
    let limited = (runs.iter().flat_map(|run| &run.devices)).any(|device| device.limited > 0.0);
    if limited {
        heads.push("limited by the device: s, by at most N".to_owned());
    }
    outln!("| {} |", heads.join(" | "));
    outln!("|{}", "---|".repeat(heads.len()));
    for run in runs {
        let mut row = run.values.clone();
        let peak = |device: &study::sweep::SweptDevice| {
            format!("{:.3} ({:.3})", device.peak, device.peak_time)
        };
        row.extend(run.devices.iter().map(peak));
        row.push(format!("{:.3}", 1e3 * run.net_energy));
        if tears {
            let each = run.tears.iter().map(|tear| {
                format!(
                    "{:.2} ({:.3}), {:.2}, {:.2}, {:.1}, {:.2}",
                    tear.force.start,
                    tear.force.from,
                    tear.force.peak,
                    tear.force.plateau,
                    1e6 * tear.area,
                    1e3 * tear.energy
                )
            });
            row.push(each.collect::<Vec<_>>().join("; "));
        }
        if limited {
            let each = run.devices.iter().filter(|device| device.limited > 0.0);
            let each = each.map(|device| {
                let (name, time, most) = (&device.name, device.limited, device.held_back);
                format!("{name} {time:.3}, {most:.2}")
            });
            row.push(each.collect::<Vec<_>>().join("; "));
        }
        outln!("| {} |", row.join(" | "));
    }
    for run in runs {
        for failure in &run.failures {
            outln!("\nFAILED {}: {failure}", named(fields, run));
        }
    }
}

/// The values of a run with the names of their fields.
fn named(fields: &[String], run: &Swept) -> String {
    let pairs = fields.iter().zip(&run.values);
    let pairs: Vec<_> = pairs
        .map(|(field, value)| format!("{} {value}", short(field)))
        .collect();
    pairs.join(", ")
}

/// The force of each device over time, a line for each run.
fn picture(scene: &str, fields: &[String], runs: &[&Swept], part: Part) -> String {
    let first = runs.iter().max_by_key(|run| run.devices.len());
    let devices = first.map_or(&[][..], |run| &run.devices);
    let panels = devices.iter().enumerate().map(|(index, device)| Panel {
        title: device.name.clone(),
        x_label: "Time (s)".to_owned(),
        y_label: format!("Force{} (N)", part.label()),
        series: (runs.iter().enumerate())
            .filter_map(|(number, run)| {
                Some(Series {
                    name: named(fields, run),
                    points: run.devices.get(index)?.force.clone(),
                    role: Role::Number(number),
                    ..Series::default()
                })
            })
            .collect(),
        ..Panel::default()
    });
    let panels: Vec<_> = panels.collect();
    let subtitle = format!("virtual time; by {}", fields.join(", "));
    plot::panels_svg(
        &format!("{scene}: {} runs", runs.len()),
        &subtitle,
        1,
        &panels,
    )
}
