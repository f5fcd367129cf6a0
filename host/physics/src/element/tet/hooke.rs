//! Tetrahedra under Hooke's law in blocks: forces, energies and products with the stiffness.
//!
//! The law is [`Corotational`](crate::material::law::Corotational), at each point with the rotation `R` of the point's
//! deformation gradient. With the strain `E = R^T F - I`, `P = R (2 mu E + lambda tr(E) I)`. The stiffness is
//! the warped stiffness `R K0 R^T` (Müller and Gross, "Interactive virtual materials", 2004), which is positive
//! semidefinite for any strain. No matrix is stored. With the rotated rest gradients `b_a = sqrt(2 mu V) R g_a` the
//! product is `f_a = (sym G + lambda / (2 mu) tr(G) I) b_a` where `G = sum u_a b_a^T`. It needs nine numbers for each
//! point and one ratio for each element.
//!
//! Displacements are relative to the rest positions, so that single precision keeps the digits of small strains.
//! `hooke_kernels` computes on the blocks, and `hooke_cost` counts the operations.

use super::cell::{Cell, Four, Ten, Tetrahedron};
use super::hooke_cost::CountedCell;
use super::hooke_kernels::{Blocks, Rest, Turned, linearize, product};
use crate::element::kernel::Kernel;
use crate::element::placed::{InBlocks, Placed};
use crate::lanes::block::{LANES, apart};
use crate::lanes::{Node, Real};
use crate::linear::block_matrix::BlockMatrix;
use crate::material::law::Frame;
use crate::polar::lanes::matrix;
use crate::{Mat3, Vec3};
use core::marker::PhantomData;

pub use super::hooke_cost::{
    LINEAR_ENDS_FLOPS, POINT_ENERGY_FLOPS, POINT_LINEARIZE_FLOPS, POINT_PRODUCT_FLOPS,
    QUADRATIC_ENDS_FLOPS, TURN_FLOPS,
};

/// Corotational tetrahedra in blocks.
#[derive(Clone, Debug)]
pub struct HookeanTets<T, C, const N: usize, const Q: usize> {
    pub(super) blocks: Blocks<T, N, Q>,
    /// Block and lane of each element.
    places: Vec<(u32, u32)>,
    pub(super) frame: Frame,
    cell: PhantomData<C>,
}

/// Linear tetrahedra.
pub type Tets<T> = HookeanTets<T, Four, 4, 1>;

/// Quadratic tetrahedra.
pub type QuadraticTets<T> = HookeanTets<T, Ten, 10, 4>;

impl<T: Real, C: Cell<N, Q>, const N: usize, const Q: usize> HookeanTets<T, C, N, Q> {
    /// The elements at rest.
    pub fn new(tets: &[Tetrahedron<N, Q>]) -> Self {
        let order = apart(tets.len(), |element| &tets[element].nodes);
        let mut all = Self {
            blocks: Blocks::default(),
            places: vec![(0, 0); tets.len()],
            frame: Frame::Turning,
            cell: PhantomData,
        };
        for (block, elements) in order.chunks(LANES).enumerate() {
            let zero = [T::ZERO; LANES];
            let mut nodes = [[0; N]; LANES];
            let mut rest = Rest {
                gradients: [[zero; 9]; Q],
                scale: [zero; Q],
            };
            let mut turned = Turned {
                gradients: rest.gradients,
                ratio: zero,
            };
            for lane in 0..LANES {
                // Copies of the last element without volume pad the last block.
                let element = elements[lane.min(elements.len() - 1)];
                let tet = &tets[element];
                nodes[lane] = tet.nodes;
                turned.ratio[lane] = T::of(tet.lambda / (2.0 * tet.mu));
                let filled = lane >= elements.len();
                if !filled {
                    all.places[element] = (block as u32, lane as u32);
                }
                for q in 0..Q {
                    let volume = if filled { 0.0 } else { tet.volumes[q] };
                    let scale = T::of((2.0 * tet.mu * volume).sqrt());
                    rest.scale[q][lane] = scale;
                    for row in 0..9 {
                        let gradient = T::of(tet.gradients[q][row / 3][row % 3] * C::FACTOR);
                        rest.gradients[q][row][lane] = gradient;
                        turned.gradients[q][row][lane] = gradient * scale;
                    }
                }
            }
            all.blocks.nodes.push(nodes);
            all.blocks.rest.push(rest);
            all.blocks.turned.push(turned);
            let none = [[T::of(1.0); LANES], zero, zero, zero];
            all.blocks.rotations.push([none; Q]);
        }
        all
    }

    /// The same elements with strains measured in `frame`. In a fixed frame the rotations are the identity, and the
    /// stiffness is that at rest.
    #[must_use]
    pub fn in_frame(self, frame: Frame) -> Self {
        Self { frame, ..self }
    }

    /// Number of elements.
    pub(super) fn count(&self) -> usize {
        self.places.len()
    }

    /// Computes the rotations at displacements `d` (m), starting from the previous rotations, and adds the elastic
    /// forces (N) to `force`. Returns the elastic energy (J).
    ///
    /// # Panics
    ///
    /// If `d` or `force` has no entry for a node.
    pub fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> T {
        if self.frame == Frame::Fixed {
            return product::<T, C, true, N, Q>(&self.blocks, T::of(-1.0), d, force);
        }
        linearize::<T, C, N, Q>(&mut self.blocks, d, force)
    }

    /// Adds `factor` times the stiffness at the latest rotations times `u` to `y`.
    ///
    /// # Panics
    ///
    /// If `u` or `y` has no entry for a node.
    pub fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        product::<T, C, false, N, Q>(&self.blocks, factor, u, y);
    }

    /// Rotation of an element at each point in the latest call of `linearize`. It is the identity before the first
    /// call.
    ///
    /// # Panics
    ///
    /// If there is no such element.
    pub fn rotations(&self, element: usize) -> [Mat3; Q] {
        let (block, lane) = self.places[element];
        let points = &self.blocks.rotations[block as usize];
        points
            .each_ref()
            .map(|rows| matrix(rows.map(|row| row[lane as usize])))
    }

    /// The 3 x 3 blocks of an element's stiffness at the latest rotations (N/m), by its nodes.
    ///
    /// # Panics
    ///
    /// If there is no such element.
    pub fn stiffness(&self, element: usize) -> [[Mat3; N]; N] {
        let (block, lane) = self.places[element];
        let (turned, lane) = (&self.blocks.turned[block as usize], lane as usize);
        let ratio = turned.ratio[lane].to_f64();
        let mut blocks = [[Mat3::zeros(); N]; N];
        for (q, rows) in turned.gradients.iter().enumerate() {
            let [b, c, d] = [0, 1, 2].map(|c| Vec3::from_fn(|i, _| rows[3 * c + i][lane].to_f64()));
            let gradients = C::gradients(q, &[-(b + c + d), b, c, d]);
            for (row, blocks) in gradients.iter().zip(&mut blocks) {
                for (column, block) in gradients.iter().zip(blocks) {
                    let (dot, crossed) = (row.dot(column), column * row.transpose());
                    let pressure = row * column.transpose() * ratio;
                    // The order of the sums decides the last digits, which recorded results contain.
                    if Q == 1 {
                        *block = (Mat3::from_diagonal_element(dot) + crossed) * 0.5 + pressure;
                    } else {
                        *block += pressure + crossed * 0.5;
                        for i in 0..3 {
                            block[(i, i)] += 0.5 * dot;
                        }
                    }
                }
            }
        }
        blocks
    }
}

impl<T: Real, C: Cell<N, Q>, const N: usize, const Q: usize> InBlocks<T, N>
    for HookeanTets<T, C, N, Q>
{
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        Self::linearize(self, d, force).to_f64()
    }

    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        Self::product(self, factor, u, y);
    }

    fn stiffness(&self, element: usize) -> [[Mat3; N]; N] {
        Self::stiffness(self, element)
    }

    fn bytes(&self) -> usize {
        size_of_val(self.places.as_slice())
            + size_of_val(self.blocks.nodes.as_slice())
            + size_of_val(self.blocks.rest.as_slice())
            + size_of_val(self.blocks.turned.as_slice())
            + size_of_val(self.blocks.rotations.as_slice())
    }
}

/// The kernel of `tets` under Hooke's law in `frame`, whose blocks are in `matrix`.
pub(in crate::element) fn kernel<T, C, const N: usize, const Q: usize>(
    frame: Frame,
    tets: &[Tetrahedron<N, Q>],
    matrix: &BlockMatrix,
) -> Box<dyn Kernel<T>>
where
    T: Real,
    C: CountedCell<N, Q> + 'static,
{
    let elements = HookeanTets::<T, C, N, Q>::new(tets).in_frame(frame);
    let nodes = tets.iter().map(|tet| tet.nodes);
    Box::new(Placed::new(elements, nodes, matrix))
}
