//! Condensation: what the hands feel of a body, as small dense matrices between handles.
//!
//! - `condenser`: by a factorization of its own.
//! - `shapes`: on a stepper's frozen factor, from the shapes of last time.
//! - `reduction`: what either kind of shapes comes to between handles.

mod condenser;
mod reduction;
mod shapes;

pub use condenser::Condenser;
pub use reduction::Condensed;
pub use shapes::{ShapeOptions, ShapeReport, Shapes};
