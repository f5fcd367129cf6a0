//! Tests of `linear`. They are one program, because each program compiles the generic solvers anew.

mod factor;
mod incomplete;

#[global_allocator]
static ALLOCATOR: alloc_count::calls::Counting = alloc_count::calls::Counting;
