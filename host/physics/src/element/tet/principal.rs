//! Tetrahedra of any isotropic law in blocks: forces, energies and products with the clipped tangent.
//!
//! No matrix is assembled. In the axes of `F = U diag(s) V^T` the modulus of an isotropic law has twelve numbers (see
//! [`isotropic`](crate::material::law::isotropic)). With the gradients `h_c = V^T g_c` a product is, at each point,
//!
//! ```text
//! f_c = U (C : sum_b (U^T u_b) h_b^T) h_c
//! ```
//!
//! so that it needs thirty numbers. Linearizations and products run in blocks, in the precision of the step: see
//! `principal_linearize` and `principal_kernels`.

use super::principal_cost::CountedLaw;
use super::principal_kernels::{CROSSED, Cell, Four, MODULI, SAME, Tangents, Ten, product};
use super::principal_linearize::{self as kernels, Axes, Rest};
use crate::element::kernel::Kernel;
use crate::element::placed::{InBlocks, Placed};
use crate::element::tet4::Tet;
use crate::element::tet4::kernels::{at, put};
use crate::element::tet10::QuadraticTet;
use crate::lanes::block::{LANES, apart};
use crate::lanes::{Node, Real};
use crate::linear::block_matrix::BlockMatrix;
use crate::material::law::isotropic::PAIRS;
use crate::material::law::lane_law::LaneLaw;
use crate::material::law::{IsotropicLaw, StVenantKirchhoff, StableNeoHookean};
use crate::{Mat3, Vec3};
use core::marker::PhantomData;

/// The constant data of a tetrahedron with `Q` points.
#[derive(Clone, Copy, Debug)]
struct Shape<const Q: usize> {
    /// At each point, the gradients of barycentric coordinates 1, 2 and 3 as rows (1/m).
    gradients: [Mat3; Q],
    /// The volume of each point (m^3).
    volumes: [f64; Q],
    mu: f64,
    lambda: f64,
}

/// Tetrahedra of an isotropic law in blocks.
#[derive(Clone, Debug)]
pub(crate) struct PrincipalTets<L, T, C, const N: usize, const Q: usize> {
    pub(super) nodes: Vec<[[u32; N]; LANES]>,
    pub(super) rest: Vec<Rest<T, Q>>,
    /// The latest right axes.
    pub(super) right: Vec<Axes<T, Q>>,
    pub(super) tangents: Vec<Tangents<T, Q>>,
    /// Block and lane of each element.
    pub(super) places: Vec<(u32, u32)>,
    kind: PhantomData<(L, C)>,
}

impl<L: LaneLaw, T: Real> PrincipalTets<L, T, Four, 4, 1> {
    /// Linear tetrahedra.
    pub(crate) fn linear(tets: &[Tet]) -> Self {
        let shape = |tet: &Tet| {
            let [_, b, c, d] = tet.gradients;
            Shape {
                gradients: [rows([b, c, d])],
                volumes: [tet.volume],
                mu: tet.mu,
                lambda: tet.lambda,
            }
        };
        let tets: Vec<_> = tets.iter().map(|tet| (tet.nodes, shape(tet))).collect();
        Self::new(&tets)
    }
}

impl<L: LaneLaw, T: Real> PrincipalTets<L, T, Ten, 10, 4> {
    /// Quadratic tetrahedra.
    pub(crate) fn quadratic(tets: &[QuadraticTet]) -> Self {
        let shape = |tet: &QuadraticTet| Shape {
            gradients: tet.gradients.map(|gradients| rows(gradients) * Ten::FACTOR),
            volumes: tet.volumes,
            mu: tet.mu,
            lambda: tet.lambda,
        };
        let tets: Vec<_> = tets.iter().map(|tet| (tet.nodes, shape(tet))).collect();
        Self::new(&tets)
    }
}

fn rows(vectors: [Vec3; 3]) -> Mat3 {
    Mat3::from_rows(&vectors.map(|vector| vector.transpose()))
}

impl<L: LaneLaw, T: Real, C: Cell<N, Q>, const N: usize, const Q: usize>
    PrincipalTets<L, T, C, N, Q>
{
    /// The elements. They have no stiffness before the first call of `linearize`.
    fn new(tets: &[([u32; N], Shape<Q>)]) -> Self {
        let order = apart(tets.len(), |element| &tets[element].0);
        let mut all = Self {
            nodes: Vec::new(),
            rest: Vec::new(),
            right: Vec::new(),
            tangents: Vec::new(),
            places: vec![(0, 0); tets.len()],
            kind: PhantomData,
        };
        let zero = [T::ZERO; LANES];
        let one = [T::of(1.0); LANES];
        for (block, elements) in order.chunks(LANES).enumerate() {
            // Copies of the last element without gradients pad the last block. They have no strain, force or stiffness.
            let last = elements.len() - 1;
            let nodes = core::array::from_fn(|lane| tets[elements[lane.min(last)]].0);
            let mut rest = Rest {
                gradients: [[zero; 9]; Q],
                mu: [zero; Q],
                lambda: [zero; Q],
            };
            for lane in 0..LANES {
                let shape = &tets[elements[lane.min(last)]].1;
                for q in 0..Q {
                    rest.mu[q][lane] = T::of(shape.volumes[q] * shape.mu);
                    rest.lambda[q][lane] = T::of(shape.volumes[q] * shape.lambda);
                    if lane <= last {
                        put_matrix(&mut rest.gradients[q], lane, &shape.gradients[q]);
                    }
                }
            }
            all.nodes.push(nodes);
            all.rest.push(rest);
            all.right.push([[one, zero, zero, zero]; Q]);
            all.tangents.push(Tangents {
                axes: [[zero; 9]; Q],
                gradients: [[zero; 9]; Q],
                moduli: [[zero; MODULI]; Q],
            });
            for (lane, &element) in elements.iter().enumerate() {
                all.places[element] = (block as u32, lane as u32);
            }
        }
        all
    }
}

impl<L: LaneLaw, T: Real, C: Cell<N, Q>, const N: usize, const Q: usize> InBlocks<T, N>
    for PrincipalTets<L, T, C, N, Q>
{
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        let fixed = (self.nodes.as_slice(), self.rest.as_slice());
        let state = (self.right.as_mut_slice(), self.tangents.as_mut_slice());
        kernels::linearize::<T, L, C, N, Q>(fixed, state, d, force).to_f64()
    }

    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        product::<T, C, N, Q>((&self.nodes, &self.tangents), factor, u, y);
    }

    fn stiffness(&self, element: usize) -> [[Mat3; N]; N] {
        let (block, lane) = self.places[element];
        let (tangents, lane) = (&self.tangents[block as usize], lane as usize);
        let mut blocks = [[Mat3::zeros(); N]; N];
        for q in 0..Q {
            let axes = matrix_at(&tangents.axes[q], lane);
            let moduli = tangents.moduli[q].map(|row| row[lane].to_f64());
            let turned = matrix_at(&tangents.gradients[q], lane);
            let [b, c, d] = [0, 1, 2].map(|c| turned.row(c).transpose());
            let coordinates = [-(b + c + d), b, c, d];
            let gradients = C::weights(q).map(|weights| {
                let terms = weights.iter().zip(&coordinates);
                terms
                    .map(|(&weight, gradient)| gradient * weight)
                    .sum::<Vec3>()
            });
            for a in 0..N {
                for b in a..N {
                    let inner = between(&moduli, &gradients[a], &gradients[b]);
                    blocks[a][b] += axes * inner * axes.transpose();
                }
            }
        }
        for a in 0..N {
            for b in 0..a {
                blocks[a][b] = blocks[b][a].transpose();
            }
        }
        blocks
    }

    fn bytes(&self) -> usize {
        size_of_val(self.places.as_slice())
            + size_of_val(self.nodes.as_slice())
            + size_of_val(self.rest.as_slice())
            + size_of_val(self.right.as_slice())
            + size_of_val(self.tangents.as_slice())
    }
}

/// The kernel of linear `tets` of `law`, whose blocks are in `matrix`.
pub(in crate::element) fn linear_kernel<T: Real>(
    law: IsotropicLaw,
    tets: &[Tet],
    matrix: &BlockMatrix,
) -> Box<dyn Kernel<T>> {
    fn of<L: CountedLaw, T: Real>(tets: &[Tet], matrix: &BlockMatrix) -> Box<dyn Kernel<T>> {
        let elements = PrincipalTets::<L, T, _, _, _>::linear(tets);
        let nodes = tets.iter().map(|tet| tet.nodes);
        Box::new(Placed::new(elements, nodes, matrix))
    }
    match law {
        IsotropicLaw::StVenantKirchhoff => of::<StVenantKirchhoff, T>(tets, matrix),
        IsotropicLaw::StableNeoHookean => of::<StableNeoHookean, T>(tets, matrix),
    }
}

/// The kernel of quadratic `tets` of `law`, whose blocks are in `matrix`.
pub(in crate::element) fn quadratic_kernel<T: Real>(
    law: IsotropicLaw,
    tets: &[QuadraticTet],
    matrix: &BlockMatrix,
) -> Box<dyn Kernel<T>> {
    fn of<L: CountedLaw, T: Real>(
        tets: &[QuadraticTet],
        matrix: &BlockMatrix,
    ) -> Box<dyn Kernel<T>> {
        let elements = PrincipalTets::<L, T, _, _, _>::quadratic(tets);
        let nodes = tets.iter().map(|tet| tet.nodes);
        Box::new(Placed::new(elements, nodes, matrix))
    }
    match law {
        IsotropicLaw::StVenantKirchhoff => of::<StVenantKirchhoff, T>(tets, matrix),
        IsotropicLaw::StableNeoHookean => of::<StableNeoHookean, T>(tets, matrix),
    }
}

/// The modulus between two gradients, in principal axes.
fn between(moduli: &[f64; MODULI], row: &Vec3, column: &Vec3) -> Mat3 {
    let mut block = Mat3::zeros();
    for (k, [i, j]) in PAIRS.into_iter().enumerate() {
        let (stretch, same, crossed) = (moduli[3 + k], moduli[SAME + k], moduli[CROSSED + k]);
        block[(k, k)] += moduli[k] * row[k] * column[k];
        block[(i, i)] += same * row[j] * column[j];
        block[(j, j)] += same * row[i] * column[i];
        block[(i, j)] += stretch * row[i] * column[j] + crossed * row[j] * column[i];
        block[(j, i)] += stretch * row[j] * column[i] + crossed * row[i] * column[j];
    }
    block
}

fn matrix_at<T: Real>(rows: &[[T; LANES]; 9], lane: usize) -> Mat3 {
    let entries = at(rows, lane);
    Mat3::from_fn(|i, j| entries[i][j].to_f64())
}

fn put_matrix<T: Real>(rows: &mut [[T; LANES]; 9], lane: usize, matrix: &Mat3) {
    for i in 0..3 {
        put(rows, lane, i, [0, 1, 2].map(|j| T::of(matrix[(i, j)])));
    }
}

#[cfg(test)]
mod tests;
