//! Notches and slits that a surface has before the first step.

use super::advance::AdvanceOptions;
use super::edit::EditError;
use super::surface::Surface;
use thiserror::Error;

/// A straight notch or slit in the plane of a flat surface at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Notch {
    /// One end (m): on the border for a notch.
    pub from: [f64; 2],
    /// The other end (m).
    pub to: [f64; 2],
}

/// Why a notch was not made.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum NotchError {
    /// The triangles at a vertex do not lie in one plane at rest.
    #[error(
        "a notch needs a surface that is flat at rest, but vertex {vertex} has two places in the plane"
    )]
    NotFlat {
        /// The vertex.
        vertex: u32,
    },
    /// An edit was refused.
    #[error("the notch stopped: {0}")]
    Edit(#[from] EditError),
}

impl Surface {
    /// Makes a notch or a slit, and returns its tips: [`NONE`](super::NONE) for an end at a border.
    ///
    /// # Errors
    /// [`NotchError`]
    pub fn notch(
        &mut self,
        _notch: &Notch,
        _options: &AdvanceOptions,
        _may_move: impl Fn(u32) -> bool,
    ) -> Result<[u32; 2], NotchError> {
        Ok([super::NONE; 2])
    }
}
