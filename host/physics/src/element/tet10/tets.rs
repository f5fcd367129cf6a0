//! Corotational quadratic tetrahedra in blocks: forces, energies and products with the stiffness.
//!
//! The law is [`Corotational`](crate::material::law::Corotational) at each of the four quadrature points, with the
//! rotation of the point. The tangent is the warped stiffness, as for linear tetrahedra (see
//! [`tet4`](crate::element::tet4)): it omits the derivative of the rotation and is positive semidefinite for any
//! strain. Edges may be curved: each point has its own gradients and volume.
//!
//! Displacements are relative to the rest positions, so that single precision keeps the digits of small strains.

use super::kernels::{Blocks, FACTOR, POINTS, Rest, Turned, WEIGHT, linearize, product};
use crate::element::placed::InBlocks;
use crate::lanes::block::{LANES, apart};
use crate::lanes::{Node, Real};
use crate::material::law::Frame;
use crate::mesh::tet::MIDSIDE_ENDS;
use crate::polar::lanes::matrix;
use crate::{Mat3, Vec3};

/// One tetrahedron, nodes in the solver's numbering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadraticTet {
    /// Its nodes: corners, then middles of edges in the order of [`MIDSIDE_ENDS`].
    pub nodes: [u32; 10],
    /// Rest gradients (1/m) of barycentric coordinates 1, 2 and 3 at each point of
    /// [`Tet10`](crate::element::tet::shape::Tet10). They are equal at all points if the edges are straight.
    pub gradients: [[Vec3; 3]; POINTS],
    /// Rest volume of each point (m^3).
    pub volumes: [f64; POINTS],
    /// Lamé's first parameter (Pa).
    pub lambda: f64,
    /// Shear modulus (Pa), positive.
    pub mu: f64,
}

/// Corotational quadratic tetrahedra in blocks.
#[derive(Clone, Debug)]
pub struct QuadraticTets<T> {
    pub(super) blocks: Blocks<T>,
    /// Block and lane of each element.
    places: Vec<(u32, u32)>,
    pub(super) frame: Frame,
}

impl<T: Real> QuadraticTets<T> {
    /// The elements at rest.
    pub fn new(tets: &[QuadraticTet]) -> Self {
        let order = apart(tets.len(), |element| &tets[element].nodes);
        let mut all = Self {
            blocks: Blocks::default(),
            places: vec![(0, 0); tets.len()],
            frame: Frame::Turning,
        };
        for (block, elements) in order.chunks(LANES).enumerate() {
            let zero = [T::ZERO; LANES];
            let mut nodes = [[0; 10]; LANES];
            let mut rest = Rest {
                gradients: [[zero; 9]; POINTS],
                scale: [zero; POINTS],
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
                for q in 0..POINTS {
                    let volume = if filled { 0.0 } else { tet.volumes[q] };
                    let scale = T::of((2.0 * tet.mu * volume).sqrt());
                    rest.scale[q][lane] = scale;
                    for row in 0..9 {
                        let gradient = T::of(tet.gradients[q][row / 3][row % 3] * FACTOR);
                        rest.gradients[q][row][lane] = gradient;
                        turned.gradients[q][row][lane] = gradient * scale;
                    }
                }
            }
            all.blocks.nodes.push(nodes);
            all.blocks.rest.push(rest);
            all.blocks.turned.push(turned);
            let none = [[T::of(1.0); LANES], zero, zero, zero];
            all.blocks.rotations.push([none; POINTS]);
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
        linearize(&mut self.blocks, d, force)
    }

    /// Adds `factor` times the stiffness at the latest rotations times `u` to `y`.
    ///
    /// # Panics
    ///
    /// If `u` or `y` has no entry for a node.
    pub fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        product::<T, false>(&self.blocks, factor, u, y);
    }

    /// Rotation of an element at each point in the latest call of `linearize`. It is the identity before the first
    /// call.
    ///
    /// # Panics
    ///
    /// If there is no such element.
    pub fn rotations(&self, element: usize) -> [Mat3; POINTS] {
        let (block, lane) = self.places[element];
        let points = &self.blocks.rotations[block as usize];
        points
            .each_ref()
            .map(|rows| matrix(rows.map(|row| row[lane as usize])))
    }

    /// Nodes of an element.
    ///
    /// # Panics
    ///
    /// If there is no such element.
    pub fn nodes(&self, element: usize) -> [u32; 10] {
        let (block, lane) = self.places[element];
        self.blocks.nodes[block as usize][lane as usize]
    }

    /// The 3 x 3 blocks of an element's stiffness at the latest rotations (N/m), by its nodes.
    ///
    /// # Panics
    ///
    /// If there is no such element.
    pub fn stiffness(&self, element: usize) -> [[Mat3; 10]; 10] {
        let (block, lane) = self.places[element];
        let (turned, lane) = (&self.blocks.turned[block as usize], lane as usize);
        let ratio = turned.ratio[lane].to_f64();
        let mut blocks = [[Mat3::zeros(); 10]; 10];
        for (q, rows) in turned.gradients.iter().enumerate() {
            let mut b = [Vec3::zeros(); 4];
            for c in 0..3 {
                b[c + 1] = Vec3::from_fn(|i, _| rows[3 * c + i][lane].to_f64());
            }
            b[0] = -(b[1] + b[2] + b[3]);
            // The gradient that each node's displacement is multiplied by: see `tet10::kernels`.
            let near = |corner: usize| if corner == q { 1.0 } else { 0.0 };
            let mut gradients = [Vec3::zeros(); 10];
            for c in 0..4 {
                gradients[c] = b[c] * (near(c) - 0.25);
            }
            for (gradient, [c, e]) in gradients[4..].iter_mut().zip(MIDSIDE_ENDS) {
                *gradient = b[c] * (WEIGHT + near(e)) + b[e] * (WEIGHT + near(c));
            }
            for (row, blocks) in gradients.iter().zip(&mut blocks) {
                for (column, block) in gradients.iter().zip(blocks) {
                    let half = 0.5 * row.dot(column);
                    *block += row * column.transpose() * ratio + column * row.transpose() * 0.5;
                    for i in 0..3 {
                        block[(i, i)] += half;
                    }
                }
            }
        }
        blocks
    }
}

impl<T: Real> InBlocks<T, 10> for QuadraticTets<T> {
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        Self::linearize(self, d, force).to_f64()
    }

    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        Self::product(self, factor, u, y);
    }

    fn stiffness(&self, element: usize) -> [[Mat3; 10]; 10] {
        Self::stiffness(self, element)
    }

    fn bytes(&self) -> usize {
        Self::bytes(self)
    }
}
