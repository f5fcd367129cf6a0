//! Tests of `linear`. They are one program, because each program compiles the generic solvers anew.

#[path = "../common/mod.rs"]
mod common;

mod factor;
mod incomplete;

#[global_allocator]
static ALLOCATOR: alloc_count::calls::Counting = alloc_count::calls::Counting;
