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
