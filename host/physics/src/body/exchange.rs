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
            (
                "vertices to continue",
                other.state.x.len(),
                self.state.x.len(),
            ),
            (
                "handles to continue",
                other.constraints.handles.len(),
                self.constraints.handles.len(),
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
        // The two may number their nodes differently.
        let (mine, theirs) = (
            &self.topology.node_of_vertex,
            &other.topology.node_of_vertex,
        );
        for (&mine, &theirs) in mine.iter().zip(theirs) {
            self.state.x[mine as usize] = other.state.x[theirs as usize];
            self.state.v[mine as usize] = other.state.v[theirs as usize];
        }
        for (mine, theirs) in self
            .constraints
            .handles
            .iter_mut()
            .zip(&other.constraints.handles)
        {
            mine.report = theirs.report;
        }
        self.forget_promise();
        self.state.revision += 1;
        self.assembly.fresh = false;
        Ok(())
    }
}
