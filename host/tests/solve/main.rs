//! Static solutions. They are one program, because each program compiles the generic solvers anew and is linked anew.

mod needles;
mod solve;
mod solve_contact;
mod solve_weight;
