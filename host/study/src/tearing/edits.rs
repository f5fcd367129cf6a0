//! Section `meshes`: what tears do to a mesh, with and without snapping.

use super::patterns::Pattern;
use super::pull::{EditErrors, Pull};
use super::specimen::CLOTH;
use crate::{Level, StudyError};
use physics::tear::TearLaw;
use serde::Serialize;

/// The length of each tear (m).
const LENGTH: f64 = 0.032;

/// The mesh of one sheet, before and after its tear.
#[derive(Clone, Debug, Serialize)]
pub struct Mesh {
    /// How the triangles lie.
    pub pattern: String,
    /// The largest displacement of a vertex that snaps, as a fraction of an edge.
    pub snapping: f64,
    /// Number of triangles before the tear, and how many it added.
    pub triangles: [usize; 2],
    /// Edges that opened, edges that were divided, and vertices that snapped.
    pub counts: [u64; 3],
    /// The smallest angle before and during the tear (degrees).
    pub angles: [f64; 2],
    /// The largest errors of an edit.
    pub errors: EditErrors,
    /// The largest distance of the tear from a straight line, as a fraction of an edge.
    pub strayed: f64,
}

/// Tears sheets of all patterns with and without snapping; at the quick level, of two patterns.
///
/// # Errors
/// [`StudyError`].
pub fn run(level: Level, progress: &dyn Fn(f64)) -> Result<Vec<Mesh>, StudyError> {
    let patterns = level.ends(&Pattern::ALL);
    let mut meshes = Vec::new();
    for (number, &pattern) in patterns.iter().enumerate() {
        for snapping in [0.0, 0.3] {
            meshes.push(mesh(pattern, level.choose(700, 1400), snapping)?);
        }
        progress((number + 1) as f64 / patterns.len() as f64);
    }
    Ok(meshes)
}

fn mesh(pattern: Pattern, triangles: usize, snapping: f64) -> Result<Mesh, StudyError> {
    let pull = Pull {
        stuff: CLOTH,
        pattern,
        triangles,
        law: TearLaw::Toughness,
        gravity: 0.0,
        snapping,
        length: LENGTH,
        longest: 3.0,
    };
    let torn = pull.run()?;
    let [before, after] = torn.triangles;
    Ok(Mesh {
        pattern: pattern.name(),
        snapping,
        triangles: [before, after - before],
        counts: [torn.report.opened, torn.report.cut, torn.report.snapped],
        angles: torn.angles,
        errors: torn.edits,
        strayed: torn.strayed / torn.spacing,
    })
}
