//! Tests of `body`. They are one program, because each program compiles the generic solvers anew.

mod border;
mod errors;
mod exchange;
mod hold;
mod load;
mod map;
