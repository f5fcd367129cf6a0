//! A damper on an estimated velocity. The damping that [`most_damping`] allows stops a bare device. The tests also show
//! by which factor a larger damping still does.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use rt_core::Vec3;
use rt_core::velocity::{Method, VelocityEstimator, most_damping};
use std::collections::VecDeque;

const MASS: f64 = 0.1;

/// A mass that only a sampled damper slows.
struct Loop {
    estimator: VelocityEstimator,
    period: f64,
    mass: f64,
    damping: f64,
    /// Encoder count (m); zero if positions are exact.
    count: f64,
    /// Forces that the device has yet to render.
    coming: VecDeque<f64>,
    x: f64,
    v: f64,
}

impl Loop {
    /// `delay` is the number of ticks from command to force.
    fn new(estimator: &VelocityEstimator, period: f64, mass: f64, delay: usize) -> Self {
        Self {
            estimator: *estimator,
            period,
            mass,
            damping: 0.0,
            count: 0.0,
            coming: vec![0.0; delay].into(),
            x: 0.0,
            v: 0.0,
        }
    }

    /// The largest speed (m/s) in the last of four seconds, after a start at speed `start` (m/s).
    fn left(mut self, damping: f64, start: f64) -> f64 {
        (self.damping, self.v) = (damping, start);
        let ticks = (4.0 / self.period) as usize;
        let mut most = 0.0_f64;
        for tick in 0..ticks {
            let seen = if self.count > 0.0 {
                (self.x / self.count).round() * self.count
            } else {
                self.x
            };
            let found = self.estimator.update(&Vec3::new(seen, 0.0, 0.0)).x;
            self.coming.push_back(-self.damping * found);
            let force = self.coming.pop_front().unwrap_or_default();
            // The force is held over the tick: the motion is exact.
            let gain = force / self.mass * self.period;
            self.x += (self.v + 0.5 * gain) * self.period;
            self.v += gain;
            if self.v.is_nan() || self.v.abs() > 1e3 {
                return f64::INFINITY;
            }
            if tick > ticks * 3 / 4 {
                most = most.max(self.v.abs());
            }
        }
        most
    }
}

/// Whether a damping of `times` the mass over all delays stops the device, with exact positions.
fn stops(method: Method, period: f64, delay: usize, times: f64) -> bool {
    // A count so large that every window is full, as adaptive windows are if the motion is small.
    let step = match method {
        Method::EndFit { .. } | Method::BestFit { .. } => 1e3,
        _ => 30e-6,
    };
    let estimator = VelocityEstimator::with_method(method, period, step);
    let late = estimator.delay() + delay as f64 * period;
    let damping = times * 4.0 * most_damping(MASS, period, late);
    Loop::new(&estimator, period, MASS, delay).left(damping, 1e-3) < 1e-6
}

#[test]
fn a_damper_is_stable_up_to_nearly_six_times_the_allowed_damping() {
    let mut methods = vec![Method::LowPass { cutoff: 80.0 }];
    for window in [1, 2, 4, 8, 16] {
        methods.push(Method::EndFit { window });
        methods.push(Method::BestFit { window });
    }
    for acceleration in [2.0, 5.0, 20.0] {
        methods.push(Method::ConstantVelocity { acceleration });
    }
    for method in methods {
        for period in [1e-3, 2.5e-4] {
            for delay in [0, 1, 3] {
                // 1.44 m / t is 5.8 times the allowed damping; a pure delay is stable up to pi / 2.
                assert!(stops(method, period, delay, 1.44), "{method:?} {delay}");
                // If its gain is small, a first-order filter turns the phase less than a delay.
                if !matches!(method, Method::LowPass { .. }) {
                    assert!(!stops(method, period, delay, 2.4), "{method:?} {delay}");
                }
            }
        }
    }
}

/// The speed of a bare device that counts leave under `times` the allowed damping, relative to the speed that a single
/// count gives it. The estimates for a lone count add up to that count, so the damper's impulse is `B count`.
fn left_by_counts(count: f64, mass: f64, period: f64, times: f64) -> f64 {
    let estimator = VelocityEstimator::for_encoder(period, count);
    let damping = times * most_damping(mass, period, estimator.delay());
    let mut device = Loop::new(&estimator, period, mass, 0);
    device.count = count;
    device.x = 0.3 * count;
    device.left(damping, 0.1) / (damping * count / mass)
}

#[test]
fn counts_leave_less_speed_than_a_single_count_gives_up_to_four_times_the_allowed_damping() {
    // Encoder counts (m) and moving masses (kg) of common devices, without the friction that would stop them
    // altogether.
    for (count, mass) in [(38e-6, 0.15), (55e-6, 0.045), (30e-6, 0.075), (10e-6, 0.2)] {
        for period in [1e-3, 2.5e-4] {
            for times in [0.5, 1.0, 2.0, 3.0, 4.0] {
                let left = left_by_counts(count, mass, period, times);
                assert!(left < 1.0, "{count} {period} {times}: {left}");
            }
            // A damping far beyond the stable one, at which windows are short as well: a limit cycle over many counts.
            let left = left_by_counts(count, mass, period, 40.0);
            assert!(left > 1.0, "{count} {period}: {left}");
        }
    }
}
