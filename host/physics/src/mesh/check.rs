//! The checks of a triangle mesh, made before any computation uses the mesh.
//!
//! A mesh that fails a check would make the physics divide by zero, read out of bounds or give a vertex no
//! stiffness. The checks do not judge the quality of a mesh otherwise. A mesh may be coarse, curved, in several
//! pieces, or wound differently from triangle to triangle.

use super::PatternError;
use super::check_named::{check_fields, check_groups};
use super::{Adjacency, TriMesh};
use crate::Vec3;
use std::cmp::Ordering;
use thiserror::Error;

/// The largest magnitude of a coordinate (m). It keeps the squares of lengths far from overflow.
pub const MAX_COORDINATE: f64 = 1e9;
/// The ratio of a triangle's height to its longest edge below which the triangle counts as flat.
/// (An equilateral triangle has 0.87.) Rounding of the coordinates alone gives a far smaller ratio.
pub const MIN_HEIGHT_RATIO: f64 = 1e-6;
/// The ratio of a triangle's longest edge to the diagonal of the mesh's bounding box below which the coordinates
/// do not resolve the triangle.
pub const MIN_EDGE_RATIO: f64 = 1e-9;
/// The largest number of vertices and of triangles. Both are numbered by `u32`, and the last number is left free.
pub const MAX_COUNT: usize = u32::MAX as usize;

/// Why arrays of positions, triangles, groups and fields are no valid mesh.
///
/// Vertices and triangles are named by their index, from zero.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum MeshError {
    /// There is no triangle.
    #[error("the mesh has no triangles; at least one is needed")]
    Empty,
    /// There are more vertices or triangles than can be numbered.
    #[error("the mesh has {found} {entities}; at most {MAX_COUNT} are allowed")]
    TooMany {
        /// "vertices", "triangles" or "cells".
        entities: &'static str,
        /// The number found.
        found: usize,
    },
    /// A coordinate is not a number, infinite or far too large.
    #[error(
        "vertex {vertex}: {axis} is {found:?} m; coordinates must be finite and within ±{MAX_COORDINATE:e} m"
    )]
    Coordinate {
        /// The vertex.
        vertex: u32,
        /// "x", "y" or "z".
        axis: &'static str,
        /// The coordinate (m).
        found: f64,
    },
    /// A triangle names a vertex that does not exist.
    #[error(
        "triangle {triangle}: vertex {found} does not exist; the mesh has {vertices} vertices, counted from 0"
    )]
    Index {
        /// The triangle.
        triangle: u32,
        /// The vertex that it names.
        found: u32,
        /// The number of vertices of the mesh.
        vertices: usize,
    },
    /// A triangle names a vertex more than once.
    #[error("triangle {triangle}: vertex {vertex} is named twice; the three vertices must differ")]
    RepeatedVertex {
        /// The triangle.
        triangle: u32,
        /// The vertex that it names more than once.
        vertex: u32,
    },
    /// A triangle has no area, relative to its own size.
    #[error(
        "triangle {triangle} is flat: its height is {found:.3e} of its longest edge; \
         at least {MIN_HEIGHT_RATIO:e} is needed"
    )]
    Flat {
        /// The triangle.
        triangle: u32,
        /// The ratio of its height to its longest edge.
        found: f64,
    },
    /// A triangle is too small for the coordinates of the mesh to resolve it.
    #[error(
        "triangle {triangle}: its longest edge is {found:.3e} m; \
         in a mesh of this extent at least {least:.3e} m is needed"
    )]
    Tiny {
        /// The triangle.
        triangle: u32,
        /// Its longest edge (m).
        found: f64,
        /// The smallest length that is allowed (m).
        least: f64,
    },
    /// More than two triangles meet at an edge.
    #[error(
        "edge {a}-{b}: triangles {0}, {1} and {2} meet there; at most two triangles may share an edge",
        triangles[0], triangles[1], triangles[2]
    )]
    CrowdedEdge {
        /// The edge's lower vertex.
        a: u32,
        /// The edge's higher vertex.
        b: u32,
        /// The first three triangles there, ascending.
        triangles: [u32; 3],
    },
    /// Two triangles have the same three vertices.
    #[error("triangle {triangle} has the same three vertices as triangle {first}")]
    Duplicate {
        /// The later triangle.
        triangle: u32,
        /// The earlier triangle.
        first: u32,
    },
    /// A vertex belongs to no triangle.
    #[error("vertex {vertex} belongs to no triangle; remove this vertex")]
    Unused {
        /// The vertex.
        vertex: u32,
    },
    /// Two vertices have the same position.
    #[error(
        "vertices {first} and {vertex} lie at one place, where the mesh is not connected; merge the two vertices, \
         as mesh.merge of a scene does (a slit needs a gap)"
    )]
    Coincident {
        /// The later vertex.
        vertex: u32,
        /// The earlier vertex.
        first: u32,
    },
    /// A vertex lies on an edge that does not end there.
    #[error(
        "vertex {vertex} lies on edge {a}-{b}, where the mesh is not connected; divide the edge at the vertex, or mesh \
         again (a slit needs a gap)"
    )]
    Hanging {
        /// The vertex.
        vertex: u32,
        /// The edge's lower vertex.
        a: u32,
        /// The edge's higher vertex.
        b: u32,
    },
    /// A group's members are out of range, out of order or repeated.
    #[error(
        "group {name:?}: member number {position} is {found}; members must ascend and be below {count}"
    )]
    GroupMember {
        /// The group's name.
        name: String,
        /// The index in the list of members, from zero.
        position: usize,
        /// The member at that index.
        found: u32,
        /// The number of vertices, triangles or cells of the mesh.
        count: usize,
    },
    /// Two groups of the same kind have one name.
    #[error(
        "group {name:?}: two groups of the same kind have this name; each group needs its own name"
    )]
    GroupName {
        /// The name.
        name: String,
    },
    /// A field has more or fewer values than there are triangles or cells.
    #[error("field {name:?} has {found} values; {count} values are needed")]
    FieldLength {
        /// The field's name.
        name: String,
        /// The number of its values.
        found: usize,
        /// The number of triangles or cells of the mesh.
        count: usize,
    },
    /// A value of a field is not a number, or infinite.
    #[error("field {name:?}: value number {position} is {found:?}; every value must be finite")]
    FieldValue {
        /// The field's name.
        name: String,
        /// The index of the triangle or cell, from zero.
        position: usize,
        /// The value at that index.
        found: f64,
    },
    /// Two fields have one name.
    #[error("field {name:?}: two fields have this name; each field needs its own name")]
    FieldName {
        /// The name.
        name: String,
    },
    /// The flat pattern is wrong.
    #[error(transparent)]
    Pattern(#[from] PatternError),
}

/// The part of a mesh that an error refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Location {
    /// A vertex.
    Vertex(u32),
    /// A triangle, or a cell of a solid.
    Cell(u32),
    /// The mesh as a whole.
    Mesh,
}

impl MeshError {
    /// The part of the mesh that is at fault. Of several triangles or vertices it is the last.
    pub fn location(&self) -> Location {
        match *self {
            Self::Coordinate { vertex, .. }
            | Self::Unused { vertex }
            | Self::Coincident { vertex, .. }
            | Self::Hanging { vertex, .. } => Location::Vertex(vertex),
            Self::Index { triangle, .. }
            | Self::RepeatedVertex { triangle, .. }
            | Self::Flat { triangle, .. }
            | Self::Tiny { triangle, .. }
            | Self::Duplicate { triangle, .. }
            | Self::CrowdedEdge {
                triangles: [_, _, triangle],
                ..
            } => Location::Cell(triangle),
            Self::Pattern(ref error) => error.triangle().map_or(Location::Mesh, Location::Cell),
            Self::Empty
            | Self::TooMany { .. }
            | Self::GroupMember { .. }
            | Self::GroupName { .. }
            | Self::FieldLength { .. }
            | Self::FieldValue { .. }
            | Self::FieldName { .. } => Location::Mesh,
        }
    }
}

impl TriMesh {
    /// A mesh without groups from rest positions (m) and triangles.
    ///
    /// # Errors
    /// The first [`MeshError`] found.
    pub fn new(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        let mesh = Self {
            positions,
            triangles,
            ..Self::default()
        };
        mesh.validate()?;
        Ok(mesh)
    }

    /// Checks the whole mesh, groups and fields included.
    ///
    /// [`TriMesh::new`] calls this function. Call it again after a change of the public fields.
    ///
    /// # Errors
    /// The first [`MeshError`] found.
    pub fn validate(&self) -> Result<(), MeshError> {
        let vertices = self.positions.len();
        check_counts(vertices, ("triangles", self.triangles.len()))?;
        if self.triangles.is_empty() {
            return Err(MeshError::Empty);
        }
        check_coordinates(&self.positions)?;
        check_indices(self)?;
        check_shapes(self)?;
        let adjacency = Adjacency::new(&self.triangles)?;
        check_duplicates(&adjacency)?;
        if let Some(vertex) = unused(vertices, self.triangles.as_flattened().iter()) {
            return Err(MeshError::Unused { vertex });
        }
        if let Some(pattern) = &self.flat_pattern {
            pattern.check(&self.triangles, &adjacency)?;
        }
        check_groups(&self.vertex_groups, vertices)?;
        check_groups(&self.triangle_groups, self.triangles.len())?;
        check_fields(&self.triangle_fields, self.triangles.len())
    }
}

/// Checks that vertices and elements (triangles, cells or lines), by their number, can be numbered.
pub(super) fn check_counts(
    vertices: usize,
    (entities, elements): (&'static str, usize),
) -> Result<(), MeshError> {
    for (entities, found) in [("vertices", vertices), (entities, elements)] {
        if found > MAX_COUNT {
            return Err(MeshError::TooMany { entities, found });
        }
    }
    Ok(())
}

pub(super) fn check_coordinates(positions: &[Vec3]) -> Result<(), MeshError> {
    for (vertex, position) in (0_u32..).zip(positions) {
        for (axis, &found) in ["x", "y", "z"].into_iter().zip(position.iter()) {
            // A coordinate that is not a number fails every comparison, and so this one.
            if !(-MAX_COORDINATE..=MAX_COORDINATE).contains(&found) {
                return Err(MeshError::Coordinate {
                    vertex,
                    axis,
                    found,
                });
            }
        }
    }
    Ok(())
}

fn check_indices(mesh: &TriMesh) -> Result<(), MeshError> {
    let vertices = mesh.positions.len();
    for (triangle, &[a, b, c]) in (0_u32..).zip(&mesh.triangles) {
        if let Some(found) = [a, b, c].into_iter().find(|&v| v as usize >= vertices) {
            return Err(MeshError::Index {
                triangle,
                found,
                vertices,
            });
        }
        if a == b || a == c {
            return Err(MeshError::RepeatedVertex {
                triangle,
                vertex: a,
            });
        }
        if b == c {
            return Err(MeshError::RepeatedVertex {
                triangle,
                vertex: b,
            });
        }
    }
    Ok(())
}

fn check_shapes(mesh: &TriMesh) -> Result<(), MeshError> {
    let diagonal = mesh.bounds().map_or(0.0, |bounds| bounds.size().norm());
    let least = MIN_EDGE_RATIO * diagonal;
    for triangle in (0_u32..).take(mesh.triangles.len()) {
        let Some([a, b, c]) = mesh.corners(triangle) else {
            continue;
        };
        let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
        let height = if longest > 0.0 {
            (b - a).cross(&(c - a)).norm() / longest
        } else {
            0.0
        };
        if height <= MIN_HEIGHT_RATIO * longest {
            let found = if longest > 0.0 { height / longest } else { 0.0 };
            return Err(MeshError::Flat { triangle, found });
        }
        if longest < least {
            return Err(MeshError::Tiny {
                triangle,
                found: longest,
                least,
            });
        }
    }
    Ok(())
}

/// Checks that no two triangles have the same vertices. Such triangles would share three edges, and each of these
/// edges would have the same opposite vertex on both sides.
fn check_duplicates(adjacency: &Adjacency) -> Result<(), MeshError> {
    match adjacency
        .interior
        .iter()
        .find(|edge| edge.opposite[0] == edge.opposite[1])
    {
        Some(edge) => Err(MeshError::Duplicate {
            triangle: edge.triangles[1],
            first: edge.triangles[0],
        }),
        None => Ok(()),
    }
}

/// The first of `vertices` vertices that is not `named` by an element.
pub(super) fn unused<'a>(vertices: usize, named: impl Iterator<Item = &'a u32>) -> Option<u32> {
    let mut used = vec![false; vertices];
    for &vertex in named {
        used[vertex as usize] = true;
    }
    let unused = used.iter().position(|used| !used);
    unused.map(|vertex| vertex as u32)
}

/// Checks that no two vertices have exactly the same position (m).
///
/// Only meshes from files are checked for this. Many programs give every triangle its own three vertices, and
/// such a mesh would consist of loose triangles. A mesh that was torn may have coincident vertices.
///
/// # Errors
/// [`MeshError::Coincident`] with the first vertex that has the position of an earlier vertex.
pub fn check_distinct(positions: &[Vec3]) -> Result<(), MeshError> {
    // Adding zero turns the negative zero into the positive one.
    let place = |vertex: u32| {
        positions
            .get(vertex as usize)
            .map(|p| [p.x + 0.0, p.y + 0.0, p.z + 0.0])
    };
    let order = |a: &u32, b: &u32| {
        let (p, q) = (place(*a).unwrap_or_default(), place(*b).unwrap_or_default());
        let by_place = p.iter().zip(&q).map(|(p, q)| p.total_cmp(q));
        by_place.fold(Ordering::Equal, Ordering::then)
    };
    let mut vertices: Vec<u32> = (0_u32..).take(positions.len()).collect();
    vertices.sort_unstable_by(|a, b| order(a, b).then(a.cmp(b)));
    let pairs = vertices.windows(2).filter_map(|pair| match *pair {
        [first, vertex] if order(&first, &vertex) == Ordering::Equal => Some((vertex, first)),
        _ => None,
    });
    match pairs.min() {
        Some((vertex, first)) => Err(MeshError::Coincident { vertex, first }),
        None => Ok(()),
    }
}
