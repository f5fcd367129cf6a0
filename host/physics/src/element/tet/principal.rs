//! Tetrahedra of any isotropic law in blocks: forces, energies and products with the clipped tangent.
//!
//! No matrix is assembled. In the axes of `F = U diag(s) V^T` the modulus of an isotropic law has twelve numbers (see
//! [`isotropic`](crate::material::law::isotropic)). With the gradients `h_c = V^T g_c` a product is, at each point,
//!
//! ```text
//! f_c = U (C : sum_b (U^T u_b) h_b^T) h_c
//! ```
//!
//! so that it needs thirty numbers. The law computes them point by point, in double precision whatever the precision of
//! the step, since stresses of large strains are differences of large numbers. Products run in blocks.

use super::principal_kernels::{CROSSED, Cell, Four, MODULI, SAME, Tangents, Ten, product};
use crate::element::kernel::Kernel;
use crate::element::placed::{InBlocks, Placed};
use crate::element::tet4::Tet;
use crate::element::tet4::kernels::{at, put};
use crate::element::tet10::QuadraticTet;
use crate::lanes::block::{LANES, apart};
use crate::lanes::{Node, Real};
use crate::linear::block_matrix::BlockMatrix;
use crate::material::law::Lame;
use crate::material::law::isotropic::{PAIRS, PointLaw};
use crate::{Mat3, Vec3};
use core::marker::PhantomData;

/// The constant data of a tetrahedron with `Q` points.
#[derive(Clone, Copy, Debug)]
struct Rest<const Q: usize> {
    /// At each point, the gradients of barycentric coordinates 1, 2 and 3 as rows (1/m).
    gradients: [Mat3; Q],
    /// The volume of each point (m^3).
    volumes: [f64; Q],
    lame: Lame,
}

/// Tetrahedra of an isotropic law in blocks.
#[derive(Clone, Debug)]
pub(crate) struct PrincipalTets<T, C, const N: usize, const Q: usize> {
    law: PointLaw,
    pub(super) nodes: Vec<[[u32; N]; LANES]>,
    /// By block and lane, without the padding of the last block.
    rest: Vec<Rest<Q>>,
    /// The latest right axes of each point, by block and lane.
    right: Vec<[Mat3; Q]>,
    pub(super) tangents: Vec<Tangents<T, Q>>,
    /// Block and lane of each element.
    pub(super) places: Vec<(u32, u32)>,
    cell: PhantomData<C>,
}

impl<T: Real> PrincipalTets<T, Four, 4, 1> {
    /// Linear tetrahedra.
    pub(crate) fn linear(law: PointLaw, tets: &[Tet]) -> Self {
        let rest = |tet: &Tet| {
            let [_, b, c, d] = tet.gradients;
            Rest {
                gradients: [rows([b, c, d])],
                volumes: [tet.volume],
                lame: Lame {
                    mu: tet.mu,
                    lambda: tet.lambda,
                },
            }
        };
        let tets: Vec<_> = tets.iter().map(|tet| (tet.nodes, rest(tet))).collect();
        Self::new(law, &tets)
    }
}

impl<T: Real> PrincipalTets<T, Ten, 10, 4> {
    /// Quadratic tetrahedra.
    pub(crate) fn quadratic(law: PointLaw, tets: &[QuadraticTet]) -> Self {
        let rest = |tet: &QuadraticTet| Rest {
            gradients: tet.gradients.map(|gradients| rows(gradients) * Ten::FACTOR),
            volumes: tet.volumes,
            lame: Lame {
                mu: tet.mu,
                lambda: tet.lambda,
            },
        };
        let tets: Vec<_> = tets.iter().map(|tet| (tet.nodes, rest(tet))).collect();
        Self::new(law, &tets)
    }
}

fn rows(vectors: [Vec3; 3]) -> Mat3 {
    Mat3::from_rows(&vectors.map(|vector| vector.transpose()))
}

impl<T: Real, C: Cell<N, Q>, const N: usize, const Q: usize> PrincipalTets<T, C, N, Q> {
    /// The elements. They have no stiffness before the first call of `linearize`.
    fn new(law: PointLaw, tets: &[([u32; N], Rest<Q>)]) -> Self {
        let order = apart(tets.len(), |element| &tets[element].0);
        let mut all = Self {
            law,
            nodes: Vec::new(),
            rest: order.iter().map(|&element| tets[element].1).collect(),
            right: vec![[Mat3::identity(); Q]; tets.len()],
            tangents: Vec::new(),
            places: vec![(0, 0); tets.len()],
            cell: PhantomData,
        };
        for (block, elements) in order.chunks(LANES).enumerate() {
            // Copies of the last element without stiffness pad the last block.
            let last = elements.len() - 1;
            let nodes = core::array::from_fn(|lane| tets[elements[lane.min(last)]].0);
            all.nodes.push(nodes);
            let zero = [T::ZERO; LANES];
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

impl<T: Real, C: Cell<N, Q>, const N: usize, const Q: usize> InBlocks<T, N>
    for PrincipalTets<T, C, N, Q>
{
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        let mut energy = 0.0;
        let mut points = [[[T::ZERO; LANES]; 9]; Q];
        let blocks = self.rest.chunks(LANES).zip(&self.nodes);
        let state = self.right.chunks_mut(LANES).zip(&mut self.tangents);
        for ((rest, nodes), (right, tangents)) in blocks.zip(state) {
            C::spread(nodes, d, &mut points);
            for (q, point) in points.iter_mut().enumerate() {
                for lane in 0..LANES {
                    let Some(rest) = rest.get(lane) else {
                        put_matrix(point, lane, &Mat3::zeros());
                        continue;
                    };
                    let (gradients, volume) = (&rest.gradients[q], rest.volumes[q]);
                    let derivatives = matrix_at(point, lane);
                    let f = derivatives.tr_mul(gradients) + Mat3::identity();
                    let right = &mut right[lane][q];
                    let found = (self.law)(rest.lame, &f, right);
                    *right = found.axes.v;
                    energy += volume * found.energy;
                    let pull = gradients * found.stress.transpose() * -volume;
                    put_matrix(point, lane, &pull);
                    put_matrix(&mut tangents.axes[q], lane, &found.axes.u);
                    let turned = gradients * found.axes.v;
                    put_matrix(&mut tangents.gradients[q], lane, &turned);
                    let moduli = &mut tangents.moduli[q];
                    let p = &found.axes.principal;
                    for (k, [i, j]) in PAIRS.into_iter().enumerate() {
                        moduli[k][lane] = T::of(volume * p.stretch[(k, k)]);
                        moduli[3 + k][lane] = T::of(volume * p.stretch[(i, j)]);
                        moduli[SAME + k][lane] = T::of(volume * p.same()[k]);
                        moduli[CROSSED + k][lane] = T::of(volume * p.crossed()[k]);
                    }
                }
            }
            C::collect(nodes, &points, force);
        }
        energy
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
    law: PointLaw,
    tets: &[Tet],
    matrix: &BlockMatrix,
) -> Box<dyn Kernel<T>> {
    let elements = PrincipalTets::<T, _, _, _>::linear(law, tets);
    Box::new(Placed::new(
        elements,
        tets.iter().map(|tet| tet.nodes),
        matrix,
    ))
}

/// The kernel of quadratic `tets` of `law`, whose blocks are in `matrix`.
pub(in crate::element) fn quadratic_kernel<T: Real>(
    law: PointLaw,
    tets: &[QuadraticTet],
    matrix: &BlockMatrix,
) -> Box<dyn Kernel<T>> {
    let elements = PrincipalTets::<T, _, _, _>::quadratic(law, tets);
    Box::new(Placed::new(
        elements,
        tets.iter().map(|tet| tet.nodes),
        matrix,
    ))
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
