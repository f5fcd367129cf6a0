//! `palpate stress scene`: runs a scene with many kinds of hands, rates and faults.

pub(super) mod cell;

use super::{CommandError, Common, Declared, Format, Values, Written, number, scheme_of};
use crate::{build, progress_bar};
use host::atomic_file::write_atomically;
use host::plot::write_picture;
use host::scene::spec::SchemeName;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use study::stress::scene::draw::Trouble;
use study::stress::scene::measure::{Outcome, Trace};
use study::stress::scene::verdict::of_outcome;
use study::stress::scene::worlds::Asked;
use study::stress::scene::written::Written as WrittenScene;
use study::stress::scene::{SCHEMES, STEP_RATE, Study, Worlds, picture};

/// Arguments of `palpate stress scene`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct SceneArguments {
    /// Scene file (TOML). Default: every trial draws a body of its own
    scene: Option<PathBuf>,
    #[command(flatten)]
    values: Values,
    /// Number of random trials. Each trial is run under every scheme
    #[arg(long, value_name = "N", value_parser = super::cells)]
    runs: Option<u64>,
    /// Schemes to run. Default: all
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = scheme)]
    schemes: Vec<SchemeName>,
    /// Publication rates of the host in Hz, which the trials take in turn. Default: 20, 30, 60, 125, 250, 500 and 1000.
    /// A trial has the same number under the same --rate and --trouble only
    #[arg(long, value_name = "HZ", value_delimiter = ',', value_parser = rate)]
    rate: Vec<f64>,
    /// Kinds of fault, which the trials take in turn: nothing, stalls, losses, softening, vanishing, or all of them at
    /// once. Default: each kind
    #[arg(long, value_name = "KINDS", value_delimiter = ',', value_parser = trouble)]
    trouble: Vec<Trouble>,
    /// Run one trial again and print its outcome: --plot draws the run, --log writes every tick, --write writes its scene
    /// file
    #[arg(long, value_name = "N", conflicts_with_all = ["runs", "quick", "shard", "json"])]
    cell: Option<u64>,
    /// Scheme of that trial's run. Default: capped
    #[arg(long, value_name = "NAME", requires = "cell", value_parser = scheme)]
    scheme: Option<SchemeName>,
    /// Write every tick of the run (CSV)
    #[arg(long, value_name = "FILE", requires = "cell")]
    log: Option<PathBuf>,
    /// Write the scene of the trial, which `palpate run` repeats but for the faults that it names (TOML)
    #[arg(long, value_name = "FILE", requires = "cell")]
    write: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

/// Default number of trials (ten of each rate and each trouble), and that of a quick study (each rate twice, without faults
/// and with stalls). A trial of the sheet takes about a second of one core.
const RUNS: [u64; 2] = [420, 14];

fn scheme(text: &str) -> Result<SchemeName, String> {
    scheme_of(text, &SCHEMES)
}

/// Parses a publication rate.
fn rate(text: &str) -> Result<f64, String> {
    let value: Option<f64> = text.parse().ok();
    let allowed = value.filter(|rate| (1.0..=STEP_RATE).contains(rate));
    allowed.ok_or_else(|| {
        format!(
            "allowed: 1 to {STEP_RATE} (Hz), as the study takes {STEP_RATE} physics steps a second"
        )
    })
}

/// Parses a kind of fault.
fn trouble(text: &str) -> Result<Trouble, String> {
    let found = Trouble::ALL.into_iter().find(|kind| kind.name() == text);
    found.ok_or_else(|| format!("allowed: {}", Trouble::ALL.map(Trouble::name).join(", ")))
}

pub(super) fn run(arguments: &SceneArguments) -> Result<(), CommandError> {
    let common = &arguments.common;
    let path = arguments.scene.as_deref();
    let loaded = path
        .map(|path| arguments.values.load(Some(path), Vec::new()))
        .transpose()?;
    let mut declared = Declared::default();
    if let Some(loaded) = &loaded {
        // This prints the warnings of the meshes.
        build(loaded, &progress_bar())?;
        declared = declared.scene(path, loaded);
    }
    let declared = declared
        .file("--log", arguments.log.as_ref(), Format::Csv)
        .file("--write", arguments.write.as_ref(), Format::Toml);
    let _held = common.declare(declared).check()?;
    let worlds = Worlds::new(Asked {
        loaded,
        seed: common.cells.seed,
        worlds: number(arguments.runs, common.quick, RUNS),
        schemes: arguments.schemes.clone(),
        rates: arguments.rate.clone(),
        troubles: arguments.trouble.clone(),
    })?;
    match arguments.cell {
        Some(cell) => show_cell(arguments, &worlds.study, cell),
        None => common.run(&worlds),
    }
}

/// Runs one trial under one scheme and prints its outcome.
fn show_cell(arguments: &SceneArguments, study: &Study, cell: u64) -> Result<(), CommandError> {
    let wanted = arguments.scheme.unwrap_or(SchemeName::Capped);
    if let Some(path) = &arguments.write {
        write_scene(path, &study.written(cell, wanted)?)?;
    }
    let (draw, reference, runs) = study.traces(cell, &[wanted])?;
    let known = SCHEMES.iter().find(|(name, _)| *name == wanted);
    let scheme = known.map_or("", |(_, name)| name);
    cell::print_draw(cell, arguments.common.cells.seed, &draw);
    for run in &runs {
        let outcome = Outcome::of(run, &reference, &draw);
        let verdict = of_outcome(&outcome);
        cell::print_outcome(&format!("{scheme}: {verdict}"), &outcome, &reference);
        let mut written = Written::default();
        written.write(arguments.common.plot.as_ref(), |path| {
            let title = format!("Cell {cell} under \"{scheme}\"");
            let subtitle = format!(
                "{:.0} Hz, latency {:.0} ms, {:.0} % of models lost; trouble: {}",
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

/// Writes the scene of a cell, and tells what the scene cannot say.
pub(super) fn write_scene(path: &Path, written: &WrittenScene) -> Result<(), CommandError> {
    write_atomically(path, written.text.as_bytes())?;
    for told in &written.told {
        errln!("{}: not in the scene file: {told}", path.display());
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
