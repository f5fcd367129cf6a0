//! Kalman filters of position, in their steady state: constant velocity and constant acceleration.
//!
//! The motion is taken to be one of constant velocity (acceleration) whose acceleration (change of
//! acceleration a tick) is white noise, and encoder counts to be white noise of `step / sqrt(12)`.
//! Then the gains depend on one number only, the tracking index of P. R. Kalata, "The tracking
//! index: a generalized parameter for alpha-beta and alpha-beta-gamma target trackers" (1984), and
//! settle, so that a tick takes a few operations:
//!
//! ```text
//! x+ = x + v T + a T^2 / 2, v+ = v + a T        predicted
//! e  = y - x+
//! x  = x+ + alpha e, v = v+ + beta e / T, a = a + gamma e / T^2
//! ```

use nalgebra::{Matrix3, Vector3};

/// Iterations after which gains have settled: of a tracking index of a millionth, too.
const SETTLED: usize = 20_000;

/// The gains of a filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Of the position.
    pub alpha: f64,
    /// Of the velocity, over the period.
    pub beta: f64,
    /// Of the acceleration, over the period squared; zero where it is not estimated.
    pub gamma: f64,
}

impl Gains {
    /// Constant velocity, with a tracking index `sigma_a T^2 / sigma_y` above zero (Kalata's closed
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

    /// Constant acceleration, with a tracking index as above, `sigma_a` being how much the
    /// acceleration changes a tick. The Riccati equation is iterated until it stands.
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

    /// By how many ticks the velocity lags where it grows steadily.
    ///
    /// A steady acceleration leaves a steady error `e` of the prediction. Where acceleration is not
    /// estimated, `beta e = a T^2` keeps the velocity growing, and what the position then needs is
    /// `v T + a T^2 / 2 = v_e T + alpha e`. Where it is, `e` is zero.
    pub fn lag(&self) -> f64 {
        if self.gamma > 0.0 {
            0.0
        } else {
            self.alpha / self.beta - 0.5
        }
    }
}

/// One axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filter {
    gains: Gains,
    /// Position (m), velocity a tick, acceleration a tick and tick; none before the first position.
    state: Option<[f64; 3]>,
}

impl Filter {
    pub(super) fn new(gains: Gains) -> Self {
        Self { gains, state: None }
    }

    /// Takes the next position (m); returns the velocity a tick (m).
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
