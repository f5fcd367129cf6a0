//! The kernels for single and double precision, compiled in this crate.
//!
//! Generic code is compiled in every program that calls it. The kernels are most of the code of a step, because each one
//! is compiled for several sets of vector instructions and for each law. [`f32`] and [`f64`] therefore make their kernels
//! in functions that are not generic: programs link these functions and do not compile the kernels again.

use super::VectorForm;
use super::kernel::Kernel;
use crate::lanes::Real;
use crate::linear::block_matrix::BlockMatrix;

/// The kernel of a set of elements.
#[derive(Debug)]
pub struct AnyKernel<T>(pub(super) Box<dyn Kernel<T>>);

/// A precision in which a stepper computes.
pub trait Precision: Real {
    /// The kernel of the elements, with the slots of their blocks in `matrix`. Other numbers than [`f32`] and [`f64`], such
    /// as those of a test that counts operations, keep this implementation.
    fn kernel(form: VectorForm, matrix: &BlockMatrix) -> AnyKernel<Self> {
        AnyKernel(form.generic_kernel(matrix))
    }
}

macro_rules! compiled_here {
    ($($type:ty),*) => {$(
        impl Precision for $type {
            #[inline(never)]
            fn kernel(form: VectorForm, matrix: &BlockMatrix) -> AnyKernel<Self> {
                AnyKernel(form.generic_kernel(matrix))
            }
        }
    )*};
}

compiled_here!(f32, f64);
