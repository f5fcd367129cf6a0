//! The realtime step made for speed: one linearization, without assembling anything, numbers laid out for vector
//! instructions and for the caches.
//!
//! - [`Stepper`]: one step of a body by conjugate gradients on a frozen factor; [`ShapeOptions`]: its local
//!   models.
//! - [`refresh`]: a new factor, made beside the steps.
//! - [`Cost`] and [`Part`]: bytes and operations of the parts of a step, and each alone.
//! - `sleep`: bodies at rest are not stepped.
//! - `kernel`: what a step needs of a set of elements.
//! - [`lanes`]: numbers of either precision, and node vectors to and from arrays over elements.
//! - [`polar`]: rotations of elements, from where they last were.
//! - [`tet`]: linear tetrahedra in blocks: forces, energies and products with the stiffness.
//! - `tet_kernels`: what is computed on such a block.
//! - [`quadratic`] and `quadratic_kernels`: the same of quadratic tetrahedra.
//! - `principal` and `principal_kernels`: tetrahedra of any isotropic law.
//! - `matrices`: those of one element in a lane.
//! - [`triangle`], `triangle_kernels` and `triangle_polar`: the same of membrane triangles.
//! - `vectors`: what conjugate gradients do with whole vectors.
//! - `precondition`: which of the two factors that follow preconditions a step.
//! - [`order`], [`supernodes`], [`factor`], [`panel`] and `sweep`: a frozen sparse Cholesky factor as a
//!   preconditioner.
//! - [`incomplete`]: an incomplete one with a coarse space, for bodies whose complete one is too large.

mod condense;
mod cost;
pub mod factor;
pub mod incomplete;
mod kernel;
pub mod lanes;
mod matrices;
pub mod order;
pub mod panel;
pub mod polar;
mod precondition;
mod principal;
mod principal_kernels;
pub mod quadratic;
mod quadratic_kernels;
pub mod refresh;
mod sleep;
mod stepper;
pub mod supernodes;
mod sweep;
pub mod tet;
mod tet_kernels;
pub mod triangle;
mod triangle_kernels;
mod triangle_polar;
mod vectors;

pub use condense::{ShapeOptions, ShapeReport};
pub use cost::{Cost, Part};
pub use lanes::Real;
pub use precondition::{Preconditioner, complete_bytes};
pub use refresh::Refresher;
pub use stepper::{Guess, Stepper, StepperOptions, StepperReport};

use crate::Vec3;

/// Three numbers of a node (x, y, z) and a fourth, zero, that fills a vector register.
pub type Node<T> = [T; 4];

#[inline(always)]
pub(crate) fn to_vec<T: Real>(node: &Node<T>) -> Vec3 {
    Vec3::new(node[0].to_f64(), node[1].to_f64(), node[2].to_f64())
}

#[inline(always)]
pub(crate) fn to_node<T: Real>(v: &Vec3) -> Node<T> {
    [T::of(v.x), T::of(v.y), T::of(v.z), T::ZERO]
}

#[inline(always)]
pub(crate) fn add<T: Real>(sum: &mut Node<T>, other: &Node<T>) {
    for i in 0..4 {
        sum[i] += other[i];
    }
}

#[inline(always)]
pub(crate) fn dot<T: Real>(a: &Node<T>, b: &Node<T>) -> T {
    (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3])
}
