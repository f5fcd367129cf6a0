//! Tests of `element`. They are one program, because each program compiles the generic solvers anew.

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
