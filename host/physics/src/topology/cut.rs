//! Cutting an edge: a new vertex divides the edge, and each of its triangles into two.

use super::NONE;
use super::edit::EditError;
use super::surface::{Origin, Surface, between, smallest_angle};

/// No part of a divided triangle may have a smaller angle at rest (rad): 3 degrees.
pub(super) const THINNEST: f64 = 0.052_359_877_559_829_88;

impl Surface {
    /// Divides the edge opposite to the tip. Returns the new vertex, which an edge joins to the tip.
    pub(super) fn cut(&mut self, tip: u32, edge: [u32; 2], at: f64) -> Result<u32, EditError> {
        let [triangle, across] = self.check_cut(tip, edge, at, THINNEST)?;
        let count = if across == NONE { 1 } else { 2 };
        if self.triangle_count() + count > self.limits.triangles {
            return Err(EditError::Full { what: "triangles" });
        }
        if self.vertex_count() >= self.limits.vertices {
            return Err(EditError::Full { what: "vertices" });
        }
        let vertex = self.vertex_count() as u32;
        self.origins.push(Origin::Between {
            ends: edge,
            weight: at,
        });
        self.first.push(NONE);
        let new = self.divide(triangle, edge, vertex, at);
        if across != NONE {
            let other = self.divide(across, edge, vertex, at);
            for (part, neighbour) in [(new, other), (other, new)] {
                if let Some(corner) = self.across(part, [vertex, edge[1]]) {
                    self.neighbours[part as usize][corner] = neighbour;
                }
            }
        }
        // The parts without a number of their own keep the first end of the edge, and the new parts have the second.
        for part in [triangle, across, new] {
            if part != NONE {
                for corner in self.triangles[part as usize] {
                    self.begin_fan(corner, part);
                }
            }
        }
        Ok(vertex)
    }

    /// The triangle at the tip that a cut divides, and the triangle across the edge or `NONE`.
    pub(super) fn check_cut(
        &self,
        tip: u32,
        edge: [u32; 2],
        at: f64,
        thinnest: f64,
    ) -> Result<[u32; 2], EditError> {
        let [a, b] = edge;
        let mut pair = self.edge_between(a, b);
        if self.corner(pair[0], tip).is_none() {
            pair.swap(0, 1);
        }
        if tip == a || tip == b || self.corner(pair[0], tip).is_none() {
            return Err(EditError::Opposite { tip, a, b });
        }
        if !(at > 0.0 && at < 1.0) {
            return Err(EditError::At { found: at });
        }
        for triangle in pair {
            if triangle != NONE && self.thinnest_part(triangle, edge, at) < thinnest {
                return Err(EditError::Thin { triangle });
            }
        }
        Ok(pair)
    }

    /// The smallest angle of the parts of a triangle that is divided at a point of an edge (rad).
    fn thinnest_part(&self, triangle: u32, edge: [u32; 2], at: f64) -> f64 {
        let ends = edge.map(|end| self.corner(triangle, end));
        let [Some(a), Some(b)] = ends else { return 0.0 };
        let shape = self.shape(triangle);
        let point = between(shape[a.corner], shape[b.corner], at);
        let angles = [a.corner, b.corner].map(|corner| {
            let mut part = shape;
            part[corner] = point;
            smallest_angle(&part)
        });
        angles[0].min(angles[1])
    }

    /// Divides a triangle from the new vertex of an edge to the opposite corner. The triangle keeps the first end of the
    /// edge, and the new triangle, which is returned, has the second. Their neighbours across the edge remain to be set.
    fn divide(&mut self, triangle: u32, edge: [u32; 2], vertex: u32, at: f64) -> u32 {
        let ends = edge.map(|end| self.corner(triangle, end));
        let [Some(a), Some(b)] = ends.map(|end| end.map(|end| end.corner)) else {
            return NONE;
        };
        let new = self.triangle_count() as u32;
        let t = triangle as usize;
        self.touch(triangle);
        let point = between(self.shapes[t][a], self.shapes[t][b], at);
        let (mut corners, mut shape, mut neighbours) =
            (self.triangles[t], self.shapes[t], self.neighbours[t]);
        // The neighbour across the edge from the second end to the apex becomes a neighbour of the new triangle.
        let beyond = neighbours[a];
        if beyond != NONE {
            self.touch(beyond);
            let apex = corners[3 - a - b];
            if let Some(corner) = self.across(beyond, [apex, edge[1]]) {
                self.neighbours[beyond as usize][corner] = new;
            }
        }
        (corners[a], shape[a]) = (vertex, point);
        neighbours[b] = triangle;
        neighbours[3 - a - b] = NONE;
        self.triangles[t][b] = vertex;
        self.shapes[t][b] = point;
        self.neighbours[t][a] = new;
        self.triangles.push(corners);
        self.shapes.push(shape);
        self.neighbours.push(neighbours);
        self.parents.push(self.parents[t]);
        self.touch(new);
        self.note_division([triangle, new]);
        new
    }
}
