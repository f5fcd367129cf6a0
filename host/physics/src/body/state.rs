//! The state of a body: positions, velocities and time, and what the last step leaves for the next.

use super::guard::Guard;
use crate::Vec3;

/// Positions, velocities and time, and the last step.
#[derive(Clone, Debug)]
pub(crate) struct State {
    /// Positions by node (m).
    pub(crate) x: Vec<Vec3>,
    /// Velocities by node (m/s).
    pub(crate) v: Vec<Vec3>,
    /// Displacement over the step by node (m).
    pub(crate) displacement: Vec<Vec3>,
    /// The bound on the energy at the end of the next step.
    pub(crate) guard: Guard,
    /// The sum of all time steps so far (s).
    pub(crate) clock: f64,
    /// Number of changes from outside a step: of positions, velocities, loads, supports or handles.
    pub(crate) revision: u64,
    /// Number of changes of the positions, by steps and from outside.
    pub(crate) motions: u64,
}

impl State {
    /// A body at rest at positions `x` (m).
    pub(crate) fn at_rest(x: &[Vec3]) -> Self {
        let zeros = vec![Vec3::zeros(); x.len()];
        Self {
            x: x.to_vec(),
            v: zeros.clone(),
            displacement: zeros,
            guard: Guard::default(),
            clock: 0.0,
            revision: 0,
            motions: 0,
        }
    }

    /// Discards what the last step left.
    pub(crate) fn forget_step(&mut self) {
        self.displacement.fill(Vec3::zeros());
        self.guard = Guard::default();
    }

    /// Memory of the vectors (bytes).
    pub(crate) fn bytes(&self) -> usize {
        let vectors = [&self.x, &self.v, &self.displacement];
        vectors.iter().map(|v| size_of_val(v.as_slice())).sum()
    }
}
