//! The turns of a sheet since its factor was made, in the preconditioner.
//!
//! A sheet is many thousand times as stiff along itself as across. If it turns, the stiff directions of an old factor
//! lie across the sheet, and conjugate gradients have to move them: a piece that flaps turns by a radian while a factor is
//! made, and its steps took hundreds of iterations. The factor of a turned sheet is nearly the old one between rotations,
//!
//! ```text
//! P^-1 = R P_old^-1 R^T
//! ```
//!
//! with the rotation of each vertex since the state of the factor in `R` (H. Courtecuisse, J. Allard, C. Duriez and
//! S. Cotin, "Asynchronous preconditioners for efficient solving of non-linear deformations", 2010). The result is positive
//! definite for any rotations. They cost about as much as a step of few iterations, so only steps of many iterations ask
//! for them.

use super::Stepper;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::lanes::{Node, to_vec};
use crate::{Mat3, Vec3};
use nalgebra::{Quaternion, Rotation3, UnitQuaternion};

/// A step of more iterations than this number asks for new rotations. Tears in the plane take six at most.
const MANY: usize = 8;

/// The rotation of each place since the factor was made.
#[derive(Debug)]
pub(super) struct Turns {
    /// The columns of the rotations.
    columns: Vec<[Node<f32>; 3]>,
    /// Sums of the quaternions of the triangles at each place.
    sums: Vec<[f64; 4]>,
    /// Whether the preconditioner turns.
    in_use: bool,
    /// Whether the rotations have to be computed before the next solve.
    is_due: bool,
}

/// The columns of no rotation.
const NONE: [Node<f32>; 3] = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
];

impl<T: Precision> Stepper<T> {
    /// Asks for new rotations in the preconditioner after a step of many `iterations`.
    pub(super) fn ask_for_turns(&mut self, iterations: usize) {
        if let Some(growth) = &mut self.growth {
            growth.turns.is_due |= iterations > MANY;
        }
    }

    /// Turns the preconditioner with the sheet, if that has been asked for.
    pub(super) fn turn(&mut self, body: &Body) {
        let (Some(growth), Some(surface)) = (self.growth.as_deref_mut(), body.surface()) else {
            return;
        };
        if !growth.turns.is_due {
            return;
        }
        let (rest, place, mask) = (&self.places.rest, &self.places.of, &self.places.mask);
        let (then, now) = (&growth.state, &self.elements.d);
        let triangles = surface.triangles().iter();
        growth.turns.find(
            triangles.map(|corners| corners.map(|vertex| place[vertex as usize] as usize)),
            |place| rest[place] + to_vec(&then[place]),
            |place| rest[place] + to_vec(&now[place]),
            // The axes that a support guides stay.
            |place| mask.get(place).is_none_or(|axes| to_vec(axes).min() > 0.0),
        );
        // Other columns would make the preconditioner indefinite.
        self.pairs.forget_responses();
    }
}

impl Turns {
    /// Room for `places`. Nothing turns yet.
    pub(super) fn new(places: usize) -> Self {
        Self {
            columns: vec![NONE; places],
            sums: vec![[0.0; 4]; places],
            in_use: false,
            is_due: false,
        }
    }

    /// Whether the preconditioner turns.
    pub(super) fn in_use(&self) -> bool {
        self.in_use
    }

    /// Notes that the state of the factor or the places have changed.
    pub(super) fn note_change(&mut self) {
        self.is_due |= self.in_use;
    }

    /// Turns from the next solve on, if `other` does.
    pub(super) fn follow(&mut self, other: &Self) {
        self.is_due |= other.in_use || other.is_due;
    }

    /// Computes the rotations of the `triangles`, given by their places, from the positions `then` to the positions `now`
    /// (m). Places that may not turn do not.
    fn find(
        &mut self,
        triangles: impl Iterator<Item = [usize; 3]>,
        then: impl Fn(usize) -> Vec3,
        now: impl Fn(usize) -> Vec3,
        may_turn: impl Fn(usize) -> bool,
    ) {
        self.sums.fill([0.0; 4]);
        for places in triangles {
            let Some(turn) = turn(places.map(&then), places.map(&now)) else {
                continue;
            };
            let turn: [f64; 4] = turn.coords.into();
            for place in places {
                let sum = &mut self.sums[place];
                let product: f64 = sum.iter().zip(turn).map(|(a, b)| a * b).sum();
                let sign = if product < 0.0 { -1.0 } else { 1.0 };
                for (sum, part) in sum.iter_mut().zip(turn) {
                    *sum += sign * part;
                }
            }
        }
        for (place, (columns, sum)) in self.columns.iter_mut().zip(&self.sums).enumerate() {
            let [i, j, k, w] = *sum;
            let size = i * i + j * j + k * k + w * w;
            *columns = NONE;
            if size > 0.0 && size.is_finite() && may_turn(place) {
                let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
                let matrix = turn.to_rotation_matrix();
                for (axis, column) in columns.iter_mut().enumerate() {
                    for row in 0..3 {
                        column[row] = matrix[(row, axis)] as f32;
                    }
                }
            }
        }
        (self.in_use, self.is_due) = (true, false);
    }

    /// Turns vectors back to the state of the factor, in place.
    pub(super) fn back(&self, z: &mut [Node<f32>]) {
        if !self.in_use {
            return;
        }
        for (z, columns) in z.iter_mut().zip(&self.columns) {
            let dot = |column: &Node<f32>| z[0] * column[0] + z[1] * column[1] + z[2] * column[2];
            *z = [dot(&columns[0]), dot(&columns[1]), dot(&columns[2]), 0.0];
        }
    }

    /// Turns vectors from the state of the factor to the present one, in place.
    pub(super) fn forth(&self, z: &mut [Node<f32>]) {
        if !self.in_use {
            return;
        }
        for (z, columns) in z.iter_mut().zip(&self.columns) {
            let mut sum = [0.0; 4];
            for (part, column) in z.iter().zip(columns) {
                for i in 0..4 {
                    sum[i] += part * column[i];
                }
            }
            *z = sum;
        }
    }
}

/// The rotation of a triangle: that of its plane, and within the plane that of the polar decomposition.
fn turn(then: [Vec3; 3], now: [Vec3; 3]) -> Option<UnitQuaternion<f64>> {
    let (from, [a, b, c]) = frame(then)?;
    let (to, [d, e, f]) = frame(now)?;
    let stretch = d / a;
    let shear = (e - stretch * b) / c;
    let angle = libm::atan2(-shear, stretch + f / c);
    let within = UnitQuaternion::new(Vec3::z() * angle);
    Some(to * within * from.inverse())
}

/// The frame of a triangle, and the components of its edges in this frame: the length of the first, the two of the second.
fn frame([a, b, c]: [Vec3; 3]) -> Option<(UnitQuaternion<f64>, [f64; 3])> {
    let (first, second) = (b - a, c - a);
    let along = first.try_normalize(0.0)?;
    let normal = first.cross(&second).try_normalize(0.0)?;
    let aside = normal.cross(&along);
    let rotation = Rotation3::from_matrix_unchecked(Mat3::from_columns(&[along, aside, normal]));
    let edges = [first.norm(), second.dot(&along), second.dot(&aside)];
    Some((UnitQuaternion::from_rotation_matrix(&rotation), edges))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of triangles.
    fn strip() -> (Vec<Vec3>, Vec<[usize; 3]>) {
        let at = |i: usize| Vec3::new(i as f64, 0.7 * (i % 2) as f64, 0.1 * (i % 3) as f64);
        (
            (0..8).map(at).collect(),
            (0..6).map(|i| [i, i + 1, i + 2]).collect(),
        )
    }

    #[test]
    fn a_sheet_that_turns_as_a_whole_turns_all_vectors() {
        let (then, triangles) = strip();
        // Up to nearly a whole turn.
        for angle in [0.3, 2.0, 3.1, -6.0] {
            let turn = UnitQuaternion::new(Vec3::new(1.0, 2.0, -1.0).normalize() * angle);
            let now: Vec<Vec3> = then.iter().map(|x| turn * x + Vec3::repeat(0.3)).collect();
            let mut turns = Turns::new(8);
            turns.find(
                triangles.iter().copied(),
                |at| then[at],
                |at| now[at],
                |at| at != 5,
            );
            let part = |i: usize| [0.1 * i as f32, 1.0, -0.3, 0.0];
            let mut z: Vec<Node<f32>> = (0..8).map(part).collect();
            turns.forth(&mut z);
            for (place, z) in z.iter().enumerate() {
                let (whole, found) = (to_vec(&part(place)), to_vec(z));
                let expected = if place == 5 { whole } else { turn * whole };
                // Numbers of single precision.
                assert!((found - expected).norm() < 1e-6, "{angle} {place}: {found}");
            }
            turns.back(&mut z);
            for (place, z) in z.iter().enumerate() {
                assert!((to_vec(z) - to_vec(&part(place))).norm() < 1e-6, "{place}");
            }
        }
    }

    #[test]
    fn a_stretch_turns_nothing_and_a_shear_by_its_polar_rotation() {
        let then = [
            Vec3::zeros(),
            Vec3::new(2.0, 0.0, 0.0),
            Vec3::new(0.3, 1.0, 0.0),
        ];
        for shear in [0.0, 0.4] {
            let now = then.map(|x| Vec3::new(1.3 * x.x + shear * x.y, 0.8 * x.y, 0.0));
            let found = turn(then, now).unwrap().scaled_axis();
            // The rotation of [[a, s], [0, b]] has the tangent -s / (a + b).
            let expected = Vec3::z() * libm::atan(-shear / (1.3 + 0.8));
            assert!((found - expected).norm() < 1e-14, "{found}");
        }
    }
}
