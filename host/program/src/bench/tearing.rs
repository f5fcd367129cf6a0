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
use study::tearing::notches::Notch;
use study::tearing::running::{self, Run};
use study::tearing::runs::RunPart;
use study::tearing::smooth::Smooth;
use study::tearing::strength::Strip;
use study::tearing::trousers::Trousers;
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
    /// Draw the force of each law against the number of triangles, the displacement of the strips, the force of the
    /// cloths, or the force over a tear (SVG or PNG; parts `mesh`, `running`, `smooth` and `figure`)
    #[arg(long, value_name = "FILE")]
    pub(super) plot: Option<PathBuf>,
    /// The scenes whose steps are timed, instead of the shipped ones (part `table`)
    #[arg(long, value_name = "FILE")]
    pub(super) scene: Vec<PathBuf>,
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
    /// The force of hands that tear a cloth, whatever damping and steps
    Smooth,
    /// The start and the direction of a crack at an angle to the load
    Path,
    /// The force of a trousers test, in three thicknesses
    Trousers,
    /// The start at notches and slits of few edges
    Notches,
    /// The force that strips without a notch bear
    Strength,
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
            Self::Smooth => Either::Sheets(Part::Smooth),
            Self::Path => Either::Sheets(Part::Path),
            Self::Trousers => Either::Sheets(Part::Trousers),
            Self::Notches => Either::Sheets(Part::Notches),
            Self::Strength => Either::Sheets(Part::Strength),
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
    if let Some(cloths) = &found.smooth {
        print_smooth(cloths);
    }
    if let Some(kinks) = &found.path {
        print_path(kinks);
    }
    if let Some(trousers) = &found.trousers {
        print_trousers(trousers);
    }
    if let Some(notches) = &found.notches {
        print_notches(notches);
    }
    if let Some(strips) = &found.strength {
        print_strength(strips);
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
    } else if let Some(cloths) = &found.smooth {
        written.write(arguments.plot.as_ref(), |path| {
            plot::write_picture(path, &smooth_chart(cloths))
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
    outln!();
}

fn print_trousers(trousers: &[Trousers]) {
    outln!(
        "Trousers: the force of a hand over the formula, its ripple over its mean, and the drift of the tear\n"
    );
    outln!("| mesh | triangles | thickness mm | force | ripple | drift mm |");
    outln!("|---|---|---|---|---|---|");
    for test in trousers {
        let force = test.relative().map_or_else(
            || "rests | ".to_owned(),
            |[force, ripple]| format!("{force:.3} | {:.1} %", 100.0 * ripple),
        );
        outln!(
            "| {} | {} | {} | {force} | {:.1} |",
            test.pattern,
            test.triangles,
            1e3 * test.thickness,
            1e3 * test.drift
        );
    }
    outln!();
}

/// The smallest and the largest of some values.
fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold(
        [f64::INFINITY, f64::NEG_INFINITY],
        |[least, most], value| [least.min(value), most.max(value)],
    )
}

fn print_path(kinks: &[Kink]) {
    outln!(
        "Start and kink of a crack, by the angle between crack and pull: the load at the first edge over that of the largest \
         hoop stress; directions at the two tips (degrees)\n"
    );
    outln!(
        "| mesh | edges of the crack | load | start | exact kink | by intensities | first edges | exact behind the kink | \
         second edges |"
    );
    outln!("|---|---|---|---|---|---|---|---|---|");
    let both = |[left, right]: [f64; 2]| format!("{left:.1}, {right:.1}");
    for kink in kinks {
        outln!(
            "| {} | {} | {} | {:.3} | {:.1} | {} | {} | {:.1} | {} |",
            kink.pattern,
            kink.edges,
            kink.load,
            kink.start,
            kink.exact[0],
            both(kink.found),
            both(kink.first),
            kink.exact[1],
            both(kink.second)
        );
    }
    outln!(
        "\nThe worst by the edges of the crack: start, and errors of the directions (degrees)\n"
    );
    outln!("| mesh | edges of the crack | start | by intensities | first edges | second edges |");
    outln!("|---|---|---|---|---|---|");
    for same in kinks.chunk_by(|a, b| (&a.pattern, a.edges) == (&b.pattern, b.edges)) {
        let Some(first) = same.first() else {
            continue;
        };
        let [least, most] = extent(same.iter().map(|kink| kink.start));
        let errors = [0, 1, 2].map(|place| extent(same.iter().map(|kink| kink.errors()[place]))[1]);
        outln!(
            "| {} | {} | {least:.3} to {most:.3} | {:.1} | {:.1} | {:.1} |",
            first.pattern,
            first.edges,
            errors[0],
            errors[1],
            errors[2]
        );
    }
    outln!();
}

fn print_notches(notches: &[Notch]) {
    outln!(
        "Error of the load at which a tear starts, by the length of its notch or slit in edges\n"
    );
    let mut lengths: Vec<u32> = notches.iter().map(|notch| notch.edges).collect();
    lengths.sort_unstable();
    lengths.dedup();
    let heads: Vec<String> = lengths.iter().map(u32::to_string).collect();
    outln!("| mesh | kind | {} |", heads.join(" | "));
    outln!("|---|---|{}", "---|".repeat(lengths.len()));
    let mut rows: Vec<(&str, &str)> = Vec::new();
    for notch in notches {
        let row = (&*notch.mesh, notch.kind);
        if rows.contains(&row) {
            continue;
        }
        rows.push(row);
        let cells = lengths.iter().map(|&edges| {
            let mut all = notches.iter();
            let found = all.find(|n| (&*n.mesh, n.kind) == row && n.edges == edges);
            found.map_or_else(String::new, |n| format!("{:+.1} %", 100.0 * n.error()))
        });
        outln!(
            "| {} | {} | {} |",
            row.0,
            row.1,
            cells.collect::<Vec<_>>().join(" | ")
        );
    }
    outln!();
}

fn print_strength(strips: &[Strip]) {
    outln!("Strips without a notch: the largest force over strength times section\n");
    outln!(
        "| mesh | Poisson's ratio | width mm | toughness J/m² | largest force | parted | tears | torn area in sections |"
    );
    outln!("|---|---|---|---|---|---|---|---|");
    for strip in strips {
        outln!(
            "| {} | {} | {} | {} | {:.3} | {} | {} | {:.2} |",
            strip.pattern,
            strip.poisson,
            1e3 * strip.width,
            strip.toughness,
            strip.peak,
            if strip.parted { "yes" } else { "no" },
            strip.tears,
            strip.torn
        );
    }
    let [least, most] = extent(strips.iter().map(|strip| strip.peak));
    let parted = strips.iter().filter(|strip| strip.parted).count();
    outln!(
        "\n{} strips: largest force {least:.3} to {most:.3}; {parted} parted\n",
        strips.len()
    );
}

fn print_smooth(cloths: &[Smooth]) {
    outln!(
        "Force of a hand that tears a cloth from a tenth to nine tenths of its way: mean, and ripple\n"
    );
    outln!("| mesh | edges mm | Hz | damping ms | mean force N | ripple |");
    outln!("|---|---|---|---|---|---|");
    let percent = |ripple: f64| format!("{:.2} %", 100.0 * ripple);
    let rests = || "rests".to_owned();
    for cloth in cloths {
        outln!(
            "| {} | {} | {} | {} | {} | {} |",
            cloth.mesh,
            1e3 * cloth.edge,
            cloth.rate,
            1e3 * cloth.damping,
            cloth
                .plateau
                .map_or_else(rests, |force| format!("{force:.3}")),
            cloth.ripple.map_or_else(rests, percent)
        );
    }
    outln!();
    for cloths in cloths.chunk_by(|a, b| (&a.mesh, a.edge) == (&b.mesh, b.edge)) {
        let Some(first) = cloths.first() else {
            continue;
        };
        let [least, most] = extent(cloths.iter().filter_map(|cloth| cloth.plateau));
        let [_, ripple] = extent(cloths.iter().filter_map(|cloth| cloth.ripple));
        outln!(
            "{}, edges of {} mm: {} cloths, mean force {least:.3} to {most:.3} N ({:.1} %), ripple up to {}",
            first.mesh,
            1e3 * first.edge,
            cloths.len(),
            200.0 * (most - least) / (most + least),
            percent(ripple)
        );
    }
    outln!();
}

/// The force over the displacement: a line for each damping on each mesh, at the smallest number of steps a second that
/// all meshes have.
fn smooth_chart(cloths: &[Smooth]) -> String {
    let rate = cloths.last().map_or(0.0, |last| {
        let same = cloths.iter().filter(|cloth| cloth.mesh == last.mesh);
        same.map(|cloth| cloth.rate).fold(f64::INFINITY, f64::min)
    });
    let drawn = cloths.iter().filter(|cloth| cloth.rate == rate);
    let lines = drawn.enumerate().map(|(place, cloth)| {
        // There are six looks of lines. Marks tell the lines of a third mesh from those of the first.
        let (marker, every) = match place {
            ..6 => (Marker::None, 1),
            _ => (Marker::by_place(place), 8),
        };
        Series {
            name: format!(
                "{}, {} mm, damping {} ms",
                cloth.mesh,
                1e3 * cloth.edge,
                1e3 * cloth.damping
            ),
            points: (cloth.course.iter().step_by(every))
                .map(|[opening, force]| (1e3 * opening, *force))
                .collect(),
            marker,
            role: Role::Number(place),
            ..Series::default()
        }
    });
    plot::line_chart_svg(
        "Two hands tear a cloth",
        "Hands apart (mm)",
        "Force of a hand (N)",
        false,
        false,
        &lines.collect::<Vec<_>>(),
    )
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
