//! The error of velocity estimates from encoder counts, and the damping that is stable with each estimate.
//!
//! Known motions are counted by the encoder of each simulated device, at 1 and 4 kHz, eight times with the counts
//! shifted by fractions of a count. Every method of [`rt_core::velocity`] estimates the velocity from the counts. An
//! error has two parts: the lag of the estimate (`-lag a` with the true acceleration `a`, by least squares), and noise,
//! which is the remainder. A damper renders both.
//!
//! Damping is tried on the bare device: a free mass at 0.1 m/s that only the damper slows. The mass never comes to rest
//! completely, because one count changes its speed by `B count / m`. Too much damping makes the mass tremble over
//! several counts. Damping counts as stable if the remaining speed is below a hundredth of a metre a second.

mod motion;
mod tables;

pub use motion::Motion;

use rt_core::Vec3;
use rt_core::velocity::{LONGEST, Method, VelocityEstimator};
use serde::Serialize;
use sim::DeviceModel;

/// The rates of the tick (Hz).
pub const RATES: [f64; 2] = [1000.0, 4000.0];
/// Damping for which the chatter is reported (N s/m).
pub const DAMPING: f64 = 20.0;
/// Time in which the filters settle, before the measurement (s).
const SETTLE: f64 = 0.05;
/// Number of shifts of the counts.
const SHIFTS: u32 = 8;
/// Initial speed, and the largest remaining speed of a stable damper (m/s).
const SPEED: f64 = 0.1;
const LEFT: f64 = 0.01;
/// Largest tried damping as a multiple of `m / T`, and the ratio of successive dampings.
const MOST: f64 = 4.0;
const NEXT: f64 = 1.05;

/// A method with a name. Its window is a time, not a number of ticks.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// The name in tables.
    pub name: &'static str,
    /// The method for a tick of the period (s).
    pub at: fn(f64) -> Method,
}

/// The methods. The first is the plain filter, the second is the method of the drivers.
pub const CANDIDATES: [Candidate; 11] = [
    Candidate {
        name: "low-pass, 80 Hz",
        at: |_| Method::LowPass { cutoff: 80.0 },
    },
    Candidate {
        name: "best fit, 4 ms",
        at: |period| Method::BestFit {
            window: ticks(VelocityEstimator::SPAN, period),
        },
    },
    Candidate {
        name: "end fit, 4 ms",
        at: |period| Method::EndFit {
            window: ticks(VelocityEstimator::SPAN, period),
        },
    },
    Candidate {
        name: "best fit, 2 ms",
        at: |period| Method::BestFit {
            window: ticks(2e-3, period),
        },
    },
    Candidate {
        name: "best fit, 16 ticks",
        at: |_| Method::BestFit { window: LONGEST },
    },
    Candidate {
        name: "end fit, 16 ticks",
        at: |_| Method::EndFit { window: LONGEST },
    },
    Candidate {
        name: "low-pass, 160 Hz",
        at: |_| Method::LowPass { cutoff: 160.0 },
    },
    Candidate {
        name: "constant velocity, 5 m/s^2",
        at: |_| Method::ConstantVelocity { acceleration: 5.0 },
    },
    Candidate {
        name: "constant velocity, 10 m/s^2",
        at: |_| Method::ConstantVelocity { acceleration: 10.0 },
    },
    Candidate {
        name: "constant acceleration, 1,000 m/s^3",
        at: |_| Method::ConstantAcceleration { jerk: 1000.0 },
    },
    Candidate {
        name: "constant acceleration, 5,000 m/s^3",
        at: |_| Method::ConstantAcceleration { jerk: 5000.0 },
    },
];

/// Number of ticks of `period` in `span` (s), at least one.
fn ticks(span: f64, period: f64) -> usize {
    (span / period).round().max(1.0) as usize
}

/// The error of an estimate in one motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Error {
    /// The motion of the handle.
    pub motion: Motion,
    /// Root mean square error (m/s).
    pub rms: f64,
    /// Lag (s).
    pub lag: f64,
    /// Root mean square of the remainder (m/s).
    pub noise: f64,
}

/// A method on a device at a rate.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The device.
    pub device: &'static str,
    /// Ticks a second (Hz).
    pub rate: f64,
    /// The method.
    pub method: &'static str,
    /// Largest lag for a velocity that grows steadily (s).
    pub delay: f64,
    /// The errors by motion.
    pub errors: Vec<Error>,
    /// Noise of the force of a damper [`DAMPING`] in a slow press (N, RMS).
    pub chatter: f64,
    /// Largest stable damping of the bare device (N s/m).
    pub stable: f64,
}

/// A method over all devices and rates: geometric means, and the largest lag.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mean {
    /// The method.
    pub method: &'static str,
    /// The largest lag (s).
    pub delay: f64,
    /// Root mean square error (m/s), by motion in the order of [`Motion::ALL`].
    pub rms: Vec<f64>,
    /// The same over all motions (m/s).
    pub all: f64,
    /// Chatter (N).
    pub chatter: f64,
    /// Stable damping (N s/m).
    pub stable: f64,
}

/// The results of the study.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VelocityStudy {
    /// `palpate.velocity/1`.
    pub schema: &'static str,
    /// Means by method, in the order of [`CANDIDATES`].
    pub means: Vec<Mean>,
    /// Rows by device, rate and method.
    pub rows: Vec<Row>,
}

/// Runs the study. `progress` receives the fraction done.
pub fn run(progress: &mut dyn FnMut(f64)) -> VelocityStudy {
    let mut rows = Vec::new();
    let models: Vec<_> = DeviceModel::spatial().collect();
    let all = models.len() * RATES.len() * CANDIDATES.len();
    for (device, model) in models {
        for rate in RATES {
            for candidate in CANDIDATES {
                rows.push(row(device, &model, rate, candidate));
                progress(rows.len() as f64 / all as f64);
            }
        }
    }
    VelocityStudy {
        schema: "palpate.velocity/1",
        means: CANDIDATES.map(|c| mean(c.name, &rows)).to_vec(),
        rows,
    }
}

fn row(device: &'static str, model: &DeviceModel, rate: f64, candidate: Candidate) -> Row {
    let period = 1.0 / rate;
    let step = model.position_step;
    let estimator = VelocityEstimator::with_method((candidate.at)(period), period, step);
    let errors: Vec<_> = Motion::ALL
        .iter()
        .map(|motion| error(&estimator, *motion, step, period))
        .collect();
    let pressed = errors.iter().find(|e| e.motion == Motion::Press);
    Row {
        device,
        rate,
        method: candidate.name,
        delay: estimator.delay(),
        chatter: DAMPING * pressed.map_or(0.0, |e| e.noise),
        stable: stable(&estimator, model, period),
        errors,
    }
}

/// The counted position of `x` (m).
fn counted(x: f64, step: f64) -> Vec3 {
    Vec3::new((x / step).round() * step, 0.0, 0.0)
}

fn error(estimator: &VelocityEstimator, motion: Motion, step: f64, period: f64) -> Error {
    let (mut squares, mut products, mut accelerations, mut samples) = (0.0, 0.0, 0.0, 0.0);
    for shift in 0..SHIFTS {
        // The golden ratio spreads the shifts evenly. A hold must stay at its place.
        let fraction = (f64::from(shift) * 0.618_034).fract();
        let shift = if motion == Motion::Hold {
            0.0
        } else {
            fraction * step
        };
        let mut estimator = *estimator;
        for tick in 0..ticks(motion.duration(), period) {
            let t = tick as f64 * period;
            let (x, v) = motion.at(t, step);
            let found = estimator.update(&counted(x + shift, step)).x;
            if t < SETTLE {
                continue;
            }
            let off = found - v;
            // Differences of the true velocity, which is free of noise, and smooth over microseconds except at corners.
            let a = (motion.at(t + 1e-6, step).1 - motion.at(t - 1e-6, step).1) / 2e-6;
            squares += off * off;
            products += off * a;
            accelerations += a * a;
            samples += 1.0;
        }
    }
    let lag = -products / accelerations;
    Error {
        motion,
        rms: (squares / samples).sqrt(),
        lag,
        noise: ((squares + lag * products) / samples).max(0.0).sqrt(),
    }
}

/// The largest damping (N s/m) below which every damping stops the bare device.
fn stable(estimator: &VelocityEstimator, model: &DeviceModel, period: f64) -> f64 {
    let unit = model.mass / period;
    let mut multiple = 0.01;
    while multiple < MOST && rests(estimator, model, period, multiple * unit) {
        multiple *= NEXT;
    }
    multiple / NEXT * unit
}

fn rests(estimator: &VelocityEstimator, model: &DeviceModel, period: f64, damping: f64) -> bool {
    let mut estimator = *estimator;
    let step = model.position_step;
    let (mut x, mut v) = (0.3 * step, SPEED);
    let all = ticks(4.0, period);
    let mut left = 0.0_f64;
    for tick in 0..all {
        let force = -damping * estimator.update(&counted(x, step)).x;
        // The force is constant over the tick, so the motion is exact.
        let gain = force / model.mass * period;
        x += (v + 0.5 * gain) * period;
        v += gain;
        if v.is_nan() || v.abs() > 10.0 {
            return false;
        }
        if tick > all * 3 / 4 {
            left = left.max(v.abs());
        }
    }
    left < LEFT
}

fn mean(method: &'static str, rows: &[Row]) -> Mean {
    let of_method = || rows.iter().filter(|row| row.method == method);
    let geometric = |of: &dyn Fn(&Row) -> f64| {
        let logs: f64 = of_method().map(|row| of(row).ln()).sum();
        (logs / of_method().count() as f64).exp()
    };
    let rms: Vec<_> = (0..Motion::ALL.len())
        .map(|k| geometric(&|row| row.errors[k].rms))
        .collect();
    let logs: f64 = rms.iter().map(|e| e.ln()).sum();
    Mean {
        method,
        delay: of_method().fold(0.0, |most, row| row.delay.max(most)),
        all: (logs / rms.len() as f64).exp(),
        rms,
        chatter: geometric(&|row| row.chatter),
        stable: geometric(&|row| row.stable),
    }
}
