//! The interface of a set of elements to the realtime step, on padded nodes.
//!
//! A step linearizes a kernel once. The solver then calls its product repeatedly. A matrix is assembled only for a
//! factorization. [`Assembled`] serves elements that have no kernel of their own.

use super::elements::{Elements, slots};
use super::tet::principal::PrincipalTets;
use super::tet::principal_kernels::{Cell, Four, Ten};
use super::tet4::{Tet, Tets};
use super::tet10::{QuadraticTet, QuadraticTets};
use super::triangle::triangles::{Triangle, Triangles};
use crate::cost::Cost;
use crate::lanes::{Node, Real};
use crate::linear::block_matrix::{BlockMatrix, ElementSlots};
use crate::material::Tangent;
use crate::material::law::Frame;
use crate::material::law::isotropic::PointLaw;
use crate::{Mat3, Vec3};
use core::fmt;

/// A set of elements with its latest linearization.
pub(crate) trait Kernel<T>: fmt::Debug + Send {
    /// Adds the elastic forces (N) at displacements `d` (m) to `force` and stores the tangent at `d`. Returns the
    /// elastic energy (J).
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64;

    /// Adds `factor K u` to `y`.
    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]);

    /// Adds the blocks of `K` to `matrix`.
    fn add_to(&self, matrix: &mut BlockMatrix);

    /// The cost of `linearize` without displacements and forces, or `None` if it has not been counted.
    fn linearize_cost(&self) -> Option<Cost>;

    /// The cost of `product` without the vectors, or `None` if it has not been counted.
    fn product_cost(&self) -> Option<Cost>;

    /// Memory of the kernel (bytes).
    fn bytes(&self) -> usize;
}

/// Elements that have a kernel of their own, and the slots of their blocks in the matrix.
#[derive(Debug)]
pub(crate) struct Placed<E, const N: usize> {
    elements: E,
    slots: Vec<ElementSlots<N>>,
}

impl<T: Real> Placed<Tets<T>, 4> {
    pub(crate) fn tets(frame: Frame, tets: Vec<Tet>, matrix: &BlockMatrix) -> Self {
        Self {
            slots: slots(tets.iter().map(|tet| tet.nodes), matrix),
            elements: Tets::new(tets.into_iter()).in_frame(frame),
        }
    }
}

impl<T: Real> Placed<QuadraticTets<T>, 10> {
    pub(crate) fn quadratic_tets(
        frame: Frame,
        tets: &[QuadraticTet],
        matrix: &BlockMatrix,
    ) -> Self {
        Self {
            slots: slots(tets.iter().map(|tet| tet.nodes), matrix),
            elements: QuadraticTets::new(tets).in_frame(frame),
        }
    }
}

impl<T: Real> Placed<PrincipalTets<T, Four, 4, 1>, 4> {
    pub(crate) fn principal_tets(law: PointLaw, tets: &[Tet], matrix: &BlockMatrix) -> Self {
        Self {
            slots: slots(tets.iter().map(|tet| tet.nodes), matrix),
            elements: PrincipalTets::linear(law, tets),
        }
    }
}

impl<T: Real> Placed<PrincipalTets<T, Ten, 10, 4>, 10> {
    pub(crate) fn principal_quadratic_tets(
        law: PointLaw,
        tets: &[QuadraticTet],
        matrix: &BlockMatrix,
    ) -> Self {
        Self {
            slots: slots(tets.iter().map(|tet| tet.nodes), matrix),
            elements: PrincipalTets::quadratic(law, tets),
        }
    }
}

impl<T: Real> Placed<Triangles<T>, 3> {
    pub(crate) fn triangles(triangles: &[Triangle], matrix: &BlockMatrix) -> Self {
        Self {
            slots: slots(triangles.iter().map(|triangle| triangle.nodes), matrix),
            elements: Triangles::new(triangles),
        }
    }
}

fn add_blocks<const N: usize>(
    matrix: &mut BlockMatrix,
    slots: &[ElementSlots<N>],
    stiffness: impl Fn(usize) -> [[Mat3; N]; N],
) {
    for (element, slots) in slots.iter().enumerate() {
        let blocks = stiffness(element);
        for (slots, blocks) in slots.iter().zip(&blocks) {
            for (&slot, block) in slots.iter().zip(blocks) {
                matrix.add(slot, block);
            }
        }
    }
}

macro_rules! placed {
    ($elements:ident, $nodes:literal) => {
        impl<T: Real> Kernel<T> for Placed<$elements<T>, $nodes> {
            fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
                self.elements.linearize(d, force).to_f64()
            }

            fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
                self.elements.product(factor, u, y);
            }

            fn add_to(&self, matrix: &mut BlockMatrix) {
                add_blocks(matrix, &self.slots, |element| {
                    self.elements.stiffness(element)
                });
            }

            fn linearize_cost(&self) -> Option<Cost> {
                Some(self.elements.linearize_cost())
            }

            fn product_cost(&self) -> Option<Cost> {
                Some(self.elements.product_cost())
            }

            fn bytes(&self) -> usize {
                self.elements.bytes() + size_of_val(self.slots.as_slice())
            }
        }
    };
}

impl<T: Real, C: Cell<N, Q>, const N: usize, const Q: usize> Kernel<T>
    for Placed<PrincipalTets<T, C, N, Q>, N>
{
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        self.elements.linearize(d, force)
    }

    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        self.elements.product(factor, u, y);
    }

    fn add_to(&self, matrix: &mut BlockMatrix) {
        add_blocks(matrix, &self.slots, |element| {
            self.elements.stiffness(element)
        });
    }

    fn linearize_cost(&self) -> Option<Cost> {
        None
    }

    fn product_cost(&self) -> Option<Cost> {
        Some(self.elements.product_cost())
    }

    fn bytes(&self) -> usize {
        self.elements.bytes() + size_of_val(self.slots.as_slice())
    }
}

placed!(Tets, 4);
placed!(QuadraticTets, 10);
placed!(Triangles, 3);

/// Elements with their assembled matrix.
#[derive(Debug)]
pub(crate) struct Assembled {
    elements: Box<dyn Elements>,
    matrix: BlockMatrix,
    rest: Vec<Vec3>,
    x: Vec<Vec3>,
    force: Vec<Vec3>,
}

impl Assembled {
    /// A kernel of `elements`, whose nodes are in the solver's order and which are bound to `matrix`. `rest` contains
    /// the rest positions of the nodes (m).
    pub(crate) fn new(elements: Box<dyn Elements>, matrix: &BlockMatrix, rest: &[Vec3]) -> Self {
        Self {
            elements,
            matrix: matrix.clone(),
            rest: rest.to_vec(),
            x: rest.to_vec(),
            force: vec![Vec3::zeros(); rest.len()],
        }
    }
}

impl<T: Real> Kernel<T> for Assembled {
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        for ((x, rest), d) in self.x.iter_mut().zip(&self.rest).zip(d) {
            *x = rest + crate::lanes::to_vec(d);
        }
        self.matrix.clear();
        self.force.fill(Vec3::zeros());
        self.elements
            .assemble(&self.x, Tangent::Clipped, &mut self.force, &mut self.matrix);
        for (sum, force) in force.iter_mut().zip(&self.force) {
            crate::lanes::add(sum, &crate::lanes::to_node(force));
        }
        self.elements.energy(&self.x)
    }

    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        for (row, y) in y.iter_mut().enumerate() {
            let mut sum = [T::ZERO; 3];
            for (column, block) in self.matrix.blocks(row) {
                let (b, u) = (&block.data.0, &u[column]);
                for i in 0..3 {
                    sum[i] += T::of(b[0][i]) * u[0] + T::of(b[1][i]) * u[1] + T::of(b[2][i]) * u[2];
                }
            }
            for i in 0..3 {
                y[i] += factor * sum[i];
            }
        }
    }

    fn add_to(&self, matrix: &mut BlockMatrix) {
        matrix.add_all(&self.matrix);
    }

    fn linearize_cost(&self) -> Option<Cost> {
        None
    }

    fn product_cost(&self) -> Option<Cost> {
        // A product and a sum for each entry, and a further product and sum for each row.
        let (nodes, blocks) = (self.matrix.nodes(), self.matrix.block_count());
        Some(Cost::read(self.matrix.bytes()) + Cost::flops(18 * blocks + 6 * nodes))
    }

    fn bytes(&self) -> usize {
        self.elements.bytes()
            + self.matrix.bytes()
            + size_of_val(self.rest.as_slice())
            + size_of_val(self.x.as_slice())
            + size_of_val(self.force.as_slice())
    }
}
