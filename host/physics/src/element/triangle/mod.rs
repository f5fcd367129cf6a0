//! Triangles of thin sheets.
//!
//! - [`membrane`]: isotropic sheets, exactly; [`triangles`] and `kernels`: the same in vectors.
//! - [`woven`]: sheets with a grain.
//! - `frame`: a triangle at rest.

pub(crate) mod frame;
mod kernels;
pub mod membrane;
pub mod triangles;
pub mod woven;

pub use woven::Woven;
