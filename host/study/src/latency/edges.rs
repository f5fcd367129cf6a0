//! From an edge of force to the first motion of the handle: a bound on the latency of a device that does not tell it.
//!
//! A square wave (`rt_core::square_wave`) changes the force on the handle in known ticks. Before an edge, the handle moves along
//! a parabola, since its acceleration changes little in twenty ticks. The parabola is fitted to these ticks and continued.
//! The first reading that leaves it by more than three times the largest residual of the fit is the first motion. The time from
//! the command to this reading contains the latency of the command, the time in which the handle covers that distance, and the
//! latency of the reading. It is therefore an upper bound on each of the latencies.

use super::percentile::Series;
use host::scene::spec::Device;
use nalgebra::{Matrix3, Vector3};
use rt_core::Telemetry;
use rt_core::square_wave::SquareWave;
use std::collections::VecDeque;

/// Ticks before an edge to which the parabola is fitted.
const BEFORE: usize = 20;
/// Most ticks after an edge in which the first motion is looked for.
const AFTER: f64 = 100.0;
/// Number of residuals by which a motion leaves the parabola.
const BEYOND: f64 = 3.0;

/// The edges of the square wave of a device.
#[derive(Clone, Debug)]
pub struct Edges {
    wave: SquareWave,
    /// Bounds (ns) of the edges after which the handle moved.
    pub bounds: Series,
    /// Edges after which no motion was found.
    pub without_motion: u64,
    /// The last ticks: nominal time (ns), and position along the force (m).
    before: VecDeque<(u64, f64)>,
    /// The edge whose motion is awaited.
    awaited: Option<Edge>,
}

/// An edge whose motion is awaited.
#[derive(Clone, Debug)]
struct Edge {
    /// The time at which the command left (ns).
    left_ns: u64,
    /// The nominal time of its tick (ns).
    time_ns: u64,
    /// Coefficients of the parabola over the time in periods of the ticks, and the largest distance that belongs to it (m).
    parabola: Vector3<f64>,
    threshold: f64,
    /// The period of the ticks (ns).
    period_ns: f64,
}

impl Edges {
    /// The edges of `device` in a run of `duration` (s); `None` if its scene commands no square wave.
    pub fn of(device: &Device, duration: f64) -> Option<Self> {
        let wave = device.square_wave?;
        Some(Self {
            wave: SquareWave {
                force: wave.force.into(),
                half_period_ns: (wave.half_period * 1e9).round() as u64,
            },
            bounds: Series::new((duration / wave.half_period) as u64),
            without_motion: 0,
            before: VecDeque::with_capacity(BEFORE),
            awaited: None,
        })
    }

    /// Takes a tick, in which the device has the index `index`.
    pub fn take(&mut self, index: usize, telemetry: &Telemetry) {
        let (Some(device), Some(axis)) = (
            telemetry.devices().nth(index),
            self.wave.force.try_normalize(0.0),
        ) else {
            return;
        };
        let time_ns = telemetry.time_ns;
        let woke_ns = time_ns + telemetry.lateness_ns;
        let stamp = |stamps: &[u64]| stamps.get(index).copied().unwrap_or(0);
        let position = device.pose.position.dot(&axis);
        if !device.fresh {
            return;
        }
        if let Some(edge) = self.awaited.take() {
            let read_ns = woke_ns + stamp(&telemetry.stamps.read_ns);
            if edge.is_left(time_ns, position) {
                self.bounds
                    .record(time_ns, read_ns.saturating_sub(edge.left_ns));
            } else if (time_ns - edge.time_ns) as f64 > AFTER * edge.period_ns {
                self.without_motion += 1;
            } else {
                self.awaited = Some(edge);
            }
        }
        let changed = (self.before.back())
            .is_some_and(|&(last_ns, _)| self.wave.at(last_ns) != self.wave.at(time_ns));
        if changed {
            self.without_motion += u64::from(self.awaited.is_some());
            let left_ns = woke_ns + stamp(&telemetry.stamps.written_ns);
            self.awaited = Edge::after(&self.before, time_ns, left_ns);
        }
        if self.before.len() == BEFORE {
            self.before.pop_front();
        }
        self.before.push_back((time_ns, position));
    }
}

impl Edge {
    /// The edge of the tick of `time_ns`, whose command left at `left_ns`, after the ticks `before`; `None` if they are too few.
    fn after(before: &VecDeque<(u64, f64)>, time_ns: u64, left_ns: u64) -> Option<Self> {
        let (&(first_ns, _), &(last_ns, _)) = (before.front()?, before.back()?);
        if before.len() < BEFORE {
            return None;
        }
        let period_ns = (last_ns - first_ns) as f64 / (BEFORE - 1) as f64;
        let mut edge = Self {
            left_ns,
            time_ns,
            parabola: Vector3::zeros(),
            threshold: 0.0,
            period_ns,
        };
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for &(at_ns, position) in before {
            let powers = edge.powers(at_ns);
            normal += powers * powers.transpose();
            right += powers * position;
        }
        edge.parabola = normal.try_inverse()? * right;
        let residuals = before
            .iter()
            .map(|&(at_ns, position)| edge.distance(at_ns, position));
        edge.threshold = BEYOND * residuals.fold(f64::MIN_POSITIVE, f64::max);
        Some(edge)
    }

    /// The powers of a time, from the edge in periods of the ticks.
    fn powers(&self, at_ns: u64) -> Vector3<f64> {
        let time = (at_ns as f64 - self.time_ns as f64) / self.period_ns;
        Vector3::new(1.0, time, time * time)
    }

    /// The distance from the parabola (m).
    fn distance(&self, at_ns: u64, position: f64) -> f64 {
        (position - self.powers(at_ns).dot(&self.parabola)).abs()
    }

    fn is_left(&self, at_ns: u64, position: f64) -> bool {
        self.distance(at_ns, position) > self.threshold
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mass of 0.1 kg under a wave of 1 N, whose force comes `delay` ticks after its command, read in steps of `step` (m).
    fn bounds(delay: u64, step: f64, moves: bool) -> Edges {
        let wave = SquareWave {
            force: [0.0, 0.0, 2.0].into(),
            half_period_ns: 250_000_000,
        };
        let mut edges = Edges {
            wave,
            bounds: Series::new(0),
            without_motion: 0,
            before: VecDeque::new(),
            awaited: None,
        };
        let (mut position, mut speed) = (0.0, -0.125 * 2.0 / 0.1);
        for tick in 0..2_000_u64 {
            let mut telemetry = Telemetry::empty();
            telemetry.device_count = 1;
            telemetry.time_ns = tick * 1_000_000;
            telemetry.lateness_ns = 10_000;
            telemetry.stamps.read_ns[0] = 5_000;
            telemetry.stamps.written_ns[0] = 25_000;
            let device = &mut telemetry.devices[0];
            device.fresh = true;
            device.pose.position.z = (position / step).round() * step;
            edges.take(0, &telemetry);
            let held = wave.at(tick.saturating_sub(delay) * 1_000_000).z;
            if moves {
                speed += held / 0.1 * 1e-3;
                position += speed * 1e-3;
            }
        }
        edges
    }

    #[test]
    fn the_bound_of_an_edge_is_the_delay_and_the_ticks_until_the_motion_shows() {
        for (delay, step) in [(0, 1e-6), (3, 1e-6), (0, 1e-4), (3, 1e-4)] {
            let edges = bounds(delay, step, true);
            assert_eq!(
                (edges.bounds.count(), edges.without_motion),
                (7, 0),
                "{delay} {step}"
            );
            // From the edge, the handle leaves the parabola by 20 m/s^2 t^2. It has to cover about three steps.
            let ticks = delay as f64 + 1.0 + (3.0 * step / 20.0).sqrt() * 1e3;
            let (most, _) = edges.bounds.max();
            let least = edges.bounds.min();
            assert!(least > delay as f64 * 1e-3, "{least}");
            assert!(most < (ticks + 2.0) * 1e-3, "{most} of {ticks} ticks");
        }
    }

    #[test]
    fn a_handle_that_stands_still_has_no_bound() {
        let edges = bounds(0, 1e-6, false);
        assert_eq!((edges.bounds.count(), edges.without_motion), (0, 7));
    }
}
