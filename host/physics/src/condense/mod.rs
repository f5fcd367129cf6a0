//! Condensation: the projection of a body onto its handles, as small dense matrices between handles.
//!
//! - `condenser`: computes the shapes by a factorization of its own.
//! - `shapes`: computes the shapes by iterations on a stepper's frozen factor, from the previous shapes.
//! - `around`: what a body touches, in its shapes.
//! - `compliance`: how the points of a surface yield to forces at each other.
//! - `loose`: the rigid motions of the pieces that nothing holds. `hold`: what else such a piece touches.
//! - `reduction`: computes the matrices between handles from either kind of shapes.

mod around;
mod compliance;
mod condenser;
mod hold;
mod loose;
mod reduction;
mod shapes;

pub use around::{Around, Beside};
pub use compliance::{Footprint, SiteCompliance, resultant};
pub use condenser::Condenser;
pub use hold::Held;
pub use reduction::Condensed;
pub use shapes::{ShapeOptions, ShapeReport, Shapes};
