//! Tearing of sheets against fracture mechanics: onset, force, path and energy, on meshes of several sizes and patterns.
//!
//! - `delaunay`, `patterns`: the meshes of the specimens. `specimen`: their materials.
//! - `pull`: a notched sheet that two hands tear.
//! - [`meshes`]: force and energy of a tear on different meshes. [`strip`]: the start of a tear in a long strip.
//! - [`kinks`]: the first kink of a crack at an angle to the load.
//! - [`energy`]: the account of the energy of a tear.
//! - [`edits`]: what tears do to a mesh.

mod delaunay;
pub mod edits;
pub mod energy;
pub mod kinks;
pub mod meshes;
mod patterns;
mod pull;
mod specimen;
pub mod strip;

pub use patterns::{Pattern, Patterned, Rectangle, Slit};
pub use pull::EditErrors;
pub use specimen::{CLOTH, PAPER, Stuff};

/// The numbers of triangles of the meshes.
pub const SIZES: [usize; 4] = [700, 1400, 2800, 5600];
