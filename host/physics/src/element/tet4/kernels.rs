//! The computations on blocks of linear tetrahedra, compiled once for each width of vector instructions.
//!
//! The compiler vectorizes a loop over lanes if its body is arithmetic without branches. The bodies are therefore small
//! functions that are always inlined, and branches are outside the loops. The versions that the attribute generates
//! differ in speed alone.

use crate::lanes::block::{LANES, Lanes, Vectors, gather, scatter};
use crate::lanes::{Node, Real};
use crate::polar::lanes::{Matrix, Quaternion, quaternion, rotation_less_identity, strain, turn};
use crate::polar::matrices::{
    energy, matrix, outer, product_of, stress, symmetric, times, transposed_times,
};
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// The largest number of Newton iterations for a rotation in a call. After these the singular values are used.
const MAX_TURNS: usize = 8;

/// The constant data of a block.
#[derive(Clone, Debug)]
pub(crate) struct Rest<T> {
    /// Component `j` of the gradient of node `a + 1` in row `3 a + j` (1/m).
    pub(crate) gradients: [Lanes<T>; 9],
    /// `sqrt(2 mu V)`, zero in lanes that pad the block.
    pub(crate) scale: Lanes<T>,
}

/// The data of a block that a product reads.
#[derive(Clone, Debug)]
pub(crate) struct Turned<T> {
    /// The gradients rotated and scaled.
    pub(crate) gradients: [Lanes<T>; 9],
    /// `lambda / (2 mu)`.
    pub(crate) ratio: Lanes<T>,
}

/// Elements by block.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blocks<T> {
    pub(crate) nodes: Vec<[[u32; 4]; LANES]>,
    pub(crate) rest: Vec<Rest<T>>,
    pub(crate) turned: Vec<Turned<T>>,
    /// Quaternions, by component.
    pub(crate) rotations: Vec<[Lanes<T>; 4]>,
}

/// See [`Tets::linearize_with`](crate::element::tet4::Tets::linearize_with). Without `GUESS`, `u` is not read.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets(
        "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
        "x86_64+avx2+bmi1+bmi2"
    ))
)]
pub(crate) fn linearize<T: Real, const GUESS: bool>(
    blocks: &mut Blocks<T>,
    d: &[Node<T>],
    u: &[Node<T>],
    factor: T,
    force: &mut [Node<T>],
) -> T {
    let zero = [T::ZERO; LANES];
    let mut energy = zero;
    let mut vectors = [[[T::ZERO; 4]; LANES]; 3];
    let mut forces = vectors;
    let mut h = [zero; 9];
    let elements = blocks.nodes.iter().zip(&blocks.rest);
    let state = blocks.turned.iter_mut().zip(&mut blocks.rotations);
    for ((nodes, rest), (turned, rotations)) in elements.zip(state) {
        gather(nodes, d, &mut vectors);
        deformation(&rest.gradients, &vectors, &mut h);
        rotate(&h, rotations);
        if GUESS {
            gather(nodes, u, &mut vectors);
        }
        let out = (&mut forces, &mut energy);
        respond::<T, GUESS>(rest, rotations, &h, &vectors, factor, turned, out);
        scatter(nodes, &forces, force);
    }
    sum(&energy)
}

/// See [`Tets::product`](crate::element::tet4::Tets::product). With `ENERGY`, `factor` must be 1 or -1, and the result
/// is the energy of the displacements `u` from the frame of the gradients.
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
    let zero = [[[T::ZERO; 4]; LANES]; 3];
    let (mut differences, mut forces) = (zero, zero);
    for (nodes, turned) in blocks.nodes.iter().zip(&blocks.turned) {
        gather(nodes, u, &mut differences);
        for lane in 0..LANES {
            let b = at(&turned.gradients, lane);
            let e = symmetric(&outer(&vectors_at(&differences, lane), &b), factor);
            let s = stress(&e, turned.ratio[lane]);
            if ENERGY {
                energies[lane] += energy(&e, &s);
            }
            let s = matrix(&s);
            forces[0][lane] = node(times(&s, b[0]));
            forces[1][lane] = node(times(&s, b[1]));
            forces[2][lane] = node(times(&s, b[2]));
        }
        scatter(nodes, &forces, y);
    }
    if ENERGY { sum(&energies) } else { T::ZERO }
}

/// `F - I = sum (d_a - d_0) g_a^T`, row by row, from the differences.
#[inline(always)]
fn deformation<T: Real>(
    gradients: &[Lanes<T>; 9],
    differences: &Vectors<T>,
    h: &mut [Lanes<T>; 9],
) {
    for lane in 0..LANES {
        let sum = outer(&vectors_at(differences, lane), &at(gradients, lane));
        put(h, lane, 0, sum[0]);
        put(h, lane, 1, sum[1]);
        put(h, lane, 2, sum[2]);
    }
}

/// Computes the rotations of a block.
#[inline(always)]
pub(crate) fn rotate<T: Real>(h: &[Lanes<T>; 9], rotations: &mut [Lanes<T>; 4]) {
    for _ in 0..MAX_TURNS {
        let mut open = 0_u32;
        for lane in 0..LANES {
            let (q, done) = turn(quaternion_at(rotations, lane), &at(h, lane));
            for k in 0..4 {
                rotations[k][lane] = q[k];
            }
            open += u32::from(!done);
        }
        if open == 0 {
            return;
        }
    }
    rotate_singly(h, rotations);
}

/// Computes the rotations one by one, by singular values if the iteration has not converged.
#[cold]
#[inline(never)]
fn rotate_singly<T: Real>(h: &[Lanes<T>; 9], rotations: &mut [Lanes<T>; 4]) {
    for lane in 0..LANES {
        let h = at(h, lane);
        let (mut q, done) = turn(quaternion_at(rotations, lane), &h);
        if !done {
            q = quaternion(&h);
        }
        for k in 0..4 {
            rotations[k][lane] = q[k];
        }
    }
}

/// Rotates the gradients of a block, computes the forces on the last three nodes of each element, and adds to the
/// energies.
///
/// The forces are those at `F - I = h`. With `GUESS` they are those at `h` plus `factor` times the gradient of the
/// guess `u`, with the rotations of `h`. The derivative of these forces is the warped stiffness.
#[inline(always)]
fn respond<T: Real, const GUESS: bool>(
    rest: &Rest<T>,
    rotations: &[Lanes<T>; 4],
    h: &[Lanes<T>; 9],
    u: &Vectors<T>,
    factor: T,
    turned: &mut Turned<T>,
    (forces, energies): (&mut Vectors<T>, &mut Lanes<T>),
) {
    let Turned { gradients, ratio } = turned;
    for lane in 0..LANES {
        let less = rotation_less_identity(quaternion_at(rotations, lane));
        let (scale, ratio) = (rest.scale[lane], ratio[lane]);
        // The strains are negated: the force of an element on its nodes is minus its stress times the gradients.
        let mut e = symmetric(&strain(&less, &at(h, lane)), -scale);
        let mut s = stress(&e, ratio);
        energies[lane] += energy(&e, &s);
        let mut r = less;
        for i in 0..3 {
            r[i][i] += T::of(1.0);
            for j in 0..3 {
                r[i][j] = r[i][j] * scale;
            }
        }
        let g = at(&rest.gradients, lane);
        if GUESS {
            let further = outer(&vectors_at(u, lane), &g);
            let more = symmetric(&transposed_times(&r, &further), -factor);
            for k in 0..6 {
                e[k] += more[k];
            }
            s = stress(&e, ratio);
        }
        let p = product_of(&r, &matrix(&s));
        forces[0][lane] = node(times(&p, g[0]));
        forces[1][lane] = node(times(&p, g[1]));
        forces[2][lane] = node(times(&p, g[2]));
        put(gradients, lane, 0, times(&r, g[0]));
        put(gradients, lane, 1, times(&r, g[1]));
        put(gradients, lane, 2, times(&r, g[2]));
    }
}

/// The sum over all lanes.
#[inline(always)]
pub(crate) fn sum<T: Real>(lanes: &Lanes<T>) -> T {
    let mut sum = T::ZERO;
    for &lane in lanes {
        sum += lane;
    }
    sum
}

/// The matrix of one element.
#[inline(always)]
pub(crate) fn at<T: Real>(rows: &[Lanes<T>; 9], lane: usize) -> Matrix<T> {
    let mut m = [[T::ZERO; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            m[i][j] = rows[3 * i + j][lane];
        }
    }
    m
}

/// The vectors of one element, as rows. The padding, which is zero, is read as well: if one entry in four is skipped,
/// the compiler processes the last lanes one by one.
#[inline(always)]
pub(crate) fn vectors_at<T: Real>(vectors: &Vectors<T>, lane: usize) -> Matrix<T> {
    let vector = |a: usize| {
        let node = &vectors[a][lane];
        [node[0] + node[3], node[1], node[2]]
    };
    [vector(0), vector(1), vector(2)]
}

#[inline(always)]
pub(crate) fn node<T: Real>(v: [T; 3]) -> Node<T> {
    [v[0], v[1], v[2], T::ZERO]
}

#[inline(always)]
pub(crate) fn put<T: Real>(rows: &mut [Lanes<T>; 9], lane: usize, a: usize, value: [T; 3]) {
    for i in 0..3 {
        rows[3 * a + i][lane] = value[i];
    }
}

#[inline(always)]
pub(crate) fn quaternion_at<T: Real>(rows: &[Lanes<T>; 4], lane: usize) -> Quaternion<T> {
    [rows[0][lane], rows[1][lane], rows[2][lane], rows[3][lane]]
}
