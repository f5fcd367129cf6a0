//! `palpate bench tearing`: tears of sheets against fracture mechanics.

use super::super::CommandError;
use super::super::outputs::{Declared, Format};
use super::{level, tell, with_bar};
use host::scene::{LoadedScene, Scene};
use std::path::PathBuf;
use study::tearing::runs::{self, RunSection};
use study::tearing::{self, Section};

/// Arguments of `palpate bench tearing`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct TearingArguments {
    /// Run this part only
    #[arg(long, value_enum, value_name = "PART")]
    part: Option<SectionName>,
    /// Write the tables as JSON as well
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw the force of each law against the number of triangles, the displacement of the strips, the force of the
    /// cloths, or the force over a tear (SVG or PNG; parts `mesh`, `running`, `smooth` and `figure`)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// The scenes whose steps are timed, instead of the shipped ones (part `table`)
    #[arg(long, value_name = "FILE")]
    scene: Vec<PathBuf>,
    /// Use only coarse meshes and short runs, in seconds instead of minutes
    #[arg(long)]
    quick: bool,
}

/// The parts, by name.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum SectionName {
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
    /// The effect of tears on a mesh
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
    Sheets(Section),
    Runs(RunSection),
}

impl SectionName {
    fn part(self) -> Either {
        match self {
            Self::Mesh => Either::Sheets(Section::Mesh),
            Self::Running => Either::Sheets(Section::Running),
            Self::Smooth => Either::Sheets(Section::Smooth),
            Self::Path => Either::Sheets(Section::Path),
            Self::Trousers => Either::Sheets(Section::Trousers),
            Self::Notches => Either::Sheets(Section::Notches),
            Self::Strength => Either::Sheets(Section::Strength),
            Self::Energy => Either::Sheets(Section::Energy),
            Self::Meshes => Either::Sheets(Section::Meshes),
            Self::Figure => Either::Runs(RunSection::Figure),
            Self::Table => Either::Runs(RunSection::Table),
            Self::Feel => Either::Runs(RunSection::Feel),
        }
    }
}

pub(super) fn run(arguments: &TearingArguments) -> Result<(), CommandError> {
    let (json, plot) = (arguments.json.as_ref(), arguments.plot.as_ref());
    let _held = Declared::default()
        .file("--json", json, Format::Json)
        .file("--plot", plot, Format::Picture)
        .check()?;
    let level = level(arguments.quick);
    let parts = match arguments.part.map(SectionName::part) {
        Some(Either::Runs(part)) => {
            let scenes = arguments.scene.iter().map(|path| Scene::load(path));
            let scenes: Vec<LoadedScene> = scenes.collect::<Result<_, _>>()?;
            let found = with_bar(|progress| runs::run(part, &scenes, level, progress))?;
            return tell(&found, json, plot);
        }
        Some(Either::Sheets(part)) => vec![part],
        None => Section::ALL.to_vec(),
    };
    let found = with_bar(|progress| tearing::run(&parts, level, progress))?;
    tell(&found, json, plot)
}
