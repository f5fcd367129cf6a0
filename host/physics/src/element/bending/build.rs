//! The curvature of each triangle from the slopes at its sides.
//!
//! By the divergence theorem the mean of the second derivatives over a triangle of area `A` is a sum over its sides,
//!
//! ```text
//! H = 1/A sum_e l_e s_e n_e (x) n_e
//! ```
//!
//! with the slope `s_e` of the sheet across the middle of each side relative to the triangle, the length of the side and
//! its outward normal `n_e`. This is the curvature of L. S. D. Morley's triangle ("The constant-moment plate-bending
//! element", 1971), whose unknowns are the vertices and the slopes. Here the slopes are those of `rotation`, so that only
//! vertices remain. Two triangles use the same derivative on their common
//! side. Hence a constant moment is in equilibrium, and a constant curvature has its exact energy, on any mesh (the patch
//! test). The energy is never below the least energy of Morley's triangles over all slopes, which vanishes
//! for rigid motions alone; so no other motion is free.
//!
//! A sheet that is cut out of a flat pattern has no curvature at rest, whatever its starting positions: not in its panels,
//! and not across their seams, which lie flat.
//!
//! A triangle whose vertices a handle or supports prescribe is rigid, and its gradient is that of the sheet at its sides:
//! it clamps the triangles beside it.
//!
//! On a border nothing resists the rotation of the sheet. The slope there is the slope of least energy, which is
//! eliminated in the triangle: the moment about a free or a hinged border is zero.

use super::NONE;
use super::curvature::Facet;
use super::exact::Bending;
use super::few::Few;
use super::rotation::{Across, gradient, rotation};
use super::scalar::ScalarMatrix;
use super::sheet::BentSheet;
use super::unfold::nearby;
use crate::element::triangle::frame::rest_frame;
use crate::{Mat3, Vec3};

/// Largest stiffness of a patch, the trace of its matrix, as a multiple of the rigidity over the square of the triangle's
/// longest side. A well-shaped triangle has some hundred, and a needle the third power of its aspect ratio. A needle of
/// more than a hundred bends too easily instead, because no solver would resolve its stiffness.
const STIFFEST: f64 = 1e6;

/// The derivative across side `k` of a triangle that has a neighbour there, which leads out of the triangle: vertices and
/// their weights (1/m).
pub(super) fn derivative(
    sheet: &BentSheet,
    x: &[Vec3],
    rigid: &[bool],
    (triangle, k): (usize, usize),
) -> Few<(u32, f64)> {
    let around = |rings| nearby(sheet, x, rigid, (triangle, k), rings);
    let beyond = sheet.neighbours[triangle][k] as usize;
    let weights = match [triangle, beyond].map(|t| rigid[t]) {
        // Between two rigid triangles there is nothing to bend.
        [true, _] => gradient(&around(0), Across::Before),
        [false, true] => gradient(&around(0), Across::Beyond),
        [false, false] => rotation(&around(1), || around(2)),
    };
    // The weights are those of the derivative times the length of the edge.
    let length = sheet.length((triangle, k), x);
    let weights = weights.iter();
    weights.map(|&(v, weight)| (v, weight / length)).collect()
}

/// The number that side `k` of a triangle has in the triangle beyond.
pub(super) fn other_side(sheet: &BentSheet, (triangle, k): (usize, usize)) -> Option<usize> {
    let beyond = sheet.neighbours[triangle][k] as usize;
    let vertices = &sheet.triangles[triangle];
    let ends = [1, 2].map(|i| vertices[(k + i) % 3]);
    let back = &sheet.neighbours[beyond];
    // Two triangles may have several sides in common, so the side is found by its vertices.
    let across = |j: usize| !ends.contains(&sheet.triangles[beyond][j]);
    (0..3).find(|&j| back[j] == triangle as u32 && across(j))
}

/// The rotations of a sheet, and the number of the rotation at each side of each triangle, or [`NONE`] on a border.
struct Numbered {
    rotations: ScalarMatrix<f64>,
    /// The triangle from which the derivative of each rotation leads outward.
    left: Vec<usize>,
    of_sides: Vec<[u32; 3]>,
}

fn rotations(sheet: &BentSheet, x: &[Vec3], rigid: &[bool]) -> Numbered {
    let count = sheet.triangles.len();
    let mut left = Vec::with_capacity(3 * count / 2);
    let mut of_sides = vec![[NONE; 3]; count];
    let mut rows: Vec<Few<(u32, f64)>> = Vec::with_capacity(3 * count / 2);
    for triangle in 0..count {
        for k in 0..3 {
            let beyond = sheet.neighbours[triangle][k];
            if beyond == NONE || (beyond as usize) < triangle {
                continue;
            }
            let number = left.len() as u32;
            of_sides[triangle][k] = number;
            if let Some(j) = other_side(sheet, (triangle, k)) {
                of_sides[beyond as usize][j] = number;
            }
            left.push(triangle);
            rows.push(derivative(sheet, x, rigid, (triangle, k)));
        }
    }
    // Rows of one length follow each other, so that the processor predicts the ends of their loops.
    let mut order: Vec<usize> = (0..rows.len()).collect();
    order.sort_by_key(|&number| rows[number].len());
    let mut rotations = ScalarMatrix::default();
    let mut place = vec![NONE; rows.len()];
    for (at, &number) in order.iter().enumerate() {
        place[number] = at as u32;
        rotations.push(rows[number].iter().copied());
    }
    for number in of_sides.iter_mut().flatten() {
        *number = place.get(*number as usize).copied().unwrap_or(NONE);
    }
    Numbered {
        rotations,
        left: order.iter().map(|&number| left[number]).collect(),
        of_sides,
    }
}

/// The matrix `R` with `R R^T = matrix`, which is symmetric and positive semidefinite: Cholesky's factor, with zeros in
/// the columns of pivots that vanish.
fn root(matrix: &Mat3) -> Mat3 {
    let mut rest = *matrix;
    let mut root = Mat3::zeros();
    let least = 1e-12 * matrix.trace();
    for k in 0..3 {
        if rest[(k, k)] > least {
            let column = rest.column(k) / rest[(k, k)].sqrt();
            rest -= column * column.transpose();
            root.set_column(k, &column);
        }
    }
    root
}

/// The curvature (xx, yy, 2 xy) that a unit slope at each side makes in a triangle with these gradients (1/m) of its
/// second and third hat function and this area (m^2), and the lengths of the sides (m).
pub(super) fn bends([g1, g2]: [[f64; 2]; 2], area: f64) -> ([Vec3; 3], [f64; 3]) {
    // The outward normals of the sides times their lengths are minus twice the area times the gradients.
    let outward = [[-g1[0] - g2[0], -g1[1] - g2[1]], g1, g2].map(|g| g.map(|c| -2.0 * area * c));
    let lengths = outward.map(|n| libm::hypot(n[0], n[1]));
    let bends = [0, 1, 2].map(|k| {
        let [x, y] = outward[k];
        Vec3::new(x * x, y * y, 2.0 * x * y) / (lengths[k] * area)
    });
    (bends, lengths)
}

/// The derivatives across the sides of a triangle with these corners (m) and its sides, if the sheet is flat. Each
/// derivative is the unit normal of the side in the plane, which leads out of the triangle or into it.
pub(super) fn flat(corners: &[Vec3; 3], leads_out: [bool; 3]) -> ([Vec3; 3], [Vec3; 2]) {
    let derivatives = [0, 1, 2].map(|k| {
        let [a, b] = [1, 2].map(|i| corners[(k + i) % 3]);
        let along = (b - a).normalize();
        let inward = corners[k] - a;
        let inward = (inward - along * inward.dot(&along)).normalize();
        if leads_out[k] { -inward } else { inward }
    });
    (
        derivatives,
        [corners[1] - corners[0], corners[2] - corners[0]],
    )
}

/// The bending of `sheet`, whose vertices start at `x` (m), at rest there unless a pattern makes the sheet flat. `rigid`
/// says of each triangle whether its motion is prescribed.
pub(super) fn bending(sheet: &BentSheet, x: &[Vec3], rigid: &[bool]) -> Bending {
    let numbered = rotations(sheet, x, rigid);
    let mut bending = Bending::new(numbered.rotations);
    if numbered.left.is_empty() {
        return bending;
    }
    for (triangle, vertices) in sheet.triangles.iter().enumerate().take(sheet.count) {
        let numbers = numbered.of_sides[triangle];
        let left = |number: u32| numbered.left.get(number as usize);
        let leads_out = numbers.map(|number| left(number) == Some(&triangle));
        let has_edge = numbers.map(|number| number != NONE);
        let (facet, stiffest) = facet(sheet, x, triangle, (has_edge, leads_out));
        bending.push(*vertices, numbers, facet);
        let at_rest = if sheet.is_cut() {
            flat(&sheet.corners(triangle, x), leads_out)
        } else {
            bending.vectors(triangle, |vertex| x[vertex as usize])
        };
        bending.rest(triangle, at_rest, stiffest);
    }
    bending.tearable(sheet, rigid, &numbered.left);
    bending
}

/// The matrix `plate` of a triangle without the moments of the sides that have no edge: the slopes there are free.
pub(super) fn condensed(plate: &Mat3, bends: &[Vec3; 3], has_edge: [bool; 3]) -> Mat3 {
    let mut plate = *plate;
    for (has_edge, bend) in has_edge.iter().zip(bends) {
        let moment = plate * bend;
        let own = bend.dot(&moment);
        if !has_edge && own > 0.0 {
            plate -= moment * moment.transpose() / own;
        }
    }
    plate
}

/// The constants of a triangle by whether it has an edge at each side and whether the derivative there leads out of it,
/// and the largest stiffness that it may have (N/m).
pub(super) fn facet(
    sheet: &BentSheet,
    x: &[Vec3],
    triangle: usize,
    (has_edge, leads_out): ([bool; 3], [bool; 3]),
) -> (Facet, f64) {
    let corners = sheet.corners(triangle, x);
    let (gradients, area) = rest_frame(corners.each_ref()).unwrap_or_default();
    let (bends, lengths) = bends(gradients, area);
    let mut plate = sheet.plate(triangle).matrix;
    let stiffest = plate.amax() * STIFFEST / lengths.into_iter().fold(0.0, f64::max).powi(2);
    plate = condensed(&(plate * area), &bends, has_edge);
    let root = root(&plate).transpose();
    let weights = [0, 1, 2].map(|k| match (has_edge[k], leads_out[k]) {
        (false, _) => Vec3::zeros(),
        (true, true) => root * bends[k],
        (true, false) => -(root * bends[k]),
    });
    let facet = Facet {
        weights,
        square: 4.0 * area * area,
    };
    (facet, stiffest)
}
