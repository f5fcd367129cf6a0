//! `palpate solve`: solves a scene without devices for equilibrium or motion.

use super::outputs::{Declared, Format};
use super::sets::Sets;
use super::written::Written;
use super::{CommandError, build, load, progress_bar};
use host::atomic_file::{write_atomically, write_json};
use host::plot::{self, Marker, Series};
use host::scene::spec::Analysis;
use host::solve::frames::FrameFolder;
use host::solve::{Solution, SolveError, check_solved, has_load_curves, solve};
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  palpate solve cube.toml --force-displacement cube.svg   draw force against displacement
  palpate solve cube.toml --csv cube.csv                  write a row for each load step
  palpate solve cube.toml --vtu out                       write the deformed mesh of each step for ParaView";

/// Arguments of `palpate solve`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct SolveArguments {
    /// Scene file (TOML) with supports and loads; its table `[solve]` sets the analysis
    scene: PathBuf,
    /// Write each frame as VTU into this folder, and the list frames.pvd, for ParaView
    #[arg(long, value_name = "FOLDER")]
    vtu: Option<PathBuf>,
    /// Draw the reactions against the loads or time (SVG or PNG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Write a row for each load step or time step: displacements and reactions of supports, energies, extremes (CSV)
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Draw the force of each displaced support against its displacement (SVG or PNG)
    #[arg(long, value_name = "FILE")]
    force_displacement: Option<PathBuf>,
    /// Write the solution as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    sets: Sets,
}

pub(super) fn run(arguments: &SolveArguments) -> Result<(), CommandError> {
    let loaded = load(Some(&arguments.scene), &arguments.sets)?;
    if arguments.force_displacement.is_some() && !has_load_curves(&loaded.scene) {
        return Err(CommandError::NothingDisplaced);
    }
    let _held = Declared::default()
        .scene(Some(&arguments.scene), &loaded)
        .frames("--vtu", arguments.vtu.as_ref(), &loaded.scene.bodies)
        .file("--plot", arguments.plot.as_ref(), Format::Picture)
        .file("--csv", arguments.csv.as_ref(), Format::Csv)
        .file(
            "--force-displacement",
            arguments.force_displacement.as_ref(),
            Format::Picture,
        )
        .file("--json", arguments.json.as_ref(), Format::Json)
        .check()?;
    let mut frames = match &arguments.vtu {
        Some(folder) => {
            let bodies = loaded.scene.bodies.iter();
            let names = bodies.map(|body| body.name.as_str());
            Some(FrameFolder::create(folder, names)?)
        }
        None => None,
    };
    let bar = progress_bar();
    let world = build(&loaded, &bar)?;
    check_solved(&loaded)?;
    let solution = solve(
        &world,
        frames.is_some(),
        &mut |fraction| bar.set_position((1000.0 * fraction) as u64),
        &mut |frame| match &mut frames {
            Some(folder) => folder.keep(&frame),
            None => Ok(()),
        },
    );
    bar.finish_and_clear();
    let solution = solution.map_err(|error| match error {
        SolveError::Frame(error) => CommandError::File(error),
        SolveError::Matrix(error) => CommandError::Solve(error),
        SolveError::Scene(error) => error.into(),
    })?;
    out!("{solution}");
    let mut written = Written::default();
    let plot = written.write(arguments.plot.as_ref(), |path| {
        plot::write_picture(path, &chart(&solution))
    });
    let csv = written.write(arguments.csv.as_ref(), |path| {
        write_atomically(path, solution.csv().as_bytes())
    });
    let curves = written.write(arguments.force_displacement.as_ref(), |path| {
        let picture = plot::force_displacement(&solution.scene, &solution.load_curves());
        plot::write_picture(path, &picture)
    });
    let json = written.write(arguments.json.as_ref(), |path| write_json(path, &solution));
    let list = frames.map(|folder| folder.list_file());
    for (output, path, there) in [
        ("vtu", &list, true),
        ("plot", &arguments.plot, plot),
        ("csv", &arguments.csv, csv),
        ("curve", &arguments.force_displacement, curves),
        ("json", &arguments.json, json),
    ] {
        if let Some(path) = path.as_ref().filter(|_| there) {
            outln!("  {output:<10} {}", path.display());
        }
    }
    written.end()?;
    if solution.failures.is_empty() {
        Ok(())
    } else {
        Err(CommandError::NotSolved)
    }
}

/// Largest number of reactions that are drawn: more lines cannot be distinguished.
const MOST_LINES: usize = 8;

/// A chart of the norm of each reaction over the steps.
fn chart(solution: &Solution) -> plot::Picture {
    let mut series = Vec::new();
    for body in &solution.bodies {
        for (index, reaction) in body.reactions.iter().enumerate() {
            let norm = |f: &[f64; 3]| f.iter().map(|x| x * x).sum::<f64>().sqrt();
            let points = body.steps.iter();
            let points: Vec<_> = points
                .map(|row| (row.at, norm(&row.forces[index])))
                .collect();
            let marker = if points.len() > 30 {
                Marker::None
            } else {
                Marker::Circle
            };
            series.push(Series {
                name: format!("{}, {}", body.name, reaction.name),
                points,
                marker,
                ..Series::default()
            });
        }
    }
    series.truncate(MOST_LINES);
    let x = match solution.analysis {
        Analysis::Static => "Fraction of displacements and loads",
        Analysis::Dynamic => "Time (s)",
    };
    let title = format!("Reactions: {}", solution.scene);
    plot::line_chart(&title, x, "Force (N)", false, false, &series)
}
