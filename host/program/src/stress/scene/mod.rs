//! `palpate stress scene`: runs a scene with many kinds of hands, rates and faults.

pub(super) mod cell;
pub(super) mod picture;
mod table;

use super::{CommandError, Common, Declared, Format, Shown, Values, Written, scheme_of};
use host::atomic_file::write_atomically;
use host::plot::write_picture;
use host::scene::LoadedScene;
use host::scene::spec::SchemeName;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use study::stress::jobs::{self, Cells, Header};
use study::stress::scene::draw::{Choice, Trouble};
use study::stress::scene::measure::{Outcome, Trace};
use study::stress::scene::verdict::{Verdict, of_outcome};
use study::stress::scene::written::Written as WrittenScene;
use study::stress::scene::{SCHEMES, STEP_RATE, Study};

/// Arguments of `palpate stress scene`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct SceneArguments {
    /// Scene file (TOML). Default: every world draws a body of its own
    scene: Option<PathBuf>,
    #[command(flatten)]
    values: Values,
    /// Number of random worlds. Each world is run under every scheme
    #[arg(long, value_name = "N", value_parser = super::cells)]
    runs: Option<u64>,
    /// Schemes to run. Default: all
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = scheme)]
    schemes: Vec<SchemeName>,
    /// Publication rates of the host in Hz, which the worlds take in turn. Default: 20, 30, 60, 125, 250, 500 and 1000.
    /// A world has the same number under the same --rate and --trouble only
    #[arg(long, value_name = "HZ", value_delimiter = ',', value_parser = rate)]
    rate: Vec<f64>,
    /// Kinds of fault, which the worlds take in turn: nothing, stalls, losses, softening, vanishing, or all of them at
    /// once. Default: each kind
    #[arg(long, value_name = "KINDS", value_delimiter = ',', value_parser = trouble)]
    trouble: Vec<Trouble>,
    /// Run one world again and print its outcome: --plot draws the run, --log writes every tick, --write writes its scene
    /// file
    #[arg(long, value_name = "N", conflicts_with_all = ["runs", "quick", "shard", "json"])]
    cell: Option<u64>,
    /// Scheme of that world's run. Default: capped
    #[arg(long, value_name = "NAME", requires = "cell", value_parser = scheme)]
    scheme: Option<SchemeName>,
    /// Write every tick of the run (CSV)
    #[arg(long, value_name = "FILE", requires = "cell")]
    log: Option<PathBuf>,
    /// Write the scene of the world, which `palpate run` repeats but for the faults that it names (TOML)
    #[arg(long, value_name = "FILE", requires = "cell")]
    write: Option<PathBuf>,
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

impl SceneArguments {
    /// The rates and troubles of the worlds.
    fn choice(&self) -> Choice {
        let mut choice = Choice::default();
        if !self.rate.is_empty() {
            choice.rates.clone_from(&self.rate);
        }
        if !self.trouble.is_empty() {
            choice.troubles.clone_from(&self.trouble);
        }
        choice
    }

    /// Everything but seed and number that determines a cell. A file of a study without --rate and --trouble has no
    /// such settings.
    fn settings(
        &self,
        loaded: Option<&LoadedScene>,
        schemes: &[(SchemeName, &str)],
    ) -> serde_json::Value {
        let mut settings = serde_json::json!({
            "schemes": schemes.iter().map(|(_, name)| name).collect::<Vec<_>>(),
        });
        if let Some(loaded) = loaded {
            let files = loaded.files.iter().map(|(name, bytes)| (name, bytes.len()));
            settings["scene"] = loaded.source.text.clone().into();
            settings["files"] = serde_json::json!(files.collect::<Vec<_>>());
        }
        if !self.rate.is_empty() {
            settings["rates"] = serde_json::json!(self.rate);
        }
        if !self.trouble.is_empty() {
            settings["troubles"] = serde_json::json!(self.trouble);
        }
        settings
    }
}

pub(super) fn run(arguments: &SceneArguments) -> Result<(), CommandError> {
    let common = &arguments.common;
    let path = arguments.scene.as_deref();
    let loaded = path
        .map(|path| arguments.values.load(Some(path), Vec::new()))
        .transpose()?;
    let mut declared = Declared::default();
    if let Some(loaded) = &loaded {
        declared = declared.scene(path, loaded);
    }
    let declared = declared
        .file("--log", arguments.log.as_ref(), Format::Csv)
        .file("--write", arguments.write.as_ref(), Format::Toml);
    let _held = common.declare(declared).check()?;
    let name = loaded
        .as_ref()
        .map_or("drawn bodies", |loaded| &loaded.scene.name)
        .to_owned();
    let schemes: Vec<_> = SCHEMES
        .into_iter()
        .filter(|(scheme, _)| arguments.schemes.is_empty() || arguments.schemes.contains(scheme))
        .collect();
    let default = if common.quick { QUICK } else { RUNS };
    let header = Header {
        study: "scene".to_owned(),
        schema: 4,
        seed: common.cells.seed,
        cells: arguments.runs.unwrap_or(default),
        settings: arguments.settings(loaded.as_ref(), &schemes),
    };
    let (seed, choice) = (common.cells.seed, arguments.choice());
    let judged = loaded
        .as_ref()
        .map_or(SchemeName::Capped, |loaded| loaded.scene.realtime.scheme);
    let study = match loaded {
        Some(loaded) => Study::among(loaded, seed, choice)?,
        None => Study::drawn(seed, choice),
    };
    if let Some(cell) = arguments.cell {
        return show_cell(arguments, &study, cell);
    }
    let shown = Shown::new();
    if header.cells > 1 {
        shown.say(&format!(
            "{} worlds, each with a reference and {} schemes; fewer --runs or --schemes, or a lower --rate, take less time",
            header.cells,
            schemes.len()
        ));
    }
    let work = |cell| study.cell_told(cell, &schemes, &|part| shown.part(part));
    let cells = jobs::run(&header, &common.cells.options(), &work, &mut |at| {
        shown.show(at);
    });
    let Cells { cells, unwritten } = shown.end(cells)?;
    // The scheme of the scene is judged, or each scheme that was run in its place.
    let own = schemes.iter().filter(|(scheme, _)| *scheme == judged);
    let judged = match own.clone().count() {
        0 => schemes.clone(),
        _ => own.copied().collect(),
    };
    for (_, scheme) in judged {
        if let Some(verdict) = Verdict::of(cells.iter(), scheme) {
            outln!("{verdict}");
        }
    }
    outln!(
        "{name}: {} worlds, seed {}\n",
        cells.len(),
        common.cells.seed
    );
    if study.tears() {
        outln!(
            "a body tears, and a body that tears does not soften: worlds of the trouble \"softening\" have no fault, and \
             those of \"all\" have the others\n"
        );
    }
    table::print(&cells);
    let mut written = Written::default();
    written.write(common.plot.as_ref(), |path| {
        write_picture(path, &picture::distributions(&name, &cells))
    });
    let mut failed = cells
        .iter()
        .filter_map(|(n, c)| Some((n, c.failed.as_ref()?)));
    let outcome = match failed.next() {
        Some((number, why)) => {
            errln!("cell {number}: {why}");
            Err(CommandError::Incomplete)
        }
        None => Ok(()),
    };
    written.and(unwritten).end_with(outcome)
}

/// Runs one world under one scheme and prints its outcome.
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
