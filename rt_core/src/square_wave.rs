//! A force that changes its sign in known ticks, by which instruments measure how long a command takes to reach the hand: an
//! oscilloscope with a current probe on a motor, or an accelerometer on the handle.
//!
//! The force is added to the forces of bodies and tools before the last stage, so every limit of the device holds for it.

use crate::geometry::Vec3;

/// A force that changes its sign at each multiple of `half_period_ns`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquareWave {
    /// The force on the hand in the first half of the period (N, scene axes).
    pub force: Vec3,
    /// Time between two changes (ns). The force never changes if the time is zero.
    pub half_period_ns: u64,
}

impl SquareWave {
    /// The force in the tick of the nominal time `now_ns` (N, scene axes).
    pub fn at(&self, now_ns: u64) -> Vec3 {
        let halves = now_ns.checked_div(self.half_period_ns).unwrap_or(0);
        if halves & 1 == 0 {
            self.force
        } else {
            -self.force
        }
    }
}
