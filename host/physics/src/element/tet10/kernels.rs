//! The computations on blocks of quadratic tetrahedra, compiled once for each width of vector instructions.
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

use crate::element::tet4::kernels::{at, node, put, quaternion_at, rotate, sum};
use crate::lanes::block::{LANES, Lanes, less, plus};
use crate::lanes::{Node, Real};
use crate::polar::lanes::{rotation_less_identity, strain};
use crate::polar::matrices::{energy, matrix, outer, product_of, stress, symmetric, times};
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// Quadrature points.
pub(crate) const POINTS: usize = 4;

/// `4 / sqrt 5`.
pub(crate) const FACTOR: f64 = 1.788_854_381_999_831_8;

/// `(sqrt 5 - 1) / 4`.
pub(crate) const WEIGHT: f64 = 0.309_016_994_374_947_45;

/// The constant data of a block.
#[derive(Clone, Debug)]
pub(crate) struct Rest<T> {
    /// At each point, component `j` of the gradient of barycentric coordinate `c + 1` in row `3 c + j`, times
    /// [`FACTOR`] (1/m).
    pub(crate) gradients: Points<T>,
    /// `sqrt(2 mu V)` of each point, zero in lanes that pad the block.
    pub(crate) scale: [Lanes<T>; POINTS],
}

/// The data of a block that a product reads.
#[derive(Clone, Debug)]
pub(crate) struct Turned<T> {
    /// The gradients rotated and scaled.
    pub(crate) gradients: Points<T>,
    /// `lambda / (2 mu)`.
    pub(crate) ratio: Lanes<T>,
}

/// Elements by block.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blocks<T> {
    pub(crate) nodes: Vec<[[u32; 10]; LANES]>,
    pub(crate) rest: Vec<Rest<T>>,
    pub(crate) turned: Vec<Turned<T>>,
    /// Quaternions of each point, by component.
    pub(crate) rotations: Vec<[[Lanes<T>; 4]; POINTS]>,
}

/// A 3 x 3 matrix at each point, row by row.
pub(crate) type Points<T> = [[Lanes<T>; 9]; POINTS];

/// A vector for each node but the first, padded like nodes.
pub(crate) type Others<T> = [[Node<T>; LANES]; 9];

/// See [`QuadraticTets::linearize`](crate::element::tet10::QuadraticTets::linearize).
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets(
        "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
        "x86_64+avx2+bmi1+bmi2"
    ))
)]
pub(crate) fn linearize<T: Real>(
    blocks: &mut Blocks<T>,
    d: &[Node<T>],
    force: &mut [Node<T>],
) -> T {
    let zero = [T::ZERO; LANES];
    let mut energies = zero;
    let mut others = [[[T::ZERO; 4]; LANES]; 9];
    let mut points = [[zero; 9]; POINTS];
    let elements = blocks.nodes.iter().zip(&blocks.rest);
    let state = blocks.turned.iter_mut().zip(&mut blocks.rotations);
    for ((nodes, rest), (turned, rotations)) in elements.zip(state) {
        gather(nodes, d, &mut others);
        spread(&others, &mut points);
        for q in 0..POINTS {
            deformation(&rest.gradients[q], &mut points[q]);
            rotate(&points[q], &mut rotations[q]);
            let fixed = (&rest.gradients[q], &rest.scale[q], &turned.ratio);
            respond(
                fixed,
                &rotations[q],
                &mut points[q],
                &mut turned.gradients[q],
                &mut energies,
            );
        }
        collect(&points, &mut others);
        scatter(nodes, &others, force);
    }
    sum(&energies)
}

/// See [`QuadraticTets::product`](crate::element::tet10::QuadraticTets::product). With `ENERGY`, `factor` must be 1 or
/// -1, and the result is the energy of the displacements `u` from the frame of the gradients.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets(
        "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
        "x86_64+avx2+bmi1+bmi2"
    ))
)]
pub(crate) fn product<T: Real, const ENERGY: bool>(
    blocks: &Blocks<T>,
    factor: T,
    u: &[Node<T>],
    y: &mut [Node<T>],
) -> T {
    let mut energies = [T::ZERO; LANES];
    let mut others = [[[T::ZERO; 4]; LANES]; 9];
    let mut points = [[[T::ZERO; LANES]; 9]; POINTS];
    for (nodes, turned) in blocks.nodes.iter().zip(&blocks.turned) {
        gather(nodes, u, &mut others);
        spread(&others, &mut points);
        for (point, gradients) in points.iter_mut().zip(&turned.gradients) {
            for lane in 0..LANES {
                let b = at(gradients, lane);
                let e = symmetric(&outer(&at(point, lane), &b), factor);
                let s = stress(&e, turned.ratio[lane]);
                if ENERGY {
                    energies[lane] += energy(&e, &s);
                }
                let s = matrix(&s);
                put(point, lane, 0, times(&s, b[0]));
                put(point, lane, 1, times(&s, b[1]));
                put(point, lane, 2, times(&s, b[2]));
            }
        }
        collect(&points, &mut others);
        scatter(nodes, &others, y);
    }
    if ENERGY { sum(&energies) } else { T::ZERO }
}

/// Replaces the differences of derivatives at a point by `F - I`.
#[inline(always)]
fn deformation<T: Real>(gradients: &[Lanes<T>; 9], point: &mut [Lanes<T>; 9]) {
    for lane in 0..LANES {
        let h = outer(&at(point, lane), &at(gradients, lane));
        put(point, lane, 0, h[0]);
        put(point, lane, 1, h[1]);
        put(point, lane, 2, h[2]);
    }
}

/// Rotates the gradients of a point, replaces `F - I` by the forces that correspond to the derivatives, and adds to the
/// energies.
#[inline(always)]
fn respond<T: Real>(
    (gradients, scale, ratio): (&[Lanes<T>; 9], &Lanes<T>, &Lanes<T>),
    rotations: &[Lanes<T>; 4],
    point: &mut [Lanes<T>; 9],
    turned: &mut [Lanes<T>; 9],
    energies: &mut Lanes<T>,
) {
    for lane in 0..LANES {
        let less = rotation_less_identity(quaternion_at(rotations, lane));
        // The strains are negated: the force of an element on its nodes is minus its stress times the gradients.
        let e = symmetric(&strain(&less, &at(point, lane)), -scale[lane]);
        let s = stress(&e, ratio[lane]);
        energies[lane] += energy(&e, &s);
        let mut r = less;
        for i in 0..3 {
            r[i][i] += T::of(1.0);
            for j in 0..3 {
                r[i][j] = r[i][j] * scale[lane];
            }
        }
        let g = at(gradients, lane);
        let p = product_of(&r, &matrix(&s));
        put(point, lane, 0, times(&p, g[0]));
        put(point, lane, 1, times(&p, g[1]));
        put(point, lane, 2, times(&p, g[2]));
        put(turned, lane, 0, times(&r, g[0]));
        put(turned, lane, 1, times(&r, g[1]));
        put(turned, lane, 2, times(&r, g[2]));
    }
}

/// Computes the derivatives by the barycentric coordinates 1, 2 and 3 at each point, minus the derivative by coordinate
/// 0, from the vectors of the nodes minus that of the first node.
#[inline(always)]
pub(crate) fn spread<T: Real>(others: &Others<T>, points: &mut Points<T>) {
    let (weight, quarter) = (T::of(WEIGHT), T::of(0.25));
    for lane in 0..LANES {
        // The fill, zero, is read too: see `tet4::kernels`.
        let vector = |a: usize| {
            let node = &others[a - 1][lane];
            [node[0] + node[3], node[1], node[2]]
        };
        let (d1, d2, d3) = (vector(1), vector(2), vector(3));
        let (m01, m12, m02) = (vector(4), vector(5), vector(6));
        let (m03, m13, m23) = (vector(7), vector(8), vector(9));
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
pub(crate) fn collect<T: Real>(points: &Points<T>, others: &mut Others<T>) {
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

/// Sets `others` to the vectors `of` at each element's other nodes minus the vector at its first node.
#[inline(always)]
pub(crate) fn gather<T: Real>(nodes: &[[u32; 10]; LANES], of: &[Node<T>], others: &mut Others<T>) {
    for lane in 0..LANES {
        let nodes = &nodes[lane];
        let first = of[nodes[0] as usize];
        for a in 0..9 {
            others[a][lane] = less(of[nodes[a + 1] as usize], first);
        }
    }
}

/// Adds `others` to the vectors `to` at each element's other nodes, and subtracts their sum from the vector at its
/// first node.
#[inline(always)]
pub(crate) fn scatter<T: Real>(nodes: &[[u32; 10]; LANES], others: &Others<T>, to: &mut [Node<T>]) {
    for lane in 0..LANES {
        let nodes = nodes[lane].map(|node| node as usize);
        let mut sum = others[0][lane];
        to[nodes[1]] = plus(to[nodes[1]], sum);
        for a in 1..9 {
            let vector = others[a][lane];
            to[nodes[a + 1]] = plus(to[nodes[a + 1]], vector);
            sum = plus(sum, vector);
        }
        to[nodes[0]] = less(to[nodes[0]], sum);
    }
}
