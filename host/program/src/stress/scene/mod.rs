//! `palpate stress scene`: runs a scene with many kinds of hands, rates and faults.

pub(super) mod picture;
mod table;

use super::{CommandError, Common, Declared, Format, Written, progress_bar, scheme_of, show};
use host::atomic_file::write_atomically;
use host::plot::write_picture;
use host::scene::Scene;
use host::scene::spec::SchemeName;
use std::fmt::Write;
use std::path::PathBuf;
use study::stress::jobs::{self, Header};
use study::stress::scene::measure::{Outcome, Trace};
use study::stress::scene::{SCHEMES, Study};

/// Arguments of `palpate stress scene`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct SceneArguments {
    /// Scene file (TOML)
    scene: PathBuf,
    /// Number of random worlds. Each world is run under every scheme
    #[arg(long, value_name = "N")]
    runs: Option<u64>,
    /// Schemes to run. Default: all
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = scheme)]
    schemes: Vec<SchemeName>,
    /// Run one world again and print its outcome: --plot draws the run, --log writes every tick
    #[arg(long, value_name = "N", conflicts_with_all = ["runs", "quick", "shard", "json"])]
    cell: Option<u64>,
    /// Scheme of that world's run. Default: capped
    #[arg(long, value_name = "NAME", requires = "cell", value_parser = scheme)]
    scheme: Option<SchemeName>,
    /// Write every tick of the run (CSV)
    #[arg(long, value_name = "FILE", requires = "cell")]
    log: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

/// Default number of worlds: ten of each rate and each trouble. A world of the sheet takes about a second of one core.
const RUNS: u64 = 420;
/// Number of worlds of a quick study: each rate twice, without faults and with stalls.
const QUICK: u64 = 14;

fn scheme(text: &str) -> Result<SchemeName, String> {
    scheme_of(text, &SCHEMES)
}

pub(super) fn run(arguments: &SceneArguments) -> Result<(), CommandError> {
    let common = &arguments.common;
    let loaded = Scene::load(&arguments.scene)?;
    let declared = Declared::default()
        .scene(Some(&arguments.scene), &loaded)
        .file("--log", arguments.log.as_ref(), Format::Csv);
    let _held = common.declare(declared).check()?;
    let name = loaded.scene.name.clone();
    let schemes: Vec<_> = SCHEMES
        .into_iter()
        .filter(|(scheme, _)| arguments.schemes.is_empty() || arguments.schemes.contains(scheme))
        .collect();
    let default = if common.quick { QUICK } else { RUNS };
    let header = Header {
        study: "scene".to_owned(),
        schema: 3,
        seed: common.seed,
        cells: arguments.runs.unwrap_or(default),
        settings: serde_json::json!({
            "scene": loaded.source.text,
            "files": loaded.files.iter().map(|(name, bytes)| (name, bytes.len())).collect::<Vec<_>>(),
            "schemes": schemes.iter().map(|(_, name)| name).collect::<Vec<_>>(),
        }),
    };
    let study = Study::new(loaded, common.seed)?;
    if let Some(cell) = arguments.cell {
        return show_cell(arguments, &study, cell);
    }
    let bar = progress_bar();
    let work = |cell| study.cell(cell, &schemes);
    let cells = jobs::run(&header, &common.options(), work, |at| show(&bar, at));
    bar.finish_and_clear();
    let cells = cells?;
    outln!("{name}: {} worlds, seed {}\n", cells.len(), common.seed);
    table::print(&cells);
    if let Some(path) = &common.plot {
        write_picture(path, &picture::distributions(&name, &cells))?;
    }
    let mut failed = cells
        .iter()
        .filter_map(|(n, c)| Some((n, c.failed.as_ref()?)));
    match failed.next() {
        Some((number, why)) => {
            errln!("cell {number}: {why}");
            Err(CommandError::Incomplete)
        }
        None => Ok(()),
    }
}

/// Runs one world under one scheme and prints its outcome.
fn show_cell(arguments: &SceneArguments, study: &Study, cell: u64) -> Result<(), CommandError> {
    let wanted = arguments.scheme.unwrap_or(SchemeName::Capped);
    let (draw, reference, runs) = study.traces(cell, &[wanted])?;
    let known = SCHEMES.iter().find(|(name, _)| *name == wanted);
    let scheme = known.map_or("", |(_, name)| name);
    outln!("{draw:#?}");
    for run in &runs {
        let outcome = Outcome::of(run, &reference, &draw);
        outln!("{scheme}: {outcome:#?}");
        outln!(
            "reference: net energy {:.3} mJ, {:#?}",
            1e3 * reference.net_energy(),
            reference.stillness()
        );
        let mut written = Written::default();
        written.write(arguments.common.plot.as_ref(), |path| {
            let title = format!("Cell {cell} under \"{scheme}\"");
            let subtitle = format!(
                "{:.0} Hz, {:.0} ms late, {:.0} % of models lost; trouble: {}",
                draw.rate,
                1e3 * draw.latency,
                100.0 * draw.models_lost,
                draw.trouble.name()
            );
            let svg = picture::cell(&title, &subtitle, run, &reference);
            write_picture(path, &svg)
        });
        written.write(arguments.log.as_ref(), |path| {
            write_atomically(path, log(run, &reference).as_bytes())
        });
        written.end()?;
    }
    Ok(())
}

/// The ticks of a run as CSV, one line per tick: time, energies, then force and position of each device in the run and
/// in the reference run.
pub(super) fn log(run: &Trace, reference: &Trace) -> String {
    let mut text = String::from("time,out,reference_out,to_spend,stored");
    for device in 0..run.devices.len() {
        for column in [
            "force",
            "position",
            "body",
            "own",
            "reference_force",
            "reference_position",
        ] {
            for axis in ["x", "y", "z"] {
                let _ = write!(text, ",{column}_{device}_{axis}");
            }
        }
    }
    for tick in 0..run.out.len() {
        let [to_spend, stored] = run.account[tick];
        let time = tick as f64 * run.period;
        let (out, expected) = (run.out[tick], reference.out[tick]);
        let _ = write!(
            text,
            "\n{time:.4},{out:.9},{expected:.9},{to_spend:.9},{stored:.9}"
        );
        for (device, expected) in run.devices.iter().zip(&reference.devices) {
            for value in [
                device.force[tick],
                device.position[tick],
                device.body[tick],
                device.own[tick].force,
                expected.force[tick],
                expected.position[tick],
            ] {
                let _ = write!(text, ",{:.6},{:.6},{:.6}", value.x, value.y, value.z);
            }
        }
    }
    text + "\n"
}
