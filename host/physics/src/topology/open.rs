//! Opening an edge: the triangles at it are no neighbours any more, and each of its ends that has two fans is doubled.

use super::NONE;
use super::edit::{EditError, Opened};
use super::surface::{Origin, Surface, length, minus};

impl Surface {
    /// Opens the edge from `tip` to `to`. `slit` allows an edge inside the surface, which leaves the surface consistent
    /// only once a second edge at one of its ends is opened.
    pub(super) fn open(&mut self, tip: u32, to: u32, slit: bool) -> Result<Opened, EditError> {
        let [left, right] = self.edge_between(tip, to);
        match [left, right] {
            [NONE, NONE] => return Err(EditError::NoEdge { a: tip, b: to }),
            [NONE, _] | [_, NONE] => return Err(EditError::Border { a: tip, b: to }),
            _ => {}
        }
        if !slit && !self.on_border(tip) && !self.on_border(to) {
            return Err(EditError::Inside { a: tip, b: to });
        }
        for (triangle, other) in [(left, right), (right, left)] {
            self.touch(triangle);
            if let Some(corner) = self.across(triangle, [tip, to]) {
                debug_assert_eq!(self.neighbours[triangle as usize][corner], other);
                self.neighbours[triangle as usize][corner] = NONE;
            }
        }
        let length = self.edge_length(left, [tip, to]);
        let tip_left = self.separate(tip, left, right)?;
        let to_left = self.separate(to, left, right)?;
        Ok(Opened {
            right: [tip, to],
            left: [tip_left, to_left],
            length,
        })
    }

    /// Doubles a vertex if its fan no longer leads from the triangle `left` to `right`. Returns the vertex at `left`.
    fn separate(&mut self, vertex: u32, left: u32, right: u32) -> Result<u32, EditError> {
        let begin = self.first_from(vertex, left);
        let mut at = begin;
        while let Some(corner) = self.corner(at, vertex) {
            if at == right {
                self.begin_fan(vertex, left);
                return Ok(vertex);
            }
            at = self.after(corner);
        }
        if self.vertex_count() >= self.limits.vertices {
            return Err(EditError::Full { what: "vertices" });
        }
        let twin = self.vertex_count() as u32;
        self.origins.push(Origin::Twin { of: vertex });
        self.first.push(begin);
        let mut at = begin;
        while let Some(corner) = self.corner(at, vertex) {
            self.touch(at);
            let next = self.after(corner);
            self.triangles[at as usize][corner.corner] = twin;
            at = next;
        }
        self.begin_fan(vertex, right);
        Ok(twin)
    }

    /// The corner of a triangle opposite to the edge between two vertices.
    pub(super) fn across(&self, triangle: u32, ends: [u32; 2]) -> Option<usize> {
        let corners = self.triangles.get(triangle as usize)?;
        let held = ends.iter().all(|end| corners.contains(end));
        let apex = corners.iter().position(|corner| !ends.contains(corner));
        apex.filter(|_| held)
    }

    /// The length at rest of an edge of a triangle (m).
    fn edge_length(&self, triangle: u32, ends: [u32; 2]) -> f64 {
        let shape = self.shape(triangle);
        self.across(triangle, ends).map_or(0.0, |apex| {
            length(minus(shape[(apex + 1) % 3], shape[(apex + 2) % 3]))
        })
    }
}
