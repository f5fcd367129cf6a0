//! The polar decomposition of a deformation gradient into rotation and stretch, for one element and in vector lanes.
//!
//! - [`svd`]: singular values of a 3 x 3 matrix; `surface`: the polar decomposition of a triangle's 3 x 2 gradient.
//! - [`lanes`]: rotations of elements by Newton iterations; `surface_lanes`: the decomposition of triangles in lanes.
//! - `axes`: principal axes of tetrahedra by Jacobi rotations, in lanes.
//! - `matrices`: matrices of the element in one lane.

pub(crate) mod axes;
pub mod lanes;
pub(crate) mod matrices;
pub(crate) mod surface;
pub(crate) mod surface_lanes;
pub mod svd;
