//! The same body made of something else, in the middle of a motion.

use super::Body;
use crate::error::BodyError;

impl Body {
    /// Takes over where `other` is and how it moves, its handles with it: this body goes on in its place. The two
    /// must be of the same mesh, with the same handles; what may differ is the material. A body that is softer
    /// than the other stores less at the same shape; the rest of the energy is gone.
    ///
    /// # Errors
    ///
    /// [`BodyError::Length`] where the numbers of vertices or handles differ; nothing is changed then.
    pub fn continue_from(&mut self, other: &Self) -> Result<(), BodyError> {
        for (what, found, expected) in [
            ("vertices to continue", other.x.len(), self.x.len()),
            (
                "handles to continue",
                other.handles.len(),
                self.handles.len(),
            ),
        ] {
            if found != expected {
                return Err(BodyError::Length {
                    what,
                    found,
                    expected,
                });
            }
        }
        // Nodes are numbered by the mesh and the handles alone.
        self.x.copy_from_slice(&other.x);
        self.v.copy_from_slice(&other.v);
        for (mine, theirs) in self.handles.iter_mut().zip(&other.handles) {
            mine.report = theirs.report;
        }
        self.forget_promise();
        self.revision += 1;
        self.fresh = false;
        Ok(())
    }
}
