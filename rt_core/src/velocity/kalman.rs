//! Kalman filters of position in their steady state: constant velocity and constant acceleration.
//!
//! The constant-velocity filter takes the acceleration to be white noise. The constant-acceleration filter takes the
//! change of the acceleration in a tick to be white noise. Both take encoder counts to be white noise of
//! `step / sqrt(12)`. The gains then depend on one number, the tracking index (P. R. Kalata, "The tracking index: a
//! generalized parameter for alpha-beta and alpha-beta-gamma target trackers", 1984). The gains settle, so that a tick
//! takes a few operations:
//!
//! ```text
//! x+ = x + v T + a T^2 / 2, v+ = v + a T        predicted
//! e  = y - x+
//! x  = x+ + alpha e, v = v+ + beta e / T, a = a + gamma e / T^2
//! ```

use nalgebra::{Matrix3, Vector3};

/// Number of iterations after which the gains have settled, even for a tracking index of 1e-6.
const SETTLED: usize = 20_000;

/// The gains of a filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Gain of the position.
    pub alpha: f64,
    /// Gain of the velocity, times the period.
    pub beta: f64,
    /// Gain of the acceleration, times the period squared; zero if the acceleration is not estimated.
    pub gamma: f64,
}

impl Gains {
    /// The gains for constant velocity, with a tracking index `sigma_a T^2 / sigma_y` above zero (Kalata's closed
    /// form).
    pub fn constant_velocity(index: f64) -> Self {
        let r = (4.0 + index - libm::sqrt(index * (8.0 + index))) / 4.0;
        let alpha = 1.0 - r * r;
        Self {
            alpha,
            beta: 2.0 * (2.0 - alpha) - 4.0 * r,
            gamma: 0.0,
        }
    }

    /// The gains for constant acceleration. In the tracking index, `sigma_a` is here the change of the acceleration in
    /// a tick. The Riccati equation is iterated to its steady state.
    pub fn constant_acceleration(index: f64) -> Self {
        let motion = Matrix3::new(1.0, 1.0, 0.5, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0);
        let noise = Vector3::new(0.5, 1.0, 1.0) * index;
        let noise = noise * noise.transpose();
        let mut variance = Matrix3::identity();
        let mut gain = Vector3::zeros();
        for _ in 0..SETTLED {
            let predicted = motion * variance * motion.transpose() + noise;
            let column = Vector3::new(predicted.m11, predicted.m21, predicted.m31);
            gain = column / (predicted.m11 + 1.0);
            variance = predicted - gain * column.transpose();
        }
        Self {
            alpha: gain.x,
            beta: gain.y,
            gamma: gain.z,
        }
    }

    /// The lag (ticks) of a velocity that grows steadily.
    ///
    /// A steady acceleration leaves a steady error `e` of the prediction. If the acceleration is not estimated,
    /// `beta e = a T^2` makes the velocity grow, and the position then requires `v T + a T^2 / 2 = v_e T + alpha e`,
    /// with `v_e` the estimated velocity. If the acceleration is estimated, `e` is zero.
    pub fn lag(&self) -> f64 {
        if self.gamma > 0.0 {
            0.0
        } else {
            self.alpha / self.beta - 0.5
        }
    }
}

/// The filter of one axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filter {
    gains: Gains,
    /// Position (m), velocity (m per tick) and acceleration (m per tick squared); `None` before the first position.
    state: Option<[f64; 3]>,
}

impl Filter {
    pub(super) fn new(gains: Gains) -> Self {
        Self { gains, state: None }
    }

    /// Takes the next position (m). Returns the velocity (m per tick).
    pub(super) fn update(&mut self, position: f64) -> f64 {
        let Gains { alpha, beta, gamma } = self.gains;
        let [x, v, a] = self.state.unwrap_or([position, 0.0, 0.0]);
        let ahead = x + v + 0.5 * a;
        let off = position - ahead;
        let velocity = v + a + beta * off;
        self.state = Some([ahead + alpha * off, velocity, a + gamma * off]);
        velocity
    }
}
