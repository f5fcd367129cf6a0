//! How far the engine's bodies lie from exact solutions and from independent programs.
//!
//! Each benchmark is one file and gives [`Series`]: the same quantity on finer and finer meshes, with the
//! error against a reference and the order at which it falls. Nothing here is tuned to its reference: meshes
//! are the generators', options the defaults, and where a published figure is known to lie off the exact one
//! the source says so.

mod cook;
mod cube;
mod local_model;
mod locking;
mod manufactured;
mod plate_bending;
mod plate_hole;
mod solve;
mod strip;
mod time;

use crate::{Level, StudyError};
use serde::Serialize;

pub use local_model::{LocalModels, Prediction};

/// One mesh of a series.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// What it is, for people.
    pub mesh: String,
    /// Size of its elements over the length of the problem (or of a time step over the duration).
    pub size: f64,
    /// What was computed, in the series' unit.
    pub ours: f64,
    /// What an independent program computes on the same mesh, in the same unit, where that is known.
    pub independent: Option<f64>,
    /// `ours / reference - 1`; for a series whose value is an error already, that error.
    pub error: f64,
    /// Order at which the error fell since the last point; `None` at the first, and where sizes are equal.
    pub order: Option<f64>,
}

/// One quantity on finer and finer meshes.
#[derive(Clone, Debug, Serialize)]
pub struct Series {
    /// A short name, by which programs find it.
    pub name: &'static str,
    /// Problem, elements and quantity, for people.
    pub title: String,
    /// Unit of the quantity; "1" for a ratio.
    pub unit: &'static str,
    /// The exact or agreed value; `None` where the quantity is an error.
    pub reference: Option<f64>,
    /// Where the reference comes from.
    pub source: &'static str,
    /// Coarse to fine.
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

    /// The finest mesh's point.
    pub fn finest(&self) -> Option<&Point> {
        self.points.last()
    }
}

/// What the study found.
#[derive(Clone, Debug, Serialize)]
pub struct Accuracy {
    /// `palpate.accuracy/2`.
    pub schema: &'static str,
    /// How much was computed.
    pub level: Level,
    /// All series, benchmark by benchmark.
    pub series: Vec<Series>,
    /// How well a published local model foretells the force.
    pub local_models: LocalModels,
}

impl Accuracy {
    /// The series called `name`.
    pub fn get(&self, name: &str) -> Option<&Series> {
        self.series.iter().find(|series| series.name == name)
    }
}

type Benchmark = fn(Level) -> Result<Vec<Series>, StudyError>;

/// Runs all benchmarks. `progress` is given the share done.
///
/// # Errors
/// [`StudyError`].
pub fn run(level: Level, mut progress: impl FnMut(f64)) -> Result<Accuracy, StudyError> {
    // Each with its share of the whole time, roughly; the local models take the rest.
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
    for (benchmark, share) in benchmarks {
        progress(done);
        series.extend(benchmark(level)?);
        done += share;
    }
    let local_models = local_model::run(level, |share| progress(done + (1.0 - done) * share))?;
    Ok(Accuracy {
        schema: "palpate.accuracy/2",
        level,
        series,
        local_models,
    })
}
