//! Snapping: a vertex inside the surface moves at rest onto the path of a tear.
//!
//! The triangles about the vertex are unfolded into one plane about it. The plane's first axis points from the vertex to
//! the tip, the second to the left. Each triangle's corner moves by the same displacement, turned into the frame of the
//! triangle.

use core::f64::consts::{PI, TAU};

use super::NONE;
use super::edit::{EditError, Moved};
use super::fan::Corner;
use super::surface::{Shape, Surface, angle, cross, length, minus, smallest_angle, twice_area};

/// Snapping makes no angle smaller than this (rad, 10 degrees), nor smaller than the smallest angle about the vertex.
const SMALLEST_ANGLE: f64 = PI / 18.0;

/// By how much the angles about a vertex may differ from a full turn (rad), and two lengths of an edge relatively, if
/// triangles count as flat together: far above rounding, far below a dart or a gathered seam.
const FLAT: f64 = 1e-6;

/// The triangles about a vertex, with their corners at the vertex displaced.
struct Displaced {
    vertex: u32,
    shift: [f64; 2],
    begin: u32,
    next: u32,
    /// The angle from the edge to the tip to the first edge of the next triangle (rad).
    turned: f64,
    /// The last triangle before and after, and the corner of the edge that follows.
    last: Option<(Shape, Shape, Corner)>,
}

impl Displaced {
    /// The next triangle, its corner at the vertex, the angle at which the triangle begins, and its new shape.
    fn next(&mut self, surface: &Surface) -> Option<(Corner, f64, Shape)> {
        let corner = surface.corner(self.next, self.vertex)?;
        let (shape, k) = (surface.shape(corner.triangle), corner.corner);
        let turned = self.turned;
        let mut moved = shape;
        moved[k] = match self.last {
            Some((before, after, last)) if continues(&before, last.corner, &shape, k) => {
                after[last.corner]
            }
            _ => {
                let edge = minus(shape[(k + 1) % 3], shape[k]);
                let size = length(edge);
                let first = [edge[0] / size, edge[1] / size];
                // The left of the first axis is on the other side in a frame that mirrors the triangle.
                let sign = if twice_area(&shape) < 0.0 { -1.0 } else { 1.0 };
                let second = [-sign * first[1], sign * first[0]];
                let (sine, cosine) = (libm::sin(turned), libm::cos(turned));
                let along = cosine * self.shift[0] + sine * self.shift[1];
                let left = cosine * self.shift[1] - sine * self.shift[0];
                [
                    shape[k][0] + along * first[0] + left * second[0],
                    shape[k][1] + along * first[1] + left * second[1],
                ]
            }
        };
        self.turned += angle(&shape, k);
        self.last = Some((shape, moved, corner));
        let after = surface.after(corner);
        self.next = if after == self.begin { NONE } else { after };
        Some((corner, turned, moved))
    }
}

/// Whether two triangles, one after the other in a fan, lie in one frame: then their common vertex stays one point of
/// it, to the last bit.
fn continues(before: &Shape, b: usize, after: &Shape, a: usize) -> bool {
    before[b] == after[a]
        && before[(b + 2) % 3] == after[(a + 1) % 3]
        && (twice_area(before) > 0.0) == (twice_area(after) > 0.0)
}

impl Surface {
    /// Moves a vertex next to the tip at rest. The shift is along the direction from the vertex to the tip, and to the
    /// left of it (m).
    pub(super) fn snap(
        &mut self,
        tip: u32,
        vertex: u32,
        shift: [f64; 2],
    ) -> Result<Moved, EditError> {
        let moved = self.check_snap(tip, vertex, shift)?;
        let mut displaced = self.displaced(tip, vertex, shift);
        while let Some((corner, _, shape)) = displaced.next(self) {
            self.touch(corner.triangle);
            self.shapes[corner.triangle as usize] = shape;
        }
        Ok(moved)
    }

    /// Where the vertex would be after a snap.
    pub(super) fn check_snap(
        &self,
        tip: u32,
        vertex: u32,
        shift: [f64; 2],
    ) -> Result<Moved, EditError> {
        if self.edge_between(vertex, tip) == [NONE; 2] {
            return Err(EditError::NoEdge { a: tip, b: vertex });
        }
        if self.on_border(vertex) || !self.is_flat_about(vertex) {
            return Err(EditError::Fixed { vertex });
        }
        let smallest = self
            .fan(vertex)
            .map(|corner| smallest_angle(&self.shape(corner.triangle)))
            .fold(SMALLEST_ANGLE, f64::min);
        let mut towards = libm::atan2(shift[1], shift[0]);
        if towards < 0.0 {
            towards += TAU;
        }
        let mut moved = Moved {
            vertex,
            corners: [vertex; 3],
            weights: [1.0, 0.0, 0.0],
        };
        let mut displaced = self.displaced(tip, vertex, shift);
        while let Some((corner, begins, shape)) = displaced.next(self) {
            let (triangle, old) = (corner.triangle, self.shape(corner.triangle));
            // The comparison refuses angles that are no numbers, too.
            let upright = twice_area(&shape) * twice_area(&old) > 0.0;
            let good = smallest_angle(&shape) >= smallest;
            if !(upright && good) {
                return Err(EditError::Thin { triangle });
            }
            if towards >= begins {
                moved.corners = self.triangles[triangle as usize];
                moved.weights = weights(&old, shape[corner.corner]);
            }
        }
        Ok(moved)
    }

    /// Where a vertex would be after a [snap](super::Growth::Snap). `visit` is called with each triangle about the vertex
    /// and the shape that the triangle would have.
    ///
    /// # Errors
    /// [`EditError`] for a snap that would be refused.
    pub fn foresee_snap(
        &self,
        tip: u32,
        vertex: u32,
        shift: [f64; 2],
        mut visit: impl FnMut(u32, &Shape),
    ) -> Result<Moved, EditError> {
        let moved = self.check_snap(tip, vertex, shift)?;
        let mut displaced = self.displaced(tip, vertex, shift);
        while let Some((corner, _, shape)) = displaced.next(self) {
            visit(corner.triangle, &shape);
        }
        Ok(moved)
    }

    /// The triangles about `vertex`, from the edge to the tip, with the vertex displaced.
    fn displaced(&self, tip: u32, vertex: u32, shift: [f64; 2]) -> Displaced {
        let begin = self.edge_between(vertex, tip)[0];
        Displaced {
            vertex,
            shift,
            begin,
            next: begin,
            turned: 0.0,
            last: None,
        }
    }

    /// Whether the triangles about a vertex inside the surface are flat together: they fill a full turn, and the
    /// triangles at each edge give it one length.
    fn is_flat_about(&self, vertex: u32) -> bool {
        let edge = |corner: Corner, far: usize| {
            let shape = self.shape(corner.triangle);
            length(minus(
                shape[(corner.corner + far) % 3],
                shape[corner.corner],
            ))
        };
        let agree = self.fan(vertex).all(|corner| {
            let Some(next) = self.corner(self.after(corner), vertex) else {
                return false;
            };
            let (one, other) = (edge(corner, 2), edge(next, 1));
            (one - other).abs() <= FLAT * one
        });
        agree && (self.total_angle(vertex) - TAU).abs() <= FLAT
    }
}

/// The weights of the corners of a triangle whose sum is `point`.
fn weights(shape: &Shape, point: [f64; 2]) -> [f64; 3] {
    let whole = twice_area(shape);
    let [a, b, c] = *shape;
    let second = cross(minus(point, a), minus(c, a)) / whole;
    let third = cross(minus(b, a), minus(point, a)) / whole;
    [1.0 - second - third, second, third]
}
