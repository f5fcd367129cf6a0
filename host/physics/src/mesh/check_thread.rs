//! The checks of a mesh of lines, made before any computation uses the mesh.
//!
//! They correspond to the checks of a sheet (see [`check`](super::check)). A mesh that fails a check would make the physics
//! divide by zero, read out of bounds or give a vertex no stiffness.

use super::check::{Location, MIN_EDGE_RATIO, check_coordinates, check_counts, unused};
use super::check_named::{check_fields, check_groups};
use super::{LineMesh, MeshError};
use crate::Vec3;
use thiserror::Error;

/// Why arrays of positions, lines, groups and fields are no mesh.
///
/// Vertices and lines are named by their index, from zero.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ThreadError {
    /// A check that all meshes have in common: coordinates, vertices at one place, groups, fields.
    #[error(transparent)]
    Common(#[from] MeshError),
    /// There is no line.
    #[error("the mesh has no lines; at least one is needed")]
    Empty,
    /// A line names a vertex that does not exist.
    #[error(
        "line {line}: vertex {found} does not exist; the mesh has {vertices} vertices, counted from 0"
    )]
    Index {
        /// The line.
        line: u32,
        /// The vertex that it names.
        found: u32,
        /// The number of vertices of the mesh.
        vertices: usize,
    },
    /// A line names a vertex twice.
    #[error("line {line}: vertex {vertex} is named twice; the two ends must differ")]
    RepeatedVertex {
        /// The line.
        line: u32,
        /// The vertex that it names twice.
        vertex: u32,
    },
    /// A line has no length, or is too short to be resolved by the coordinates of its mesh.
    #[error(
        "line {line} is {found:.3e} m long; in a mesh of this extent more than {least:.3e} m is needed"
    )]
    Short {
        /// The line.
        line: u32,
        /// Its length (m).
        found: f64,
        /// The length that it must exceed (m).
        least: f64,
    },
    /// Two lines have the same ends.
    #[error("line {line} has the same ends as line {first}")]
    Duplicate {
        /// The later line.
        line: u32,
        /// The earlier one.
        first: u32,
    },
    /// A vertex belongs to no line.
    #[error("vertex {vertex} belongs to no line; remove this vertex")]
    Unused {
        /// The vertex.
        vertex: u32,
    },
}

impl ThreadError {
    /// The place of the fault: of several lines or vertices, the last.
    pub fn location(&self) -> Location {
        match *self {
            Self::Common(ref error) => error.location(),
            Self::Unused { vertex } => Location::Vertex(vertex),
            Self::Index { line, .. }
            | Self::RepeatedVertex { line, .. }
            | Self::Short { line, .. }
            | Self::Duplicate { line, .. } => Location::Cell(line),
            Self::Empty => Location::Mesh,
        }
    }
}

impl LineMesh {
    /// A mesh without groups and fields from rest positions (m) and lines.
    ///
    /// # Errors
    /// The first [`ThreadError`] found.
    pub fn new(positions: Vec<Vec3>, lines: Vec<[u32; 2]>) -> Result<Self, ThreadError> {
        let mesh = Self {
            positions,
            lines,
            ..Self::default()
        };
        mesh.validate()?;
        Ok(mesh)
    }

    /// Checks the whole mesh, groups and fields included. For a mesh that was changed through its public fields.
    ///
    /// # Errors
    /// The first [`ThreadError`] found.
    pub fn validate(&self) -> Result<(), ThreadError> {
        let vertices = self.positions.len();
        check_counts(vertices, ("lines", self.lines.len()))?;
        if self.lines.is_empty() {
            return Err(ThreadError::Empty);
        }
        check_coordinates(&self.positions)?;
        check_ends(self)?;
        check_lengths(self)?;
        check_duplicates(&self.lines)?;
        if let Some(vertex) = unused(vertices, self.lines.as_flattened().iter()) {
            return Err(ThreadError::Unused { vertex });
        }
        check_groups(&self.vertex_groups, vertices)?;
        check_groups(&self.line_groups, self.lines.len())?;
        Ok(check_fields(&self.line_fields, self.lines.len())?)
    }
}

fn check_ends(mesh: &LineMesh) -> Result<(), ThreadError> {
    let vertices = mesh.positions.len();
    for (line, &[a, b]) in (0_u32..).zip(&mesh.lines) {
        if let Some(found) = [a, b].into_iter().find(|&v| v as usize >= vertices) {
            return Err(ThreadError::Index {
                line,
                found,
                vertices,
            });
        }
        if a == b {
            return Err(ThreadError::RepeatedVertex { line, vertex: a });
        }
    }
    Ok(())
}

fn check_lengths(mesh: &LineMesh) -> Result<(), ThreadError> {
    let diagonal = mesh.bounds().map_or(0.0, |bounds| bounds.size().norm());
    let least = MIN_EDGE_RATIO * diagonal;
    for (line, &[a, b]) in (0_u32..).zip(&mesh.lines) {
        let at = |vertex: u32| -> &Vec3 { &mesh.positions[vertex as usize] };
        let found = (at(b) - at(a)).norm();
        if found <= least {
            return Err(ThreadError::Short { line, found, least });
        }
    }
    Ok(())
}

fn check_duplicates(lines: &[[u32; 2]]) -> Result<(), ThreadError> {
    let mut numbered: Vec<([u32; 2], u32)> = lines
        .iter()
        .zip(0_u32..)
        .map(|(&[a, b], line)| ([a.min(b), a.max(b)], line))
        .collect();
    numbered.sort_unstable();
    let pairs = numbered.windows(2).filter_map(|pair| match *pair {
        [(ends, first), (other, line)] => (ends == other).then_some((line, first)),
        _ => None,
    });
    match pairs.min() {
        Some((line, first)) => Err(ThreadError::Duplicate { line, first }),
        None => Ok(()),
    }
}
