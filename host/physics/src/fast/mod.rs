//! The realtime step, fast: one linearization, without assembling anything.
//!
//! - [`Stepper`]: one step of a body by preconditioned conjugate gradients.
//! - `kernel`: what it needs of a set of elements.

mod condense;
mod factor;
mod kernel;
mod order;
mod panel;
mod stepper;

pub use condense::{ShapeOptions, ShapeReport};
pub use stepper::{Guess, Stepper, StepperOptions, StepperReport};

use crate::Vec3;
use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A vector at a node, padded so that one load brings it: x, y, z, 0.
pub type Node<T> = [T; 4];

/// `f32` or `f64`.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialOrd
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + 'static
{
    /// Zero.
    const ZERO: Self;
    /// The nearest.
    fn of(value: f64) -> Self;
    /// The same.
    fn to_f64(self) -> f64;
}

impl Real for f64 {
    const ZERO: Self = 0.0;
    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
}

impl Real for f32 {
    const ZERO: Self = 0.0;
    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
}

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
