//! Corotational linear tetrahedra in blocks: forces, energies and products with the stiffness.
//!
//! The law is [`Corotational`](crate::material::law::Corotational): with the rotation `R` of the element's
//! deformation gradient and the strain `E = R^T F - I`, `P = R (2 mu E + lambda tr(E) I)`. The stiffness is
//! the warped stiffness `R K0 R^T` (Müller and Gross, "Interactive virtual materials", 2004), which is positive
//! semidefinite for any strain. No matrix is stored. With the rotated rest gradients `b_a = sqrt(2 mu V) R g_a` the
//! product is `f_a = (sym G + lambda / (2 mu) tr(G) I) b_a` where `G = sum u_a b_a^T`. It needs nine numbers and one
//! ratio for each element.
//!
//! Displacements are relative to the rest positions, so that single precision keeps the digits of small strains.

use super::kernels::{Blocks, Rest, Turned, linearize, product};
use crate::element::placed::InBlocks;
use crate::lanes::block::{LANES, apart};
use crate::lanes::{Node, Real};
use crate::material::law::Frame;
use crate::polar::lanes::matrix;
use crate::{Mat3, Vec3};

/// One tetrahedron, nodes in the solver's numbering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tet {
    /// Its nodes.
    pub nodes: [u32; 4],
    /// Rest gradients of the shape functions (1/m). Their sum is zero.
    pub gradients: [Vec3; 4],
    /// Rest volume (m^3).
    pub volume: f64,
    /// Lamé's first parameter (Pa).
    pub lambda: f64,
    /// Shear modulus (Pa), positive.
    pub mu: f64,
}

/// Corotational linear tetrahedra in blocks.
#[derive(Clone, Debug)]
pub struct Tets<T> {
    pub(super) blocks: Blocks<T>,
    /// Block and lane of each element.
    places: Vec<(u32, u32)>,
    pub(super) frame: Frame,
}

impl<T: Real> Tets<T> {
    /// The elements at rest.
    pub fn new(tets: impl ExactSizeIterator<Item = Tet>) -> Self {
        let tets: Vec<Tet> = tets.collect();
        let order = apart(tets.len(), |element| &tets[element].nodes);
        let mut all = Self {
            blocks: Blocks::default(),
            places: vec![(0, 0); tets.len()],
            frame: Frame::Turning,
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
                // Copies of the last element without volume pad the last block.
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
            all.blocks.nodes.push(nodes);
            all.blocks.rest.push(rest);
            all.blocks.turned.push(Turned { gradients, ratio });
            all.blocks
                .rotations
                .push([[T::of(1.0); LANES], zero, zero, zero]);
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
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there are no elements.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Memory of the elements (bytes).
    pub fn bytes(&self) -> usize {
        size_of_val(self.places.as_slice())
            + size_of_val(self.blocks.nodes.as_slice())
            + size_of_val(self.blocks.rest.as_slice())
            + size_of_val(self.blocks.turned.as_slice())
            + size_of_val(self.blocks.rotations.as_slice())
    }

    /// Computes the rotations at displacements `d` (m), starting from the previous rotations, and adds the elastic
    /// forces (N) to `force`. Returns the elastic energy (J).
    ///
    /// # Panics
    ///
    /// If `d` or `force` has no entry for a node.
    pub fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> T {
        if self.frame == Frame::Fixed {
            return product::<T, true>(&self.blocks, T::of(-1.0), d, force);
        }
        linearize::<T, false>(&mut self.blocks, d, d, T::ZERO, force)
    }

    /// [`linearize`](Self::linearize) that also subtracts `factor` times the stiffness times `u` from `force`. The
    /// result is the residual of a guess `u` of the step. Returns the elastic energy at `d` (J).
    ///
    /// # Panics
    ///
    /// If `d`, `u` or `force` has no entry for a node.
    pub fn linearize_with(
        &mut self,
        d: &[Node<T>],
        u: &[Node<T>],
        factor: T,
        force: &mut [Node<T>],
    ) -> T {
        if self.frame == Frame::Fixed {
            self.product(-factor, u, force);
            return self.linearize(d, force);
        }
        linearize::<T, true>(&mut self.blocks, d, u, factor, force)
    }

    /// Adds `factor` times the stiffness at the latest rotations times `u` to `y`.
    ///
    /// # Panics
    ///
    /// If `u` or `y` has no entry for a node.
    pub fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        product::<T, false>(&self.blocks, factor, u, y);
    }

    /// Rotation of an element in the latest call of `linearize`. It is the identity before the first call.
    ///
    /// # Panics
    ///
    /// If there is no such element.
    pub fn rotation(&self, element: usize) -> Mat3 {
        let (block, lane) = self.places[element];
        let rows = &self.blocks.rotations[block as usize];
        matrix(rows.map(|row| row[lane as usize]))
    }

    /// Nodes of an element.
    ///
    /// # Panics
    ///
    /// If there is no such element.
    pub fn nodes(&self, element: usize) -> [u32; 4] {
        let (block, lane) = self.places[element];
        self.blocks.nodes[block as usize][lane as usize]
    }

    /// The 3 x 3 blocks of an element's stiffness at the latest rotations (N/m), by its nodes.
    ///
    /// # Panics
    ///
    /// If there is no such element.
    pub fn stiffness(&self, element: usize) -> [[Mat3; 4]; 4] {
        let (block, lane) = self.places[element];
        let turned = &self.blocks.turned[block as usize];
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

impl<T: Real> InBlocks<T, 4> for Tets<T> {
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        Self::linearize(self, d, force).to_f64()
    }

    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        Self::product(self, factor, u, y);
    }

    fn stiffness(&self, element: usize) -> [[Mat3; 4]; 4] {
        Self::stiffness(self, element)
    }

    fn bytes(&self) -> usize {
        Self::bytes(self)
    }
}
