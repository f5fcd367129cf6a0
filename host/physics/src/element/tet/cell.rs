//! Tetrahedra as the kernels take them, and how the displacements of their nodes give derivatives at their points.
//!
//! A [`Cell`] is all by which linear and quadratic tetrahedra differ in the vector form. The kernels of every law
//! (`hooke`, `principal`) are generic over the cell.

pub use super::quadratic::Ten;

use crate::Vec3;
use crate::lanes::block::{LANES, Vectors, gather, node, scatter, vectors_at};
use crate::lanes::{Node, Real};
use core::fmt::Debug;

/// One tetrahedron of `N` nodes and `Q` quadrature points, nodes in the solver's numbering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tetrahedron<const N: usize, const Q: usize> {
    /// Its nodes: corners, then middles of edges in the order of [`MIDSIDE_ENDS`](crate::mesh::tet::MIDSIDE_ENDS).
    pub nodes: [u32; N],
    /// Rest gradients (1/m) of barycentric coordinates 1, 2 and 3 at each point. They are equal at all points if the
    /// edges are straight.
    pub gradients: [[Vec3; 3]; Q],
    /// Rest volume of each point (m^3).
    pub volumes: [f64; Q],
    /// Lamé's first parameter (Pa).
    pub lambda: f64,
    /// Shear modulus (Pa), positive.
    pub mu: f64,
}

/// A linear tetrahedron.
pub type Tet = Tetrahedron<4, 1>;

/// A quadratic tetrahedron, with the points of [`Tet10`](super::shape::Tet10).
pub type QuadraticTet = Tetrahedron<10, 4>;

/// How displacements of `N` nodes give derivatives by barycentric coordinates at `Q` points, for a block of elements.
pub trait Cell<const N: usize, const Q: usize>: Clone + Debug + Send + Sync {
    /// A factor that the derivatives lack and the gradients contain.
    const FACTOR: f64;

    /// The derivatives by coordinates 1, 2 and 3, minus the derivative by coordinate 0, at the points of a block; or
    /// the forces that correspond to these derivatives.
    type Derivatives<T: Real>;

    /// Derivatives of a field that is zero.
    fn zero<T: Real>() -> Self::Derivatives<T>;

    /// Sets `to` to the derivatives of the vectors `of` at the nodes.
    fn spread<T: Real>(nodes: &[[u32; N]; LANES], of: &[Node<T>], to: &mut Self::Derivatives<T>);

    /// The derivatives of one element at a point, by coordinate.
    fn at<T: Real>(derivatives: &Self::Derivatives<T>, point: usize, lane: usize) -> [[T; 3]; 3];

    /// Sets the force of one element at a point that corresponds to the derivative by coordinate `c + 1`. The derivative
    /// is lost.
    fn put<T: Real>(
        derivatives: &mut Self::Derivatives<T>,
        point: usize,
        lane: usize,
        c: usize,
        force: [T; 3],
    );

    /// The transpose of `spread`: adds the forces to the nodes.
    fn collect<T: Real>(
        nodes: &[[u32; N]; LANES],
        from: &mut Self::Derivatives<T>,
        to: &mut [Node<T>],
    );

    /// The gradient that each node's displacement is multiplied by at a point, without `FACTOR`, from those of the four
    /// `coordinates`.
    fn gradients(point: usize, coordinates: &[Vec3; 4]) -> [Vec3; N];
}

/// Linear tetrahedra. A derivative is the difference of two nodes.
#[derive(Clone, Debug)]
pub struct Four;

impl Cell<4, 1> for Four {
    const FACTOR: f64 = 1.0;

    /// The differences of the nodes.
    type Derivatives<T: Real> = Vectors<T, 3>;

    #[inline(always)]
    fn zero<T: Real>() -> Vectors<T, 3> {
        [[[T::ZERO; 4]; LANES]; 3]
    }

    #[inline(always)]
    fn spread<T: Real>(nodes: &[[u32; 4]; LANES], of: &[Node<T>], to: &mut Vectors<T, 3>) {
        gather(nodes, of, to);
    }

    #[inline(always)]
    fn at<T: Real>(derivatives: &Vectors<T, 3>, _: usize, lane: usize) -> [[T; 3]; 3] {
        vectors_at(derivatives, lane)
    }

    #[inline(always)]
    fn put<T: Real>(to: &mut Vectors<T, 3>, _: usize, lane: usize, c: usize, force: [T; 3]) {
        to[c][lane] = node(force);
    }

    #[inline(always)]
    fn collect<T: Real>(nodes: &[[u32; 4]; LANES], from: &mut Vectors<T, 3>, to: &mut [Node<T>]) {
        scatter(nodes, from, to);
    }

    fn gradients(_: usize, coordinates: &[Vec3; 4]) -> [Vec3; 4] {
        *coordinates
    }
}
