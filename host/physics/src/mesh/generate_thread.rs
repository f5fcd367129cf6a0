//! Straight threads.

use super::check_thread::ThreadError;
use super::generate::{MAX_VERTICES, across};
use super::{Group, LineMesh};
use crate::Vec3;
use thiserror::Error;

/// Why a thread cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum StraightError {
    /// The length is zero, negative or not a number.
    #[error("thread: its length is {found:?} m, and must be positive and finite")]
    Length {
        /// The length (m).
        found: f64,
    },
    /// There are no segments.
    #[error("thread: it has 0 segments; at least one is needed")]
    NoSegments,
    /// There would be too many vertices.
    #[error(
        "thread: {segments} segments make {vertices} vertices; at most {MAX_VERTICES} are allowed"
    )]
    TooMany {
        /// The segments.
        segments: u32,
        /// The vertices that they would make.
        vertices: u64,
    },
    /// The result is no usable mesh: the thread is far too long, or its segments far too short.
    #[error("thread: {0}")]
    Mesh(#[from] ThreadError),
}

/// A straight thread along x, centred at the origin, of `length` (m) in `segments` lines of equal length.
///
/// Vertices are numbered along x. The vertex groups "left" and "right" hold the ends.
///
/// # Errors
/// [`StraightError`] for a length that is not positive, no segments, more than [`MAX_VERTICES`] vertices, or a mesh that
/// [`LineMesh::validate`] refuses.
pub fn straight_thread(length: f64, segments: u32) -> Result<LineMesh, StraightError> {
    if !(length > 0.0 && length.is_finite()) {
        return Err(StraightError::Length { found: length });
    }
    if segments == 0 {
        return Err(StraightError::NoSegments);
    }
    let vertices = u64::from(segments) + 1;
    if vertices > MAX_VERTICES {
        return Err(StraightError::TooMany { segments, vertices });
    }
    let positions = (0..=segments)
        .map(|i| Vec3::new(length * across(i, segments), 0.0, 0.0))
        .collect();
    let lines = (0..segments).map(|i| [i, i + 1]).collect();
    let mut mesh = LineMesh::new(positions, lines)?;
    mesh.vertex_groups = [("left", 0), ("right", segments)]
        .map(|(name, end): (&str, u32)| Group {
            name: name.to_owned(),
            members: vec![end],
        })
        .to_vec();
    Ok(mesh)
}
