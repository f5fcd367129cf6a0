//! The connectivity of a body as a person sees it.

use super::frame::Surface;
use physics::Body;

/// The surface of a body at rest.
pub(super) fn of_body(index: usize, body: &Body) -> Surface {
    Surface {
        body: index as u32,
        epoch: body.epoch() as u32,
        vertices: body.vertex_count() as u32,
        rest: body
            .positions()
            .flat_map(|x| [x.x as f32, x.y as f32, x.z as f32])
            .collect(),
        ..Surface::default()
    }
}

/// The surface of a body after a change.
pub(super) fn after_change(before: &Surface, now: &Body) -> Surface {
    Surface {
        epoch: now.epoch() as u32,
        ..before.clone()
    }
}
