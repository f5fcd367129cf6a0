//! How a deformation gradient splits into a turn and a stretch: exactly, and in the lanes of vector instructions.
//!
//! - [`svd`]: singular values of a 3 x 3 matrix; `surface`: those of a triangle's 3 x 2.
//! - [`lanes`]: rotations of elements, from where they last were; `surface_lanes`: the same of triangles.
//! - `matrices`: the matrices of one element in a lane.

pub mod lanes;
pub(crate) mod matrices;
pub(crate) mod surface;
pub(crate) mod surface_lanes;
pub mod svd;
