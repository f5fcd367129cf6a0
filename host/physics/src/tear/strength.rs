//! Stress against strength: where a tear starts, and the bound below which none can start.
//!
//! The stress of a triangle is that of the membrane's law in its frame at rest, with the rotation taken out: Biot's
//! stress `S = R^T P = 2 mu (U - I) + lambda tr(U - I) I`, per area at rest. In small strains it is Cauchy's stress. The
//! stress of a vertex is the mean over the triangles of its fan, weighted by area at rest, as in O'Brien and Hodgins
//! 1999 and Allard et al. 2009, whose method the thesis takes. The triangles' frames are turned into the frame of one of
//! them across the shared edges.
//!
//! **Bound.** In plane stress `2 E W = s_1^2 + s_2^2 - 2 nu s_1 s_2`. For a given `s_1` the least value over `s_2` is at
//! `s_2 = nu s_1`: `W >= s_1^2 (1 - nu^2) / (2 E)`. So a triangle with `W < strength^2 (1 - nu^2) / (2 E)` has
//! `s_1 < strength`. The larger principal value is a convex function of the tensor, so that of a mean is at most the
//! largest of the triangles. The same bound therefore rules out every vertex, and it is reached by a uniform stress with
//! `s_2 = nu s_1`: no larger bound is valid.

use super::fields::stretch;
use super::law::TearMaterial;
use super::rings::{Sheet, fan};
use super::unfold::turn;
use crate::Vec3;

/// Symmetric 2 x 2 tensor: xx, xy, yy.
pub type Symmetric = [f64; 3];

/// A vertex at which a tear may start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// The vertex.
    pub vertex: u32,
    /// A triangle at it. The directions are in the frame of its shape at rest.
    pub triangle: u32,
    /// The larger principal stress (Pa).
    pub stress: f64,
    /// The unit direction along which a tear opens: orthogonal to that of the larger principal stress. Its sign is free.
    pub along: [f64; 2],
}

/// Principal values, the larger first.
pub fn principal([xx, xy, yy]: Symmetric) -> [f64; 2] {
    let mean = 0.5 * (xx + yy);
    let radius = libm::hypot(0.5 * (xx - yy), xy);
    [mean + radius, mean - radius]
}

/// The unit direction of the smaller principal value: orthogonal to that of the larger one. The second axis if both are
/// equal.
pub fn orthogonal([xx, xy, yy]: Symmetric) -> [f64; 2] {
    let half = 0.5 * libm::atan2(2.0 * xy, xx - yy);
    [-libm::sin(half), libm::cos(half)]
}

/// Whether a sheet whose largest energy density is `density` (J/m^3) has no vertex whose stress reaches the strength. The
/// margin covers rounding.
pub fn cannot_start(density: f64, material: &TearMaterial) -> bool {
    density < material.safe_density() * (1.0 - 1e-12)
}

/// Computes the stress of every triangle at the positions `x` (m) into `stress` (Pa). Returns the largest energy density
/// (J/m^3). `stress` needs one entry for each triangle; further entries are left alone.
pub fn stresses(
    sheet: &Sheet,
    x: &[Vec3],
    material: &TearMaterial,
    stress: &mut [Symmetric],
) -> f64 {
    let mut largest = 0.0_f64;
    for ((corners, shape), out) in sheet.triangles.iter().zip(sheet.shapes).zip(stress) {
        let found = stretch(shape, corners.map(|v| x[v as usize]), material);
        largest = largest.max(found.density);
        *out = found.stress;
    }
    largest
}

/// The stress of a vertex (Pa) from those of the triangles, in the frame of `triangle`, one of its fan.
pub fn at_vertex(sheet: &Sheet, vertex: u32, triangle: u32, stress: &[Symmetric]) -> Symmetric {
    let mut sum = [0.0; 3];
    let mut area = 0.0;
    let mut frame = [1.0, 0.0];
    fan(sheet, vertex, triangle, |t, from| {
        // A fan is walked from its first triangle in both directions, each step from the triangle before.
        frame = match from {
            None => [1.0, 0.0],
            Some(_) if from == Some(triangle) => turn(sheet, triangle, t, [1.0, 0.0]),
            Some(before) => turn(sheet, before, t, frame),
        };
        let weight = area_of(&sheet.shapes[t as usize]);
        let turned = rotated(stress[t as usize], frame);
        for (sum, value) in sum.iter_mut().zip(turned) {
            *sum += weight * value;
        }
        area += weight;
    });
    sum.map(|value| value / area)
}

/// The vertex of the highest principal stress, if it is at least `strength` (Pa). Of equal ones, the vertex of the
/// smallest number. `may_start` says at which vertices a tear may start. `stress` is that of [`stresses`].
///
/// Only vertices of triangles whose own principal stress is as high can be the highest, since the stress of a vertex is
/// a mean. The others cost one comparison a triangle.
pub fn highest(
    sheet: &Sheet,
    stress: &[Symmetric],
    strength: f64,
    may_start: impl Fn(u32) -> bool,
) -> Option<Candidate> {
    let mut best: Option<Candidate> = None;
    for (t, (corners, &own)) in (0_u32..).zip(sheet.triangles.iter().zip(stress)) {
        // The mean may exceed the largest of its terms by rounding.
        let least = best.map_or(strength, |best| best.stress);
        if principal(own)[0] * (1.0 + 1e-12) < least {
            continue;
        }
        for &vertex in corners {
            let known = best.is_some_and(|best| best.vertex == vertex);
            if known || !may_start(vertex) {
                continue;
            }
            let found = candidate(sheet, vertex, t, stress);
            let higher = best.is_none_or(|best| {
                found.stress > best.stress || (found.stress == best.stress && vertex < best.vertex)
            });
            if found.stress >= strength && higher {
                best = Some(found);
            }
        }
    }
    best
}

/// The stress at one vertex and the direction of a tear there, in the frame of `triangle`, one of its fan.
pub fn candidate(sheet: &Sheet, vertex: u32, triangle: u32, stress: &[Symmetric]) -> Candidate {
    let tensor = at_vertex(sheet, vertex, triangle, stress);
    Candidate {
        vertex,
        triangle,
        stress: principal(tensor)[0],
        along: orthogonal(tensor),
    }
}

/// `along` or its opposite, whichever continues in the direction `before`: a tear never goes backwards.
pub fn onwards(along: [f64; 2], before: [f64; 2]) -> [f64; 2] {
    if along[0] * before[0] + along[1] * before[1] < 0.0 {
        [-along[0], -along[1]]
    } else {
        along
    }
}

/// `Q S Q^T` for the rotation `Q` by the angle of the unit vector `(c, s)`.
fn rotated([xx, xy, yy]: Symmetric, [c, s]: [f64; 2]) -> Symmetric {
    [
        c * c * xx - 2.0 * c * s * xy + s * s * yy,
        c * s * (xx - yy) + (c * c - s * s) * xy,
        s * s * xx + 2.0 * c * s * xy + c * c * yy,
    ]
}

fn area_of(s: &[[f64; 2]; 3]) -> f64 {
    let (a, b) = (
        [s[1][0] - s[0][0], s[1][1] - s[0][1]],
        [s[2][0] - s[0][0], s[2][1] - s[0][1]],
    );
    0.5 * (a[0] * b[1] - a[1] * b[0]).abs()
}
