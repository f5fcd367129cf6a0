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

use super::cell::{Cell, Tetrahedron};
use super::hooke_cost::CountedCell;
use super::principal_kernels::{CROSSED, MODULI, SAME, Tangents, product};
use super::principal_linearize::{self as kernels, Axes, Rest};
use crate::element::kernel::Kernel;
use crate::element::placed::{InBlocks, Placed};
use crate::lanes::block::{LANES, apart, at, put};
use crate::lanes::{Node, Real};
use crate::linear::block_matrix::BlockMatrix;
use crate::material::law::isotropic::PAIRS;
use crate::material::law::lane_law::LaneLaw;
use crate::material::law::{IsotropicLaw, StVenantKirchhoff, StableNeoHookean};
use crate::{Mat3, Vec3};
use core::marker::PhantomData;

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

impl<L: LaneLaw, T: Real, C: Cell<N, Q>, const N: usize, const Q: usize>
    PrincipalTets<L, T, C, N, Q>
{
    /// The elements. They have no stiffness before the first call of `linearize`.
    fn new(tets: &[Tetrahedron<N, Q>]) -> Self {
        let order = apart(tets.len(), |element| &tets[element].nodes);
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
            let nodes = core::array::from_fn(|lane| tets[elements[lane.min(last)]].nodes);
            let mut rest = Rest {
                gradients: [[zero; 9]; Q],
                mu: [zero; Q],
                lambda: [zero; Q],
            };
            for lane in 0..LANES {
                let tet = &tets[elements[lane.min(last)]];
                for q in 0..Q {
                    rest.mu[q][lane] = T::of(tet.volumes[q] * tet.mu);
                    rest.lambda[q][lane] = T::of(tet.volumes[q] * tet.lambda);
                    if lane > last {
                        continue;
                    }
                    for (c, gradient) in tet.gradients[q].iter().enumerate() {
                        let row = [0, 1, 2].map(|j| T::of(gradient[j] * C::FACTOR));
                        put(&mut rest.gradients[q], lane, c, row);
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
            let gradients = C::gradients(q, &[-(b + c + d), b, c, d]);
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

/// The kernel of `tets` of `law`, whose blocks are in `matrix`.
pub(in crate::element) fn kernel<T: Real, C, const N: usize, const Q: usize>(
    law: IsotropicLaw,
    tets: &[Tetrahedron<N, Q>],
    matrix: &BlockMatrix,
) -> Box<dyn Kernel<T>>
where
    C: CountedCell<N, Q> + 'static,
{
    let nodes = tets.iter().map(|tet| tet.nodes);
    match law {
        IsotropicLaw::StVenantKirchhoff => {
            let elements = PrincipalTets::<StVenantKirchhoff, T, C, N, Q>::new(tets);
            Box::new(Placed::new(elements, nodes, matrix))
        }
        IsotropicLaw::StableNeoHookean => {
            let elements = PrincipalTets::<StableNeoHookean, T, C, N, Q>::new(tets);
            Box::new(Placed::new(elements, nodes, matrix))
        }
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

#[cfg(test)]
mod tests;
