//! A triangle surface that can be torn: the triangles, their neighbours and their shapes at rest, and edits of them.
//!
//! A [`Surface`] knows nothing of positions in space, masses or materials. It is made once, with a reserve of vertices
//! and triangles, and edited in place without allocating. An [`Edit`] lets a tear grow from its tip along one edge. The
//! edge exists ([`Growth::Open`]), is made by the division of an edge ([`Growth::Cut`]), or is turned at rest onto the
//! path of the tear ([`Growth::Snap`]). [`Surface::advance`] chooses the edit that follows a direction.
//!
//! - `surface`: the data. `check`: which triangles form a surface.
//! - `fan`: the triangles about a vertex. `angle`: directions about a vertex.
//! - `edit`: edits, and what they changed. `open`, `cut`, `snap`: their parts. `journal`: how a refused edit is undone.
//! - `advance`: the choice of an edit. `notch`: notches and slits before the first step. `pieces`: connected parts.
//!
//! **Fans.** The triangles about a vertex form a **fan**: each shares an edge at the vertex with the next one. At a
//! border the fan is open. Every vertex has exactly one fan, before and after every edit. A vertex that would have two
//! is doubled: the second fan gets a new vertex, the **twin** (O'Brien and Hodgins, "Graphical modeling and animation of
//! brittle fracture", 1999, split vertices so).
//!
//! A square of four triangles tears from the left corner straight through its middle:
//!
//! ```
//! use physics::topology::{AdvanceOptions, NONE, Pieces, Reserve, Surface};
//!
//! let corners = [[-1.0, 0.0], [0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0]];
//! let triangles = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
//! let shapes = triangles.map(|triangle| triangle.map(|vertex| corners[vertex as usize]));
//! let reserve = Reserve { vertices: 8, triangles: 8 };
//! let mut surface = Surface::new(5, &triangles, &shapes, reserve)?;
//!
//! let (mut tip, mut edges) = (0, 0);
//! while tip != NONE {
//!     let direction = surface.straight_ahead(tip);
//!     let options = AdvanceOptions { snapping: 0.4, opening: 0.0 };
//!     let edit = surface.advance(tip, direction, options, |_| true).ok_or("no way on")?;
//!     let done = surface.edit(&edit)?;
//!     tip = done.tips[0];
//!     edges += 1;
//! }
//! assert_eq!((edges, surface.vertex_count()), (2, 8));
//! assert_eq!(Pieces::new(&surface).count(), 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! **Snapping** moves a vertex at rest onto the path, instead of cutting slivers beside it (Wu, Westermann and Dick, "A
//! survey of physically based simulation of cuts in deformable bodies", 2015, section 3).

mod advance;
mod angle;
mod check;
mod cut;
mod edit;
mod fan;
mod journal;
mod notch;
mod open;
mod pieces;
mod snap;
mod surface;

pub use advance::AdvanceOptions;
pub use angle::Wedge;
pub use check::SurfaceError;
pub use edit::{Done, Edit, EditError, Growth, Moved, Opened};
pub use fan::{Corner, Fan};
pub use notch::{Notch, NotchError};
pub use pieces::Pieces;
pub use surface::{Origin, Reserve, Shape, Surface};

/// No triangle, or no vertex.
pub const NONE: u32 = u32::MAX;
