//! Triangles about a tip laid into one plane at rest.
//!
//! The shapes of the triangles at rest may be given in separate frames, as in a flat pattern with darts. A neighbour is
//! turned about the shared edge: its frame is rotated and shifted until the two ends coincide. If the shapes already
//! share a frame, the neighbour keeps the placement of the triangle before it, without rounding. About a vertex whose
//! angles do not sum to a full turn, the placement depends on the way; the rings of a tip are then unfolded along the
//! way on which they are found.

use super::rings::Sheet;

/// The placement of a frame in the plane of the tip: a rotation by the unit vector `turn`, then a shift (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Cosine and sine of the rotation.
    pub turn: [f64; 2],
    /// The shift after the rotation (m).
    pub shift: [f64; 2],
}

impl Placement {
    /// A point or corner (m) of the frame in the plane of the tip.
    pub fn apply(&self, p: [f64; 2]) -> [f64; 2] {
        let turned = multiply(self.turn, p);
        [turned[0] + self.shift[0], turned[1] + self.shift[1]]
    }
}

/// Product of two complex numbers: the rotation of `b` by the unit vector `a`.
pub(super) fn multiply(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

/// The two corners that `child` shares with `parent`, in the frames of both: those of the parent, then of the child.
fn shared(sheet: &Sheet, parent: u32, child: u32) -> Option<[[[f64; 2]; 2]; 2]> {
    let (p, c) = (
        &sheet.triangles[parent as usize],
        &sheet.triangles[child as usize],
    );
    let side = sheet.neighbours[parent as usize]
        .iter()
        .position(|&t| t == child)?;
    let ends = [(side + 1) % 3, (side + 2) % 3];
    let mut of_child = [[0.0; 2]; 2];
    for (end, out) in ends.iter().zip(&mut of_child) {
        let corner = c.iter().position(|&vertex| vertex == p[*end])?;
        *out = sheet.shapes[child as usize][corner];
    }
    let of_parent = ends.map(|end| sheet.shapes[parent as usize][end]);
    Some([of_parent, of_child])
}

/// The rotation from the frame of `child` to that frame into which `frame` turns the frame of `parent`.
pub(super) fn turn(sheet: &Sheet, parent: u32, child: u32, frame: [f64; 2]) -> [f64; 2] {
    let Some([[a, b], [c, d]]) = shared(sheet, parent, child) else {
        return frame;
    };
    if a == c && b == d {
        return frame;
    }
    let (old, new) = (
        [b[0] - a[0], b[1] - a[1]],
        multiply([b[0] - a[0], b[1] - a[1]], [d[0] - c[0], -(d[1] - c[1])]),
    );
    let length = libm::hypot(new[0], new[1]);
    if old == [0.0; 2] || length <= 0.0 {
        return frame;
    }
    multiply(frame, [new[0] / length, new[1] / length])
}

/// The placement of `child` beside `parent`, which has the placement `before`.
pub(super) fn place(sheet: &Sheet, parent: u32, child: u32, before: &Placement) -> Placement {
    let Some([[a, b], [c, d]]) = shared(sheet, parent, child) else {
        return *before;
    };
    if a == c && b == d {
        return *before;
    }
    let rotation = turn(sheet, parent, child, before.turn);
    // The middles of the two edges coincide, so that a difference of their lengths is shared.
    let middle = before.apply([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]);
    let own = multiply(rotation, [0.5 * (c[0] + d[0]), 0.5 * (c[1] + d[1])]);
    Placement {
        turn: rotation,
        shift: [middle[0] - own[0], middle[1] - own[1]],
    }
}
