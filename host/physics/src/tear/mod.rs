//! Tearing of a sheet: when a tear starts, when its tip advances, and where it goes.
//!
//! How opened edges let go is part of the step: see [`motion::stepper`](crate::motion::stepper).
//!
//! Every item is a function over slices. A [`Sheet`] gives the triangles, their neighbours and their shapes at rest;
//! positions and material come beside it. No item knows bodies, solvers or edits.
//!
//! - [`law`]: the two laws by name, the parameters and their checks.
//! - [`strength`]: principal stress at vertices, where a tear starts, and the bound below which none can start.
//! - [`rings`]: the rings of vertices about a tip and the cut-off function `q`. [`unfold`]: their triangles in one plane.
//! - [`fields`]: stretch, stress and energy density in these triangles.
//! - [`driving`]: the energy release rate `G` at a tip.
//! - [`path`]: the stress intensities `K_I` and `K_II` and the angle by which a tear turns.
//!
//! A [`Patch`] holds the memory for all computations about a tip. It allocates when it is made and never afterwards.
//!
//! Sources: Griffith 1921 and Irwin 1957 (energy release rate); Eshelby 1951 and Rice 1968 (the integral); Shih, Moran
//! and Nakamura 1986 (its form over a domain); Yau, Wang and Corten 1980 (interaction integrals); Erdogan and Sih 1963
//! (the angle); Le Gouis et al. 2017 (the law `thesis`).

pub mod driving;
pub mod fields;
pub mod law;
pub mod path;
pub mod rings;
pub mod strength;
pub mod unfold;

pub use driving::Driving;
pub use law::{TearError, TearLaw, TearMaterial};
pub use path::Intensity;
pub use rings::{Patch, Sheet, Tip};
pub use strength::Candidate;

/// The last ring of vertices about a tip on which `q` is 1, if nothing is in the way.
///
/// See [`rings`] for the errors of fewer rings.
pub const RINGS: usize = 3;
