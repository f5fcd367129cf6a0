//! The computations on blocks of triangles that bend, compiled once for each width of vector instructions.
//!
//! The formulas are those of `curvature`. Loops over lanes stay loops until the compiler makes vectors of them (see
//! `hooke_kernels`), so nothing branches.

use super::curvature::{EASE, THIN};
use crate::lanes::block::{LANES, Lanes, less, plus};
use crate::lanes::{Node, Real};
use crate::polar::surface_lanes::{Vector, combine, cross, dot, larger, sum, times};
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// The constant data of a block.
#[derive(Clone, Debug)]
pub(super) struct Rest<T> {
    /// The two sides at rest (m).
    pub(super) sides: [Lanes<T>; 6],
    /// The parts of the three derivatives along the two sides (1/m): side `k` of derivative `e` in row `2 e + k`.
    pub(super) along: [Lanes<T>; 6],
    /// The weights of the three slopes, zero in lanes that pad the block.
    pub(super) weights: [Lanes<T>; 9],
}

/// The constant data of a block of triangles that are curved at rest.
#[derive(Clone, Debug)]
pub(super) struct Curved<T> {
    /// The parts of the three derivatives along the normal.
    pub(super) rise: [Lanes<T>; 3],
    /// The normal at rest.
    pub(super) normal: [Lanes<T>; 3],
    /// The weighted curvature.
    pub(super) curvature: [Lanes<T>; 3],
}

/// The latest linearization of a block.
#[derive(Clone, Debug)]
pub(super) struct State<T> {
    /// The normals.
    pub(super) normal: [Lanes<T>; 3],
    /// The derivatives of the three slopes by the derivatives across the sides.
    pub(super) slopes: [Lanes<T>; 9],
    /// The derivatives of the three slopes by the two sides, along minus the normal (1/m).
    pub(super) tilts: [Lanes<T>; 6],
}

impl<T: Real> State<T> {
    pub(super) const ZERO: Self = Self {
        normal: [[T::ZERO; LANES]; 3],
        slopes: [[T::ZERO; LANES]; 9],
        tilts: [[T::ZERO; LANES]; 6],
    };
}

/// The constant data of triangles by block.
#[derive(Debug, Default)]
pub(super) struct Blocks<T> {
    pub(super) nodes: Vec<[[u32; 3]; LANES]>,
    /// The edges at the sides.
    pub(super) edges: Vec<[[u32; 3]; LANES]>,
    pub(super) rest: Vec<Rest<T>>,
    /// Empty if all triangles are flat at rest.
    pub(super) curved: Vec<Curved<T>>,
}

/// The vectors of a block, padded like nodes: two sides, three derivatives.
struct Vectors<T> {
    sides: [[Node<T>; LANES]; 2],
    edges: [[Node<T>; LANES]; 3],
}

impl<T: Real> Vectors<T> {
    const ZERO: Self = Self {
        sides: [[[T::ZERO; 4]; LANES]; 2],
        edges: [[[T::ZERO; 4]; LANES]; 3],
    };

    #[inline(always)]
    fn gather(
        &mut self,
        ends: (&[[u32; 3]; LANES], &[[u32; 3]; LANES]),
        of: &[Node<T>],
        by_edge: &[Node<T>],
    ) {
        let (nodes, edges) = ends;
        for lane in 0..LANES {
            let [n0, n1, n2] = nodes[lane];
            let first = of[n0 as usize];
            self.sides[0][lane] = less(of[n1 as usize], first);
            self.sides[1][lane] = less(of[n2 as usize], first);
            for side in 0..3 {
                self.edges[side][lane] = by_edge[edges[lane][side] as usize];
            }
        }
    }

    #[inline(always)]
    fn scatter(
        &self,
        ends: (&[[u32; 3]; LANES], &[[u32; 3]; LANES]),
        to: &mut [Node<T>],
        by_edge: &mut [Node<T>],
    ) {
        let (nodes, edges) = ends;
        for lane in 0..LANES {
            let [n0, n1, n2] = nodes[lane].map(|node| node as usize);
            let [v1, v2] = [self.sides[0][lane], self.sides[1][lane]];
            to[n1] = plus(to[n1], v1);
            to[n2] = plus(to[n2], v2);
            to[n0] = less(to[n0], plus(v1, v2));
            for side in 0..3 {
                let edge = &mut by_edge[edges[lane][side] as usize];
                *edge = plus(*edge, self.edges[side][lane]);
            }
        }
    }

    /// The vectors of one lane. The padding, which is zero, is read as well: if one entry in four is skipped, the
    /// compiler processes the last lanes one by one.
    #[inline(always)]
    fn at(&self, lane: usize) -> ([Vector<T>; 2], [Vector<T>; 3]) {
        let vector = |node: &Node<T>| [node[0] + node[3], node[1], node[2]];
        (
            [vector(&self.sides[0][lane]), vector(&self.sides[1][lane])],
            [
                vector(&self.edges[0][lane]),
                vector(&self.edges[1][lane]),
                vector(&self.edges[2][lane]),
            ],
        )
    }
}

/// Adds the forces at displacements `d` to `force`, and the forces on the derivatives across edges, which are displaced
/// by `theta`, to `pull`. Stores the linearization. Returns the energy.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets(
        "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
        "x86_64+avx2+bmi1+bmi2"
    ))
)]
pub(super) fn linearize<T: Real>(
    (blocks, state): (&Blocks<T>, &mut [State<T>]),
    (d, theta): (&[Node<T>], &[Node<T>]),
    (force, pull): (&mut [Node<T>], &mut [Node<T>]),
) -> T {
    let mut energies = [T::ZERO; LANES];
    let mut vectors = Vectors::ZERO;
    let mut forces = Vectors::ZERO;
    let ends = blocks.nodes.iter().zip(&blocks.edges);
    let states = blocks.rest.iter().zip(state);
    for (block, (ends, (rest, state))) in ends.zip(states).enumerate() {
        vectors.gather(ends, d, theta);
        match blocks.curved.get(block) {
            None => respond::<T, false>(rest, None, &vectors, &mut forces, state, &mut energies),
            curved => respond::<T, true>(rest, curved, &vectors, &mut forces, state, &mut energies),
        }
        forces.scatter(ends, force, pull);
    }
    let mut sum = T::ZERO;
    for energy in energies {
        sum += energy;
    }
    sum
}

/// Computes forces and linearization of a block, and adds to the energies.
#[inline(always)]
fn respond<T: Real, const CURVED: bool>(
    rest: &Rest<T>,
    curved: Option<&Curved<T>>,
    vectors: &Vectors<T>,
    forces: &mut Vectors<T>,
    state: &mut State<T>,
    energies: &mut Lanes<T>,
) {
    let (keep, ease) = (T::of(1.0 - EASE), T::of(EASE));
    let (one, thin) = (T::of(1.0), T::of(THIN));
    for lane in 0..LANES {
        let (d, theta) = vectors.at(lane);
        let s: [T; 6] = entries(&rest.sides, lane);
        let e1 = sum([s[0], s[1], s[2]], d[0]);
        let e2 = sum([s[3], s[4], s[5]], d[1]);
        let normal = cross(e1, e2);
        let flat = cross([s[0], s[1], s[2]], [s[3], s[4], s[5]]);
        let square = larger(dot(normal, normal), thin * dot(flat, flat));
        let over = one / square;
        let n = times(normal, over.sqrt());
        let g = [
            times(cross(e2, normal), over),
            times(cross(normal, e1), over),
        ];
        let along: [T; 6] = entries(&rest.along, lane);
        let weights: [T; 9] = entries(&rest.weights, lane);
        let (mut rise, mut at_rest, mut upright) = ([T::ZERO; 3], [T::ZERO; 3], n);
        if CURVED && let Some(curved) = curved {
            rise = entries(&curved.rise, lane);
            at_rest = entries(&curved.normal, lane);
            upright = entries(&curved.curvature, lane);
        }
        let mut curvature = if CURVED {
            times(upright, -one)
        } else {
            [T::ZERO; 3]
        };
        let mut slopes = [[T::ZERO; 3]; 3];
        let mut tilts = [[T::ZERO; 2]; 3];
        for e in 0..3 {
            let [a1, a2] = [along[2 * e], along[2 * e + 1]];
            // The derivative relative to the motion of the triangle. It is small where the derivative itself is not.
            let own = combine(d[0], -a1, d[1], -a2);
            let relative = sum(theta[e], own);
            let mut across = sum(combine(e1, a1, e2, a2), relative);
            let mut tau = dot(n, relative);
            if CURVED {
                across = sum(across, times(at_rest, rise[e]));
                tau += rise[e] * dot(n, at_rest);
            }
            let r = one / (keep * dot(across, across) + ease).sqrt();
            let slope = r * tau;
            for c in 0..3 {
                curvature[c] += weights[3 * e + c] * slope;
            }
            slopes[e] = combine(n, r, across, -(keep * r * r * slope));
            tilts[e] = [r * dot(g[0], across), r * dot(g[1], across)];
        }
        energies[lane] += T::of(0.5) * dot(curvature, curvature);
        let mut tilt = [T::ZERO; 2];
        for e in 0..3 {
            let weight = [weights[3 * e], weights[3 * e + 1], weights[3 * e + 2]];
            let moment = dot(weight, curvature);
            forces.edges[e][lane] = node(times(slopes[e], -moment));
            for k in 0..2 {
                tilt[k] += moment * tilts[e][k];
                state.tilts[2 * e + k][lane] = tilts[e][k];
            }
            for i in 0..3 {
                state.slopes[3 * e + i][lane] = slopes[e][i];
            }
        }
        for k in 0..2 {
            forces.sides[k][lane] = node(times(n, tilt[k]));
        }
        for i in 0..3 {
            state.normal[i][lane] = n[i];
        }
    }
}

/// Adds `factor` times the stiffness times `u`, with the derivatives `theta` of `u` across edges, to `y`, and the part
/// on the derivatives to `pull`.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets(
        "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
        "x86_64+avx2+bmi1+bmi2"
    ))
)]
pub(super) fn product<T: Real>(
    (blocks, state): (&Blocks<T>, &[State<T>]),
    factor: T,
    (u, theta): (&[Node<T>], &[Node<T>]),
    (y, pull): (&mut [Node<T>], &mut [Node<T>]),
) {
    let mut vectors = Vectors::ZERO;
    let mut forces = Vectors::ZERO;
    let ends = blocks.nodes.iter().zip(&blocks.edges);
    let states = blocks.rest.iter().zip(state);
    for (ends, (rest, state)) in ends.zip(states) {
        vectors.gather(ends, u, theta);
        for lane in 0..LANES {
            let (d, theta) = vectors.at(lane);
            let n: [T; 3] = entries(&state.normal, lane);
            let slopes: [T; 9] = entries(&state.slopes, lane);
            let tilts: [T; 6] = entries(&state.tilts, lane);
            let weights: [T; 9] = entries(&rest.weights, lane);
            let rise = [factor * dot(n, d[0]), factor * dot(n, d[1])];
            let mut curvature = [T::ZERO; 3];
            for e in 0..3 {
                let slope = [slopes[3 * e], slopes[3 * e + 1], slopes[3 * e + 2]];
                let tilt = tilts[2 * e] * rise[0] + tilts[2 * e + 1] * rise[1];
                let change = factor * dot(slope, theta[e]) - tilt;
                for c in 0..3 {
                    curvature[c] += weights[3 * e + c] * change;
                }
            }
            let mut tilt = [T::ZERO; 2];
            for e in 0..3 {
                let weight = [weights[3 * e], weights[3 * e + 1], weights[3 * e + 2]];
                let moment = dot(weight, curvature);
                let slope = [slopes[3 * e], slopes[3 * e + 1], slopes[3 * e + 2]];
                forces.edges[e][lane] = node(times(slope, moment));
                for k in 0..2 {
                    tilt[k] += moment * tilts[2 * e + k];
                }
            }
            for k in 0..2 {
                forces.sides[k][lane] = node(times(n, -tilt[k]));
            }
        }
        forces.scatter(ends, y, pull);
    }
}

#[inline(always)]
fn entries<T: Real, const N: usize>(rows: &[Lanes<T>; N], lane: usize) -> [T; N] {
    let mut entries = [T::ZERO; N];
    for i in 0..N {
        entries[i] = rows[i][lane];
    }
    entries
}

#[inline(always)]
fn node<T: Real>(v: Vector<T>) -> Node<T> {
    [v[0], v[1], v[2], T::ZERO]
}
