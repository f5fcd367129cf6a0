//! `palpate compare`: runs a scene under several force schemes, and prints them side by side.

use super::fault::fault;
use super::outputs::{Declared, Format};
use super::stress::scheme_of;
use super::written::Written;
use super::{CommandError, SceneArgument, build, progress_bar};
use host::atomic_file::{write_atomically, write_json};
use host::engine::faults::HostFault;
use host::plot::{self, Panel, Role, Series, write_picture};
use host::scene::spec::SchemeName;
use std::num::NonZero;
use std::path::PathBuf;
use study::compare::{Comparison, ForceError, Measures, Record, Run, Settings, compare, csv};
use study::stress::scene::SCHEMES;
use study::sweep::thin;

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

/// Largest number of points of a line: more would not be visible.
const POINTS: usize = 320;

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
    print(&found);
    let mut written = Written::default();
    written.write(arguments.json.as_ref(), |path| write_json(path, &found));
    written.write(arguments.plot.as_ref(), |path| {
        write_picture(path, &picture(&found))
    });
    written.write(arguments.csv.as_ref(), |path| {
        write_atomically(path, csv(&found).as_bytes())
    });
    written.end()?;
    if found.runs.iter().any(|run| !run.failures.is_empty()) {
        return Err(CommandError::Incomplete);
    }
    Ok(())
}

/// Prints one row for each run, and one for the reference. Each number is that of the worst device or body.
fn print(found: &Comparison) {
    outln!(
        "{}: {} runs of {} s in virtual time, seed {}; ticks at {} Hz, steps of the host at {} Hz, latency {:.1} ms",
        found.scene,
        found.runs.len(),
        found.duration,
        found.seed,
        found.tick_rate,
        found.step_rate,
        1e3 * found.latency
    );
    outln!(
        "  force errors and ripple are measured from {:.3} s on",
        found.measured_from
    );
    for fault in &found.faults {
        outln!("  fault: {fault}");
    }
    outln!(
        "\n| scheme | models a second | peak force N | force error N, RMS | force error % | largest force error N \
         | ripple N | net energy mJ | capped % | longest hold-back s | most withheld N | faded % | limited % \
         | model age ms: median, most |"
    );
    outln!("|{}", "---|".repeat(14));
    for run in &found.runs {
        print_run(run);
    }
    if let Some(reference) = &found.reference {
        let [peak, ripple, energy, limited] = common(reference);
        outln!("| reference | | {peak} | | | | {ripple} | {energy} | | | | | {limited} | |");
    }
    if let Some(why) = &found.no_reference {
        outln!("\nno reference: {why}");
    }
    for run in &found.runs {
        for failure in &run.failures {
            outln!(
                "\nFAILED {} at {} Hz: {failure}",
                run.scheme,
                run.publish_rate
            );
        }
    }
}

fn print_run(run: &Run) {
    let measures = &run.measures;
    let [peak, ripple, energy, limited] = common(measures);
    let has_error = measures.devices.iter().any(|device| device.error.is_some());
    let error = |value: fn(&ForceError) -> f64, decimals: usize| {
        let worst = measures.worst(|device| device.error.as_ref().map_or(0.0, value));
        if has_error {
            format!("{worst:.decimals$}")
        } else {
            String::new()
        }
    };
    let ages = measures.bodies.iter().filter_map(|body| body.model_age);
    let age = ages.reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])]);
    let age = age.map_or(String::new(), |[median, most]| {
        format!("{:.1}, {:.1}", 1e3 * median, 1e3 * most)
    });
    outln!(
        "| {} | {} | {peak} | {} | {} | {} | {ripple} | {energy} | {:.1} | {:.2} | {:.2} | {:.1} | {limited} | {age} |",
        run.scheme,
        run.publish_rate,
        error(|error| error.rms, 4),
        error(|error| 100.0 * error.relative, 1),
        error(|error| error.largest, 3),
        100.0 * measures.worst_body(|body| body.capped),
        measures.worst_body(|body| body.longest_hold_back),
        measures.worst_body(|body| body.most_withheld),
        100.0 * measures.worst_body(|body| body.faded),
    );
}

/// Peak force, ripple, net energy and the fraction of ticks at the limit of the device: what a run and a reference have.
fn common(measures: &Measures) -> [String; 4] {
    [
        format!("{:.2}", measures.worst(|device| device.peak_force)),
        format!("{:.3}", measures.worst(|device| device.ripple)),
        format!("{:.3}", 1e3 * measures.net_energy),
        format!("{:.1}", 100.0 * measures.worst(|device| device.limited)),
    ]
}

/// The force of each device over time along its main direction, one row of panels for each rate and device; beside it
/// the difference from the reference.
fn picture(found: &Comparison) -> String {
    let mut rates: Vec<f64> = found.runs.iter().map(|run| run.publish_rate).collect();
    rates.dedup();
    let mut panels = Vec::new();
    for rate in rates {
        let runs = found.runs.iter().filter(|run| run.publish_rate == rate);
        let runs: Vec<_> = runs.collect();
        let devices = runs.first().map_or(0, |run| run.measures.devices.len());
        for device in 0..devices {
            panels.extend(row(found, &runs, device));
        }
    }
    let title = format!("{}: force schemes", found.scene);
    let subtitle = format!(
        "virtual time, seed {}; latency {:.1} ms; forces along the main direction of each device",
        found.seed,
        1e3 * found.latency
    );
    plot::panels_svg(&title, &subtitle, 2, &panels)
}

/// The panels of one device in `runs`, which are of one rate: its force, and the difference from the reference.
fn row(found: &Comparison, runs: &[&Run], device: usize) -> Vec<Panel> {
    let reference = found.reference_record.as_ref();
    let first = &runs[0];
    let axis = reference.unwrap_or(&first.record).devices[device].main_direction();
    let along = |record: &Record| -> Vec<f64> {
        let force = record.devices[device].force.iter();
        force.map(|force| force.dot(&axis)).collect()
    };
    let line = |name: &str, role, from: f64, values: &[f64]| Series {
        name: name.to_owned(),
        points: thin(first.record.period, values, POINTS)
            .into_iter()
            .filter(|(time, _)| *time >= from)
            .collect(),
        role,
        ..Series::default()
    };
    let panel = |quantity: &str, series| Panel {
        title: format!(
            "{}, {} Hz: {}",
            first.measures.devices[device].name,
            first.publish_rate,
            quantity.to_lowercase()
        ),
        x_label: "Time (s)".to_owned(),
        y_label: format!("{quantity} (N)"),
        x_covers: vec![0.0, found.duration],
        series,
        ..Panel::default()
    };
    let expected = reference.map(along);
    // Errors are drawn as they are measured: without the time in which the first forces fade in.
    let from = found.measured_from;
    // The reference comes first: the others are drawn over it.
    let mut forces: Vec<_> = expected
        .iter()
        .map(|force| line("reference", Role::Reference, 0.0, force))
        .collect();
    let mut errors: Vec<_> = expected
        .iter()
        .map(|force| line("reference", Role::Reference, from, &vec![0.0; force.len()]))
        .collect();
    for run in runs {
        let force = along(&run.record);
        forces.push(line(run.scheme, Role::Scheme(run.scheme), 0.0, &force));
        if let Some(expected) = &expected {
            let pairs = force.iter().zip(expected);
            let off: Vec<_> = pairs.map(|(found, expected)| found - expected).collect();
            errors.push(line(run.scheme, Role::Scheme(run.scheme), from, &off));
        }
    }
    let mut panels = vec![panel("Force", forces)];
    if expected.is_some() {
        panels.push(panel("Force error", errors));
    }
    panels
}
