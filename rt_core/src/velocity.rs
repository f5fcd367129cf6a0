//! Velocity from encoder positions, for drivers whose device reports none.
//!
//! One encoder count a tick is 10 to 55 mm/s on common devices, so the difference of two positions
//! cannot be used for damping. Every estimate pays for less noise with delay, and delay bounds the
//! damping that a device can render ([`most_damping`]). `palpate bench velocity` measures both for
//! all methods; drivers use the one that came out of it ([`VelocityEstimator::for_encoder`]).

mod adaptive;
mod kalman;

use crate::geometry::Vec3;
use adaptive::Window;
use kalman::Filter;

pub use adaptive::LONGEST;
pub use kalman::Gains;

/// Fraction of `mass / (period / 2 + late)` that [`most_damping`] allows.
const DAMPING_FRACTION: f64 = 0.25;

/// Damping (N s/m) that may be rendered on a device's moving mass (kg) with ticks of `period` and a
/// velocity that is `late` (s), its estimate's delay and the device's own together.
///
/// A held force is half a period late in the mean, so the loop is `B exp(-s t) / (m s)` with `t =
/// period / 2 + late`: its gain is one at `B / m`, where a phase of `B t / m` is lost beside the
/// integrator's quarter turn. It is stable for `B < (pi / 2) m / t`; sampled loops with the
/// estimates here at least up to 1.44 `m / t` (`rt_core/tests/velocity.rs`). A quarter of `m / t`
/// leaves 76 of 90 degrees, and more than a fivefold gain for what a wall's stiffness, encoder
/// counts and a mass that is not well known take.
pub fn most_damping(mass: f64, period: f64, late: f64) -> f64 {
    DAMPING_FRACTION * mass / (0.5 * period + late)
}

/// How velocity is estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// The backward difference through a first-order low-pass.
    LowPass {
        /// Cut-off frequency (Hz).
        cutoff: f64,
    },
    /// First-order adaptive windowing between the window's ends.
    EndFit {
        /// Most ticks of a window, at most [`LONGEST`].
        window: usize,
    },
    /// The same with a line of least squares.
    BestFit {
        /// Most ticks of a window, at most [`LONGEST`].
        window: usize,
    },
    /// A Kalman filter of constant velocity.
    ConstantVelocity {
        /// Standard deviation of the acceleration (m/s^2).
        acceleration: f64,
    },
    /// A Kalman filter of constant acceleration.
    ConstantAcceleration {
        /// Standard deviation of the jerk (m/s^3).
        jerk: f64,
    },
}

/// One axis.
#[derive(Clone, Copy, Debug)]
enum Axis {
    LowPass {
        gain: f64,
        last: Option<f64>,
        velocity: f64,
    },
    Adaptive(Window),
    Kalman(Filter),
}

/// An estimator of velocity, one axis triple.
#[derive(Clone, Copy, Debug)]
pub struct VelocityEstimator {
    axes: [Axis; 3],
    period: f64,
    delay: f64,
}

impl VelocityEstimator {
    /// Cut-off that keeps quantization noise low without a delay that a hand could feel (Hz).
    pub const DEFAULT_CUTOFF: f64 = 80.0;

    /// Longest window that drivers use (s).
    pub const SPAN: f64 = 4e-3;

    /// A low-pass for positions sampled every `period` (s), with a cut-off frequency in Hz.
    pub fn new(period: f64, cutoff: f64) -> Self {
        Self::with_method(Method::LowPass { cutoff }, period, 0.0)
    }

    /// What drivers use for an encoder with counts of `step` (m), read every `period` (s): a best
    /// fit over four milliseconds, as far as [`LONGEST`] ticks reach. By `palpate bench velocity`
    /// no other method as quick errs less.
    pub fn for_encoder(period: f64, step: f64) -> Self {
        let window = libm::round(Self::SPAN / period).clamp(1.0, LONGEST as f64) as usize;
        Self::with_method(Method::BestFit { window }, period, step)
    }

    /// For positions sampled every `period` (s) in counts of `step` (m).
    pub fn with_method(method: Method, period: f64, step: f64) -> Self {
        // Counts are off by up to half a step, evenly distributed.
        let index = |acceleration: f64| {
            acceleration * period * period / (step / libm::sqrt(12.0)).max(f64::MIN_POSITIVE)
        };
        let (axis, ticks) = match method {
            Method::LowPass { cutoff } => {
                // The exactly discretized filter.
                let gain = 1.0 - libm::exp(-2.0 * core::f64::consts::PI * cutoff * period);
                let axis = Axis::LowPass {
                    gain,
                    last: None,
                    velocity: 0.0,
                };
                (axis, 0.5 + (1.0 - gain) / gain)
            }
            Method::EndFit { window } => Self::adaptive(window, step, false),
            Method::BestFit { window } => Self::adaptive(window, step, true),
            Method::ConstantVelocity { acceleration } => {
                Self::kalman(Gains::constant_velocity(index(acceleration)))
            }
            Method::ConstantAcceleration { jerk } => {
                Self::kalman(Gains::constant_acceleration(index(jerk * period)))
            }
        };
        Self {
            axes: [axis; 3],
            period,
            delay: ticks * period,
        }
    }

    fn adaptive(window: usize, step: f64, best: bool) -> (Axis, f64) {
        let window = window.clamp(1, LONGEST);
        // Two points of the line are off by half a step each.
        let axis = Axis::Adaptive(Window::new(window, step, best));
        (axis, 0.5 * window as f64)
    }

    fn kalman(gains: Gains) -> (Axis, f64) {
        (Axis::Kalman(Filter::new(gains)), gains.lag())
    }

    /// The longest time (s) by which a velocity that grows steadily is behind.
    pub fn delay(&self) -> f64 {
        self.delay
    }

    /// Takes the next position (m); returns the velocity (m/s).
    pub fn update(&mut self, position: &Vec3) -> Vec3 {
        let mut velocity = Vec3::zeros();
        let each = self.axes.iter_mut().zip(position.iter());
        for ((axis, position), velocity) in each.zip(velocity.iter_mut()) {
            *velocity = match axis {
                Axis::LowPass {
                    gain,
                    last,
                    velocity,
                } => {
                    let raw = (position - last.unwrap_or(*position)) / self.period;
                    *last = Some(*position);
                    *velocity += (raw - *velocity) * *gain;
                    *velocity
                }
                Axis::Adaptive(window) => window.update(*position).0 / self.period,
                Axis::Kalman(filter) => filter.update(*position) / self.period,
            };
        }
        velocity
    }
}

#[cfg(test)]
mod tests;
