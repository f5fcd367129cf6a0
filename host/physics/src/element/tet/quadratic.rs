//! Quadratic tetrahedra as a [`Cell`].
//!
//! The derivatives of the displacement by the barycentric coordinates at the quadrature points have a common part. With
//! `M_cc` the displacement of corner `c`, `M_ce` that of the middle of edge `ce`, and point `q` of the rule near corner
//! `q`, the gradients of [`Tet10`](crate::element::tet::shape::Tet10) give for coordinate `c`
//!
//! ```text
//! 4 / sqrt 5 (M_cq + s (sum of M_ce over e but c) - M_cc / 4)        s = (sqrt 5 - 1) / 4
//! ```
//!
//! [`spread`] computes the differences of these derivatives from that by coordinate 0. [`collect`], its transpose,
//! computes forces on nodes. Between the two each point is treated as a linear tetrahedron with the gradients of the
//! barycentric coordinates at the point. These gradients contain the factor `4 / sqrt 5`.

use super::cell::Cell;
use crate::Vec3;
use crate::lanes::block::{LANES, Lanes, Vectors, at, gather, node, put, scatter, vectors_at};
use crate::lanes::{Node, Real};
use crate::mesh::tet::MIDSIDE_ENDS;

/// Quadrature points.
const POINTS: usize = 4;

/// `4 / sqrt 5`.
const FACTOR: f64 = 1.788_854_381_999_831_8;

/// `(sqrt 5 - 1) / 4`.
const WEIGHT: f64 = 0.309_016_994_374_947_45;

/// A 3 x 3 matrix at each point, row by row.
type Points<T> = [[Lanes<T>; 9]; POINTS];

/// Quadratic tetrahedra.
#[derive(Clone, Debug)]
pub struct Ten;

/// The vectors of all nodes but the first, and what they give at the points.
#[derive(Debug)]
pub struct Derivatives<T> {
    others: Vectors<T, 9>,
    points: Points<T>,
}

impl Cell<10, POINTS> for Ten {
    const FACTOR: f64 = FACTOR;

    type Derivatives<T: Real> = Derivatives<T>;

    #[inline(always)]
    fn zero<T: Real>() -> Derivatives<T> {
        Derivatives {
            others: [[[T::ZERO; 4]; LANES]; 9],
            points: [[[T::ZERO; LANES]; 9]; POINTS],
        }
    }

    #[inline(always)]
    fn spread<T: Real>(nodes: &[[u32; 10]; LANES], of: &[Node<T>], to: &mut Derivatives<T>) {
        gather(nodes, of, &mut to.others);
        spread(&to.others, &mut to.points);
    }

    #[inline(always)]
    fn at<T: Real>(derivatives: &Derivatives<T>, point: usize, lane: usize) -> [[T; 3]; 3] {
        at(&derivatives.points[point], lane)
    }

    #[inline(always)]
    fn put<T: Real>(to: &mut Derivatives<T>, point: usize, lane: usize, c: usize, force: [T; 3]) {
        put(&mut to.points[point], lane, c, force);
    }

    #[inline(always)]
    fn collect<T: Real>(nodes: &[[u32; 10]; LANES], from: &mut Derivatives<T>, to: &mut [Node<T>]) {
        collect(&from.points, &mut from.others);
        scatter(nodes, &from.others, to);
    }

    fn gradients(point: usize, coordinates: &[Vec3; 4]) -> [Vec3; 10] {
        let near = |corner: usize| if corner == point { 1.0 } else { 0.0 };
        let mut gradients = [Vec3::zeros(); 10];
        for c in 0..4 {
            gradients[c] = coordinates[c] * (near(c) - 0.25);
        }
        for (gradient, [c, e]) in gradients[4..].iter_mut().zip(MIDSIDE_ENDS) {
            *gradient = coordinates[c] * (WEIGHT + near(e)) + coordinates[e] * (WEIGHT + near(c));
        }
        gradients
    }
}

/// Computes the derivatives by the barycentric coordinates 1, 2 and 3 at each point, minus the derivative by coordinate
/// 0, from the vectors of the nodes minus that of the first node.
#[inline(always)]
fn spread<T: Real>(others: &Vectors<T, 9>, points: &mut Points<T>) {
    let (weight, quarter) = (T::of(WEIGHT), T::of(0.25));
    for lane in 0..LANES {
        let [d1, d2, d3, m01, m12, m02, m03, m13, m23] = vectors_at(others, lane);
        for i in 0..3 {
            let all1 = weight * ((m12[i] + m13[i]) - (m02[i] + m03[i])) - quarter * d1[i];
            let all2 = weight * ((m12[i] + m23[i]) - (m01[i] + m03[i])) - quarter * d2[i];
            let all3 = weight * ((m13[i] + m23[i]) - (m01[i] + m02[i])) - quarter * d3[i];
            points[0][i][lane] = all1 + m01[i];
            points[0][3 + i][lane] = all2 + m02[i];
            points[0][6 + i][lane] = all3 + m03[i];
            points[1][i][lane] = all1 + (d1[i] - m01[i]);
            points[1][3 + i][lane] = all2 + (m12[i] - m01[i]);
            points[1][6 + i][lane] = all3 + (m13[i] - m01[i]);
            points[2][i][lane] = all1 + (m12[i] - m02[i]);
            points[2][3 + i][lane] = all2 + (d2[i] - m02[i]);
            points[2][6 + i][lane] = all3 + (m23[i] - m02[i]);
            points[3][i][lane] = all1 + (m13[i] - m03[i]);
            points[3][3 + i][lane] = all2 + (m23[i] - m03[i]);
            points[3][6 + i][lane] = all3 + (d3[i] - m03[i]);
        }
    }
}

/// The transpose of [`spread`]: forces on all nodes but the first.
#[inline(always)]
fn collect<T: Real>(points: &Points<T>, others: &mut Vectors<T, 9>) {
    let (weight, quarter) = (T::of(WEIGHT), T::of(0.25));
    for lane in 0..LANES {
        let mut forces = [[T::ZERO; 3]; 9];
        for i in 0..3 {
            let by = |c: usize| [0, 1, 2, 3].map(|q: usize| points[q][3 * c + i][lane]);
            let (t1, t2, t3) = (by(0), by(1), by(2));
            let all1 = (t1[0] + t1[1]) + (t1[2] + t1[3]);
            let all2 = (t2[0] + t2[1]) + (t2[2] + t2[3]);
            let all3 = (t3[0] + t3[1]) + (t3[2] + t3[3]);
            // The term of coordinate 0 is minus the sum of the others.
            let (all12, all13, all23) = (
                weight * (all1 + all2),
                weight * (all1 + all3),
                weight * (all2 + all3),
            );
            forces[0][i] = t1[1] - quarter * all1;
            forces[1][i] = t2[2] - quarter * all2;
            forces[2][i] = t3[3] - quarter * all3;
            forces[3][i] = (t1[0] - (t1[1] + t2[1] + t3[1])) - all23;
            forces[4][i] = (t1[2] + t2[1]) + all12;
            forces[5][i] = (t2[0] - (t1[2] + t2[2] + t3[2])) - all13;
            forces[6][i] = (t3[0] - (t1[3] + t2[3] + t3[3])) - all12;
            forces[7][i] = (t1[3] + t3[1]) + all13;
            forces[8][i] = (t2[3] + t3[2]) + all23;
        }
        for a in 0..9 {
            others[a][lane] = node(forces[a]);
        }
    }
}
