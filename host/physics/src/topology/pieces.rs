//! The connected parts of a surface.

use super::NONE;
use super::surface::{Reserve, Surface, copied};

/// The pieces of a surface: the triangles that are connected by edges. Pieces are numbered in the order of their first
/// triangles, so they are counted from zero and the first triangle of the surface is in piece 0.
#[derive(Debug)]
pub struct Pieces {
    of_triangle: Vec<u32>,
    of_vertex: Vec<u32>,
    /// Triangles whose neighbours are still to be visited.
    pending: Vec<u32>,
    count: usize,
    limits: Reserve,
}

impl Clone for Pieces {
    /// The copy has the whole room, too.
    fn clone(&self) -> Self {
        Self {
            of_triangle: copied(&self.of_triangle, self.limits.triangles),
            of_vertex: copied(&self.of_vertex, self.limits.vertices),
            pending: Vec::with_capacity(self.limits.triangles),
            count: self.count,
            limits: self.limits,
        }
    }
}

impl Pieces {
    /// The pieces of a surface, with room for all that its edits can add.
    pub fn new(surface: &Surface) -> Self {
        let limits = surface.limits();
        let mut pieces = Self {
            of_triangle: Vec::with_capacity(limits.triangles),
            of_vertex: Vec::with_capacity(limits.vertices),
            pending: Vec::with_capacity(limits.triangles),
            count: 0,
            limits,
        };
        pieces.find(surface);
        pieces
    }

    /// Finds the pieces anew, in a time proportional to the number of triangles. Does not allocate for the surface for
    /// which the pieces were made.
    pub fn find(&mut self, surface: &Surface) {
        self.of_triangle.clear();
        self.of_triangle.resize(surface.triangle_count(), NONE);
        self.of_vertex.clear();
        self.of_vertex.resize(surface.vertex_count(), NONE);
        self.count = 0;
        for begin in 0..surface.triangle_count() {
            if self.of_triangle[begin] != NONE {
                continue;
            }
            let piece = self.count as u32;
            self.count += 1;
            self.of_triangle[begin] = piece;
            self.pending.push(begin as u32);
            while let Some(triangle) = self.pending.pop() {
                for neighbour in surface.neighbours()[triangle as usize] {
                    if neighbour != NONE && self.of_triangle[neighbour as usize] == NONE {
                        self.of_triangle[neighbour as usize] = piece;
                        self.pending.push(neighbour);
                    }
                }
            }
        }
        for (corners, &piece) in surface.triangles().iter().zip(&self.of_triangle) {
            for &vertex in corners {
                self.of_vertex[vertex as usize] = piece;
            }
        }
    }

    /// The number of pieces.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The piece of a triangle, or [`NONE`] if there is no such triangle.
    pub fn of_triangle(&self, triangle: u32) -> u32 {
        let found = self.of_triangle.get(triangle as usize);
        found.copied().unwrap_or(NONE)
    }

    /// The vertices of a piece.
    pub fn vertices(&self, piece: u32) -> impl Iterator<Item = u32> + Clone + '_ {
        let all = (0_u32..).zip(&self.of_vertex);
        all.filter(move |(_, of)| **of == piece)
            .map(|(vertex, _)| vertex)
    }

    /// The piece of a vertex, or [`NONE`] for a vertex of no triangle.
    pub fn of_vertex(&self, vertex: u32) -> u32 {
        let found = self.of_vertex.get(vertex as usize);
        found.copied().unwrap_or(NONE)
    }
}
