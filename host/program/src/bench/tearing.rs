//! `palpate bench tearing`: tears of sheets against fracture mechanics.

use super::super::CommandError;
use super::super::outputs::{Declared, Format};
use super::super::written::Written;
use super::{level, tearing_runs, with_bar};
use host::atomic_file::write_json;
use host::plot::{self, Marker, Role, Series};
use std::path::PathBuf;
use study::tearing::edits::Mesh;
use study::tearing::energy::Account;
use study::tearing::kinks::Kink;
use study::tearing::meshes::{MeshStudy, Tear};
use study::tearing::running::{self, Run};
use study::tearing::runs::RunPart;
use study::tearing::{self, Part};

/// Arguments of `palpate bench tearing`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct TearingArguments {
    /// Run this part only
    #[arg(long, value_enum, value_name = "PART")]
    part: Option<PartName>,
    /// Write the tables as JSON as well
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
    /// Draw the force of each law against the number of triangles, the displacement of the strips, or the force over a
    /// tear (SVG or PNG; parts `mesh`, `running` and `figure`)
    #[arg(long, value_name = "FILE")]
    pub(super) plot: Option<PathBuf>,
    /// Use only coarse meshes and short runs, in seconds instead of minutes
    #[arg(long)]
    pub(super) quick: bool,
}

/// The parts, by name.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum PartName {
    /// Force, energy and start of tears on meshes of several sizes and patterns
    Mesh,
    /// The displacement at which a tear runs through a clamped strip, whatever mesh, damping and steps
    Running,
    /// The direction of a crack at an angle to the load
    Path,
    /// The account of the energy of a tear
    Energy,
    /// What tears do to a mesh
    Meshes,
    /// The force over a tear of the cloth scene
    Figure,
    /// The times of the steps of the scenes of cloth and banknote
    Table,
    /// The force error of slow hosts in the cloth scene
    Feel,
}

/// A part of one of the two studies.
enum Either {
    Sheets(Part),
    Runs(RunPart),
}

impl PartName {
    fn part(self) -> Either {
        match self {
            Self::Mesh => Either::Sheets(Part::Mesh),
            Self::Running => Either::Sheets(Part::Running),
            Self::Path => Either::Sheets(Part::Path),
            Self::Energy => Either::Sheets(Part::Energy),
            Self::Meshes => Either::Sheets(Part::Meshes),
            Self::Figure => Either::Runs(RunPart::Figure),
            Self::Table => Either::Runs(RunPart::Table),
            Self::Feel => Either::Runs(RunPart::Feel),
        }
    }
}

pub(super) fn run(arguments: &TearingArguments) -> Result<(), CommandError> {
    let _held = Declared::default()
        .file("--json", arguments.json.as_ref(), Format::Json)
        .file("--plot", arguments.plot.as_ref(), Format::Picture)
        .check()?;
    let parts = match arguments.part.map(PartName::part) {
        Some(Either::Runs(part)) => return tearing_runs::run(arguments, part),
        Some(Either::Sheets(part)) => vec![part],
        None => Part::ALL.to_vec(),
    };
    let level = level(arguments.quick);
    let found = with_bar(|progress| tearing::run(&parts, level, progress))?;
    if let Some(mesh) = &found.mesh {
        print_mesh(mesh);
    }
    if let Some(runs) = &found.running {
        print_running(runs);
    }
    if let Some(kinks) = &found.path {
        print_path(kinks);
    }
    if let Some(accounts) = &found.energy {
        print_energy(accounts);
    }
    if let Some(meshes) = &found.meshes {
        print_meshes(meshes);
    }
    let mut written = Written::default();
    written.write(arguments.json.as_ref(), |path| write_json(path, &found));
    if let Some(mesh) = &found.mesh {
        written.write(arguments.plot.as_ref(), |path| {
            plot::write_picture(path, &chart(&mesh.tears))
        });
    } else if let Some(runs) = &found.running {
        written.write(arguments.plot.as_ref(), |path| {
            plot::write_picture(path, &running_chart(runs))
        });
    }
    written.end()?;
    Ok(())
}

fn print_mesh(found: &MeshStudy) {
    outln!(
        "Mesh independence: a notched cloth in two hands; its toughness is {} J/m²\n",
        found.toughness
    );
    outln!(
        "| law | pattern | triangles | peak N | mean force N | tear mm | energy J/m² | off the line, edges |"
    );
    outln!("|---|---|---|---|---|---|---|---|");
    for tear in &found.tears {
        outln!(
            "| `{}` | {} | {} | {:.3} | {:.3} | {:.1} | {:.0} | {:.2} |",
            tear.law,
            tear.pattern,
            tear.triangles,
            tear.peak,
            tear.plateau,
            1e3 * tear.length,
            tear.energy,
            tear.strayed
        );
    }
    outln!("\nLargest deviation from the mean over all meshes\n");
    outln!("| law | mean force | energy |");
    outln!("|---|---|---|");
    for spread in &found.spreads {
        outln!(
            "| `{}` | {:.1} % | {:.1} % |",
            spread.law,
            100.0 * spread.plateau,
            100.0 * spread.energy
        );
    }
    outln!("\nLong clamped strips: the strain at which the tear starts\n");
    outln!("| pattern | triangles | exact | found | error |");
    outln!("|---|---|---|---|---|");
    for start in &found.starts {
        outln!(
            "| {} | {} | {:.4} | {:.4} | {:+.1} % |",
            start.pattern,
            start.triangles,
            start.exact,
            start.found,
            100.0 * start.error()
        );
    }
    outln!("\nTrousers: the force of a hand (N)\n");
    outln!("| pattern | triangles | formula | found | error |");
    outln!("|---|---|---|---|---|");
    for test in &found.trousers {
        outln!(
            "| {} | {} | {:.4} | {:.4} | {:+.1} % |",
            test.pattern,
            test.triangles,
            test.exact,
            test.found,
            100.0 * test.error()
        );
    }
    outln!();
}

fn print_path(kinks: &[Kink]) {
    outln!("First kink of a crack (degrees), by the angle between crack and load\n");
    outln!("| pattern | triangles | load | exact | found | error |");
    outln!("|---|---|---|---|---|---|");
    for kink in kinks {
        outln!(
            "| {} | {} | {} | {:.1} | {:.1}, {:.1} | {:.1} |",
            kink.pattern,
            kink.triangles,
            kink.load,
            kink.exact,
            kink.found[0],
            kink.found[1],
            kink.error()
        );
    }
    outln!();
}

fn print_running(runs: &[Run]) {
    outln!(
        "Displacement of a clamped strip over the exact one, at the first edge and where parts of the strip are torn\n"
    );
    let parts: Vec<String> = running::TORN
        .iter()
        .map(|part| format!("{:.0} %", 100.0 * part))
        .collect();
    outln!(
        "| mesh | edges across | Hz | damping ms | toughness J/m² | first edge | {} | work / (G_c t A) |",
        parts.join(" | ")
    );
    outln!(
        "|---|---|---|---|---|---|{}---|",
        "---|".repeat(parts.len())
    );
    let value = |value: Option<f64>| {
        value.map_or_else(|| "rests".to_owned(), |value| format!("{value:.3}"))
    };
    for run in runs {
        let torn: Vec<String> = run.displacement.iter().copied().map(value).collect();
        outln!(
            "| {} | {} | {} | {} | {} | {} | {} | {} |",
            run.mesh,
            run.across,
            run.rate,
            1e3 * run.damping,
            run.toughness,
            value(run.start),
            torn.join(" | "),
            value(run.work)
        );
    }
    let all = || runs.iter().flat_map(|run| run.displacement);
    let rests = all().filter(Option::is_none).count();
    let [least, most] =
        [f64::min, f64::max].map(|of: fn(f64, f64) -> f64| all().flatten().reduce(of));
    let [less, more] = [f64::min, f64::max]
        .map(|of: fn(f64, f64) -> f64| runs.iter().filter_map(|run| run.work).reduce(of));
    outln!(
        "\n{} strips: displacement {} to {}, work {} to {}; {rests} rest\n",
        runs.len(),
        value(least),
        value(most),
        value(less),
        value(more)
    );
}

/// Most lines of a chart.
const MOST_LINES: usize = 9;

/// The displacement over the torn part: a line for each strip of three meshes with the most edges up to 10 and steps
/// of a millisecond.
fn running_chart(runs: &[Run]) -> String {
    let drawn = runs.iter().filter(|run| {
        let is_drawn = ["0°", "scattered", "Frontal"].contains(&&*run.mesh);
        is_drawn && run.across <= 10 && run.rate >= 1000.0
    });
    let skipped = drawn.clone().count().saturating_sub(MOST_LINES);
    let lines = drawn.skip(skipped).enumerate().map(|(place, run)| {
        let start = run.start.map(|start| (0.0, start));
        let torn = running::TORN.iter().zip(run.displacement);
        Series {
            name: format!("{}, damping {} ms", run.mesh, 1e3 * run.damping),
            points: (start.into_iter())
                .chain(torn.filter_map(|(part, at)| Some((100.0 * part, at?))))
                .collect(),
            marker: Marker::by_place(place),
            role: Role::Number(place),
            ..Series::default()
        }
    });
    plot::line_chart_svg(
        "A tear through a clamped strip",
        "Torn part (%)",
        "Displacement over the exact one",
        false,
        false,
        &lines.collect::<Vec<_>>(),
    )
}

fn print_energy(accounts: &[Account]) {
    type Term = (&'static str, fn(&Account) -> f64);
    let terms: [Term; 13] = [
        ("supplied", |a| a.supplied),
        ("stored: kinetic, elastic, weight", |a| a.stored),
        ("damping", |a| a.damping),
        ("toughness times torn area", |a| a.due),
        ("of it, still to be taken", |a| a.pending),
        ("of it, into motion and damping at the tip", |a| a.slackened),
        ("taken by letting go", |a| a.released),
        ("edits (source)", |a| a.edits),
        ("implicit Euler", |a| a.integrator),
        ("linearization", |a| a.linearization),
        ("guard (source)", |a| a.guard),
        ("solver (source)", |a| a.solver),
        ("missing", |a| a.missing() * a.supplied),
    ];
    outln!("Energy of a whole tear (mJ)\n");
    let heads: Vec<String> = accounts
        .iter()
        .map(|a| format!("{}, {} triangles", a.pattern, a.triangles))
        .collect();
    outln!("| term | {} |", heads.join(" | "));
    outln!("|---|{}", "---|".repeat(accounts.len()));
    for (name, term) in terms {
        let cells: Vec<String> = accounts
            .iter()
            .map(|a| format!("{:.4}", 1e3 * term(a)))
            .collect();
        outln!("| {name} | {} |", cells.join(" | "));
    }
    let cells: Vec<String> = accounts
        .iter()
        .map(|a| format!("{:+.3} %", 100.0 * a.missing()))
        .collect();
    outln!("| missing of supplied | {} |", cells.join(" | "));
    let cells: Vec<String> = accounts
        .iter()
        .map(|a| format!("{:.0e}", a.rounding()))
        .collect();
    outln!(
        "| the same with what letting go took | {} |\n",
        cells.join(" | ")
    );
}

fn print_meshes(meshes: &[Mesh]) {
    outln!("Meshes: what a tear adds, by the largest snap (as a fraction of an edge)\n");
    outln!(
        "| pattern | snapping | triangles | added | opened | cut | snapped | smallest angle before, after | off the line, \
         edges | mass | area | momentum | inverted |"
    );
    outln!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for mesh in meshes {
        let [opened, cut, snapped] = mesh.counts;
        outln!(
            "| {} | {} | {} | {} | {opened} | {cut} | {snapped} | {:.1}°, {:.1}° | {:.2} | {:.0e} | {:.0e} | {:.0e} | {} |",
            mesh.pattern,
            mesh.snapping,
            mesh.triangles[0],
            mesh.triangles[1],
            mesh.angles[0],
            mesh.angles[1],
            mesh.strayed,
            mesh.errors.mass,
            mesh.errors.area,
            mesh.errors.momentum,
            mesh.errors.inverted
        );
    }
    outln!();
}

/// The mean force against the number of triangles: a line for each law and pattern.
fn chart(tears: &[Tear]) -> String {
    let mut drawn: Vec<Series> = Vec::new();
    let lines = tears.chunk_by(|a, b| (a.law, &a.pattern) == (b.law, &b.pattern));
    for (place, line) in lines.enumerate() {
        let Some(first) = line.first() else {
            continue;
        };
        drawn.push(Series {
            name: format!("{}, {}", first.law, first.pattern),
            points: line
                .iter()
                .map(|tear| (tear.triangles as f64, tear.plateau))
                .collect(),
            marker: Marker::by_place(place),
            role: Role::Number(place),
            ..Series::default()
        });
    }
    plot::line_chart_svg(
        "Mean force of a tear",
        "Triangles",
        "Force of a hand (N)",
        true,
        false,
        &drawn,
    )
}
