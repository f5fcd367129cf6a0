//! The errors of the engine's bodies against exact solutions and independent programs.
//!
//! Each benchmark is one file and computes [`Series`]: the same quantity on a sequence of refined meshes, with the
//! error against a reference and the order of convergence. No benchmark is tuned to its reference: meshes come from the
//! generators, and options have their defaults. If a published figure is known to differ from the exact one, the
//! source says so.

mod cook;
mod cube;
mod local_model;
mod locking;
mod manufactured;
mod plate_bending;
mod plate_hole;
mod solve;
mod strip;
mod tables;
mod time;

use crate::{Level, StudyError};
use serde::Serialize;

pub use local_model::{LocalModels, Prediction};

/// One mesh of a series.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// Description for readers.
    pub mesh: String,
    /// Relative size: of the elements over the length of the problem (or of a time step over the duration).
    pub size: f64,
    /// The computed value, in the unit of the series.
    pub ours: f64,
    /// The value of an independent program on the same mesh, in the unit of the series, if it is known.
    pub independent: Option<f64>,
    /// Relative error, `ours / reference - 1`; the value itself if the series is an error already.
    pub error: f64,
    /// Order of convergence from the previous point; none at the first point, and for equal sizes.
    pub order: Option<f64>,
}

/// One quantity on a sequence of refined meshes.
#[derive(Clone, Debug, Serialize)]
pub struct Series {
    /// A short name, for programs that look for the series.
    pub name: &'static str,
    /// Problem, elements and quantity, for readers.
    pub title: String,
    /// Unit of the quantity; "1" for a ratio.
    pub unit: &'static str,
    /// The exact or agreed value, in `unit`; none if the quantity is an error.
    pub reference: Option<f64>,
    /// The source of the reference.
    pub source: &'static str,
    /// The points, from coarse to fine.
    pub points: Vec<Point>,
}

impl Series {
    fn new(
        name: &'static str,
        title: impl Into<String>,
        unit: &'static str,
        reference: Option<f64>,
        source: &'static str,
    ) -> Self {
        Self {
            name,
            title: title.into(),
            unit,
            reference,
            source,
            points: Vec::new(),
        }
    }

    fn push(&mut self, mesh: impl Into<String>, size: f64, ours: f64, independent: Option<f64>) {
        let error = self.reference.map_or(ours, |exact| ours / exact - 1.0);
        let order = self.points.last().and_then(|last| {
            let order = libm::log(last.error.abs() / error.abs()) / libm::log(last.size / size);
            order.is_finite().then_some(order)
        });
        self.points.push(Point {
            mesh: mesh.into(),
            size,
            ours,
            independent,
            error,
            order,
        });
    }

    /// The point of the finest mesh.
    pub fn finest(&self) -> Option<&Point> {
        self.points.last()
    }
}

/// The results of the study.
#[derive(Clone, Debug, Serialize)]
pub struct Accuracy {
    /// `palpate.accuracy/2`.
    pub schema: &'static str,
    /// The extent of the computation.
    pub level: Level,
    /// All series, benchmark by benchmark.
    pub series: Vec<Series>,
    /// How well a published local model predicts the force.
    pub local_models: LocalModels,
}

impl Accuracy {
    /// The series called `name`.
    pub fn get(&self, name: &str) -> Option<&Series> {
        self.series.iter().find(|series| series.name == name)
    }
}

type Benchmark = fn(Level) -> Result<Vec<Series>, StudyError>;

/// Runs all benchmarks. `progress` receives the fraction done.
///
/// # Errors
/// [`StudyError`].
pub fn run(level: Level, progress: &mut dyn FnMut(f64)) -> Result<Accuracy, StudyError> {
    // Each benchmark with its approximate fraction of the whole time. The local models take the rest.
    let benchmarks: [(Benchmark, f64); 8] = [
        (plate_hole::run, 0.01),
        (cook::run, 0.08),
        (plate_bending::run, 0.02),
        (strip::run, 0.01),
        (manufactured::run, 0.07),
        (locking::run, 0.01),
        (cube::run, 0.2),
        (time::run, 0.04),
    ];
    let mut series = Vec::new();
    let mut done = 0.0;
    for (benchmark, fraction) in benchmarks {
        progress(done);
        series.extend(benchmark(level)?);
        done += fraction;
    }
    let local_models = local_model::run(level, &mut |fraction| {
        progress(done + (1.0 - done) * fraction);
    })?;
    Ok(Accuracy {
        schema: "palpate.accuracy/2",
        level,
        series,
        local_models,
    })
}
