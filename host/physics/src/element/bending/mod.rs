//! The resistance of a sheet to bending: a thin plate over the triangles of the sheet, without further unknowns.
//!
//! The energy of a triangle is Kirchhoff's, a quadratic function of the change of its curvature,
//!
//! ```text
//! W = A/2 (k - k_0)^T D (k - k_0)
//! ```
//!
//! with its area `A`, the plate's matrix `D` and the curvature at rest `k_0`. The curvature follows from the slopes at the
//! sides of the triangle. Stretches in the plane of a triangle do not change the slopes, so that in-plane stress is free
//! of bending.
//!
//! - `sheet`: the facts about a sheet from which all else follows.
//! - `unfold`: the vertices near an edge, in the plane of its triangles.
//! - `rotation`: the derivative across an edge, from nearby vertices.
//! - `build`: the curvature of a triangle from the slopes at its sides, and its energy.
//! - `curvature`: slopes, curvature and their derivatives for one triangle.
//! - `exact`: forces, energy and stiffness of all triangles; `patch`: the vertices on which each triangle depends.
//! - `tear`: how all this follows the edits of a torn sheet; `torn_facets`: the vector form of it. `few`: short lists.
//! - `moment`: the moments in each triangle, for reports. `release`: the bending energy that a tear gives up.
//! - `facets`: forces and products in the form for vector instructions; `kernels`: its loops; `cost`: its operations.
//!
//! Deflections converge to those of the plate with the square of the size of the cells on any triangulation
//! (`palpate bench accuracy`).

mod build;
mod cost;
mod curvature;
mod exact;
mod facets;
mod few;
mod kernels;
mod moment;
mod patch;
mod release;
mod rotation;
pub(crate) mod scalar;
mod sheet;
mod tear;
mod torn_facets;
mod unfold;

pub use cost::PRODUCT_FLOPS;
pub(crate) use exact::Bending;
pub(crate) use sheet::{BentSheet, BorderSide, Plate};

/// Stands for the neighbour across a border. An `Option` would take twice the memory.
const NONE: u32 = u32::MAX;
