//! Directions about a vertex at rest, as angles of its fan.
//!
//! A **fan angle** is measured at rest (rad), counterclockwise from the first edge of the fan: the far end of this edge is
//! `from` of the first [`Corner`](super::Corner) of [`Surface::fan`]. The fan of a vertex on a border begins at the
//! border. That of a vertex inside the surface begins anywhere, and may begin elsewhere after an edit. The triangles
//! count with their own angles, so the angles of a fan may add up to any sum.

use core::f64::consts::TAU;

use super::surface::{Surface, angle, cross, dot, length, minus, twice_area};

/// The triangle of a fan in which a direction lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wedge {
    /// The triangle.
    pub triangle: u32,
    /// Which of its three corners is at the vertex.
    pub corner: usize,
    /// The fan angle of its first edge (rad).
    pub begin: f64,
    /// Its angle at the vertex (rad).
    pub angle: f64,
    /// The angle from its first edge to the direction (rad).
    pub within: f64,
}

impl Surface {
    /// The sum of the angles of a fan (rad): a full turn about a vertex inside a flat surface, and about a tip.
    pub fn total_angle(&self, vertex: u32) -> f64 {
        let corners = self.fan(vertex);
        corners
            .map(|corner| angle(&self.shape(corner.triangle), corner.corner))
            .sum()
    }

    /// The fan angle of the direction straight ahead of a tip (rad): halfway between the two faces of the tear. At
    /// another vertex on a border, the direction halfway between its two border edges.
    pub fn straight_ahead(&self, tip: u32) -> f64 {
        0.5 * self.total_angle(tip)
    }

    /// The fan angle of the edge from `vertex` to `to` (rad), or `None` if there is no such edge.
    pub fn angle_of_edge(&self, vertex: u32, to: u32) -> Option<f64> {
        let mut begin = 0.0;
        for corner in self.fan(vertex) {
            if corner.from == to {
                return Some(begin);
            }
            begin += angle(&self.shape(corner.triangle), corner.corner);
            if corner.to == to {
                return Some(begin);
            }
        }
        None
    }

    /// The triangle in which a fan angle lies. Inside the surface, angles are taken modulo the sum of the fan. `None` for
    /// an angle outside of the fan, or one that is no number.
    pub fn wedge(&self, vertex: u32, direction: f64) -> Option<Wedge> {
        let mut direction = direction;
        if !self.on_border(vertex) {
            let total = self.total_angle(vertex);
            direction -= total * libm::floor(direction / total);
        }
        let mut begin = 0.0;
        for corner in self.fan(vertex) {
            let width = angle(&self.shape(corner.triangle), corner.corner);
            let within = direction - begin;
            // A closed fan ends where rounding ends it.
            let last = !self.on_border(vertex) && corner.to == self.fan(vertex).next()?.from;
            if within >= 0.0 && (within <= width || last) {
                return Some(Wedge {
                    triangle: corner.triangle,
                    corner: corner.corner,
                    begin,
                    angle: width,
                    within: within.min(width),
                });
            }
            begin += width;
        }
        None
    }

    /// The triangle in which a fan angle lies, and the unit vector of that direction in the frame of the triangle.
    pub fn direction_at(&self, vertex: u32, direction: f64) -> Option<(u32, [f64; 2])> {
        let wedge = self.wedge(vertex, direction)?;
        let (shape, k) = (self.shape(wedge.triangle), wedge.corner);
        let edge = minus(shape[(k + 1) % 3], shape[k]);
        let size = length(edge);
        let first = [edge[0] / size, edge[1] / size];
        let turn = if twice_area(&shape) < 0.0 {
            -wedge.within
        } else {
            wedge.within
        };
        let (sine, cosine) = (libm::sin(turn), libm::cos(turn));
        let unit = [
            cosine * first[0] - sine * first[1],
            sine * first[0] + cosine * first[1],
        ];
        Some((wedge.triangle, unit))
    }

    /// The fan angle at `vertex` of a direction in the frame of one of its triangles (rad). The direction may point out
    /// of the triangle: the fan is unfolded into the frame. `None` if it points out of an open fan, if the triangle is
    /// not at the vertex, or if the direction has no length.
    pub fn fan_angle(&self, vertex: u32, triangle: u32, direction: [f64; 2]) -> Option<f64> {
        let length = length(direction);
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        let mut begin = 0.0;
        let corner = self.fan(vertex).find(|corner| {
            let found = corner.triangle == triangle;
            if !found {
                begin += angle(&self.shape(corner.triangle), corner.corner);
            }
            found
        })?;
        let (shape, k) = (self.shape(triangle), corner.corner);
        let edge = minus(shape[(k + 1) % 3], shape[k]);
        let sign = if twice_area(&shape) < 0.0 { -1.0 } else { 1.0 };
        let turned = begin + libm::atan2(sign * cross(edge, direction), dot(edge, direction));
        let total = self.total_angle(vertex);
        if !self.on_border(vertex) {
            return Some(turned - total * libm::floor(turned / total));
        }
        let turns = [turned, turned + TAU, turned - TAU];
        turns.into_iter().find(|turn| (0.0..=total).contains(turn))
    }
}
