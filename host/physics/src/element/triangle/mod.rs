//! Triangles of thin sheets.
//!
//! - [`membrane`]: isotropic sheets in the exact form; [`triangles`] and `kernels`: the same in the vector form.
//! - [`woven`]: woven sheets.
//! - `torn`: how they follow the edits of a torn surface.
//! - `frame`: the rest frame of a triangle.
//! - `cost`: the operations and bytes of `kernels`.

mod cost;
pub(crate) mod frame;
mod kernels;
pub mod membrane;
mod torn;
pub mod triangles;
pub mod woven;

pub use woven::Woven;
