//! Section `mesh`: force and energy of a tear on meshes of several sizes and patterns, under both laws.
//!
//! Fracture mechanics gives one force and one energy for a unit of torn area, whatever the mesh. The force is averaged
//! over the motion of the hands, from the start of the tear on, and the energy over the torn area.

use super::patterns::Pattern;
use super::pull::Pull;
use super::specimen::CLOTH;
use super::{SIZES, strip};
use crate::{Level, StudyError};
use physics::tear::TearLaw;
use serde::Serialize;

/// The time of a run (s): the hands are then 6 cm apart.
const TIME: f64 = 0.8;

/// A tear on one mesh.
#[derive(Clone, Debug, Serialize)]
pub struct Tear {
    /// `toughness` or `thesis`.
    pub law: &'static str,
    /// How the triangles lie.
    pub pattern: String,
    /// Number of triangles before the tear.
    pub triangles: usize,
    /// The largest force of a hand (N).
    pub peak: f64,
    /// The mean force of a hand from the start of the tear on (N).
    pub plateau: f64,
    /// The length of the tear at the end (m).
    pub length: f64,
    /// The energy that is supplied and not stored, for a unit of torn area (J/m^2): the toughness, damping, and the waves
    /// that the tear makes.
    pub energy: f64,
    /// The largest distance of the tear from a straight line, as a fraction of an edge.
    pub strayed: f64,
}

/// The largest deviation from the mean over all meshes of one law, relative.
#[derive(Clone, Debug, Serialize)]
pub struct Spread {
    /// `toughness` or `thesis`.
    pub law: &'static str,
    /// Of the mean force, relative.
    pub plateau: f64,
    /// Of the energy, relative.
    pub energy: f64,
}

/// The part `mesh`.
#[derive(Clone, Debug, Serialize)]
pub struct MeshStudy {
    /// The toughness of the cloth (J/m^2).
    pub toughness: f64,
    /// The tears, law by law.
    pub tears: Vec<Tear>,
    /// The spread of each law.
    pub spreads: Vec<Spread>,
    /// The starts of long strips.
    pub starts: Vec<strip::Start>,
}

/// The name of a law.
fn name(law: TearLaw) -> &'static str {
    match law {
        TearLaw::Toughness => "toughness",
        TearLaw::Thesis => "thesis",
    }
}

/// Tears sheets of all sizes and patterns; at the quick level, of two sizes and two patterns.
///
/// # Errors
/// [`StudyError`].
pub fn run(level: Level, progress: &dyn Fn(f64)) -> Result<MeshStudy, StudyError> {
    let patterns = level.ends(&Pattern::ALL);
    let sizes = level.take(&SIZES, 2);
    // Run times grow with the number of triangles; the last tenth is that of the strips.
    let whole = 2.0 * (patterns.len() * sizes.iter().sum::<usize>()) as f64 / 0.9;
    let (mut tears, mut spreads, mut done) = (Vec::new(), Vec::new(), 0.0);
    for law in [TearLaw::Toughness, TearLaw::Thesis] {
        let begin = tears.len();
        for &pattern in &patterns {
            for &triangles in sizes {
                tears.push(tear(law, pattern, triangles)?);
                done += triangles as f64 / whole;
                progress(done);
            }
        }
        let of = |value: fn(&Tear) -> f64| deviation(tears[begin..].iter().map(value));
        spreads.push(Spread {
            law: name(law),
            plateau: of(|tear| tear.plateau),
            energy: of(|tear| tear.energy),
        });
    }
    Ok(MeshStudy {
        toughness: CLOTH.toughness,
        tears,
        spreads,
        starts: strip::run(level, &SIZES)?,
    })
}

/// The largest deviation from the mean, relative.
fn deviation(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = values.clone().count().max(1);
    let mean = values.clone().sum::<f64>() / count as f64;
    values
        .map(|value| (value / mean - 1.0).abs())
        .fold(0.0, f64::max)
}

fn tear(law: TearLaw, pattern: Pattern, triangles: usize) -> Result<Tear, StudyError> {
    let pull = Pull {
        stuff: CLOTH,
        pattern,
        triangles,
        law,
        gravity: 0.0,
        snapping: 0.3,
        length: f64::INFINITY,
        longest: TIME,
    };
    let torn = pull.run()?;
    let (Some(first), Some(last)) = (torn.at(f64::MIN_POSITIVE), torn.samples.last()) else {
        return Err(StudyError::Rests);
    };
    let supplied = last.supplied - first.supplied;
    let spent = last.supplied - last.stored + torn.pending;
    let forces = torn.samples.iter().flat_map(|sample| sample.force);
    Ok(Tear {
        law: name(law),
        pattern: pattern.name(),
        triangles: torn.triangles[0],
        peak: forces.fold(0.0, f64::max),
        plateau: supplied / (last.opening - first.opening),
        energy: spent / (last.torn * CLOTH.thickness),
        length: last.torn,
        strayed: torn.strayed / torn.spacing,
    })
}
