//! The fan of a vertex: the triangles about it, one after another.

use super::NONE;
use super::surface::Surface;

/// A triangle at a vertex, as a fan passes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corner {
    /// The triangle.
    pub triangle: u32,
    /// Which of its three corners is at the vertex.
    pub corner: usize,
    /// The far end of the edge through which the fan enters the triangle.
    pub from: u32,
    /// The far end of the edge through which the fan leaves the triangle.
    pub to: u32,
}

/// The triangles about a vertex, counterclockwise. An open fan begins at the border, on the right of one who looks
/// from the vertex into the surface.
#[derive(Clone, Debug)]
pub struct Fan<'a> {
    surface: &'a Surface,
    vertex: u32,
    begin: u32,
    next: u32,
}

impl Iterator for Fan<'_> {
    type Item = Corner;

    fn next(&mut self) -> Option<Corner> {
        let corner = self.surface.corner(self.next, self.vertex)?;
        let after = self.surface.neighbours[self.next as usize][(corner.corner + 1) % 3];
        self.next = if after == self.begin { NONE } else { after };
        Some(corner)
    }
}

impl Surface {
    /// The triangles about a vertex, counterclockwise. Empty for a vertex of no triangle.
    pub fn fan(&self, vertex: u32) -> Fan<'_> {
        let begin = self.first.get(vertex as usize).copied().unwrap_or(NONE);
        Fan {
            surface: self,
            vertex,
            begin,
            next: begin,
        }
    }

    /// Whether a vertex is on a border. The two faces of a tear are borders, and so is a tip.
    pub fn on_border(&self, vertex: u32) -> bool {
        let begin = self.first.get(vertex as usize).copied().unwrap_or(NONE);
        self.corner(begin, vertex)
            .is_some_and(|corner| self.before(corner) == NONE)
    }

    /// The two triangles at the edge from `a` to `b`: the triangle on the left and the triangle on the right of one who
    /// walks from `a` to `b`. [`NONE`] stands for the outside, or for both if there is no such edge.
    pub fn edge_between(&self, a: u32, b: u32) -> [u32; 2] {
        for corner in self.fan(a) {
            if corner.from == b {
                return [corner.triangle, self.before(corner)];
            }
            if corner.to == b {
                return [self.after(corner), corner.triangle];
            }
        }
        [NONE; 2]
    }

    /// The corner of a triangle at a vertex.
    pub(super) fn corner(&self, triangle: u32, vertex: u32) -> Option<Corner> {
        let corners = self.triangles.get(triangle as usize)?;
        let corner = corners.iter().position(|&found| found == vertex)?;
        Some(Corner {
            triangle,
            corner,
            from: corners[(corner + 1) % 3],
            to: corners[(corner + 2) % 3],
        })
    }

    /// The triangle before a corner, clockwise.
    pub(super) fn before(&self, corner: Corner) -> u32 {
        self.neighbours[corner.triangle as usize][(corner.corner + 2) % 3]
    }

    /// The triangle after a corner, counterclockwise.
    pub(super) fn after(&self, corner: Corner) -> u32 {
        self.neighbours[corner.triangle as usize][(corner.corner + 1) % 3]
    }

    /// The first triangle of the fan that contains `triangle`: at the border, or `triangle` itself if the fan closes.
    pub(super) fn first_from(&self, vertex: u32, triangle: u32) -> u32 {
        let mut at = triangle;
        while let Some(corner) = self.corner(at, vertex) {
            match self.before(corner) {
                NONE => return at,
                before if before == triangle => return triangle,
                before => at = before,
            }
        }
        at
    }
}
