//! The surfaces that may touch, in one numbering: triangles and edges over vertices, by part.
//!
//! A **part** is the surface of one body or of one obstacle. A sheet has its triangles, with half its thickness as
//! radius; a solid has the triangles of its boundary, with a radius of zero or of a stated skin; a thread has its lines.
//! An edge without a triangle is a segment of a thread. The distance at which two parts touch is the sum of their radii.

use super::faces::Twins;
use super::obstacle::ClosedMesh;
use crate::Vec3;
use crate::mesh::{Adjacency, Mesh, MeshError};
use core::ops::Range;
use std::collections::BTreeSet;

/// The angle (rad) between two triangles up to which they are one plane. A segment of 10 mm across their edge sinks by a
/// quarter of a micrometre.
const FLAT: f64 = 1e-4;

/// A part of the surfaces.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Its vertices.
    pub vertices: Range<u32>,
    /// Its triangles.
    pub triangles: Range<u32>,
    /// Its edges.
    pub edges: Range<u32>,
    /// The distance between its surface and its vertices, edges and triangles (m): half the thickness of a sheet.
    pub radius: f64,
    /// The distance at which it touches itself (m).
    pub thickness: f64,
    /// Whether it may touch itself.
    pub touches_itself: bool,
    /// Whether it is an obstacle. Two obstacles do not touch each other.
    pub is_obstacle: bool,
    /// Whether it tears.
    pub tears: bool,
    /// Whether it is the surface of a solid, with its triangles counterclockwise seen from outside.
    pub is_solid: bool,
}

/// The surfaces that may touch.
#[derive(Clone, Debug, Default)]
pub struct Surfaces {
    /// Number of vertices.
    pub vertices: usize,
    /// Vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Vertices of each edge, ascending.
    pub edges: Vec<[u32; 2]>,
    /// Of each edge, the third vertices of the triangles to the left and to the right of it; a vertex of the edge where there
    /// is no triangle.
    pub opposite: Vec<[u32; 2]>,
    /// The parts, in the order in which they were added.
    pub parts: Vec<Part>,
    /// The area of the surface at rest around each vertex (m²), of a thread by the radius of its skin; infinite for obstacles.
    pub areas: Vec<f64>,
    /// Vertices and edges of rigid parts where no contact has its foot: see [`is_rigid`](Self::is_rigid).
    pub(super) flat_vertices: Vec<bool>,
    pub(super) flat_edges: Vec<bool>,
    /// Positions at rest (m), by vertex; empty if no part tears.
    pub rest: Vec<Vec3>,
    /// The twins of parts that tear, ascending.
    pub(super) twins: Vec<Twins>,
    /// Pairs of parts that do not touch, the smaller number first.
    apart: BTreeSet<[usize; 2]>,
}

/// Most triangles, and most edges, of a [`Fan`].
const MOST_OF_FAN: usize = 32;

/// The numbers of the triangles and the edges at a vertex.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fan {
    pub(crate) triangles: heapless::Vec<u32, MOST_OF_FAN>,
    pub(crate) edges: heapless::Vec<u32, MOST_OF_FAN>,
}

/// How a part takes part in contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Skin {
    /// See [`Part::radius`] (m).
    pub radius: f64,
    /// See [`Part::touches_itself`].
    pub touches_itself: bool,
    /// See [`Part::is_obstacle`].
    pub is_obstacle: bool,
}

impl Surfaces {
    /// Adds the surface of a mesh. Its vertices are all vertices of the mesh in their order, so that a solid's vertices
    /// inside have a number, but no triangle. Returns the number of the part.
    ///
    /// # Errors
    /// [`MeshError`] if triangles share an edge in a way that no surface does.
    pub fn add(&mut self, mesh: &Mesh, skin: Skin) -> Result<usize, MeshError> {
        let positions = mesh.positions();
        match mesh {
            Mesh::Thread(mesh) => {
                let edges = mesh.lines.iter().map(|[a, b]| [*a.min(b), *a.max(b)]);
                Ok(self.push(positions, &[], edges.map(|ends| (ends, ends)), skin))
            }
            Mesh::Sheet(mesh) => self.add_triangles(positions, &mesh.triangles, skin),
            Mesh::Solid(mesh) => {
                let part = self.add_triangles(positions, &mesh.boundary(), skin)?;
                self.parts[part].is_solid = true;
                Ok(part)
            }
        }
    }

    /// Adds the surface of a closed mesh. Returns the number of the part.
    ///
    /// # Errors
    /// As [`add`](Self::add).
    pub fn add_closed(&mut self, mesh: &ClosedMesh, skin: Skin) -> Result<usize, MeshError> {
        self.add_triangles(mesh.positions(), mesh.triangles(), skin)
    }

    fn add_triangles(
        &mut self,
        positions: &[Vec3],
        triangles: &[[u32; 3]],
        skin: Skin,
    ) -> Result<usize, MeshError> {
        let adjacency = Adjacency::new(triangles)?;
        let interior = adjacency.interior.iter().map(|edge| {
            let [first, second] = edge.opposite;
            let [a, b, c] = triangles[edge.triangles[0] as usize];
            let is_left = [[a, b], [b, c], [c, a]].contains(&edge.vertices);
            let opposite = if is_left {
                [first, second]
            } else {
                [second, first]
            };
            (edge.vertices, opposite)
        });
        let border = adjacency.boundary.iter();
        let border = border.map(|edge| (edge.vertices, [edge.opposite, edge.vertices[0]]));
        Ok(self.push(positions, triangles, interior.chain(border), skin))
    }

    fn push(
        &mut self,
        positions: &[Vec3],
        triangles: &[[u32; 3]],
        edges: impl Iterator<Item = ([u32; 2], [u32; 2])>,
        skin: Skin,
    ) -> usize {
        let count = |number: usize| u32::try_from(number).unwrap_or(u32::MAX);
        let first = count(self.vertices);
        let (triangle, edge) = (count(self.triangles.len()), count(self.edges.len()));
        let moved = triangles.iter().map(|corners| corners.map(|v| v + first));
        self.triangles.extend(moved);
        for (ends, opposite) in edges {
            let [a, b] = ends.map(|v| v + first);
            self.edges.push([a, b]);
            self.opposite.push(opposite.map(|v| v + first));
        }
        self.vertices += positions.len();
        self.flat_vertices.resize(self.vertices, false);
        self.flat_edges.resize(self.edges.len(), false);
        self.parts.push(Part {
            vertices: first..count(self.vertices),
            triangles: triangle..count(self.triangles.len()),
            edges: edge..count(self.edges.len()),
            radius: skin.radius,
            thickness: 2.0 * skin.radius,
            touches_itself: skin.touches_itself,
            is_obstacle: skin.is_obstacle,
            tears: false,
            is_solid: false,
        });
        let part = self.parts.len() - 1;
        self.measure(part, positions);
        part
    }

    /// Measures the areas of a part with these positions (m).
    fn measure(&mut self, part: usize, positions: &[Vec3]) {
        let Part {
            vertices,
            triangles,
            edges,
            radius,
            is_obstacle,
            ..
        } = self.parts[part].clone();
        let least = if is_obstacle { f64::INFINITY } else { 0.0 };
        self.areas.resize(self.vertices, least);
        let at = |vertex: u32| positions[(vertex - vertices.start) as usize];
        let triangles = &self.triangles[triangles.start as usize..triangles.end as usize];
        for corners in triangles {
            let [a, b, c] = corners.map(at);
            let third = (b - a).cross(&(c - a)).norm() / 6.0;
            for vertex in corners {
                self.areas[*vertex as usize] += third;
            }
        }
        let is_thread = triangles.is_empty();
        for ends in &self.edges[edges.start as usize..edges.end as usize] {
            let [a, b] = ends.map(at);
            for vertex in ends.iter().filter(|_| is_thread) {
                self.areas[*vertex as usize] += radius * (b - a).norm();
            }
        }
    }

    /// Notes that a part tears. Its vertices have these positions at rest (m).
    pub fn tears(&mut self, part: usize, rest: &[Vec3]) {
        self.parts[part].tears = true;
        let first = self.parts[part].vertices.start as usize;
        self.rest.resize(self.vertices, Vec3::zeros());
        for (to, from) in self.rest[first..].iter_mut().zip(rest) {
            *to = *from;
        }
        self.find_twins(part);
    }

    /// Notes that a part keeps its shape, with its vertices at these positions (m) and its triangles counterclockwise seen from
    /// outside. An edge at which the surface is flat or concave touches no other edge: a segment is nearest to a plane at one of
    /// its ends, where a vertex has a row. The same holds for a vertex of such edges alone.
    ///
    /// # Errors
    /// [`MeshError`] if the triangles are no surface.
    pub fn is_rigid(&mut self, part: usize, positions: &[Vec3]) -> Result<(), MeshError> {
        let Part {
            vertices,
            triangles,
            edges,
            ..
        } = self.parts[part].clone();
        let at = |vertex: u32| positions[(vertex - vertices.start) as usize];
        let corners = &self.triangles[triangles.start as usize..triangles.end as usize];
        let adjacency = Adjacency::new(corners)?;
        let range = vertices.start as usize..vertices.end as usize;
        self.flat_vertices[range.clone()].fill(true);
        for edge in &adjacency.boundary {
            for vertex in edge.vertices {
                self.flat_vertices[vertex as usize] = false;
            }
        }
        // The edges have been added in the order of the adjacency, those between two triangles first.
        let flat_edges = &mut self.flat_edges[edges.start as usize..edges.end as usize];
        for (edge, is_flat) in adjacency.interior.iter().zip(flat_edges) {
            let [a, b, c] = corners[edge.triangles[0] as usize].map(at);
            let normal = (b - a).cross(&(c - a)).normalize();
            let [from, to] = edge.vertices.map(at);
            let beyond = at(edge.opposite[1]) - from;
            let along = (to - from).normalize();
            let height = (beyond - along * along.dot(&beyond)).norm();
            // The sine of the angle by which the second triangle falls away from the first one.
            *is_flat = normal.dot(&beyond) > -FLAT * height;
            if !*is_flat {
                for vertex in edge.vertices {
                    self.flat_vertices[vertex as usize] = false;
                }
            }
        }
        Ok(())
    }

    /// What is at a vertex of a part; `None` if there is no room for it. The work grows with the size of the part.
    pub(crate) fn fan(&self, part: &Part, vertex: u32) -> Option<Fan> {
        let mut fan = Fan::default();
        for triangle in part.triangles.clone() {
            if self.triangles[triangle as usize].contains(&vertex) {
                fan.triangles.push(triangle).ok()?;
            }
        }
        for edge in part.edges.clone() {
            if self.edges[edge as usize].contains(&vertex) {
                fan.edges.push(edge).ok()?;
            }
        }
        Some(fan)
    }

    /// The part of a vertex.
    pub fn part_of(&self, vertex: u32) -> usize {
        let after = self
            .parts
            .partition_point(|part| part.vertices.start <= vertex);
        after.saturating_sub(1)
    }

    /// Whether two parts may touch each other.
    pub fn may_touch(&self, one: usize, other: usize) -> bool {
        let (first, second) = (&self.parts[one], &self.parts[other]);
        if one == other {
            first.touches_itself
        } else {
            let is_apart = self.apart.contains(&[one.min(other), one.max(other)]);
            !(is_apart || first.is_obstacle && second.is_obstacle)
        }
    }

    /// Keeps two parts from touching each other.
    pub fn keep_apart(&mut self, one: usize, other: usize) {
        self.apart.insert([one.min(other), one.max(other)]);
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::mesh::TriMesh;

    /// A roof over two squares, `height` (m) high at its ridge between vertices 1 and 4, and the positions of its vertices.
    pub(in crate::contact) fn roof(height: f64) -> (Surfaces, Vec<Vec3>) {
        let at = |x: f64, y: f64, z: f64| Vec3::new(x, y, z);
        let positions = vec![
            at(0.0, 0.0, 0.0),
            at(0.01, 0.0, height),
            at(0.02, 0.0, 0.0),
            at(0.0, 0.01, 0.0),
            at(0.01, 0.01, height),
            at(0.02, 0.01, 0.0),
        ];
        let triangles = vec![[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]];
        let mut surfaces = Surfaces::default();
        let skin = Skin {
            radius: 0.0,
            touches_itself: false,
            is_obstacle: true,
        };
        let mesh = TriMesh::new(positions.clone(), triangles).expect("a surface");
        surfaces.add(&Mesh::Sheet(mesh), skin).expect("a surface");
        (surfaces, positions)
    }

    /// A roof that keeps its shape, with its flags.
    fn rigid_roof(height: f64) -> Surfaces {
        let (mut surfaces, positions) = roof(height);
        surfaces.is_rigid(0, &positions).expect("a surface");
        surfaces
    }

    #[test]
    fn a_ridge_holds_edges_and_a_plane_or_a_valley_does_not() {
        let flat = |height: f64| {
            let surfaces = rigid_roof(height);
            let edges = surfaces.edges.iter().zip(&surfaces.flat_edges);
            let flat = edges.filter(|(_, is_flat)| **is_flat);
            flat.map(|(edge, _)| *edge).collect::<Vec<_>>()
        };
        // The diagonals are flat, the border is not.
        assert_eq!(flat(1e-3), [[0, 4], [1, 5]]);
        assert_eq!(flat(0.0), [[0, 4], [1, 4], [1, 5]]);
        assert_eq!(flat(-1e-3), [[0, 4], [1, 4], [1, 5]]);
        assert_eq!(rigid_roof(0.0).flat_vertices, [false; 6]);
    }
}
