//! Tearing of sheets against fracture mechanics: onset, force, path and energy, on meshes of several sizes and patterns.
//!
//! - `delaunay`, `patterns`: the meshes of the specimens.

mod delaunay;
mod patterns;

pub use patterns::{Pattern, Patterned, Rectangle, Slit};
