//! Stress against strength: where a tear starts, and the bound below which none can start.
//!
//! The stress of a triangle is that of the membrane's law in its frame at rest, with the rotation taken out: Biot's
//! stress `S = R^T P = 2 mu (U - I) + lambda tr(U - I) I`, per area at rest. In small strains it is Cauchy's stress. The
//! stress of a vertex is the mean over the triangles of its fan, weighted by area at rest, as in O'Brien and Hodgins
//! 1999 and Allard et al. 2009, whose method the thesis takes. The triangles' frames are turned into the frame of one of
//! them across the shared edges.
//!
//! **Corners.** The fan of a sharp notch's end contains the stress ahead, which opens it, and the flanks behind, along
//! which the sheet is stretched. The mean of both is less than the stress of the next vertex on a flank, and its direction
//! leads nowhere. So where the fan of a border vertex turns by more than [`CORNER`], the means over half planes count: the
//! stress is the highest of them, and the tear leads into that one with the highest mean across its middle, as a crack turns
//! by the largest hoop stress (Erdogan and Sih 1963).
//!
//! **Bound.** In plane stress `2 E W = s_1^2 + s_2^2 - 2 nu s_1 s_2`. For a given `s_1` the least value over `s_2` is at
//! `s_2 = nu s_1`: `W >= s_1^2 (1 - nu^2) / (2 E)`. So a triangle with `W < strength^2 (1 - nu^2) / (2 E)` has
//! `s_1 < strength`. The larger principal value is a convex function of the tensor, so that of a mean is at most the
//! largest of the triangles. The same bound therefore rules out every vertex, and it is reached by a uniform stress with
//! `s_2 = nu s_1`: no larger bound is valid.

use super::fields::stretch;
use super::law::TearMaterial;
use super::rings::{Sheet, fan};
use super::unfold::{multiply, turn};
use crate::Vec3;
use crate::topology::NONE;
use core::f64::consts::{FRAC_PI_2, PI};

/// The angle of the fan of a border vertex (rad) from which the vertex is the end of a notch: 225 degrees.
pub const CORNER: f64 = 1.25 * PI;

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
    /// The unit direction along which a tear opens: orthogonal to that of the larger principal stress. At a
    /// [corner](CORNER) it leads into the sheet; elsewhere its sign is free.
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
    mean(sheet, vertex, triangle, [0.0, f64::INFINITY], stress)
}

/// The mean stress (Pa) of some triangles in the fan of a vertex, in the frame of `triangle`: of those whose bisectors are
/// within the angle `reach` (rad) of a direction at the angle `ahead` from the bisector of `triangle`, counterclockwise.
fn mean(
    sheet: &Sheet,
    vertex: u32,
    triangle: u32,
    [ahead, reach]: [f64; 2],
    stress: &[Symmetric],
) -> Symmetric {
    let mut sum = [0.0; 3];
    let mut area = 0.0;
    let mut frame = [1.0, 0.0];
    let part = reach.is_finite();
    let half = |t: u32| {
        if part {
            0.5 * angle_at(sheet, vertex, t)
        } else {
            0.0
        }
    };
    let (mut angle, mut sign) = (0.0, 1.0);
    fan(sheet, vertex, triangle, |t, from| {
        // A fan is walked from its first triangle in both directions, each step from the triangle before.
        if let Some(before) = from {
            if before == triangle {
                (frame, angle) = ([1.0, 0.0], 0.0);
                sign = if follows(sheet, vertex, triangle, t) {
                    1.0
                } else {
                    -1.0
                };
            }
            angle += sign * (half(before) + half(t));
            frame = turn(sheet, before, t, frame);
        }
        if (angle - ahead).abs() > reach {
            return;
        }
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
            let found = beginning(sheet, vertex, t, stress);
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

/// Where a tear would start at a vertex, in the frame of a triangle of its fan, which is `triangle` unless the vertex is a
/// [corner](CORNER).
fn beginning(sheet: &Sheet, vertex: u32, triangle: u32, stress: &[Symmetric]) -> Candidate {
    let whole = candidate(sheet, vertex, triangle, stress);
    if !is_corner(sheet, vertex, triangle) {
        return whole;
    }
    let mut best = whole;
    let mut highest = f64::NEG_INFINITY;
    fan(sheet, vertex, triangle, |centre, _| {
        let half = 0.5 * angle_at(sheet, vertex, centre);
        // Half planes about the triangle, and about its two edges: that about the middle of a symmetric fan is among them.
        for ahead in [0.0, half, -half] {
            let tensor = mean(sheet, vertex, centre, [ahead, FRAC_PI_2], stress);
            let middle = multiply(
                [libm::cos(ahead), libm::sin(ahead)],
                bisector(sheet, vertex, centre),
            );
            best.stress = best.stress.max(principal(tensor)[0]);
            let across = across(tensor, middle);
            if across > highest {
                highest = across;
                best.triangle = centre;
                best.along = onwards(orthogonal(tensor), middle);
            }
        }
    });
    best
}

/// The stress (Pa) across a unit vector.
fn across([xx, xy, yy]: Symmetric, [x, y]: [f64; 2]) -> f64 {
    xx * y * y - 2.0 * xy * x * y + yy * x * x
}

/// Whether a vertex is on a border that turns inwards there by more than [`CORNER`].
fn is_corner(sheet: &Sheet, vertex: u32, triangle: u32) -> bool {
    let (mut turned, mut on_border) = (0.0, false);
    fan(sheet, vertex, triangle, |t, _| {
        turned += angle_at(sheet, vertex, t);
        let corners = sheet.triangles[t as usize].iter();
        let beside = corners.zip(sheet.neighbours[t as usize]);
        on_border |= beside
            .filter(|(corner, _)| **corner != vertex)
            .any(|(_, next)| next == NONE);
    });
    on_border && turned > CORNER
}

/// The two edges of a triangle from a vertex, counterclockwise in its frame (m); `None` if it has no such corner.
fn edges_at(sheet: &Sheet, vertex: u32, triangle: u32) -> Option<[[f64; 2]; 2]> {
    let corners = &sheet.triangles[triangle as usize];
    let corner = corners.iter().position(|&v| v == vertex)?;
    let shape = &sheet.shapes[triangle as usize];
    let at = shape[corner];
    Some([1, 2].map(|next| {
        let to = shape[(corner + next) % 3];
        [to[0] - at[0], to[1] - at[1]]
    }))
}

/// Whether `next` is the neighbour of a triangle on the counterclockwise side of a vertex.
fn follows(sheet: &Sheet, vertex: u32, triangle: u32, next: u32) -> bool {
    let corners = &sheet.triangles[triangle as usize];
    let corner = corners.iter().position(|&v| v == vertex);
    corner.is_some_and(|corner| sheet.neighbours[triangle as usize][(corner + 1) % 3] == next)
}

/// The angle of a triangle at a vertex (rad).
fn angle_at(sheet: &Sheet, vertex: u32, triangle: u32) -> f64 {
    edges_at(sheet, vertex, triangle).map_or(0.0, |[a, b]| {
        libm::atan2((a[0] * b[1] - a[1] * b[0]).abs(), a[0] * b[0] + a[1] * b[1])
    })
}

/// The unit vector from a vertex through the middle of a triangle's angle.
fn bisector(sheet: &Sheet, vertex: u32, triangle: u32) -> [f64; 2] {
    edges_at(sheet, vertex, triangle).map_or([0.0; 2], |[a, b]| {
        let [a, b] = [a, b].map(|[x, y]| {
            let length = libm::hypot(x, y);
            [x / length, y / length]
        });
        let sum = [a[0] + b[0], a[1] + b[1]];
        let length = libm::hypot(sum[0], sum[1]);
        [sum[0] / length, sum[1] / length]
    })
}

/// `along` or its opposite, whichever goes on in the direction `before`: a tear never goes backwards.
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
