//! Meshes, finite elements and condensation: pure computation.
//!
//! Everything here is a plain function or struct over state and time step. There are no threads, clocks,
//! files or printing, and no knowledge of devices: a mesh arrives as arrays, time as a step length, and every
//! budget is a count of iterations. That is what makes a run repeat to the byte.
//!
//! - [`mesh`]: triangle and tetrahedral meshes, their checks and generators.
//! - [`fast`]: the realtime step of a body, without assembling anything.
//! - [`fem`]: membranes with bending and elastic solids, implicit time steps, equilibria, and the
//!   condensation of a body onto its handles.
#![forbid(unsafe_code)]

pub mod fast;
pub mod fem;
pub mod mesh;

/// A vector in three dimensions (m, m/s or N, as its name says).
pub type Vec3 = nalgebra::Vector3<f64>;
/// A 3 x 3 matrix.
pub type Mat3 = nalgebra::Matrix3<f64>;
