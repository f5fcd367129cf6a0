//! Tests of `material`. They are one program, because each program compiles the generic solvers anew.

#[path = "../common/mod.rs"]
mod common;

mod sheet_law;
