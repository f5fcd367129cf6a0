//! What a step needs of a set of elements, on padded nodes.
//!
//! A kernel is linearized once a step and then multiplied by as often as the solver asks: nothing is assembled
//! unless a factor is to be made. [`Assembled`] serves elements that have no kernel of their own.

use super::cost::Cost;
use super::lanes::{less, plus};
use super::principal::PrincipalTets;
use super::principal_kernels::{Cell, Four, Ten};
use super::quadratic::{QuadraticTet, QuadraticTets};
use super::tet::{Tet, Tets};
use super::triangle::{Triangle, Triangles};
use super::{Node, Real};
use crate::fem::block_matrix::ElementSlots;
use crate::fem::elements::slots;
use crate::fem::law::Frame;
use crate::fem::law::isotropic::PointLaw;
use crate::fem::{BlockMatrix, Elements, Tangent};
use crate::{Mat3, Vec3};
use core::fmt;
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// A set of elements, linearized where it was last told to be.
pub(crate) trait Kernel<T>: fmt::Debug + Send {
    /// Adds the elastic forces (N) at displacements `d` (m) to `force` and keeps the tangent there. Returns the
    /// elastic energy (J).
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64;

    /// Adds `factor K u` to `y`.
    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]);

    /// Adds the blocks of `K` to `matrix`.
    fn add_to(&self, matrix: &mut BlockMatrix);

    /// What `linearize` costs, but for displacements and forces; `None` where it has not been counted.
    fn linearize_cost(&self) -> Option<Cost>;

    /// What `product` costs, but for the vectors; `None` where it has not been counted.
    fn product_cost(&self) -> Option<Cost>;

    /// Memory that it holds (bytes).
    fn bytes(&self) -> usize;
}

/// Elements that have a kernel of their own, and where the blocks of each lie in the matrix.
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

/// Elements by their assembled matrix.
#[derive(Debug)]
pub(crate) struct Assembled {
    elements: Box<dyn Elements>,
    matrix: BlockMatrix,
    rest: Vec<Vec3>,
    x: Vec<Vec3>,
    force: Vec<Vec3>,
}

impl Assembled {
    /// `elements` over nodes in the solver's order and bound to `matrix`; `rest` are their positions (m).
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
            *x = rest + super::to_vec(d);
        }
        self.matrix.clear();
        self.force.fill(Vec3::zeros());
        self.elements
            .assemble(&self.x, Tangent::Clipped, &mut self.force, &mut self.matrix);
        for (sum, force) in force.iter_mut().zip(&self.force) {
            super::add(sum, &super::to_node(force));
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
        // A product and a sum for each entry, and both once more for each row.
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

/// A constant matrix of scalars: the bending of a sheet that is flat at rest.
#[derive(Debug)]
pub(crate) struct ScalarMatrix<T> {
    row_start: Vec<u32>,
    columns: Vec<u32>,
    weights: Vec<T>,
    exact: Vec<f64>,
}

impl<T: Real> ScalarMatrix<T> {
    /// `weights` by slot of `matrix`, whose pattern it takes; zeros are left out.
    pub(crate) fn new(matrix: &BlockMatrix, weights: &[f64]) -> Self {
        let mut row_start = vec![0];
        let (mut columns, mut kept) = (Vec::new(), Vec::new());
        for row in 0..matrix.nodes() {
            let (in_row, first) = matrix.row(row);
            for (offset, &column) in in_row.iter().enumerate() {
                if weights[first + offset] != 0.0 {
                    columns.push(column);
                    kept.push(T::of(weights[first + offset]));
                }
            }
            row_start.push(columns.len() as u32);
        }
        Self {
            row_start,
            columns,
            weights: kept,
            exact: weights.to_vec(),
        }
    }

    /// What all rows times a vector cost.
    fn read_cost(&self) -> Cost {
        Cost::read(size_of_val(self.row_start.as_slice()))
            + Cost::read(size_of_val(self.columns.as_slice()))
            + Cost::read(size_of_val(self.weights.as_slice()))
            + Cost::flops(6 * self.weights.len())
    }

    /// Rows times `u`: `sum(row, pull)` by row.
    #[inline(always)]
    fn rows(&self, u: &[Node<T>], mut sum: impl FnMut(usize, Node<T>)) {
        let ends = self.row_start[1..].iter().map(|&end| end as usize);
        let mut start = 0;
        for (row, end) in ends.enumerate() {
            let mut pull = [T::ZERO; 4];
            let entries = self.columns[start..end]
                .iter()
                .zip(&self.weights[start..end]);
            for (&column, &weight) in entries {
                let u = &u[column as usize];
                for i in 0..4 {
                    pull[i] += weight * u[i];
                }
            }
            sum(row, pull);
            start = end;
        }
    }
}

/// Subtracts the rows times `d` from `force`; returns twice the energy.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx2+bmi1+bmi2"))
)]
fn scalar_linearize<T: Real>(
    matrix: &ScalarMatrix<T>,
    d: &[Node<T>],
    force: &mut [Node<T>],
) -> f64 {
    let mut work = 0.0;
    matrix.rows(d, |row, pull| {
        force[row] = less(force[row], pull);
        work += super::dot(&pull, &d[row]).to_f64();
    });
    work
}

/// Adds `factor` times the rows times `u` to `y`.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx2+bmi1+bmi2"))
)]
fn scalar_product<T: Real>(matrix: &ScalarMatrix<T>, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
    matrix.rows(u, |row, pull| {
        y[row] = plus(y[row], pull.map(|pull| factor * pull));
    });
}

impl<T: Real> Kernel<T> for ScalarMatrix<T> {
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        0.5 * scalar_linearize(self, d, force)
    }

    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        scalar_product(self, factor, u, y);
    }

    fn add_to(&self, matrix: &mut BlockMatrix) {
        matrix.add_scalar(&self.exact);
    }

    fn linearize_cost(&self) -> Option<Cost> {
        // The force's three sums and the energy's six operations for each row.
        Some(self.read_cost() + Cost::flops(9 * (self.row_start.len() - 1)))
    }

    fn product_cost(&self) -> Option<Cost> {
        Some(self.read_cost() + Cost::flops(6 * (self.row_start.len() - 1)))
    }

    fn bytes(&self) -> usize {
        size_of_val(self.row_start.as_slice())
            + size_of_val(self.columns.as_slice())
            + size_of_val(self.weights.as_slice())
            + size_of_val(self.exact.as_slice())
    }
}
