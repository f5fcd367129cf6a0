//! The forces of a tool on bodies in the last ticks, by which a message is compared with the tick at its time.

use crate::geometry::Vec3;

/// Number of ticks that are kept: a message that is older tells nothing of the present force.
const KEPT: usize = 64;

/// The forces on a tool in the last ticks (N).
#[derive(Clone, Debug)]
pub(super) struct Past {
    forces: [Vec3; KEPT],
    /// The place of the last tick.
    last: usize,
}

impl Past {
    /// No force in any tick.
    pub(super) const NONE: Self = Self {
        forces: [Vec3::new(0.0, 0.0, 0.0); KEPT],
        last: 0,
    };

    /// Takes the force of a tick.
    pub(super) fn push(&mut self, force: Vec3) {
        self.last = self.last.wrapping_add(1) % KEPT;
        if let Some(place) = self.forces.get_mut(self.last) {
            *place = force;
        }
    }

    /// The force in the tick that is this number of ticks older than the last; `None` if it is no longer kept.
    pub(super) fn force(&self, older: usize) -> Option<Vec3> {
        if older >= KEPT {
            return None;
        }
        let place = self.last.wrapping_add(KEPT).wrapping_sub(older) % KEPT;
        self.forces.get(place).copied()
    }
}
