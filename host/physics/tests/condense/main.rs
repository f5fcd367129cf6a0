//! Tests of `condense`. They are one program, because each program compiles the generic solvers anew.

mod compliance;
mod drift;
mod perturbation;
mod touching;
