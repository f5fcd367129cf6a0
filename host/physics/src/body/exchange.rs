//! The replacement of a body by one of another material, in the middle of a motion.

use super::Body;
use crate::error::BodyError;

impl Body {
    /// Copies the positions, the velocities and the handle reports of `other`, so that this body continues its motion.
    /// Both bodies must have the same mesh and the same handles; the material may differ. A softer body stores less
    /// energy in the same shape; the difference of the energies is lost.
    ///
    /// # Errors
    ///
    /// [`BodyError::Length`] where the numbers of vertices or handles differ; nothing has changed then.
    pub fn continue_from(&mut self, other: &Self) -> Result<(), BodyError> {
        for (quantity, found, expected) in [
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
                    quantity,
                    found,
                    expected,
                });
            }
        }
        // The two bodies may number their nodes differently.
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
