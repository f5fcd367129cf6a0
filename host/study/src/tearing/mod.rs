//! Tearing of sheets against fracture mechanics: onset, force, path and energy, on meshes of several sizes and patterns.
//!
//! - `delaunay`, `patterns`: the meshes of the specimens. `specimen`: their materials.
//! - `kinks`: the first kink of a crack at an angle to the load.
//! - `strip`: the strain at which a long clamped strip starts to tear.

mod delaunay;
pub mod kinks;
mod patterns;
mod specimen;
pub mod strip;

pub use patterns::{Pattern, Patterned, Rectangle, Slit};
pub use specimen::{CLOTH, PAPER, Stuff};

/// The numbers of triangles of the meshes.
pub const SIZES: [usize; 4] = [700, 1400, 2800, 5600];
