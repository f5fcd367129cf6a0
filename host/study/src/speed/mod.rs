//! Run time against error: the cost of a step on each path, and the error of its force.
//!
//! Times are processor times of one thread for whole steps: medians and upper percentiles. They stand beside a
//! description of the machine and the time of a small kernel, because absolute times of different machines do not
//! compare programs. Beside every time stand two errors of the force on the hand, each the largest over the motion as a
//! fraction of the largest force: the error of the solver (against the same equation solved to 1e-12), and the error of
//! the linearization (against implicit Euler by Newton's method, with the same steps).

mod calibration;
mod ceiling;
pub mod chart;
pub(crate) mod clock;
pub mod csv;
mod cube;
mod kernels;
mod machine;
mod motion;
mod parts;
mod path;
mod precision;
mod scaling;
mod set_up;
mod sheets;
mod skips;
mod tables;
mod trial;

use crate::{Level, StudyError};
use serde::Serialize;

pub use clock::Times;
pub use kernels::KernelRow;
pub use machine::Machine;
pub use parts::{Memory, Parts, Timed};
pub use precision::{Curve, Setting, Varied};
pub use scaling::{Scaling, Size};
pub use set_up::SetUp;
pub use skips::Skip;
pub use tables::Live;

/// The fraction of a force that a hand can just notice: the unit for errors.
pub const JUST_NOTICEABLE: f64 = 0.1;

/// A part of the study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// The scenes of the cube.
    Cube,
    /// The scenes of the sheets.
    Sheets,
    /// Cubes of growing size.
    Scaling,
    /// Work that is skipped on purpose.
    Skips,
    /// Error against time.
    Precision,
    /// The parts of the fast step's time.
    Parts,
    /// Each kind of element and law, assembled and by the fast step.
    Kernels,
}

/// One scene on one path.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The scene's name in files.
    pub scene: &'static str,
    /// The scene's title for readers.
    pub title: String,
    /// Tetrahedra or triangles.
    pub elements: usize,
    /// Unknown coordinates.
    pub unknowns: usize,
    /// Length of a time step (s).
    pub step: f64,
    /// The path.
    pub path: &'static str,
    /// Processor time of a step.
    pub times: Times,
    /// Mean number of iterations in a step: of conjugate gradients, or of Newton's method.
    pub mean_iterations: f64,
    /// Largest number of iterations in a step.
    pub most_iterations: usize,
    /// The largest relative residual of a step, in the definition of the path.
    pub residual: f64,
    /// Force at the end, along the motion (N).
    pub force: f64,
    /// Largest error of the force against the same equation solved tightly, as a fraction of the largest force.
    pub solver_error: f64,
    /// Largest error of the force against implicit Euler by Newton's method, as a fraction of the largest force; none if
    /// that path did not run.
    pub step_error: Option<f64>,
}

impl Row {
    /// The larger of the two errors, in just-noticeable differences.
    pub fn noticeable(&self) -> f64 {
        self.step_error.unwrap_or(0.0).max(self.solver_error) / JUST_NOTICEABLE
    }
}

/// The results of the study.
#[derive(Clone, Debug, Serialize)]
pub struct Speed {
    /// `palpate.speed/1`.
    pub schema: &'static str,
    /// The extent of the measurements.
    pub level: Level,
    /// The machine.
    pub machine: Machine,
    /// The scenes of the cube.
    pub cube: Vec<Row>,
    /// The scenes of the sheets.
    pub sheets: Vec<Row>,
    /// Cubes of growing size.
    pub scaling: Vec<Scaling>,
    /// Work that is skipped on purpose.
    pub skips: Vec<Skip>,
    /// Error against time.
    pub precision: Vec<Curve>,
    /// The parts of the fast step's time.
    pub parts: Parts,
    /// Each kind of element and law, assembled and by the fast step.
    pub kernels: Vec<KernelRow>,
}

impl Speed {
    /// The row of a scene, a number of elements and a path.
    pub fn row(&self, scene: &str, elements: usize, path: &str) -> Option<&Row> {
        let mut rows = self.cube.iter().chain(&self.sheets);
        rows.find(|row| row.scene == scene && row.elements == elements && row.path == path)
    }
}

/// News that the study tells while it runs.
#[derive(Clone, Copy, Debug)]
pub enum Told<'a> {
    /// The fraction done.
    Fraction(f64),
    /// The machine, before the first measurement.
    Machine(&'a Machine),
    /// A scene of the cube on one path.
    Cube(&'a Row),
    /// A scene of the sheets on one path.
    Sheet(&'a Row),
    /// A path, by its name, on a cube of some size.
    Size(&'static str, &'a Size),
}

/// Measures everything, or the part `only` of the study; the other parts are then empty. `tell` is given the fraction done,
/// and each row of the longest parts as soon as it is measured.
///
/// # Errors
/// [`StudyError`].
pub fn run(
    level: Level,
    only: Option<Section>,
    tell: &mut dyn FnMut(Told<'_>),
) -> Result<Speed, StudyError> {
    // Each part ends at an approximate fraction of the whole time.
    let [cube_end, sheets_end, scaling_end, precision_end, parts_end] = match level {
        Level::Quick => [0.47, 0.61, 0.66, 0.85, 0.9],
        Level::Full => [0.54, 0.68, 0.82, 0.95, 0.96],
    };
    let wanted = |section| only.is_none_or(|only| only == section);
    let mut found = Speed {
        schema: "palpate.speed/1",
        level,
        machine: Machine::here(),
        cube: Vec::new(),
        sheets: Vec::new(),
        scaling: Vec::new(),
        skips: Vec::new(),
        precision: Vec::new(),
        parts: Parts::default(),
        kernels: Vec::new(),
    };
    tell(Told::Machine(&found.machine));
    // Forwards the news of a part, with the fraction of the part as a fraction of the whole.
    let mut within = |from: f64, to: f64, told: Told<'_>| match told {
        Told::Fraction(fraction) => tell(Told::Fraction(from + (to - from) * fraction)),
        other => tell(other),
    };
    if wanted(Section::Cube) {
        found.cube = cube::run(level, &mut |told| within(0.0, cube_end, told))?;
    }
    if wanted(Section::Sheets) {
        found.sheets = sheets::run(level, &mut |told| within(cube_end, sheets_end, told))?;
    }
    if wanted(Section::Scaling) {
        found.scaling = scaling::run(level, &mut |told| within(sheets_end, scaling_end, told))?;
    }
    if wanted(Section::Skips) {
        found.skips = skips::run(level)?;
    }
    if wanted(Section::Precision) {
        let mut report = |fraction| within(scaling_end, precision_end, Told::Fraction(fraction));
        found.precision = precision::run(level, &mut report)?;
    }
    if wanted(Section::Parts) {
        found.parts = parts::run(level, &mut |fraction| {
            within(precision_end, parts_end, Told::Fraction(fraction));
        })?;
    }
    if wanted(Section::Kernels) {
        found.kernels = kernels::run(level, &mut |fraction| {
            within(parts_end, 1.0, Told::Fraction(fraction));
        })?;
    }
    Ok(found)
}
