//! Corotational membrane triangles in blocks: forces, energies and products with the stiffness.
//!
//! The law is that of [`Membrane`](crate::element::triangle::membrane::Membrane), and the tangent is its positive part,
//! [`Tangent::Clipped`](crate::Tangent::Clipped). Forces and tangent depend on the displacements of the second and
//! third node relative to the first alone, so the stiffness of a triangle is a symmetric 6 x 6 matrix. This matrix is
//! stored. A product with its 21 numbers takes fewer operations than a product with the 18 numbers from which it is
//! computed.
//!
//! Displacements are relative to the starting positions, so that single precision keeps the digits of small strains. These
//! are the positions at rest, unless a flat pattern gives triangles other shapes at rest.

use super::kernels::{BLOCK_11, BLOCK_12, BLOCK_22, Blocks, ENTRIES, Rest, linearize, product};
use crate::element::kernel::Kernel;
use crate::element::placed::{InBlocks, Placed};
use crate::element::torn::TearableKernel;
use crate::lanes::block::{LANES, apart};
use crate::lanes::{Node, Real};
use crate::linear::block_matrix::BlockMatrix;
use crate::{Mat3, Vec3};

pub use super::cost::{LINEARIZE_FLOPS, PRODUCT_FLOPS};

/// One triangle, nodes in the solver's numbering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Its nodes.
    pub nodes: [u32; 3],
    /// Rest gradients of the shape functions of its second and third node (1/m), in an orthonormal frame of its
    /// plane at rest. The gradient of the first is minus their sum.
    pub gradients: [[f64; 2]; 2],
    /// The axes of that frame in world coordinates.
    pub frame: [Vec3; 2],
    /// The deformation gradient of the positions from which displacements count, less the frame. It is zero unless a flat
    /// pattern gives the triangle another shape at rest.
    pub strained: [Vec3; 2],
    /// Shear modulus times thickness times rest area (N m).
    pub mu: f64,
    /// Lamé's first parameter in plane stress times thickness times rest area (N m).
    pub lambda: f64,
}

/// Corotational triangles in blocks.
#[derive(Clone, Debug)]
pub struct Triangles<T> {
    pub(super) blocks: Blocks<T>,
    /// Block and lane of each element.
    pub(super) places: Vec<(u32, u32)>,
    /// The moduli per area (N/m) of the triangles that were there at first; empty if no edits are followed.
    pub(super) moduli: Vec<[f64; 2]>,
}

impl<T: Real> Triangles<T> {
    /// The elements. They have no stiffness before the first call of `linearize`.
    pub fn new(triangles: &[Triangle]) -> Self {
        let order = apart(triangles.len(), |element| &triangles[element].nodes);
        let zeros = [Vec3::zeros(); 2];
        let any_strained = triangles.iter().any(|triangle| triangle.strained != zeros);
        let mut all = Self {
            blocks: Blocks::default(),
            places: vec![(0, 0); triangles.len()],
            moduli: Vec::new(),
        };
        for (block, elements) in order.chunks(LANES).enumerate() {
            let zero = [T::ZERO; LANES];
            let mut nodes = [[0; 3]; LANES];
            let mut rest = Rest {
                gradients: [zero; 4],
                frame: [zero; 6],
                mu: zero,
                lambda: zero,
            };
            let mut strained = [zero; 6];
            for lane in 0..LANES {
                // Copies of the last element without stiffness pad the last block.
                let element = elements[lane.min(elements.len() - 1)];
                let triangle = &triangles[element];
                nodes[lane] = triangle.nodes;
                for a in 0..2 {
                    for j in 0..2 {
                        rest.gradients[2 * a + j][lane] = T::of(triangle.gradients[a][j]);
                    }
                    for i in 0..3 {
                        rest.frame[3 * a + i][lane] = T::of(triangle.frame[a][i]);
                        strained[3 * a + i][lane] = T::of(triangle.strained[a][i]);
                    }
                }
                if lane < elements.len() {
                    rest.mu[lane] = T::of(triangle.mu);
                    rest.lambda[lane] = T::of(triangle.lambda);
                    all.places[element] = (block as u32, lane as u32);
                }
            }
            all.blocks.nodes.push(nodes);
            all.blocks.rest.push(rest);
            if any_strained {
                all.blocks.strained.push(strained);
            }
            all.blocks.stiffness.push([zero; ENTRIES]);
        }
        all
    }

    /// Number of elements.
    pub fn count(&self) -> usize {
        self.places.len()
    }

    /// Memory of the elements (bytes).
    pub fn bytes(&self) -> usize {
        size_of_val(self.places.as_slice())
            + size_of_val(self.moduli.as_slice())
            + size_of_val(self.blocks.nodes.as_slice())
            + size_of_val(self.blocks.rest.as_slice())
            + size_of_val(self.blocks.strained.as_slice())
            + size_of_val(self.blocks.stiffness.as_slice())
    }

    /// Adds the elastic forces (N) at displacements `d` (m) to `force` and stores the stiffness at `d`. Returns the
    /// elastic energy (J).
    ///
    /// # Panics
    ///
    /// If `d` or `force` has no entry for a node.
    pub fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> T {
        linearize(&mut self.blocks, d, force)
    }

    /// Adds `factor` times the latest stiffness times `u` to `y`.
    ///
    /// # Panics
    ///
    /// If `u` or `y` has no entry for a node.
    pub fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        product(&self.blocks, factor, u, y);
    }

    /// Nodes of an element.
    ///
    /// # Panics
    ///
    /// If there is no such element.
    pub fn nodes(&self, element: usize) -> [u32; 3] {
        let (block, lane) = self.places[element];
        self.blocks.nodes[block as usize][lane as usize]
    }

    /// The constant data of an element's block, and its lane.
    pub(super) fn rest_of(&self, element: usize) -> (&Rest<T>, usize) {
        let (block, lane) = self.places[element];
        (&self.blocks.rest[block as usize], lane as usize)
    }

    /// The 3 x 3 blocks of an element's latest stiffness (N/m), by its nodes.
    ///
    /// # Panics
    ///
    /// If there is no such element.
    pub fn stiffness(&self, element: usize) -> [[Mat3; 3]; 3] {
        let (block, lane) = self.places[element];
        let rows = &self.blocks.stiffness[block as usize];
        let k: [f64; ENTRIES] = core::array::from_fn(|i| rows[i][lane as usize].to_f64());
        let symmetric = |first: usize| {
            let [xx, yy, zz, yz, xz, xy] = core::array::from_fn(|i| k[first + i]);
            Mat3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
        };
        let (k11, k22) = (symmetric(BLOCK_11), symmetric(BLOCK_22));
        let k12 = Mat3::from_row_slice(&k[BLOCK_12..BLOCK_22]);
        let k21 = k12.transpose();
        // Translations give no force, so rows sum to zero.
        let (k01, k02) = (-(k11 + k21), -(k12 + k22));
        [
            [-(k01 + k02), k01, k02],
            [k01.transpose(), k11, k12],
            [k02.transpose(), k21, k22],
        ]
    }
}

impl<T: Real> InBlocks<T, 3> for Triangles<T> {
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        Self::linearize(self, d, force).to_f64()
    }

    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        Self::product(self, factor, u, y);
    }

    fn stiffness(&self, element: usize) -> [[Mat3; 3]; 3] {
        Self::stiffness(self, element)
    }

    fn bytes(&self) -> usize {
        Self::bytes(self)
    }

    fn tearable(&mut self) -> Option<&mut dyn TearableKernel<T>> {
        Some(self)
    }
}

/// The kernel of `triangles`, whose blocks are in `matrix`.
pub(in crate::element) fn kernel<T: Real>(
    triangles: &[Triangle],
    matrix: &BlockMatrix,
) -> Box<dyn Kernel<T>> {
    let nodes = triangles.iter().map(|triangle| triangle.nodes);
    Box::new(Placed::new(Triangles::<T>::new(triangles), nodes, matrix))
}
