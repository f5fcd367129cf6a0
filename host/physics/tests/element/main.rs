//! Tests of `element`. They are one program, because each program compiles the generic solvers anew.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common_kernels/mod.rs"]
mod common_kernels;

mod bending;
mod cost;
mod flat_pattern;
mod membrane;
mod solid;
mod tet10;
mod tet4;
mod triangle;
mod truss;
mod vector_form;
mod woven;
