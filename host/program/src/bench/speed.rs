//! `palpate bench speed`: run time against error, on every path.

use super::super::CommandError;
use super::super::outputs::{Declared, Format};
use super::super::written::Written;
use super::{level, progress_bar, tell};
use host::atomic_file::write_atomically;
use host::plot::write_picture;
use std::path::PathBuf;
use study::speed::{self, Live, Section, Told, chart, csv};

/// Arguments of `palpate bench speed`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct SpeedArguments {
    /// Write all results as JSON as well
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a line for each scene and path as CSV as well
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Draw error against processor time: speed-solver, speed-mesh and speed-time-step, each as SVG and as PNG
    #[arg(long, value_name = "FOLDER")]
    plot: Option<PathBuf>,
    /// Use faster motions and fewer meshes: within one minute instead of twenty
    #[arg(long)]
    quick: bool,
    /// Measure only this part of the study
    #[arg(long, value_name = "PART")]
    only: Option<SectionName>,
}

/// A part of the study, as an argument.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum SectionName {
    /// The cube's scenes
    Cube,
    /// The sheets' scenes
    Sheets,
    /// Cubes of increasing size
    Scaling,
    /// Work that is skipped on purpose
    Skips,
    /// Error against time
    Precision,
    /// Distribution of the time of the fast step
    Parts,
    /// Each kind of element and law, with and without an assembled matrix
    Kernels,
}

impl From<SectionName> for Section {
    fn from(part: SectionName) -> Self {
        match part {
            SectionName::Cube => Self::Cube,
            SectionName::Sheets => Self::Sheets,
            SectionName::Scaling => Self::Scaling,
            SectionName::Skips => Self::Skips,
            SectionName::Precision => Self::Precision,
            SectionName::Parts => Self::Parts,
            SectionName::Kernels => Self::Kernels,
        }
    }
}

pub(super) fn run(arguments: &SpeedArguments) -> Result<(), CommandError> {
    let _held = Declared::default()
        .file("--json", arguments.json.as_ref(), Format::Json)
        .file("--csv", arguments.csv.as_ref(), Format::Csv)
        .folder("--plot", arguments.plot.as_ref(), chart::writes)
        .check()?;
    let level = level(arguments.quick);
    let bar = progress_bar();
    let mut live = Live::default();
    let only = arguments.only.map(Section::from);
    let found = speed::run(level, only, &mut |told| match told {
        Told::Fraction(fraction) => bar.set_position((1000.0 * fraction) as u64),
        told => bar.above(|| out!("{}", live.lines(told))),
    })?;
    bar.finish_and_clear();
    tell(&found, arguments.json.as_ref(), None)?;
    let mut written = Written::default();
    written.write(arguments.csv.as_ref(), |path| {
        write_atomically(path, csv::rows(&found).as_bytes())
    });
    // The charts show the part `precision` only.
    let drawn = arguments.plot.is_some() && !found.precision.is_empty();
    for (name, picture) in drawn
        .then(|| chart::all(&found.precision))
        .into_iter()
        .flatten()
    {
        for ending in chart::ENDINGS {
            let file = format!("{name}.{ending}");
            let path = arguments.plot.as_ref().map(|folder| folder.join(file));
            written.write(path.as_ref(), |path| write_picture(path, &picture));
        }
    }
    written.end()
}
