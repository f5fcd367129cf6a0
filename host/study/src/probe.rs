//! What the states of a device say about it: their rate, their jitter, and their resolution.

use devices::response::Response;
use rt_core::{DeviceError, DeviceState, Vec3};
use serde::Serialize;

/// The readings of a device, tick by tick.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    states: Vec<(u64, DeviceState)>,
    ticks: u64,
    missing: u64,
    errors: u64,
    last_error: Option<DeviceError>,
}

impl Seen {
    /// Room for the states of `ticks` ticks.
    pub fn new(ticks: usize) -> Self {
        Self {
            states: Vec::with_capacity(ticks),
            ..Self::default()
        }
    }

    /// Takes the reading of the tick at `now_ns`.
    pub fn take(&mut self, now_ns: u64, reading: &Result<DeviceState, DeviceError>) {
        self.ticks += 1;
        match reading {
            Ok(state) => self.states.push((now_ns, *state)),
            Err(DeviceError::NoReport) => self.missing += 1,
            Err(error) => {
                self.errors += 1;
                self.last_error = Some(*error);
            }
        }
    }
}

/// Times between successive states.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// Median (s).
    pub median: f64,
    /// 99th percentile (s).
    pub p99: f64,
    /// The longest (s).
    pub longest: f64,
}

/// The delay from a force to the motion, from short pulses of force.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Motion {
    /// Force of a pulse (N).
    pub force: f64,
    /// Pulses that moved the handle.
    pub pulses: usize,
    /// Time from the command of a pulse to the first state that shows a motion (s): the smallest, the median and the
    /// largest.
    pub first_motion: [f64; 3],
    /// The part of the median that is not the motion itself (s), by mass and friction of the profile.
    pub delay: f64,
    /// The delay is known up to this time either way (s).
    pub bound: f64,
}

impl From<Response> for Motion {
    fn from(found: Response) -> Self {
        let Response {
            first_motion,
            delay,
            bound,
            pulses,
            force,
        } = found;
        Self {
            force,
            pulses,
            first_motion,
            delay,
            bound,
        }
    }
}

/// What a device's states say about it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Probed {
    /// Version of this layout.
    pub schema: &'static str,
    /// The connection of the device.
    pub connect: String,
    /// Ticks of the measurement.
    pub ticks: u64,
    /// Ticks with a state.
    pub states: u64,
    /// Ticks without a state.
    pub missing: u64,
    /// Ticks with an error.
    pub errors: u64,
    /// The last error.
    pub last_error: Option<String>,
    /// States by time, from the first to the last (Hz); zero where there are fewer than two.
    pub rate: f64,
    /// Times between successive states, by the clock of the device.
    pub interval: Option<Interval>,
    /// The smallest displacement between two successive states (m); `None` where the device did not move.
    pub step: Option<f64>,
    /// Extent of the positions along x, y and z (m).
    pub span: Option<[f64; 3]>,
    /// The delay from a force to the motion; `None` without pulses.
    pub motion: Option<Motion>,
}

impl Probed {
    /// Summarizes the readings of the device with this connection.
    pub fn new(connect: &str, seen: &Seen) -> Self {
        let pairs = || seen.states.iter().zip(seen.states.iter().skip(1));
        let mut intervals: Vec<f64> = pairs()
            .map(|((_, a), (_, b))| b.device_time_ns.saturating_sub(a.device_time_ns))
            .map(|interval| interval as f64 * 1e-9)
            .collect();
        intervals.sort_by(f64::total_cmp);
        let at = |fraction: f64| {
            let last = intervals.len().saturating_sub(1);
            intervals[(fraction * last as f64).round() as usize]
        };
        let steps = pairs().map(|((_, a), (_, b))| (b.pose.position - a.pose.position).norm());
        let step = steps.filter(|step| *step > 0.0).min_by(f64::total_cmp);
        let positions = || seen.states.iter().map(|(_, state)| state.pose.position);
        let most = positions().reduce(|a, b| a.sup(&b));
        let least = positions().reduce(|a: Vec3, b| a.inf(&b));
        let rate = match (seen.states.first(), seen.states.last()) {
            (Some((first, _)), Some((last, _))) if last > first => {
                (seen.states.len() - 1) as f64 / ((last - first) as f64 * 1e-9)
            }
            _ => 0.0,
        };
        Self {
            schema: "palpate.probe/1",
            connect: connect.to_owned(),
            ticks: seen.ticks,
            states: seen.states.len() as u64,
            missing: seen.missing,
            errors: seen.errors,
            last_error: seen.last_error.map(|error| error.to_string()),
            rate,
            interval: (!intervals.is_empty()).then(|| Interval {
                median: at(0.5),
                p99: at(0.99),
                longest: at(1.0),
            }),
            step,
            span: most.zip(least).map(|(most, least)| (most - least).into()),
            motion: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::Pose;

    #[test]
    fn rate_interval_step_and_span_are_those_of_the_states() {
        let mut seen = Seen::new(4);
        for (tick, x) in [(0, 0.0), (1, 2e-5), (3, 1e-5), (4, 1e-5)] {
            seen.take(
                tick * 1_000_000,
                &Ok(DeviceState {
                    pose: Pose::at(Vec3::new(x, 0.0, 0.0)),
                    device_time_ns: tick * 1_000_000,
                    ..DeviceState::resting()
                }),
            );
        }
        seen.take(5_000_000, &Err(DeviceError::NoReport));
        seen.take(6_000_000, &Err(DeviceError::Disconnected(19)));
        let probed = Probed::new("x", &seen);
        assert_eq!((probed.ticks, probed.states), (6, 4));
        assert_eq!((probed.missing, probed.errors), (1, 1));
        assert!((probed.rate - 750.0).abs() < 1e-9);
        let interval = probed.interval.expect("there are intervals");
        assert!((interval.median - 1e-3).abs() < 1e-15 && (interval.longest - 2e-3).abs() < 1e-15);
        assert!((probed.step.expect("it moved") - 1e-5).abs() < 1e-15);
        assert_eq!(probed.span, Some([2e-5, 0.0, 0.0]));
        let none = Probed::new("x", &Seen::new(0));
        assert_eq!(
            (none.rate, none.interval, none.step, none.span),
            (0.0, None, None, None)
        );
    }
}
