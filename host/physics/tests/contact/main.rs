//! Contact: detection of pairs that may touch, and their rows.

#[global_allocator]
static ALLOCATOR: alloc_count::calls::Counting = alloc_count::calls::Counting;

mod layers;
mod lists;
mod motions;
mod rest;
mod rows;
mod throws;
mod world;
