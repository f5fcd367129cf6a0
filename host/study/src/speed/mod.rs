//! Run time against error: what a step costs on each path, and how far its force lies from the exact one.
//!
//! Times are processor time of one thread for whole steps, medians and upper percentiles, with the machine
//! and a small kernel's time on it: absolute times of different machines say little about programs. Every
//! time stands beside two errors of the force on the hand, each the largest over the motion as a share of
//! the largest force: that of the solver (against the same equation solved to 1e-12), and that of the
//! linearization (against implicit Euler by Newton's method, the same steps).

mod calibration;
mod ceiling;
mod clock;
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

/// The share of a force that a hand can just tell: the unit of errors that matter to it.
pub const JUST_NOTICEABLE: f64 = 0.1;

/// A part of the study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// The cube's scenes.
    Cube,
    /// The sheets' scenes.
    Sheets,
    /// Larger and larger cubes.
    Scaling,
    /// What is left undone on purpose.
    Skips,
    /// Error against time.
    Precision,
    /// Where the time of the fast step goes.
    Parts,
    /// Each kind of element and law, assembled and not.
    Kernels,
}

/// One scene on one path.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The scene, for programs.
    pub scene: &'static str,
    /// The scene, for people.
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
    /// Iterations in a step, on average: of conjugate gradients, or of Newton's method.
    pub mean_iterations: f64,
    /// Iterations in the step that took most.
    pub most_iterations: usize,
    /// The worst residual of any step, as the path measures it.
    pub residual: f64,
    /// Force at the end, along the motion (N).
    pub force: f64,
    /// Largest error of the force against the same equation solved tightly, as a share of the largest force.
    pub solver_error: f64,
    /// The same against implicit Euler by Newton's method, where that was run.
    pub step_error: Option<f64>,
}

impl Row {
    /// The larger of its errors, in just-noticeable differences.
    pub fn noticeable(&self) -> f64 {
        self.step_error.unwrap_or(0.0).max(self.solver_error) / JUST_NOTICEABLE
    }
}

/// What the study found.
#[derive(Clone, Debug, Serialize)]
pub struct Speed {
    /// `palpate.speed/1`.
    pub schema: &'static str,
    /// How much was measured.
    pub level: Level,
    /// Where.
    pub machine: Machine,
    /// The cube's scenes.
    pub cube: Vec<Row>,
    /// The sheets' scenes.
    pub sheets: Vec<Row>,
    /// Larger and larger cubes; empty where little was measured.
    pub scaling: Vec<Scaling>,
    /// What is left undone on purpose.
    pub skips: Vec<Skip>,
    /// Error against time.
    pub precision: Vec<Curve>,
    /// Where the time of the fast step goes.
    pub parts: Parts,
    /// Each kind of element and law, assembled and not.
    pub kernels: Vec<KernelRow>,
}

impl Speed {
    /// The row of a scene, a number of elements and a path.
    pub fn row(&self, scene: &str, elements: usize, path: &str) -> Option<&Row> {
        let mut rows = self.cube.iter().chain(&self.sheets);
        rows.find(|row| row.scene == scene && row.elements == elements && row.path == path)
    }
}

/// Measures everything, or `only` one part of the study: the others are empty then. `progress` is given the share
/// done.
///
/// # Errors
/// [`StudyError`].
pub fn run(
    level: Level,
    only: Option<Section>,
    mut progress: impl FnMut(f64),
) -> Result<Speed, StudyError> {
    // Each part with its share of the whole time, roughly.
    let [cube_end, sheets_end, scaling_end, precision_end, parts_end] = match level {
        Level::Quick => [0.5, 0.65, 0.65, 0.85, 0.9],
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
    let mut within = |from: f64, to: f64, share: f64| progress(from + (to - from) * share);
    if wanted(Section::Cube) {
        found.cube = cube::run(level, |share| within(0.0, cube_end, share))?;
    }
    if wanted(Section::Sheets) {
        found.sheets = sheets::run(level, |share| within(cube_end, sheets_end, share))?;
    }
    if wanted(Section::Scaling) {
        found.scaling = scaling::run(level, |share| within(sheets_end, scaling_end, share))?;
    }
    if wanted(Section::Skips) {
        found.skips = skips::run(level)?;
    }
    if wanted(Section::Precision) {
        found.precision = precision::run(level, |share| within(scaling_end, precision_end, share))?;
    }
    if wanted(Section::Parts) {
        found.parts = parts::run(level, |share| within(precision_end, parts_end, share))?;
    }
    if wanted(Section::Kernels) {
        found.kernels = kernels::run(level, |share| within(parts_end, 1.0, share))?;
    }
    Ok(found)
}
