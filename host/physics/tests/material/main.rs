//! Tests of `material`. They are one program, because each program compiles the generic solvers anew.

mod sheet_law;
