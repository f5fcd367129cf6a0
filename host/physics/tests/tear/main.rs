//! Tests of tears. They are one program, because each program compiles the generic solvers anew.

mod body;
mod elements;
mod law;
mod path;
mod solver;
mod topology;
mod whole;

#[global_allocator]
static ALLOCATOR: alloc_count::calls::Counting = alloc_count::calls::Counting;
