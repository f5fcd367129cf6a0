//! Tests of `mesh`. They are one program, because each program compiles the generic solvers anew.

mod check;
mod check_solid;
mod plate;
mod sheet;
mod solids;
mod thread;
