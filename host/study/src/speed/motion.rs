//! The motions of the hand: displacements of a handle over time.

use physics::Vec3;

/// A displacement over time, in steps of one length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// Length of a step (s).
    pub(super) step: f64,
    /// Number of steps.
    pub(super) steps: usize,
    /// Number of timed steps, from the first: those in which the hand moves.
    pub(super) timed: usize,
    /// Displacement of the handle over time.
    pub(super) path: Path,
}

/// The shape of a motion.
#[derive(Clone, Copy, Debug)]
pub(super) enum Path {
    /// Straight to `to` (m) within `duration` (s), then constant.
    Ramp {
        /// Displacement at the end.
        to: Vec3,
        /// Duration of the ramp (s).
        duration: f64,
    },
    /// The same with a tremor of `amplitude` (m) at `frequency` (Hz), from the start.
    Tremor {
        /// Displacement at the end of the ramp.
        to: Vec3,
        /// Duration of the ramp (s).
        duration: f64,
        /// Amplitude of the tremor along each axis (m).
        amplitude: Vec3,
        /// Frequency of the tremor (Hz).
        frequency: f64,
    },
    /// To `to` (m) and back, repeatedly, from rest: `(1 - cos) / 2`.
    Swing {
        /// The far end (m).
        to: Vec3,
        /// Frequency (Hz).
        frequency: f64,
    },
}

impl Motion {
    /// A straight motion to `to` (m) within `duration` (s), held for `hold` (s) more.
    pub(super) fn ramp(to: Vec3, duration: f64, hold: f64, step: f64) -> Self {
        Self {
            step,
            steps: libm::round((duration + hold) / step) as usize,
            timed: libm::round(duration / step) as usize,
            path: Path::Ramp { to, duration },
        }
    }

    /// The first `steps` steps of the motion.
    pub(super) fn first(self, steps: usize) -> Self {
        Self {
            steps,
            timed: self.timed.min(steps),
            ..self
        }
    }

    /// Displacement (m) at the end of step number `step`, counted from 0.
    pub(super) fn after(&self, step: usize) -> Vec3 {
        self.at(self.step * (step + 1) as f64)
    }

    /// Displacement (m) at a time (s).
    fn at(&self, time: f64) -> Vec3 {
        match self.path {
            Path::Ramp { to, duration } => to * (time / duration).min(1.0),
            Path::Tremor {
                to,
                duration,
                amplitude,
                frequency,
            } => {
                let phase = 2.0 * core::f64::consts::PI * frequency * time;
                to * (time / duration).min(1.0) + amplitude * libm::sin(phase)
            }
            Path::Swing { to, frequency } => {
                let phase = 2.0 * core::f64::consts::PI * frequency * time;
                to * (0.5 - 0.5 * libm::cos(phase))
            }
        }
    }
}
