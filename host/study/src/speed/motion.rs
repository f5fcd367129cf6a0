//! How the hand moves: displacements of a handle over time.

use physics::Vec3;

/// A displacement over time, of so many steps of one length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// Length of a step (s).
    pub(super) step: f64,
    /// Number of steps.
    pub(super) steps: usize,
    /// The first so many are timed: those in which the hand moves.
    pub(super) timed: usize,
    /// Where the handle is, from where it was.
    pub(super) path: Path,
}

/// The shape of a motion.
#[derive(Clone, Copy, Debug)]
pub(super) enum Path {
    /// Straight to `to` (m) within `duration` (s), and held there.
    Ramp {
        /// Displacement at the end.
        to: Vec3,
        /// When it is reached.
        duration: f64,
    },
    /// The same with a tremor of `amplitude` (m) at `frequency` (Hz) on top, from the start.
    Tremor {
        /// Displacement at the end of the ramp.
        to: Vec3,
        /// When it is reached (s).
        duration: f64,
        /// Of the tremor, along all axes.
        amplitude: Vec3,
        /// Of the tremor.
        frequency: f64,
    },
    /// To `to` (m) and back, again and again, from rest: half of one less a cosine.
    Swing {
        /// The far end.
        to: Vec3,
        /// How often (Hz).
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

    /// Its first `steps` only.
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
