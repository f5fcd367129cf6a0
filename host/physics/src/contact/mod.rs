//! Contact: which parts of the surfaces of bodies and obstacles may touch.
//!
//! - [`surface`]: the surfaces, in one numbering. [`pair`]: vertices against triangles, edges against edges; `distance`.
//! - [`hierarchy`]: boxes over the surfaces, and clusters. `aabb`: a box. `search`: all pairs of two clusters.
//! - [`row`]: the law of a contact. [`rows`]: the contacts of a step, from its pairs and shapes. `feet`: where a pair may
//!   touch. `between`: points between vertices. `nearest`: what a vertex touches. `least`: which connections are contacts. `kept`: what contacts keep from step to step. `thinning`: which contacts have
//!   rows.
//! - `faces`: the two faces of a tear.
//! - [`facet`]: the facets of solids, and what two of them share.
//! - [`obstacle`]: obstacles and their motion. [`shape`]: shapes of obstacles with an exact distance.
//!   [`placed`]: a shape in a step. [`vicinity`]: the surface of an obstacle near a tool.
//! - [`start`]: what keeps surfaces from beginning a run.
//! - [`certificate`]: what keeps pairs from passing through each other in a step. [`crossing`]: whether an edge does.
//! - [`lists`]: kept lists of pairs, by how far two clusters have departed from a common rigid motion (`rigid`,
//!   `drift`).
//!
//! Vertex-triangle and edge-edge pairs: Provot, "Collision and self-collision handling in cloth model dedicated to design
//! garments" (1997). Lists that are kept while objects move little: Mirtich's "Timewarp" (2000) and Verlet's lists of
//! neighbours (1967); the clusters with a measure of their deformation: chapter 4 of the thesis that this project follows.

pub mod aabb;
mod between;
pub mod certificate;
pub mod crossing;
pub mod distance;
mod drift;
mod faces;
pub mod facet;
mod feet;
pub mod hierarchy;
pub(crate) mod kept;
mod least;
pub mod lists;
pub mod moves;
mod nearest;
pub mod obstacle;
pub mod pair;
pub mod placed;
pub mod rigid;
pub mod rounded;
pub mod row;
pub mod rows;
mod search;
pub mod shape;
pub mod start;
pub mod surface;
mod thinning;
pub mod vicinity;

pub use hierarchy::Hierarchy;
pub use kept::Key;
pub use lists::{Counts, Lists};
pub use moves::Moves;
pub use obstacle::Obstacle;
pub use pair::{Foot, Pair};
pub use placed::Placed;
pub use rows::{Contact, Meeting, Rows, RowsReport, Step};
pub use surface::{Part, Skin, Surfaces};
