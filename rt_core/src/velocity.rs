//! Velocity from encoder positions, for drivers whose device reports none.
//!
//! One encoder count per tick is 10 to 55 mm/s on common devices, so the difference of two positions cannot be used for
//! damping. Every estimate pays with delay for less noise, and delay bounds the damping that a device can render
//! ([`most_damping`]). `palpate bench velocity` measures both for all methods. Drivers use the method that it
//! recommends ([`VelocityEstimator::for_encoder`]).

mod adaptive;
mod kalman;

use crate::geometry::Vec3;
use adaptive::Window;
use kalman::Filter;

pub use adaptive::LONGEST;
pub use kalman::Gains;

/// Fraction of `mass / (period / 2 + late)` that [`most_damping`] allows.
const DAMPING_FRACTION: f64 = 0.25;

/// Largest damping (N s/m) to render on a device with a moving mass (kg) and ticks of `period` (s). The velocity is
/// late by `late` (s): the delay of its estimate plus the delay of the device.
///
/// A held force is late by half a period in the mean, so the loop is `B exp(-s t) / (m s)` with
/// `t = period / 2 + late`. Its gain is one at the frequency `B / m`. There the delay adds a phase of `B t / m` to the
/// integrator's 90 degrees. The loop is stable for `B < (pi / 2) m / t`; sampled loops with the estimates of this
/// module are stable up to 1.44 `m / t` at least (`rt_core/tests/velocity.rs`). A quarter of `m / t` leaves a phase
/// margin of 76 degrees and a gain margin of more than five. A wall's stiffness, encoder counts and an uncertain mass
/// use up a part of these margins.
pub fn most_damping(mass: f64, period: f64, late: f64) -> f64 {
    DAMPING_FRACTION * mass / (0.5 * period + late)
}

/// The method that estimates the velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// The backward difference, passed through a first-order low-pass.
    LowPass {
        /// Cut-off frequency (Hz).
        cutoff: f64,
    },
    /// First-order adaptive windowing, with the line between the ends of the window.
    EndFit {
        /// Largest number of ticks in a window, at most [`LONGEST`].
        window: usize,
    },
    /// First-order adaptive windowing, with the line of least squares.
    BestFit {
        /// Largest number of ticks in a window, at most [`LONGEST`].
        window: usize,
    },
    /// A Kalman filter that assumes constant velocity.
    ConstantVelocity {
        /// Standard deviation of the acceleration (m/s^2).
        acceleration: f64,
    },
    /// A Kalman filter that assumes constant acceleration.
    ConstantAcceleration {
        /// Standard deviation of the jerk (m/s^3).
        jerk: f64,
    },
}

/// The estimator of one axis.
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

/// An estimator of velocity for three axes.
///
/// ```
/// use rt_core::Vec3;
/// use rt_core::velocity::VelocityEstimator;
///
/// // An encoder with counts of 30 um, read every millisecond, on a device that moves at 0.1 m/s.
/// let (period, count) = (1e-3, 30e-6);
/// let mut estimator = VelocityEstimator::for_encoder(period, count);
/// let mut velocity = Vec3::zeros();
/// for tick in 0..100 {
///     let x = 0.1 * period * f64::from(tick);
///     velocity = estimator.update(&Vec3::new((x / count).round() * count, 0.0, 0.0));
/// }
/// // The difference of two positions would err by up to 30 mm/s.
/// assert!((velocity.x - 0.1).abs() < 0.01);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct VelocityEstimator {
    axes: [Axis; 3],
    period: f64,
    delay: f64,
}

impl VelocityEstimator {
    /// Cut-off frequency (Hz) that keeps quantization noise low without a delay that a hand could feel.
    pub const DEFAULT_CUTOFF: f64 = 80.0;

    /// Longest window that drivers use (s).
    pub const SPAN: f64 = 4e-3;

    /// A low-pass for positions sampled every `period` (s), with a cut-off frequency in Hz.
    pub fn new(period: f64, cutoff: f64) -> Self {
        Self::with_method(Method::LowPass { cutoff }, period, 0.0)
    }

    /// The estimator for an encoder with counts of `step` (m), read every `period` (s): a best fit over four
    /// milliseconds, or over [`LONGEST`] ticks if these are shorter. According to `palpate bench velocity`, no other
    /// method of the same delay has a smaller error.
    pub fn for_encoder(period: f64, step: f64) -> Self {
        let window = libm::round(Self::SPAN / period).clamp(1.0, LONGEST as f64) as usize;
        Self::with_method(Method::BestFit { window }, period, step)
    }

    /// An estimator by `method` for positions sampled every `period` (s) in counts of `step` (m).
    pub fn with_method(method: Method, period: f64, step: f64) -> Self {
        // Counts err by up to half a step, uniformly distributed.
        let index = |acceleration: f64| {
            acceleration * period * period / (step / libm::sqrt(12.0)).max(f64::MIN_POSITIVE)
        };
        let (axis, ticks) = match method {
            Method::LowPass { cutoff } => {
                // The exact discretization of the filter.
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
        // Each of two points of the line errs by up to half a step.
        let axis = Axis::Adaptive(Window::new(window, step, best));
        (axis, 0.5 * window as f64)
    }

    fn kalman(gains: Gains) -> (Axis, f64) {
        (Axis::Kalman(Filter::new(gains)), gains.lag())
    }

    /// The longest time (s) by which the estimate lags a velocity that grows steadily.
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
