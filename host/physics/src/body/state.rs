//! Where a body is and how it moves.

use crate::Vec3;

/// Positions, velocities and time.
#[derive(Clone, Debug)]
pub(crate) struct State {
    /// Positions by node (m).
    pub(crate) x: Vec<Vec3>,
    /// Velocities by node (m/s).
    pub(crate) v: Vec<Vec3>,
    /// How much time steps have taken (s).
    pub(crate) clock: f64,
    /// How often something was set from outside.
    pub(crate) revision: u64,
}
