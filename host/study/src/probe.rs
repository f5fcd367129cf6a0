//! The properties of a device that its states show: rate, jitter, and resolution.

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
    /// Errors after the first state. An operator may have to calibrate the device before.
    lost: u64,
    /// Ticks since the last state, and the most between two states.
    silent: u64,
    longest_silence: u64,
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
        self.silent += 1;
        match reading {
            Ok(state) => {
                if !self.states.is_empty() {
                    self.longest_silence = self.longest_silence.max(self.silent - 1);
                }
                self.silent = 0;
                self.states.push((now_ns, *state));
            }
            Err(DeviceError::NoReport) => self.missing += 1,
            Err(error) => {
                self.errors += 1;
                self.lost += u64::from(!self.states.is_empty());
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

/// A part of its profile's rate below which a device is too slow. Clocks of devices differ by less.
const SLOW: f64 = 0.9;

/// The facts about a device that its states do not show.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Known {
    /// Name of the device in its profile.
    pub profile: String,
    /// The name that the device states; `None` if it states none.
    pub name: Option<String>,
    /// The version of its firmware; `None` if the device states none.
    pub firmware: Option<String>,
    /// The largest force that holds (N).
    pub max_force: f64,
    /// The largest moment that holds (N m); zero if the device actuates no rotation.
    pub max_moment: f64,
    /// Radius of the largest ball inside the workspace (m).
    pub workspace_radius: f64,
    /// Displacement of one encoder count by the profile (m).
    pub position_step: f64,
    /// Rate of states by the profile (Hz).
    pub profile_rate: f64,
    /// Number of ticks in a row for which a run lets the device stay silent before its force is removed.
    pub patience: u64,
}

/// The properties of a device that its states show.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Probed {
    /// Version of this layout.
    pub schema: &'static str,
    /// The connection of the device.
    pub connect: String,
    /// The facts about the device that its states do not show.
    pub device: Known,
    /// Ticks a second in which the device was asked (Hz).
    pub tick_rate: f64,
    /// Ticks of the measurement.
    pub ticks: u64,
    /// Ticks with a state.
    pub states: u64,
    /// Ticks without a state.
    pub missing: u64,
    /// Ticks with an error.
    pub errors: u64,
    /// Ticks with an error after the first state.
    pub lost: u64,
    /// Most ticks in a row without a state, between two states.
    pub longest_silence: u64,
    /// The last error.
    pub last_error: Option<String>,
    /// Ticks with a state by time, from the first to the last (Hz); zero if there are fewer than two. Of a device that is
    /// faster than the ticks, a tick reads the newest state only.
    pub rate: f64,
    /// Times between successive states, by the clock of the device.
    pub interval: Option<Interval>,
    /// The smallest displacement between two successive states (m); `None` if the device did not move.
    pub step: Option<f64>,
    /// Extent of the positions along x, y and z (m).
    pub span: Option<[f64; 3]>,
    /// The delay from a force to the motion; `None` without pulses.
    pub motion: Option<Motion>,
}

impl Probed {
    /// Summarizes the readings of the device with this connection, which was asked `tick_rate` times a second (Hz).
    pub fn new(connect: &str, device: Known, tick_rate: f64, seen: &Seen) -> Self {
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
            schema: "palpate.probe/2",
            connect: connect.to_owned(),
            device,
            tick_rate,
            ticks: seen.ticks,
            states: seen.states.len() as u64,
            missing: seen.missing,
            errors: seen.errors,
            lost: seen.lost,
            longest_silence: seen.longest_silence,
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

    /// The summary for a person.
    pub fn words(&self) -> String {
        let mut text = format!("{}: {} ticks without force\n", self.connect, self.ticks);
        let mut line = |title: &str, words: String| put!(text, "  {title:<10} {words}");
        let device = &self.device;
        let stated = device.name.as_deref().map_or_else(
            || "states no name".to_owned(),
            |name| format!("calls itself {name:?}"),
        );
        let firmware = device.firmware.as_deref().unwrap_or("not stated");
        line(
            "device",
            format!("{stated}, firmware {firmware}; profile {}", device.profile),
        );
        let moment = match device.max_moment {
            0.0 => String::new(),
            moment => format!(" and {moment:.3} N m"),
        };
        line(
            "limits",
            format!(
                "{:.2} N{moment}; workspace of {:.0} mm about the middle",
                device.max_force,
                1e3 * device.workspace_radius
            ),
        );
        line(
            "states",
            format!(
                "read {:.1} times a second, at {:.0} ticks a second (the profile: {:.0} states a second)",
                self.rate, self.tick_rate, device.profile_rate
            ),
        );
        line(
            "ticks",
            format!(
                "{} with a state, {} without, {} with an error; at most {} in a row without a state",
                self.states, self.missing, self.errors, self.longest_silence
            ),
        );
        if let Some(error) = &self.last_error {
            line("error", error.clone());
        }
        if let Some(interval) = self.interval {
            line(
                "interval",
                format!(
                    "median {:.3} ms, 99 % {:.3}, longest {:.3} (clock of the device)",
                    1e3 * interval.median,
                    1e3 * interval.p99,
                    1e3 * interval.longest
                ),
            );
        }
        if let Some(step) = self.step {
            line(
                "step",
                format!(
                    "{:.4} mm, the smallest displacement between two states",
                    1e3 * step
                ),
            );
        }
        if let Some(span) = self.span {
            let [x, y, z] = span.map(|length| 1e3 * length);
            line("moved", format!("{x:.2} x {y:.2} x {z:.2} mm"));
        }
        if let Some(motion) = &self.motion {
            let [least, median, most] = motion.first_motion.map(|time| 1e3 * time);
            line(
                "motion",
                format!(
                    "first seen {median:.1} ms after a force of {:.2} N ({least:.1} to {most:.1}, {} pulses)",
                    motion.force, motion.pulses
                ),
            );
            line(
                "delay",
                format!(
                    "{:.1} ms, up to {:.1} ms either way (without the motion itself, by the mass of the profile)",
                    1e3 * motion.delay,
                    1e3 * motion.bound
                ),
            );
        }
        line("verdict", self.verdict());
        text
    }

    /// The reasons why the device cannot be used in a run, in words; empty if there are none.
    pub fn problems(&self) -> Vec<String> {
        let mut problems = Vec::new();
        if self.states == 0 {
            problems.push("it gave no state".to_owned());
            return problems;
        }
        // Of a faster device, a tick sees the newest state only.
        let expected = self.device.profile_rate.min(self.tick_rate);
        if self.rate < SLOW * expected {
            problems.push(format!(
                "a state in {:.0} ticks a second, where its profile lets expect {expected:.0}",
                self.rate
            ));
        }
        if self.lost > 0 {
            problems.push(format!(
                "errors in {} ticks after the first state",
                self.lost
            ));
        }
        if self.longest_silence > self.device.patience {
            problems.push(format!(
                "{} ticks in a row without a state, where a run takes the force away after {}",
                self.longest_silence, self.device.patience
            ));
        }
        problems
    }

    /// The verdict, in one line.
    pub fn verdict(&self) -> String {
        let problems = self.problems();
        if problems.is_empty() {
            format!(
                "ready: a state in {:.0} ticks a second, without errors",
                self.rate
            )
        } else {
            format!("NOT ready: {}", problems.join("; "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::Pose;

    fn known() -> Known {
        Known {
            profile: "Falcon".to_owned(),
            name: None,
            firmware: None,
            max_force: 8.0,
            max_moment: 0.0,
            workspace_radius: 0.04,
            position_step: 4e-5,
            profile_rate: 1000.0,
            patience: 5,
        }
    }

    /// A device that gives a state in every tick of `every`, but in no tick of `gap`, in two seconds.
    fn every(every: u64, gap: std::ops::Range<u64>) -> Probed {
        let mut seen = Seen::new(0);
        for tick in 0..2000 {
            let now = tick * 1_000_000;
            let state = DeviceState {
                device_time_ns: now,
                ..DeviceState::resting()
            };
            let comes = tick.is_multiple_of(every) && !gap.contains(&tick);
            seen.take(now, &comes.then_some(state).ok_or(DeviceError::NoReport));
        }
        Probed::new("x", known(), 1000.0, &seen)
    }

    #[test]
    fn the_verdict_holds_the_rate_against_the_profile_and_names_what_is_wrong() {
        // A run tolerates as many ticks without a state as its patience.
        let good = every(1, 1000..1005);
        assert_eq!(good.longest_silence, 5);
        assert_eq!(
            good.verdict(),
            "ready: a state in 997 ticks a second, without errors"
        );
        let slow = every(2, 0..0).verdict();
        assert_eq!(
            slow,
            "NOT ready: a state in 500 ticks a second, where its profile lets expect 1000"
        );
        let gap = every(1, 1000..1006).verdict();
        assert_eq!(
            gap,
            "NOT ready: 6 ticks in a row without a state, where a run takes the force away after 5"
        );
        // The ticks before the first state are those of an operator who calibrates the device.
        assert_eq!(every(1, 0..100).longest_silence, 0);
        let none = Probed::new("x", known(), 1000.0, &Seen::new(0)).verdict();
        assert_eq!(none, "NOT ready: it gave no state");
    }

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
        let probed = Probed::new("x", known(), 1000.0, &seen);
        assert_eq!((probed.ticks, probed.states), (6, 4));
        assert_eq!((probed.missing, probed.errors), (1, 1));
        assert!((probed.rate - 750.0).abs() < 1e-9);
        let interval = probed.interval.expect("there are intervals");
        assert!((interval.median - 1e-3).abs() < 1e-15 && (interval.longest - 2e-3).abs() < 1e-15);
        assert!((probed.step.expect("it moved") - 1e-5).abs() < 1e-15);
        assert_eq!(probed.span, Some([2e-5, 0.0, 0.0]));
        let none = Probed::new("x", known(), 1000.0, &Seen::new(0));
        assert_eq!(
            (none.rate, none.interval, none.step, none.span),
            (0.0, None, None, None)
        );
    }
}
