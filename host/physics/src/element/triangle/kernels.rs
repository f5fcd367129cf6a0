//! The computations on blocks of triangles, compiled once for each width of vector instructions.
//!
//! Loops over lanes stay loops until the compiler makes vectors of them (see `hooke_kernels`), so nothing branches:
//! both sides of a choice are computed and one is selected.

use crate::lanes::block::{LANES, Lanes, Vectors, gather, node, scatter, vectors_at};
use crate::lanes::{Node, Real};
use crate::polar::surface_lanes::{Vector, combine, dot, larger, out_of_plane, polar, sum, times};
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// The vectors of two nodes of each element.
type Pairs<T> = Vectors<T, 2>;

/// Numbers of the stiffness with respect to the displacements of the second and third node relative to the first. The
/// stiffness is a symmetric 6 x 6 matrix: block 11 (xx, yy, zz, yz, xz, xy), block 12 (row by row) and block 22.
pub(crate) const ENTRIES: usize = 21;
pub(crate) const BLOCK_11: usize = 0;
pub(crate) const BLOCK_12: usize = 6;
pub(crate) const BLOCK_22: usize = 15;

/// The constant data of a block.
#[derive(Clone, Debug)]
pub(crate) struct Rest<T> {
    /// Component `j` of the gradient of node `a + 1` in row `2 a + j` (1/m).
    pub(crate) gradients: [Lanes<T>; 4],
    /// The two axes of the rest frame in world coordinates.
    pub(crate) frame: [Lanes<T>; 6],
    /// Lamé's parameters times the volume (N m), zero in lanes that pad the block.
    pub(crate) mu: Lanes<T>,
    pub(crate) lambda: Lanes<T>,
}

/// Elements by block.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blocks<T> {
    pub(crate) nodes: Vec<[[u32; 3]; LANES]>,
    pub(crate) rest: Vec<Rest<T>>,
    /// The two columns of the strain at displacement zero. Empty if there is none.
    pub(crate) strained: Vec<[Lanes<T>; 6]>,
    pub(crate) stiffness: Vec<[Lanes<T>; ENTRIES]>,
}

/// One element of a block at rest.
struct Shape<T> {
    g: [[T; 2]; 2],
    frame: [Vector<T>; 2],
    mu: T,
    lambda: T,
}

/// See [`Triangles::linearize`](crate::element::triangle::triangles::Triangles::linearize).
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
    let mut energies = [T::ZERO; LANES];
    let mut vectors = [[[T::ZERO; 4]; LANES]; 2];
    let mut forces = vectors;
    let elements = blocks.nodes.iter().zip(&blocks.rest).enumerate();
    for ((block, (nodes, rest)), stiffness) in elements.zip(&mut blocks.stiffness) {
        gather(nodes, d, &mut vectors);
        let (moved, pulled) = (&vectors, &mut forces);
        match blocks.strained.get(block) {
            None => respond::<T, false>((rest, None), moved, pulled, stiffness, &mut energies),
            start => respond::<T, true>((rest, start), moved, pulled, stiffness, &mut energies),
        }
        scatter(nodes, &forces, force);
    }
    let mut sum = T::ZERO;
    for energy in energies {
        sum += energy;
    }
    sum
}

/// See [`Triangles::product`](crate::element::triangle::triangles::Triangles::product).
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets(
        "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
        "x86_64+avx2+bmi1+bmi2"
    ))
)]
pub(crate) fn product<T: Real>(blocks: &Blocks<T>, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
    let mut differences = [[[T::ZERO; 4]; LANES]; 2];
    let mut forces = differences;
    for (nodes, k) in blocks.nodes.iter().zip(&blocks.stiffness) {
        gather(nodes, u, &mut differences);
        for lane in 0..LANES {
            let [a, b] = vectors_at(&differences, lane).map(|v| times(v, factor));
            let k11 = symmetric_at(k, BLOCK_11, lane);
            let k22 = symmetric_at(k, BLOCK_22, lane);
            let mut k12 = [[T::ZERO; 3]; 3];
            let mut k21 = [[T::ZERO; 3]; 3];
            for i in 0..3 {
                for j in 0..3 {
                    k12[i][j] = k[BLOCK_12 + 3 * i + j][lane];
                    k21[j][i] = k12[i][j];
                }
            }
            forces[0][lane] = node(sum(rows(&k11, a), rows(&k12, b)));
            forces[1][lane] = node(sum(rows(&k21, a), rows(&k22, b)));
        }
        scatter(nodes, &forces, y);
    }
}

/// Computes the forces on the last two nodes of each element of a block and its stiffness, and adds to the energies.
#[inline(always)]
fn respond<T: Real, const STRAINED: bool>(
    (rest, strained): (&Rest<T>, Option<&[Lanes<T>; 6]>),
    differences: &Pairs<T>,
    forces: &mut Pairs<T>,
    stiffness: &mut [Lanes<T>; ENTRIES],
    energies: &mut Lanes<T>,
) {
    for lane in 0..LANES {
        let shape = shape_at(rest, lane);
        let (g, mu, lambda) = (shape.g, shape.mu, shape.lambda);
        let [d1, d2] = vectors_at(differences, lane);
        let mut gradient = [0, 1].map(|j| combine(d1, g[0][j], d2, g[1][j]));
        if STRAINED && let Some(strained) = strained {
            let start = [0, 1, 2, 3, 4, 5].map(|row: usize| strained[row][lane]);
            gradient[0] = sum([start[0], start[1], start[2]], gradient[0]);
            gradient[1] = sum([start[3], start[4], start[5]], gradient[1]);
        }
        let polar = polar(&shape.frame, &gradient);
        let [xx, xy, yy] = polar.strain;

        let pressure = lambda * (xx + yy);
        let twice = mu + mu;
        let stress = [twice * xx + pressure, twice * xy, twice * yy + pressure];
        energies[lane] += T::of(0.5) * (stress[0] * xx + stress[2] * yy) + stress[1] * xy;
        let [r1, r2] = polar.r;
        let pull = |g: [T; 2]| {
            let along = stress[0] * g[0] + stress[1] * g[1];
            let across = stress[1] * g[0] + stress[2] * g[1];
            node(combine(r1, -along, r2, -across))
        };
        forces[0][lane] = pull(g[0]);
        forces[1][lane] = pull(g[1]);

        let spin = larger(
            T::ZERO,
            T::of(0.5) * (stress[0] + stress[2]) * polar.over_trace,
        );
        let taut = out_of_plane(&polar.strain, twice, pressure);
        // With the rotated gradients b_a = R g_a and w = g_a^T taut g_c a block is
        // (mu + spin) (g_a . g_c) (I - n n^T) + (mu - spin) b_c b_a^T + lambda b_a b_c^T + w n n^T.
        let n = polar.n;
        let turned = |g: [T; 2]| combine(r1, g[0], r2, g[1]);
        let (b1, b2) = (turned(g[0]), turned(g[1]));
        let parts = |a: [T; 2], c: [T; 2]| {
            let same = (mu + spin) * (a[0] * c[0] + a[1] * c[1]);
            let w =
                a[0] * (taut[0] * c[0] + taut[1] * c[1]) + a[1] * (taut[1] * c[0] + taut[2] * c[1]);
            (same, times(n, w - same))
        };
        let diagonal = |g: [T; 2], b: Vector<T>| {
            let (same, normal) = parts(g, g);
            let own = times(b, mu - spin + lambda);
            let entry = |i: usize, j: usize| own[i] * b[j] + normal[i] * n[j];
            [
                same + entry(0, 0),
                same + entry(1, 1),
                same + entry(2, 2),
                entry(1, 2),
                entry(0, 2),
                entry(0, 1),
            ]
        };
        put(stiffness, BLOCK_11, lane, diagonal(g[0], b1));
        put(stiffness, BLOCK_22, lane, diagonal(g[1], b2));
        let (same, normal) = parts(g[0], g[1]);
        let (swapped, straight) = (times(b2, mu - spin), times(b1, lambda));
        let entry =
            |i: usize, j: usize| swapped[i] * b1[j] + straight[i] * b2[j] + normal[i] * n[j];
        let mixed = [
            same + entry(0, 0),
            entry(0, 1),
            entry(0, 2),
            entry(1, 0),
            same + entry(1, 1),
            entry(1, 2),
            entry(2, 0),
            entry(2, 1),
            same + entry(2, 2),
        ];
        put(stiffness, BLOCK_12, lane, mixed);
    }
}

#[inline(always)]
fn shape_at<T: Real>(rest: &Rest<T>, lane: usize) -> Shape<T> {
    let g = [0, 1, 2, 3].map(|row: usize| rest.gradients[row][lane]);
    let axes = [0, 1, 2, 3, 4, 5].map(|row: usize| rest.frame[row][lane]);
    Shape {
        g: [[g[0], g[1]], [g[2], g[3]]],
        frame: [[axes[0], axes[1], axes[2]], [axes[3], axes[4], axes[5]]],
        mu: rest.mu[lane],
        lambda: rest.lambda[lane],
    }
}

#[inline(always)]
fn symmetric_at<T: Real>(k: &[Lanes<T>; ENTRIES], first: usize, lane: usize) -> [Vector<T>; 3] {
    let [xx, yy, zz, yz, xz, xy] = [0, 1, 2, 3, 4, 5].map(|entry: usize| k[first + entry][lane]);
    [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
}

#[inline(always)]
fn put<T: Real, const N: usize>(
    k: &mut [Lanes<T>; ENTRIES],
    first: usize,
    lane: usize,
    entries: [T; N],
) {
    for i in 0..N {
        k[first + i][lane] = entries[i];
    }
}

#[inline(always)]
fn rows<T: Real>(m: &[Vector<T>; 3], v: Vector<T>) -> Vector<T> {
    [dot(m[0], v), dot(m[1], v), dot(m[2], v)]
}
