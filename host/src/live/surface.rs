//! The connectivity of a body as a person sees it.

use super::frame::Surface;
use physics::Body;

/// The surface of a body after a change.
pub(super) fn after_change(before: &Surface, now: &Body) -> Surface {
    Surface { epoch: now.epoch() as u32, ..before.clone() }
}
