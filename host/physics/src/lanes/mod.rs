//! Numbers laid out for vector instructions and for the caches.
//!
//! - [`Real`]: numbers of single or double precision.
//! - [`Node`]: the vector of a node, padded.
//! - `logarithm`: the logarithm in lanes.
//! - [`block`]: gathering node vectors into arrays over elements, and scattering them back.

pub mod block;
pub(crate) mod logarithm;
mod real;

pub use real::Real;

use crate::Vec3;

/// Three components of a node (x, y, z) and a fourth, zero, that fills a vector register.
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
