//! The bending of a sheet in blocks: forces, energies and products with the stiffness of Gauss and Newton.
//!
//! A pass has three parts. The derivatives across the edges follow from the nodes by a constant sparse matrix. The
//! triangles compute with the derivatives at their sides, in blocks. The transposed matrix carries the forces on the
//! derivatives back to the nodes.
//!
//! Displacements are relative to the rest positions, so that single precision keeps the digits of small curvatures.

use super::NONE;
use super::curvature::VECTORS;
use super::exact::Bending;
use super::kernels::{Blocks, Curved, Rest, State, linearize, product};
use super::patch::Sided;
use super::scalar::{ScalarMatrix, add_product, differences, set_product};
use super::torn_facets::Followed;
use crate::Vec3;
use crate::element::kernel::Kernel;
use crate::element::torn::TearableKernel;
use crate::lanes::block::{LANES, apart};
use crate::lanes::{Node, Real};
use crate::linear::block_matrix::BlockMatrix;
use std::sync::Arc;

/// A derivative at rest that leaves the plane of its triangle by less than this value is in the plane: rounding.
const FLAT: f64 = 1e-13;

/// The bending of a sheet in blocks. Clones share the constant data.
#[derive(Clone, Debug)]
pub(crate) struct BentFacets<T> {
    pub(super) plan: Arc<Plan<T>>,
    /// The latest linearization by block.
    pub(super) state: Vec<State<T>>,
    /// By edge: the derivative, and the force on it.
    pub(super) theta: Vec<Node<T>>,
    pub(super) pull: Vec<Node<T>>,
    /// The exact form of a sheet that can tear.
    pub(super) followed: Option<Box<Followed>>,
}

/// The constant data.
#[derive(Debug)]
pub(super) struct Plan<T> {
    /// Number of triangles. Lanes after the last triangle pad the last block.
    pub(super) count: usize,
    pub(super) blocks: Blocks<T>,
    /// The derivatives across edges from nodes, and the transpose.
    pub(super) derivatives: ScalarMatrix<T>,
    pub(super) back: ScalarMatrix<T>,
}

/// The constants of a triangle at rest.
pub(super) struct AtRest {
    pub(super) sides: [Vec3; 2],
    pub(super) along: [[f64; 2]; 3],
    pub(super) rise: [f64; 3],
    pub(super) normal: Vec3,
}

impl AtRest {
    /// The constants of a triangle of `exact`, whose vertices start at `rest` (m).
    pub(super) fn new(exact: &Bending, triangle: usize, rest: &[Vec3]) -> Self {
        let (theta, sides) = exact.vectors(triangle, |vertex| rest[vertex as usize]);
        let cross = sides[0].cross(&sides[1]);
        let square = cross.norm_squared();
        let duals = [
            sides[1].cross(&cross) / square,
            cross.cross(&sides[0]) / square,
        ];
        let normal = cross / square.sqrt();
        Self {
            sides,
            along: theta.map(|theta| duals.map(|dual| dual.dot(&theta))),
            rise: theta.map(|theta| theta.dot(&normal)),
            normal,
        }
    }
}

impl<T: Real> BentFacets<T> {
    /// The kernel of `exact`, whose vertices are the nodes in the solver's order, at `rest` (m) at rest.
    pub(super) fn new(exact: &Bending, rest: &[Vec3]) -> Self {
        let corners = &exact.triangles;
        let order = apart(corners.len(), |triangle| &corners[triangle]);
        let at_rest = |triangle| AtRest::new(exact, triangle, rest);
        let all: Vec<AtRest> = (0..corners.len()).map(at_rest).collect();
        let is_curved = all
            .iter()
            .any(|one| one.rise.iter().any(|rise| rise.abs() > FLAT));
        let derivatives = exact.rotations.converted();
        let mut blocks = Blocks::default();
        for triangles in order.chunks(LANES) {
            let zero = [T::ZERO; LANES];
            let (mut nodes, mut edges) = ([[0; 3]; LANES], [[0; 3]; LANES]);
            let mut constants = Rest {
                sides: [zero; 6],
                along: [zero; 6],
                weights: [zero; 9],
            };
            let mut curved = Curved {
                rise: [zero; 3],
                normal: [zero; 3],
                curvature: [zero; 3],
            };
            for lane in 0..LANES {
                // Copies of the last triangle without stiffness pad the last block.
                let triangle = triangles[lane.min(triangles.len() - 1)];
                let (facet, one) = (&exact.facets[triangle], &all[triangle]);
                nodes[lane] = corners[triangle];
                // The slope at a border has no weight, so that any edge does there.
                edges[lane] = exact.sides[triangle].map(|edge| if edge == NONE { 0 } else { edge });
                for i in 0..3 {
                    for k in 0..2 {
                        constants.sides[3 * k + i][lane] = T::of(one.sides[k][i]);
                        constants.along[2 * i + k][lane] = T::of(one.along[i][k]);
                    }
                    curved.rise[i][lane] = T::of(one.rise[i]);
                    curved.normal[i][lane] = T::of(one.normal[i]);
                }
                if lane < triangles.len() {
                    let curvature = exact.rest_curvature(triangle);
                    for i in 0..3 {
                        curved.curvature[i][lane] = T::of(curvature[i]);
                        for e in 0..3 {
                            constants.weights[3 * e + i][lane] = T::of(facet.weights[e][i]);
                        }
                    }
                }
            }
            blocks.nodes.push(nodes);
            blocks.edges.push(edges);
            blocks.rest.push(constants);
            if is_curved {
                blocks.curved.push(curved);
            }
        }
        let zeros = vec![[T::ZERO; 4]; derivatives.rows()];
        let plan = Plan {
            count: corners.len(),
            back: derivatives.transposed(rest.len()),
            derivatives,
            blocks,
        };
        Self {
            state: vec![State::ZERO; plan.blocks.rest.len()],
            plan: Arc::new(plan),
            theta: zeros.clone(),
            pull: zeros,
            followed: Followed::new(exact, rest, &order),
        }
    }

    /// Number of triangles.
    pub(super) fn len(&self) -> usize {
        self.plan.count
    }

    /// The derivatives of the three components of a triangle's curvature by its five vectors.
    fn derivatives(&self, block: usize, lane: usize) -> [[Vec3; VECTORS]; 3] {
        let (rest, state) = (&self.plan.blocks.rest[block], &self.state[block]);
        let number = |rows: &[[T; LANES]], row: usize| rows[row][lane].to_f64();
        let vector = |rows: &[[T; LANES]], row| Vec3::from_fn(|i, _| number(rows, row + i));
        let normal = vector(&state.normal, 0);
        let mut all = [[Vec3::zeros(); VECTORS]; 3];
        for (c, of) in all.iter_mut().enumerate() {
            for e in 0..3 {
                let weight = number(&rest.weights, 3 * e + c);
                of[e] = vector(&state.slopes, 3 * e) * weight;
                for k in 0..2 {
                    of[3 + k] -= normal * (weight * number(&state.tilts, 2 * e + k));
                }
            }
        }
        all
    }
}

impl<T: Real> Kernel<T> for BentFacets<T> {
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        let plan = &*self.plan;
        differences(&plan.derivatives, d, &mut self.theta);
        self.pull.fill([T::ZERO; 4]);
        let blocks = (&plan.blocks, &mut *self.state);
        let energy = linearize(blocks, (d, &self.theta), (force, &mut self.pull));
        add_product(&plan.back, &self.pull, force);
        energy.to_f64()
    }

    fn product(&mut self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        let plan = &*self.plan;
        set_product(&plan.derivatives, u, &mut self.theta);
        self.pull.fill([T::ZERO; 4]);
        let blocks = (&plan.blocks, &*self.state);
        product(blocks, factor, (u, &self.theta), (y, &mut self.pull));
        add_product(&plan.back, &self.pull, y);
    }

    fn add_to(&self, matrix: &mut BlockMatrix) {
        let Plan {
            count,
            blocks,
            derivatives,
            ..
        } = &*self.plan;
        for triangle in 0..*count {
            let (block, lane) = (triangle / LANES, triangle % LANES);
            let weights = &blocks.rest[block].weights;
            let has_weight = |side: usize| (0..3).any(|c| weights[3 * side + c][lane] != T::ZERO);
            let edges = blocks.edges[block][lane];
            let sided = Sided {
                rotations: derivatives,
                corners: blocks.nodes[block][lane],
                sides: [0, 1, 2].map(|side| has_weight(side).then_some(edges[side])),
            };
            sided.add_to(&self.derivatives(block, lane), None, matrix);
        }
    }

    /// The constant data count in equal parts for each of the kernels that share them.
    fn bytes(&self) -> usize {
        let Plan {
            blocks,
            derivatives,
            back,
            ..
        } = &*self.plan;
        let shared = size_of_val(blocks.nodes.as_slice())
            + size_of_val(blocks.edges.as_slice())
            + size_of_val(blocks.rest.as_slice())
            + size_of_val(blocks.curved.as_slice())
            + derivatives.bytes()
            + back.bytes();
        shared / Arc::strong_count(&self.plan)
            + size_of_val(self.state.as_slice())
            + size_of_val(self.theta.as_slice())
            + size_of_val(self.pull.as_slice())
            + self
                .followed
                .as_ref()
                .map_or(0, |followed| followed.bytes())
    }

    fn tearable(&mut self) -> Option<&mut dyn TearableKernel<T>> {
        self.followed.is_some().then_some(self)
    }
}

impl Bending {
    /// The kernel of the bending in another order: `place` gives the place of each row, and `rest` contains the rest
    /// positions of the places (m).
    pub(crate) fn kernel<T: Real>(&self, place: &[u32], rest: &[Vec3]) -> BentFacets<T> {
        let mut exact = self.clone();
        exact.renumber(place);
        BentFacets::new(&exact, rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::bending::{BentSheet, Plate};
    use crate::lanes::{to_node, to_vec};
    use crate::material::{Material, Tangent};

    const CELLS: u32 = 7;

    /// Numbers between -1/2 and 1/2 without a pattern.
    fn vector(seed: u32) -> Vec3 {
        Vec3::from_fn(|i, _| {
            let mixed = (seed * 3 + i as u32 + 1).wrapping_mul(2_654_435_761) >> 16;
            f64::from(mixed % 4096) / 4096.0 - 0.5
        })
    }

    /// Irregular triangles, at rest on a cylinder or in a plane, with one vertex numbered out of order.
    fn sheet(curved: bool) -> (Vec<[u32; 3]>, Vec<Vec3>) {
        let mut triangles = Vec::new();
        for j in 0..CELLS {
            for i in 0..CELLS {
                let a = j * (CELLS + 1) + i;
                let (b, c, d) = (a + 1, a + CELLS + 2, a + CELLS + 1);
                if (i + 2 * j) % 3 == 0 {
                    triangles.extend([[a, b, d], [b, c, d]]);
                } else {
                    triangles.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
        let place = |n: u32| {
            let grid = Vec3::new(f64::from(n % (CELLS + 1)), f64::from(n / (CELLS + 1)), 0.0);
            let mut flat = (grid + vector(n) * 0.4) * 0.01;
            flat.z = 0.0;
            let (angle, radius) = (flat.x / 0.05, 0.05);
            if curved {
                Vec3::new(radius * angle.sin(), flat.y, radius * (1.0 - angle.cos()))
            } else {
                flat
            }
        };
        (triangles, (0..(CELLS + 1).pow(2)).map(place).collect())
    }

    fn rotated(v: &Vec3) -> Vec3 {
        nalgebra::Rotation3::from_euler_angles(0.7, -0.4, 1.9) * v
    }

    /// The kernel and the exact form in a turned state with strains and curvatures.
    fn compare<T: Real>(curved: bool, tolerance: f64) {
        let (triangles, rest) = sheet(curved);
        let material = Material {
            young: 1e6,
            poisson: 0.3,
            thickness: 1e-3,
            density: 1000.0,
        };
        let count = rest.len();
        let x: Vec<Vec3> = (0_u32..)
            .zip(&rest)
            .map(|(n, x)| rotated(&(x + vector(n + 500) * 0.002)) + Vec3::repeat(0.02))
            .collect();
        let bent = BentSheet::new(
            &triangles,
            vec![Plate {
                matrix: material.plate(),
                thickness: material.thickness,
            }],
        );
        let bending = bent.map(|sheet| sheet.bending(&rest, core::iter::empty(), |_| false));
        let Ok(exact) = bending else {
            panic!("the sheet is regular");
        };
        let nodes: Vec<u32> = (0..count as u32).collect();
        let patches = exact.patches();
        let pattern = || BlockMatrix::new(count, count, patches.iter().map(Vec::as_slice));
        let mut matrix = pattern();
        let mut force = vec![Vec3::zeros(); count];
        exact.assemble((&x, &nodes), Tangent::Clipped, &mut force, &mut matrix);

        let mut kernel = BentFacets::<T>::new(&exact, &rest);
        let d: Vec<Node<T>> = x
            .iter()
            .zip(&rest)
            .map(|(x, rest)| to_node(&(x - rest)))
            .collect();
        let mut found = vec![[T::ZERO; 4]; count];
        let energy = kernel.linearize(&d, &mut found);
        let near = |found: &[Node<T>], expected: &[Vec3]| {
            let largest = expected.iter().map(Vec3::amax).fold(0.0, f64::max);
            let errors = found
                .iter()
                .zip(expected)
                .map(|(a, b)| (to_vec(a) - b).amax());
            let worst = errors.fold(0.0, f64::max);
            assert!(worst < tolerance * largest, "{worst:e} of {largest:e}");
        };
        near(&found, &force);
        let expected = exact.energy(&x, &nodes);
        assert!(
            (energy / expected - 1.0).abs() < tolerance,
            "{energy:e} {expected:e}"
        );

        let u: Vec<Vec3> = (0..count as u32).map(|n| vector(n + 900) * 1e-3).collect();
        let mut ku = vec![Vec3::zeros(); count];
        matrix.product(&u, &mut ku);
        let mut found = vec![[T::ZERO; 4]; count];
        let single: Vec<Node<T>> = u.iter().map(to_node).collect();
        kernel.product(T::of(1.0), &single, &mut found);
        near(&found, &ku);

        let mut again = pattern();
        kernel.add_to(&mut again);
        let mut added = vec![Vec3::zeros(); count];
        again.product(&u, &mut added);
        let added: Vec<Node<T>> = added.iter().map(to_node).collect();
        near(&added, &ku);
    }

    /// Rounding errors of some hundred operations, multiplied by the turn of the sheet over its slopes.
    #[test]
    fn the_vector_form_is_the_exact_form() {
        for curved in [false, true] {
            compare::<f64>(curved, 1e-12);
            compare::<f32>(curved, 1e-4);
        }
    }
}
