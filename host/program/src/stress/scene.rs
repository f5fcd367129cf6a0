//! `palpate stress scene`: runs a scene with many kinds of hands, rates and faults.

use super::{CommandError, Common, Declared, Format, Values, Written, number, scheme_of};
use crate::{build, progress_bar};
use host::atomic_file::write_atomically;
use host::plot::write_picture;
use host::scene::spec::SchemeName;
use std::path::{Path, PathBuf};
use study::stress::scene::again::Again;
use study::stress::scene::draw::Trouble;
use study::stress::scene::trials::Asked;
use study::stress::scene::written::Written as WrittenScene;
use study::stress::scene::{SCHEMES, STEP_RATE, Study, Trials};

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
    let trials = Trials::new(Asked {
        loaded,
        seed: common.cells.seed,
        trials: number(arguments.runs, common.quick, RUNS),
        schemes: arguments.schemes.clone(),
        rates: arguments.rate.clone(),
        troubles: arguments.trouble.clone(),
    })?;
    match arguments.cell {
        Some(cell) => show_cell(arguments, &trials.study, cell),
        None => common.run(&trials),
    }
}

/// Runs one trial under one scheme and prints its outcome.
fn show_cell(arguments: &SceneArguments, study: &Study, cell: u64) -> Result<(), CommandError> {
    let wanted = arguments.scheme.unwrap_or(SchemeName::Capped);
    if let Some(path) = &arguments.write {
        write_scene(path, &study.written(cell, wanted)?)?;
    }
    let files = [&arguments.common.plot, &arguments.log];
    show(&study.again(cell, wanted)?, files)
}

/// Prints a cell that was run again, and writes its picture and its ticks if the person wants them.
pub(super) fn show(again: &Again, [plot, log]: [&Option<PathBuf>; 2]) -> Result<(), CommandError> {
    out!("{}", again.text);
    let mut written = Written::default();
    written.write(plot.as_ref(), |path| write_picture(path, &again.picture()));
    written.write(log.as_ref(), |path| {
        write_atomically(path, again.log().as_bytes())
    });
    written.end()
}

/// Writes the scene of a cell, and tells what the scene cannot say.
pub(super) fn write_scene(path: &Path, written: &WrittenScene) -> Result<(), CommandError> {
    write_atomically(path, written.text.as_bytes())?;
    for told in &written.told {
        errln!("{}: not in the scene file: {told}", path.display());
    }
    Ok(())
}
