//! The measurements of a run: of each device, of each body, and of the energy.

use super::record::{BodyRecord, DeviceRecord, Record};
use crate::stress::scene::measure::{LEAST_FORCE, band_rms};
use physics::Vec3;
use serde::Serialize;

/// Length of the windows in which ripple is measured (s). A window begins every half length.
const WINDOW: f64 = 0.5;
/// Longest gap within a hold-back (s). A cap that acts in most ticks feels like a cap that acts in all.
const GAP: f64 = 0.1;

/// The measurements of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measures {
    /// Net energy (J): the largest work on the hands of all devices together, over time, less the energy stored at the
    /// start.
    pub net_energy: f64,
    /// The devices, in the scene's order.
    pub devices: Vec<DeviceMeasures>,
    /// The bodies, in the scene's order; none for the reference.
    pub bodies: Vec<BodyMeasures>,
}

/// The measurements of one device.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceMeasures {
    /// Name in the scene.
    pub name: String,
    /// Largest force of the motors (N).
    pub peak_force: f64,
    /// Time of the largest force (s).
    pub peak_time: f64,
    /// Force from `measured_from` on (N, RMS).
    pub rms_force: f64,
    /// Force from 20 to 400 Hz in the worst half second from `measured_from` on (N, RMS).
    pub ripple: f64,
    /// Fraction of the ticks in which the force was reduced to the limit of the device.
    pub limited: f64,
    /// Difference of the force from that of the reference; none without a reference.
    pub error: Option<ForceError>,
}

/// The difference of a force from that of the reference at the same time, from `measured_from` on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ForceError {
    /// Over the time (N, RMS).
    pub rms: f64,
    /// `rms` as a fraction of the RMS force of the reference, or of 0.1 N if that is more.
    pub relative: f64,
    /// Largest (N).
    pub largest: f64,
    /// Time of the largest (s).
    pub largest_time: f64,
}

/// The measurements of the local models of one body.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BodyMeasures {
    /// Fraction of the ticks in which a cap reduced a wrench, or the classic controller damped.
    pub capped: f64,
    /// Time for which a noticeable force was withheld (s).
    pub held_back: f64,
    /// The longest hold-back (s): a time over which a noticeable force was withheld, with gaps of at most 0.1 s.
    pub longest_hold_back: f64,
    /// Largest force withheld (N).
    pub most_withheld: f64,
    /// Fraction of the ticks in which the force faded, or was the safe hold, because the model was too old.
    pub faded: f64,
    /// Age of the local model in use (s): median and largest; none without a model.
    pub model_age: Option<[f64; 2]>,
}

impl Measures {
    /// Measures `run`, whose devices have the names `names`, against the reference `expected`; errors and ripple from
    /// the time `from` (s) on.
    pub(super) fn of(run: &Record, names: &[String], expected: Option<&Record>, from: f64) -> Self {
        // At least one tick is measured.
        let last = run.out.len().saturating_sub(1);
        let from = ((from / run.period).round() as usize).min(last);
        let devices = run.devices.iter().zip(names).enumerate();
        let devices = devices.map(|(index, (device, name))| {
            let expected = expected.map(|record| &record.devices[index]);
            DeviceMeasures::of(device, name, run.period, expected, from)
        });
        Self {
            net_energy: run.out.iter().copied().fold(0.0, f64::max),
            devices: devices.collect(),
            bodies: run
                .bodies
                .iter()
                .map(|body| BodyMeasures::of(body, run.period))
                .collect(),
        }
    }

    /// The largest value of `measure` over the devices; zero without a device.
    pub fn worst(&self, measure: impl Fn(&DeviceMeasures) -> f64) -> f64 {
        self.devices.iter().map(measure).fold(0.0, f64::max)
    }

    /// The largest value of `measure` over the bodies; zero without a body.
    pub fn worst_body(&self, measure: impl Fn(&BodyMeasures) -> f64) -> f64 {
        self.bodies.iter().map(measure).fold(0.0, f64::max)
    }
}

impl DeviceMeasures {
    fn of(
        device: &DeviceRecord,
        name: &str,
        period: f64,
        expected: Option<&DeviceRecord>,
        from: usize,
    ) -> Self {
        let (peak_force, peak_time) = largest(device.force.iter().map(Vec3::norm), period);
        let force = &device.force[from..];
        Self {
            name: name.to_owned(),
            peak_force,
            peak_time,
            rms_force: rms(force.iter().copied()),
            ripple: worst_ripple(force, period),
            limited: device.limited as f64 / device.force.len().max(1) as f64,
            error: expected.map(|expected| ForceError::of(device, expected, period, from)),
        }
    }
}

impl ForceError {
    fn of(device: &DeviceRecord, expected: &DeviceRecord, period: f64, from: usize) -> Self {
        let pairs = || device.force.iter().zip(&expected.force).skip(from);
        let rms_error = rms(pairs().map(|(found, expected)| found - expected));
        let whole = rms(expected.force[from..].iter().copied());
        let off = pairs().map(|(found, expected)| (found - expected).norm());
        let (largest, after) = largest(off, period);
        let largest_time = from as f64 * period + after;
        Self {
            rms: rms_error,
            relative: rms_error / whole.max(LEAST_FORCE),
            largest,
            largest_time,
        }
    }
}

impl BodyMeasures {
    fn of(body: &BodyRecord, period: f64) -> Self {
        let ticks = body.withheld.len().max(1) as f64;
        let (mut held, mut longest) = (0, 0);
        // The first and the last tick of the hold-back that is open.
        let mut open: Option<(usize, usize)> = None;
        let gap = (GAP / period).round() as usize;
        for (tick, _) in body
            .withheld
            .iter()
            .enumerate()
            .filter(|(_, withheld)| withheld.is_noticeable())
        {
            held += 1;
            let from = open
                .filter(|(_, last)| tick - last <= gap)
                .map_or(tick, |(from, _)| from);
            open = Some((from, tick));
            longest = longest.max(tick + 1 - from);
        }
        Self {
            capped: body.capped as f64 / ticks,
            held_back: f64::from(held) * period,
            longest_hold_back: longest as f64 * period,
            most_withheld: body.withheld.iter().map(|w| w.force).fold(0.0, f64::max),
            faded: body.faded as f64 / ticks,
            model_age: body.model_age,
        }
    }
}

/// The largest of `values`, one each tick, and its time (s).
fn largest(values: impl Iterator<Item = f64>, period: f64) -> (f64, f64) {
    let each = values.enumerate();
    each.fold((0.0, 0.0), |most, (tick, value)| {
        if value > most.0 {
            (value, tick as f64 * period)
        } else {
            most
        }
    })
}

fn rms(values: impl Iterator<Item = Vec3>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_u64), |(sum, count), value| {
        (sum + value.norm_squared(), count + 1)
    });
    (sum / count.max(1) as f64).sqrt()
}

fn worst_ripple(force: &[Vec3], period: f64) -> f64 {
    let length = ((WINDOW / period).round() as usize).max(1);
    let starts = (0..).map(|k| k * length / 2);
    let starts = starts.take_while(|start| *start == 0 || start + length <= force.len());
    let windows = starts.map(|start| &force[start..force.len().min(start + length)]);
    windows
        .map(|window| band_rms(window, period))
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::Withheld;

    fn within(from: f64, to: f64, time: f64) -> bool {
        (from..to).contains(&time)
    }

    #[test]
    fn a_hold_back_lasts_over_short_gaps_and_needs_a_noticeable_force() {
        // Two newtons, of which `force` is withheld at each time (s).
        let body = |force: fn(f64) -> f64| {
            let ticks = (0..2000).map(|tick| f64::from(tick) * 1e-3);
            let withheld = ticks.map(|time| Withheld {
                force: force(time),
                of: 2.0,
            });
            BodyRecord {
                withheld: withheld.collect(),
                capped: 500,
                ..BodyRecord::default()
            }
        };
        let quiet = BodyMeasures::of(&body(|_| 0.015), 1e-3);
        assert_eq!((quiet.held_back, quiet.longest_hold_back), (0.0, 0.0));
        assert_eq!((quiet.most_withheld, quiet.capped), (0.015, 0.25));
        // 50 ms without are a gap, 200 ms end the hold-back.
        let found = BodyMeasures::of(
            &body(|time| {
                let acts =
                    within(0.1, 0.3, time) || within(0.35, 0.4, time) || within(0.6, 0.7, time);
                if acts { 0.5 } else { 0.0 }
            }),
            1e-3,
        );
        // The bound is one tick on either side.
        assert!((found.held_back - 0.35).abs() < 3.1e-3, "{found:?}");
        assert!((found.longest_hold_back - 0.3).abs() < 2.1e-3, "{found:?}");
        let whole = BodyMeasures::of(&body(|_| 0.5), 1e-3);
        assert_eq!(whole.longest_hold_back, 2.0);
    }

    #[test]
    fn errors_ripple_and_peaks_are_those_of_the_signals() {
        let run = |amplitude: f64| {
            let force = (0..2000).map(|tick| {
                let angle = std::f64::consts::TAU * 50.0 * f64::from(tick) * 1e-3;
                // A pulse at the start, which is not measured.
                let pulse = if tick < 100 { 5.0 } else { 0.0 };
                Vec3::new(2.0 + pulse + amplitude * libm::sin(angle), 0.0, 0.0)
            });
            Record {
                period: 1e-3,
                devices: vec![DeviceRecord {
                    force: force.collect(),
                    ..DeviceRecord::default()
                }],
                out: vec![0.0; 2000],
                ..Record::default()
            }
        };
        let mut expected = run(0.0);
        expected.devices[0].force[..100].fill(Vec3::zeros());
        let found = Measures::of(&run(0.4), &["one".to_owned()], Some(&expected), 0.5);
        let device = &found.devices[0];
        let rms = 0.4 / 2.0_f64.sqrt();
        let error = device.error.expect("a reference");
        // Whole periods of the sine; rounding alone.
        assert!((error.rms - rms).abs() < 1e-9 && (error.relative - rms / 2.0).abs() < 1e-9);
        assert!((error.largest - 0.4).abs() < 1e-9 && error.largest_time >= 0.5);
        // A line of a Hann window is three lines wide, all in the band.
        assert!((device.ripple - rms).abs() < 1e-6, "{}", device.ripple);
        assert!(device.peak_force > 7.0 && device.peak_time < 0.1);
    }
}
