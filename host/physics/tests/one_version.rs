//! The tests that compare bytes and steps, for `tests/vectors check`: a build in which vectorized functions have only the
//! version for every x86-64 processor. In other builds these tests are part of the rooms' programs.
#![cfg(palpate_one_version)]

#[path = "linear/factor.rs"]
mod factor;
#[path = "motion/stepper.rs"]
mod stepper;
#[path = "element/tet10.rs"]
mod tet10;
#[path = "element/tet4.rs"]
mod tet4;
#[path = "element/triangle.rs"]
mod triangle;

#[global_allocator]
static ALLOCATOR: alloc_count::calls::Counting = alloc_count::calls::Counting;
