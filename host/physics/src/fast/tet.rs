//! Corotational linear tetrahedra in blocks: forces, energies and products with the stiffness.
//!
//! The law is [`Corotational`](crate::fem::law::Corotational): with the rotation `R` of the element's
//! deformation gradient and the strain `E = R^T F - I`, `P = R (2 mu E + lambda tr(E) I)`. The stiffness is
//! the warped one, `R K0 R^T` (Müller and Gross, "Interactive virtual materials", 2004): positive
//! semidefinite whatever the strain. No matrix is kept. With the rotated rest gradients
//! `b_a = sqrt(2 mu V) R g_a` the product is `f_a = (sym G + lambda / (2 mu) tr(G) I) b_a` where
//! `G = sum u_a b_a^T`: nine numbers an element and one ratio.
//!
//! Displacements are those from rest, so that single precision keeps the digits of small strains.

use super::Node;
use super::lanes::{LANES, Lanes, Real, gather, scatter};
use super::polar::{Quaternion, matrix, quaternion, rotation_less_identity, strain, turn};
use crate::{Mat3, Vec3};
use multiversion::multiversion;

/// Newton iterations a call spends on a rotation before it takes the singular values instead.
const MAX_TURNS: usize = 8;
/// Elements among which the next is chosen, and the number of elements before it that it should share no
/// node with.
const WINDOW: usize = 128;
const APART: usize = 8;

/// One tetrahedron, nodes in the solver's numbering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tet {
    /// Its nodes.
    pub nodes: [u32; 4],
    /// Rest gradients of the shape functions (1/m); they sum to zero.
    pub gradients: [Vec3; 4],
    /// Rest volume (m^3).
    pub volume: f64,
    /// Lamé's first parameter (Pa).
    pub lambda: f64,
    /// Shear modulus (Pa), positive.
    pub mu: f64,
}

/// What does not change of a block.
#[derive(Clone, Debug)]
struct Rest<T> {
    /// Component `j` of the gradient of node `a + 1` in row `3 a + j` (1/m).
    gradients: [Lanes<T>; 9],
    /// `sqrt(2 mu V)`; zero where the block is filled up.
    scale: Lanes<T>,
}

/// What a product reads of a block.
#[derive(Clone, Debug)]
struct Turned<T> {
    /// The gradients rotated and scaled.
    gradients: [Lanes<T>; 9],
    /// `lambda / (2 mu)`.
    ratio: Lanes<T>,
}

/// Corotational tetrahedra.
#[derive(Clone, Debug)]
pub struct Tets<T> {
    nodes: Vec<[[u32; 4]; LANES]>,
    rest: Vec<Rest<T>>,
    turned: Vec<Turned<T>>,
    rotations: Vec<[Lanes<T>; 4]>,
    /// Block and lane of each element.
    places: Vec<(u32, u32)>,
}

/// An order of the elements in which neighbours share no node where that can be had, so that sums into nodes
/// need not wait for each other; it stays near the given one.
fn order(tets: &[Tet]) -> Vec<usize> {
    let mut order = Vec::with_capacity(tets.len());
    let mut window: Vec<usize> = (0..tets.len().min(WINDOW)).collect();
    let mut next = window.len();
    while !window.is_empty() {
        let recent = &order[order.len().saturating_sub(APART)..];
        let apart = |&element: &usize| {
            let shares = |&other: &usize| {
                let other: &Tet = &tets[other];
                tets[element].nodes.iter().any(|n| other.nodes.contains(n))
            };
            !recent.iter().any(shares)
        };
        let chosen = window.iter().position(apart).unwrap_or(0);
        order.push(window.remove(chosen));
        if next < tets.len() {
            window.push(next);
            next += 1;
        }
    }
    order
}

impl<T: Real> Tets<T> {
    /// The elements at rest.
    pub fn new(tets: impl ExactSizeIterator<Item = Tet>) -> Self {
        let tets: Vec<Tet> = tets.collect();
        let order = order(&tets);
        let mut all = Self {
            nodes: Vec::new(),
            rest: Vec::new(),
            turned: Vec::new(),
            rotations: Vec::new(),
            places: vec![(0, 0); tets.len()],
        };
        for (block, elements) in order.chunks(LANES).enumerate() {
            let zero = [T::ZERO; LANES];
            let mut nodes = [[0; 4]; LANES];
            let mut rest = Rest {
                gradients: [zero; 9],
                scale: zero,
            };
            let mut ratio = zero;
            for lane in 0..LANES {
                // A block is filled up with copies of its last element that have no volume.
                let element = elements[lane.min(elements.len() - 1)];
                let tet = &tets[element];
                nodes[lane] = tet.nodes;
                for a in 0..3 {
                    for j in 0..3 {
                        rest.gradients[3 * a + j][lane] = T::of(tet.gradients[a + 1][j]);
                    }
                }
                ratio[lane] = T::of(tet.lambda / (2.0 * tet.mu));
                if lane < elements.len() {
                    rest.scale[lane] = T::of((2.0 * tet.mu * tet.volume).sqrt());
                    all.places[element] = (block as u32, lane as u32);
                }
            }
            let mut gradients = rest.gradients;
            for row in &mut gradients {
                for (entry, &scale) in row.iter_mut().zip(&rest.scale) {
                    *entry = *entry * scale;
                }
            }
            all.nodes.push(nodes);
            all.rest.push(rest);
            all.turned.push(Turned { gradients, ratio });
            all.rotations.push([[T::of(1.0); LANES], zero, zero, zero]);
        }
        all
    }

    /// Number of elements.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Finds the rotations at displacements `d` (m), starting from the last ones, and adds the elastic forces
    /// (N) to `force`. Returns the elastic energy (J).
    ///
    /// # Panics
    ///
    /// Where `d` or `force` is shorter than a node's number.
    pub fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> T {
        linearize::<T, false>(
            &self.nodes,
            &self.rest,
            &mut self.turned,
            &mut self.rotations,
            d,
            d,
            T::ZERO,
            force,
        )
    }

    /// The same, and subtracts `factor` times the stiffness times `u` from `force` on the way: the residual
    /// of a guess `u` of the step. Returns the elastic energy at `d` (J).
    ///
    /// # Panics
    ///
    /// Where `d`, `u` or `force` is shorter than a node's number.
    pub fn linearize_with(
        &mut self,
        d: &[Node<T>],
        u: &[Node<T>],
        factor: T,
        force: &mut [Node<T>],
    ) -> T {
        linearize::<T, true>(
            &self.nodes,
            &self.rest,
            &mut self.turned,
            &mut self.rotations,
            d,
            u,
            factor,
            force,
        )
    }

    /// Adds `factor` times the stiffness at the last rotations times `u` to `y`.
    ///
    /// # Panics
    ///
    /// Where `u` or `y` is shorter than a node's number.
    pub fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        product(&self.nodes, &self.turned, factor, u, y);
    }

    /// Rotation of an element in the last call of `linearize`; the identity before the first.
    ///
    /// # Panics
    ///
    /// Where there is no such element.
    pub fn rotation(&self, element: usize) -> Mat3 {
        let (block, lane) = self.places[element];
        let rows = &self.rotations[block as usize];
        matrix(rows.map(|row| row[lane as usize]))
    }

    /// Nodes of an element.
    ///
    /// # Panics
    ///
    /// Where there is no such element.
    pub fn nodes(&self, element: usize) -> [u32; 4] {
        let (block, lane) = self.places[element];
        self.nodes[block as usize][lane as usize]
    }

    /// The 3 x 3 blocks of an element's stiffness at the last rotations (N/m), by its nodes.
    ///
    /// # Panics
    ///
    /// Where there is no such element.
    pub fn stiffness(&self, element: usize) -> [[Mat3; 4]; 4] {
        let (block, lane) = self.places[element];
        let turned = &self.turned[block as usize];
        let lane = lane as usize;
        let ratio = turned.ratio[lane].to_f64();
        let mut b = [Vec3::zeros(); 4];
        for a in 0..3 {
            b[a + 1] = Vec3::from_fn(|i, _| turned.gradients[3 * a + i][lane].to_f64());
        }
        b[0] = -(b[1] + b[2] + b[3]);
        b.map(|row| {
            b.map(|column| {
                (Mat3::from_diagonal_element(row.dot(&column)) + column * row.transpose()) * 0.5
                    + row * column.transpose() * ratio
            })
        })
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
    "x86_64+avx2+bmi1+bmi2"
))]
#[allow(clippy::too_many_arguments)]
fn linearize<T: Real, const GUESS: bool>(
    nodes: &[[[u32; 4]; LANES]],
    rest: &[Rest<T>],
    turned: &mut [Turned<T>],
    rotations: &mut [[Lanes<T>; 4]],
    d: &[Node<T>],
    u: &[Node<T>],
    factor: T,
    force: &mut [Node<T>],
) -> T {
    let mut energy = [T::ZERO; LANES];
    let blocks = nodes.iter().zip(rest).zip(turned).zip(rotations);
    for (((nodes, rest), turned), rotations) in blocks {
        let mut rows = deformation(rest, gather(nodes, d));
        rotate(&rows, rotations);
        add_energy(rest, &turned.ratio, rotations, &rows, &mut energy);
        if GUESS {
            let further = deformation(rest, gather(nodes, u));
            for (row, further) in rows.iter_mut().zip(&further) {
                for lane in 0..LANES {
                    row[lane] += factor * further[lane];
                }
            }
        }
        respond(rest, rotations, turned, &mut rows);
        scatter(nodes, &rows, force);
    }
    let mut sum = T::ZERO;
    for energy in energy {
        sum += energy;
    }
    sum
}

/// `F - I = sum (d_a - d_0) g_a^T`, row by row, from the differences.
#[inline(always)]
fn deformation<T: Real>(rest: &Rest<T>, differences: [Lanes<T>; 9]) -> [Lanes<T>; 9] {
    let g = &rest.gradients;
    let e = &differences;
    let mut h = [[T::ZERO; LANES]; 9];
    for lane in 0..LANES {
        for i in 0..3 {
            for j in 0..3 {
                h[3 * i + j][lane] = e[i][lane] * g[j][lane]
                    + e[3 + i][lane] * g[3 + j][lane]
                    + e[6 + i][lane] * g[6 + j][lane];
            }
        }
    }
    h
}

#[inline(always)]
fn at<T: Real>(rows: &[Lanes<T>; 9], lane: usize) -> [[T; 3]; 3] {
    let mut m = [[T::ZERO; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            m[i][j] = rows[3 * i + j][lane];
        }
    }
    m
}

#[inline(always)]
fn quaternion_at<T: Real>(rows: &[Lanes<T>; 4], lane: usize) -> Quaternion<T> {
    [rows[0][lane], rows[1][lane], rows[2][lane], rows[3][lane]]
}

/// Rotations of a block.
#[inline(always)]
fn rotate<T: Real>(h: &[Lanes<T>; 9], rotations: &mut [Lanes<T>; 4]) {
    let mut open = [0_u32; LANES];
    for _ in 0..MAX_TURNS {
        let before = *rotations;
        let mut after = before;
        let mut count = 0;
        for lane in 0..LANES {
            let (q, done) = turn(quaternion_at(&before, lane), &at(h, lane));
            for (row, entry) in after.iter_mut().zip(q) {
                row[lane] = entry;
            }
            open[lane] = u32::from(!done);
            count += u32::from(!done);
        }
        *rotations = after;
        if count == 0 {
            return;
        }
    }
    for lane in 0..LANES {
        if open[lane] != 0 {
            let q = quaternion(&at(h, lane));
            for (row, entry) in rotations.iter_mut().zip(q) {
                row[lane] = entry;
            }
        }
    }
}

/// Adds the energies of a block to `energy`, lane by lane.
#[inline(always)]
fn add_energy<T: Real>(
    rest: &Rest<T>,
    ratio: &Lanes<T>,
    rotations: &[Lanes<T>; 4],
    h: &[Lanes<T>; 9],
    energy: &mut Lanes<T>,
) {
    let half = T::of(0.5);
    for lane in 0..LANES {
        let less = rotation_less_identity(quaternion_at(rotations, lane));
        let e = strain(&less, &at(h, lane));
        let (e01, e02, e12) = (e[0][1] + e[1][0], e[0][2] + e[2][0], e[1][2] + e[2][1]);
        let trace = e[0][0] + e[1][1] + e[2][2];
        let square = e[0][0] * e[0][0]
            + e[1][1] * e[1][1]
            + e[2][2] * e[2][2]
            + half * (e01 * e01 + e02 * e02 + e12 * e12);
        let scale = rest.scale[lane];
        energy[lane] += half * (scale * scale) * (square + ratio[lane] * (trace * trace));
    }
}

/// Rotates the gradients of a block and replaces `rows`, `F - I`, by the forces on the last three nodes.
#[inline(always)]
fn respond<T: Real>(
    rest: &Rest<T>,
    rotations: &[Lanes<T>; 4],
    turned: &mut Turned<T>,
    rows: &mut [Lanes<T>; 9],
) {
    let half = T::of(0.5);
    let one = T::of(1.0);
    let mut gradients = [[T::ZERO; LANES]; 9];
    let mut forces = [[T::ZERO; LANES]; 9];
    for lane in 0..LANES {
        let mut r = rotation_less_identity(quaternion_at(rotations, lane));
        let e = strain(&r, &at(rows, lane));
        for (i, row) in r.iter_mut().enumerate() {
            row[i] = row[i] + one;
        }
        let scale = rest.scale[lane];
        let pressure = turned.ratio[lane] * (e[0][0] + e[1][1] + e[2][2]);
        let s01 = half * (e[0][1] + e[1][0]) * scale;
        let s02 = half * (e[0][2] + e[2][0]) * scale;
        let s12 = half * (e[1][2] + e[2][1]) * scale;
        let s = [
            [(e[0][0] + pressure) * scale, s01, s02],
            [s01, (e[1][1] + pressure) * scale, s12],
            [s02, s12, (e[2][2] + pressure) * scale],
        ];
        for a in 0..3 {
            let g = [
                rest.gradients[3 * a][lane],
                rest.gradients[3 * a + 1][lane],
                rest.gradients[3 * a + 2][lane],
            ];
            let t = times(&s, g);
            let f = times(&r, t);
            let b = times(&r, g);
            for i in 0..3 {
                forces[3 * a + i][lane] = -(f[i] * scale);
                gradients[3 * a + i][lane] = b[i] * scale;
            }
        }
    }
    *rows = forces;
    turned.gradients = gradients;
}

#[inline(always)]
fn times<T: Real>(m: &[[T; 3]; 3], v: [T; 3]) -> [T; 3] {
    let mut product = [T::ZERO; 3];
    for i in 0..3 {
        product[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
    }
    product
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
    "x86_64+avx2+bmi1+bmi2"
))]
fn product<T: Real>(
    nodes: &[[[u32; 4]; LANES]],
    turned: &[Turned<T>],
    factor: T,
    u: &[Node<T>],
    y: &mut [Node<T>],
) {
    let half = T::of(0.5) * factor;
    for (nodes, turned) in nodes.iter().zip(turned) {
        let e = gather(nodes, u);
        let b = &turned.gradients;
        let mut forces = [[T::ZERO; LANES]; 9];
        for lane in 0..LANES {
            let mut g = [[T::ZERO; 3]; 3];
            for i in 0..3 {
                for j in 0..3 {
                    g[i][j] = e[i][lane] * b[j][lane]
                        + e[3 + i][lane] * b[3 + j][lane]
                        + e[6 + i][lane] * b[6 + j][lane];
                }
            }
            let pressure = turned.ratio[lane] * (g[0][0] + g[1][1] + g[2][2]);
            let s01 = half * (g[0][1] + g[1][0]);
            let s02 = half * (g[0][2] + g[2][0]);
            let s12 = half * (g[1][2] + g[2][1]);
            let s = [
                [factor * (g[0][0] + pressure), s01, s02],
                [s01, factor * (g[1][1] + pressure), s12],
                [s02, s12, factor * (g[2][2] + pressure)],
            ];
            for a in 0..3 {
                let f = times(&s, [b[3 * a][lane], b[3 * a + 1][lane], b[3 * a + 2][lane]]);
                for i in 0..3 {
                    forces[3 * a + i][lane] = f[i];
                }
            }
        }
        scatter(nodes, &forces, y);
    }
}
