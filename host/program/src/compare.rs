//! `palpate compare`: runs a scene under several force schemes, and prints them side by side.

use super::fault::fault;
use super::outputs::{Declared, Format};
use super::stress::scheme_of;
use super::written::Written;
use super::{CommandError, SceneArgument, build, progress_bar};
use host::atomic_file::{write_atomically, write_json};
use host::engine::faults::HostFault;
use host::plot::write_picture;
use host::scene::spec::SchemeName;
use std::num::NonZero;
use std::path::PathBuf;
use study::Results;
use study::compare::{Settings, compare, csv};
use study::stress::scene::SCHEMES;

/// Arguments of `palpate compare`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct CompareArguments {
    #[command(flatten)]
    scene: SceneArgument,
    /// Schemes to compare: hold, thesis, linear, classic, proxy, capped. Default: all
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = scheme)]
    schemes: Vec<SchemeName>,
    /// Publication rates of the host in Hz; each scheme runs at each rate. Default: host.publish_rate of the scene
    #[arg(long, value_name = "HZ", value_delimiter = ',', value_parser = rate)]
    publish_rates: Vec<f64>,
    /// Seed of every random choice, the same for all runs. Default: the seed of the scene
    #[arg(long, value_parser = crate::seed)]
    seed: Option<u64>,
    /// Duration of each run in seconds. Default: the duration of the scene
    #[arg(long, value_name = "SECONDS", value_parser = super::run::seconds)]
    duration: Option<f64>,
    /// Time in seconds from which force errors and ripple are measured. Default: when the first forces have faded in
    #[arg(long, value_name = "SECONDS", value_parser = super::run::seconds)]
    from: Option<f64>,
    /// Make the host of each run fail on purpose, as in `palpate run`: stall@1.5+0.5, nan@T+D, topology@T+D, panic@T.
    /// The reference has no host. May be given several times
    #[arg(long, value_name = "FAULT", value_parser = fault)]
    fault: Vec<HostFault>,
    /// Leave out the reference run, which takes a physics step in every tick: for bodies whose steps are slow
    #[arg(long)]
    no_reference: bool,
    /// Number of threads. Default: all cores
    #[arg(long, value_name = "N", value_parser = crate::stress::threads)]
    threads: Option<NonZero<usize>>,
    /// Write the measurements of all runs as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw the forces of all runs over time, and their differences from the reference (SVG or PNG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Write force and position of each device in every tick of all runs (CSV)
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  palpate compare                                        all schemes on the built-in scene
  palpate compare my_scene.toml --plot schemes.svg       your own scene, with a plot of the forces
  palpate compare my_scene.toml --schemes linear,capped --publish-rates 50,125,250
                                                         two schemes at three rates of the host
  palpate compare my_scene.toml --fault stall@1.5+0.5    what the hand feels when the host stalls
  palpate compare my_scene.toml --json c.json --csv c.csv
                                                         measurements and ticks for your own figures";

fn scheme(text: &str) -> Result<SchemeName, String> {
    scheme_of(text, &SCHEMES)
}

/// Parses a publication rate.
fn rate(text: &str) -> Result<f64, String> {
    let value: Option<f64> = text.parse().ok();
    let allowed = value.filter(|rate| rate.is_finite() && *rate > 0.0);
    allowed.ok_or_else(|| "allowed: numbers above 0 (Hz)".to_owned())
}

pub(super) fn run(arguments: &CompareArguments) -> Result<(), CommandError> {
    let scene = arguments.scene.scene.as_deref();
    let loaded = arguments.scene.load()?;
    let _held = Declared::default()
        .scene(scene, &loaded)
        .file("--json", arguments.json.as_ref(), Format::Json)
        .file("--plot", arguments.plot.as_ref(), Format::Picture)
        .file("--csv", arguments.csv.as_ref(), Format::Csv)
        .check()?;
    let settings = Settings {
        schemes: arguments.schemes.clone(),
        publish_rates: arguments.publish_rates.clone(),
        seed: arguments.seed,
        duration: arguments.duration,
        from: arguments.from,
        faults: arguments.fault.clone(),
        without_reference: arguments.no_reference,
        threads: arguments.threads,
    };
    let bar = progress_bar();
    // This prints the warnings of the meshes.
    build(&loaded, &bar)?;
    let found = compare(&loaded, &settings, &|fraction| {
        bar.set_position((1000.0 * fraction) as u64);
    });
    bar.finish_and_clear();
    let found = found?;
    out!("{}", found.tables());
    let mut written = Written::default();
    written.write(arguments.json.as_ref(), |path| write_json(path, &found));
    if let Some(picture) = arguments.plot.as_ref().and_then(|_| found.picture()) {
        written.write(arguments.plot.as_ref(), |path| {
            write_picture(path, &picture)
        });
    }
    written.write(arguments.csv.as_ref(), |path| {
        write_atomically(path, csv(&found).as_bytes())
    });
    written.end()?;
    if found.runs.iter().any(|run| !run.failures.is_empty()) {
        return Err(CommandError::Incomplete);
    }
    Ok(())
}
