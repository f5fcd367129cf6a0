//! The computations on blocks of tetrahedra under Hooke's law, compiled once for each width of vector instructions.
//!
//! The compiler vectorizes a loop over lanes if its body is arithmetic without branches. The bodies are therefore small
//! functions that are always inlined, and branches are outside the loops. The versions that the attribute generates
//! differ in speed alone.

use super::cell::Cell;
use crate::lanes::block::{LANES, Lanes, at, put, quaternion_at, sum};
use crate::lanes::{Node, Real};
use crate::polar::lanes::{quaternion, rotation_less_identity, strain, turn};
use crate::polar::matrices::{energy, matrix, outer, product_of, stress, symmetric, times};
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// The largest number of Newton iterations for a rotation in a call. After these the singular values are used.
const MAX_TURNS: usize = 8;

/// A 3 x 3 matrix at each point, row by row.
type Points<T, const Q: usize> = [[Lanes<T>; 9]; Q];

/// The constant data of a block.
#[derive(Clone, Debug)]
pub(crate) struct Rest<T, const Q: usize> {
    /// At each point, component `j` of the gradient of barycentric coordinate `c + 1` in row `3 c + j`, times the
    /// factor of the cell (1/m).
    pub(crate) gradients: Points<T, Q>,
    /// `sqrt(2 mu V)` of each point, zero in lanes that pad the block.
    pub(crate) scale: [Lanes<T>; Q],
}

/// The data of a block that a product reads.
#[derive(Clone, Debug)]
pub(crate) struct Turned<T, const Q: usize> {
    /// The gradients rotated and scaled.
    pub(crate) gradients: Points<T, Q>,
    /// `lambda / (2 mu)`.
    pub(crate) ratio: Lanes<T>,
}

/// Elements by block.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blocks<T, const N: usize, const Q: usize> {
    pub(crate) nodes: Vec<[[u32; N]; LANES]>,
    pub(crate) rest: Vec<Rest<T, Q>>,
    pub(crate) turned: Vec<Turned<T, Q>>,
    /// Quaternions of each point, by component.
    pub(crate) rotations: Vec<[[Lanes<T>; 4]; Q]>,
}

/// See [`HookeanTets::linearize`](super::hooke::HookeanTets::linearize).
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets(
        "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
        "x86_64+avx2+bmi1+bmi2"
    ))
)]
pub(crate) fn linearize<T: Real, C: Cell<N, Q>, const N: usize, const Q: usize>(
    blocks: &mut Blocks<T, N, Q>,
    d: &[Node<T>],
    force: &mut [Node<T>],
) -> T {
    let zero = [T::ZERO; LANES];
    let mut energies = zero;
    let mut derivatives = C::zero::<T>();
    let mut h = [zero; 9];
    let elements = blocks.nodes.iter().zip(&blocks.rest);
    let state = blocks.turned.iter_mut().zip(&mut blocks.rotations);
    for ((nodes, rest), (turned, rotations)) in elements.zip(state) {
        C::spread(nodes, d, &mut derivatives);
        for q in 0..Q {
            deformation::<T, C, N, Q>(&rest.gradients[q], &derivatives, q, &mut h);
            rotate(&h, &mut rotations[q]);
            respond::<T, C, N, Q>(
                rest,
                q,
                &rotations[q],
                &h,
                turned,
                (&mut derivatives, &mut energies),
            );
        }
        C::collect(nodes, &mut derivatives, force);
    }
    sum(&energies)
}

/// See [`HookeanTets::product`](super::hooke::HookeanTets::product). With `ENERGY`, `factor` must be 1 or -1, and the
/// result is the energy of the displacements `u` from the frame of the gradients.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets(
        "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
        "x86_64+avx2+bmi1+bmi2"
    ))
)]
pub(crate) fn product<
    T: Real,
    C: Cell<N, Q>,
    const ENERGY: bool,
    const N: usize,
    const Q: usize,
>(
    blocks: &Blocks<T, N, Q>,
    factor: T,
    u: &[Node<T>],
    y: &mut [Node<T>],
) -> T {
    let mut energies = [T::ZERO; LANES];
    let mut derivatives = C::zero::<T>();
    for (nodes, turned) in blocks.nodes.iter().zip(&blocks.turned) {
        C::spread(nodes, u, &mut derivatives);
        for q in 0..Q {
            let gradients = &turned.gradients[q];
            for lane in 0..LANES {
                let b = at(gradients, lane);
                let e = symmetric(&outer(&C::at(&derivatives, q, lane), &b), factor);
                let s = stress(&e, turned.ratio[lane]);
                if ENERGY {
                    energies[lane] += energy(&e, &s);
                }
                let s = matrix(&s);
                C::put(&mut derivatives, q, lane, 0, times(&s, b[0]));
                C::put(&mut derivatives, q, lane, 1, times(&s, b[1]));
                C::put(&mut derivatives, q, lane, 2, times(&s, b[2]));
            }
        }
        C::collect(nodes, &mut derivatives, y);
    }
    if ENERGY { sum(&energies) } else { T::ZERO }
}

/// Sets `h` to `F - I = sum d_c g_c^T` at point `q`, row by row.
#[inline(always)]
pub(crate) fn deformation<T: Real, C: Cell<N, Q>, const N: usize, const Q: usize>(
    gradients: &[Lanes<T>; 9],
    derivatives: &C::Derivatives<T>,
    q: usize,
    h: &mut [Lanes<T>; 9],
) {
    for lane in 0..LANES {
        let rows = outer(&C::at(derivatives, q, lane), &at(gradients, lane));
        put(h, lane, 0, rows[0]);
        put(h, lane, 1, rows[1]);
        put(h, lane, 2, rows[2]);
    }
}

/// Computes the rotations at a point of a block.
#[inline(always)]
fn rotate<T: Real>(h: &[Lanes<T>; 9], rotations: &mut [Lanes<T>; 4]) {
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

/// Rotates the gradients of point `q`, computes the forces that correspond to the derivatives at `F - I = h`, and adds to
/// the energies. The derivative of these forces with the rotations held is the warped stiffness.
#[inline(always)]
fn respond<T: Real, C: Cell<N, Q>, const N: usize, const Q: usize>(
    rest: &Rest<T, Q>,
    q: usize,
    rotations: &[Lanes<T>; 4],
    h: &[Lanes<T>; 9],
    turned: &mut Turned<T, Q>,
    (forces, energies): (&mut C::Derivatives<T>, &mut Lanes<T>),
) {
    let Turned { gradients, ratio } = turned;
    let gradients = &mut gradients[q];
    for lane in 0..LANES {
        let less = rotation_less_identity(quaternion_at(rotations, lane));
        let scale = rest.scale[q][lane];
        // The strains are negated: the force of an element on its nodes is minus its stress times the gradients.
        let e = symmetric(&strain(&less, &at(h, lane)), -scale);
        let s = stress(&e, ratio[lane]);
        energies[lane] += energy(&e, &s);
        let mut r = less;
        for i in 0..3 {
            r[i][i] += T::of(1.0);
            for j in 0..3 {
                r[i][j] = r[i][j] * scale;
            }
        }
        let g = at(&rest.gradients[q], lane);
        let p = product_of(&r, &matrix(&s));
        C::put(forces, q, lane, 0, times(&p, g[0]));
        C::put(forces, q, lane, 1, times(&p, g[1]));
        C::put(forces, q, lane, 2, times(&p, g[2]));
        put(gradients, lane, 0, times(&r, g[0]));
        put(gradients, lane, 1, times(&r, g[1]));
        put(gradients, lane, 2, times(&r, g[2]));
    }
}
