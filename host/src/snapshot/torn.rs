//! The surface of a sheet that tears, copied after a step into a buffer that was made before the run.
//!
//! A tear adds vertices and triangles at the end of the lists of the body, and changes corners of triangles. The whole
//! surface is copied, because a viewer may have missed every surface before. The host copies it only after an edit.

use crate::record::Surface;
use physics::Body;

/// A buffer for the surface of one body. It is empty for a body that cannot tear.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TornSurface {
    surface: Surface,
    /// Whether the surface was copied since the buffer was last cleared.
    fresh: bool,
}

impl TornSurface {
    /// A buffer with room for the surface of `body`, whose index is `index`, and for all that tears may add to it.
    pub fn new(index: usize, body: &Body) -> Self {
        let limits = body.surface().map(physics::topology::Surface::limits);
        let limits = limits.unwrap_or_default();
        Self {
            surface: Surface {
                body: index as u32,
                rest: Vec::with_capacity(3 * limits.vertices),
                triangles: Vec::with_capacity(3 * limits.triangles),
                ..Surface::default()
            },
            fresh: false,
        }
    }

    /// Copies the present surface of `body`, of index `index`. Returns whether the body has torn; the buffer stays as it
    /// is otherwise. A buffer with room does not allocate.
    ///
    /// The positions at rest are those of the body, so a vertex that snapped has its new place. In a sheet with a flat
    /// pattern they are the positions at the start.
    pub fn copy(&mut self, index: usize, body: &Body) -> bool {
        let Some(torn) = body.surface().filter(|_| body.edit_count() > 0) else {
            return false;
        };
        let surface = &mut self.surface;
        surface.body = index as u32;
        surface.epoch = body.epoch() as u32;
        surface.vertices = torn.vertex_count() as u32;
        surface.triangle_count = torn.triangle_count() as u32;
        surface.rest.clear();
        let rest = body.rest_positions().iter();
        rest.for_each(|p| surface.rest.extend([p.x, p.y, p.z].map(|x| x as f32)));
        surface.triangles.clear();
        surface
            .triangles
            .extend_from_slice(torn.triangles().as_flattened());
        self.fresh = true;
        true
    }

    /// The surface, if one was copied since the buffer was last cleared.
    pub fn fresh(&self) -> Option<&Surface> {
        self.fresh.then_some(&self.surface)
    }

    /// Forgets the surface. The memory stays.
    pub fn clear(&mut self) {
        self.fresh = false;
    }

    /// Takes the surface of `older`, a buffer that was filled before, unless this buffer has a newer one.
    pub fn merge_before(&mut self, older: &mut Self) {
        if !self.fresh && older.fresh {
            std::mem::swap(self, older);
        }
    }
}
