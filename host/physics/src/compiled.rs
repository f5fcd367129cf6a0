//! The functions of a step in single and double precision, compiled in this crate.
//!
//! The compiler compiles a generic function again in every crate that calls it. Only a function that is never inlined is
//! linked, if a crate below has compiled it. The outer functions of a step are therefore never inlined, and this module
//! names them for both precisions. Crates that step bodies compile faster, and their steps are the same machine code.

use crate::cost::ceiling::multiply_and_add;
use crate::{Refresher, Shapes, Stepper, Tearing};

macro_rules! functions {
    ($($type:ty),*) => {
        [$(
            Stepper::<$type>::new as *const (),
            Stepper::<$type>::follow as *const (),
            Stepper::<$type>::prepare as *const (),
            Stepper::<$type>::predict as *const (),
            Stepper::<$type>::constrain as *const (),
            Stepper::<$type>::solve_until as *const (),
            Stepper::<$type>::finish_until as *const (),
            Stepper::<$type>::grow as *const (),
            Stepper::<$type>::settle as *const (),
            Stepper::<$type>::adopt as *const (),
            Stepper::<$type>::lend as *const (),
            Stepper::<$type>::cost as *const (),
            Stepper::<$type>::repeat as *const (),
            Stepper::<$type>::bytes as *const (),
            Refresher::<$type>::work as *const (),
            Refresher::<$type>::read_ahead as *const (),
            Shapes::condense::<$type> as *const (),
            Tearing::advance::<$type> as *const (),
            Tearing::limit::<$type> as *const (),
            multiply_and_add::<$type> as *const (),
        )*]
    };
}

/// The addresses of the functions. Nothing calls this function: the compiler compiles all functions that it names.
#[doc(hidden)]
#[inline(never)]
pub fn functions_of_a_step() -> [*const (); 40] {
    functions!(f32, f64)
}
