//! The state of a body: positions, velocities and time.

use crate::Vec3;

/// Positions, velocities and time.
#[derive(Clone, Debug)]
pub(crate) struct State {
    /// Positions by node (m).
    pub(crate) x: Vec<Vec3>,
    /// Velocities by node (m/s).
    pub(crate) v: Vec<Vec3>,
    /// The sum of all time steps so far (s).
    pub(crate) clock: f64,
    /// Number of changes from outside a step: of positions, velocities, loads, supports or handles.
    pub(crate) revision: u64,
}
