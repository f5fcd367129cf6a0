//! The motion from which a device is identified: one tick at a time, with its limits.
//!
//! Every free axis has a weak spring and damper at the position where the handle started. One axis at a time also gets a
//! sum of sines. Together they are the force
//!
//! ```text
//! F = k (A r(t) - (x - x0)) - c v,    shortened to the largest force that is allowed
//! ```
//!
//! `k` and `c` follow from the limits alone, because the mass is unknown: half of the largest force at the largest
//! distance, and three fifths of the largest force at the largest speed. `A` grows from a tenth of the largest distance until
//! position or speed comes near its limit, and shrinks at once if position or speed comes nearer. Near the limits of
//! position and speed the sines fade out as well, and near that of position a stiffer spring pushes back. The force is
//! known in every tick, so none of these changes disturbs the fit.
#![cfg_attr(
    not(test),
    deny(
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used,
    )
)]

use super::fit::{self, Sample};
use super::{Identified, IdentifyError};
use core::f64::consts::TAU;
use rt_core::{Capabilities, DeviceError, DeviceState, Freedom, Vec3, Wrench};

/// Fraction of the device's largest force that the motion uses at most.
const FORCE_FRACTION: f64 = 0.3;
/// Largest distance from the start (m).
const LARGEST_DISTANCE: f64 = 0.02;
/// Largest distance from the start, as a fraction of the workspace's radius.
const RADIUS_FRACTION: f64 = 0.25;
/// Largest speed (m/s).
const LARGEST_SPEED: f64 = 0.3;
/// Ticks in a row without a reading that end the motion.
const SILENT_TICKS: u32 = 5;

/// Frequencies (Hz) and phases (rad) of the sines, of equal amplitude. The slow sines make long swings, which show
/// damping and friction best; the fast sines add acceleration. No two frequencies have a simple ratio, so swings of many
/// speeds occur.
const SINES: [(f64, f64); 4] = [(1.1, 0.0), (1.9, 2.0), (3.7, 4.0), (7.9, 1.0)];
/// Time to ramp the sines in and out (s).
const RAMP: f64 = 0.5;
/// Time of the sines on one axis (s), with both ramps.
const AXIS_TIME: f64 = 20.0;
/// Time at the start of the sines on an axis that the record leaves out (s). In that time the spring brings the other axes
/// to rest, and the amplitude grows.
const SETTLE_TIME: f64 = 3.0;
/// Time between two axes for the handle to come to rest (s).
const REST_TIME: f64 = 0.5;
/// Number of positions from which the speed follows: the handle's speed is their mean over the time between the first and the
/// last.
const SPEED_SPAN: usize = 8;
/// Amplitude at the start and at most, as multiples of the largest distance.
const AMPLITUDE: (f64, f64) = (0.1, 3.0);
/// Rate at which the amplitude grows, and at which it shrinks (1/s).
const GROW: f64 = 1.0;
const SHRINK: f64 = 40.0;
/// The amplitude grows below the first fraction of the limits of position and speed and shrinks above the second.
const BAND: (f64, f64) = (0.6, 0.7);
/// Time by which the approach to the largest distance is seen ahead (s).
const AHEAD: f64 = 0.01;
/// Time constant with which the nearest approach to a limit is forgotten (s).
const FORGET: f64 = 1.5;

/// The limits of the motion.
#[derive(Clone, Copy, Debug)]
struct Limits {
    force: f64,
    distance: f64,
    speed: f64,
}

/// Guides a device through the motion from which it is identified.
#[derive(Clone, Debug)]
pub struct Guide {
    period: f64,
    limits: Limits,
    freedom: Freedom,
    /// The axes in their order, with the record of each.
    records: [Vec<Sample>; 3],
    free: [bool; 3],
    /// The axis that moves; 3 or more at the end.
    axis: usize,
    /// Ticks on this axis.
    ticks: usize,
    ticks_per_axis: usize,
    settle_ticks: usize,
    rest_ticks: usize,
    start: Option<Vec3>,
    /// The newest positions, newest first.
    recent: [Vec3; SPEED_SPAN],
    amplitude: f64,
    /// The nearest approach to a limit, as a fraction of it, slowly forgotten.
    approach: f64,
    silent: u32,
    ended: Option<Result<(), IdentifyError>>,
}

impl Guide {
    /// A guide for a device with these capabilities, which is read and written every `period` (s). The handle starts at
    /// the position of the first reading.
    ///
    /// # Errors
    /// [`IdentifyError::Senseless`] if a number that the motion needs is not finite or not above zero.
    pub fn new(device: &Capabilities, period: f64) -> Result<Self, IdentifyError> {
        for (field, found) in [
            ("largest force", device.max_force),
            ("workspace radius", device.workspace_radius),
            ("position step", device.position_step),
            ("period", period),
        ] {
            if !(found.is_finite() && found > 0.0) {
                return Err(IdentifyError::Senseless { field, found });
            }
        }
        let freedom = device.actuated;
        let free = match freedom {
            Freedom::Along(axes) => axes.free(),
            Freedom::Three | Freedom::Six => [true; 3],
        };
        // A period below 10 us would only fill memory.
        let ticks = |time: f64| (time / period.max(1e-5)).ceil() as usize;
        let (ticks_per_axis, rest_ticks) = (ticks(AXIS_TIME), ticks(REST_TIME));
        let mut guide = Self {
            period,
            limits: Limits {
                force: FORCE_FRACTION * device.max_force,
                distance: LARGEST_DISTANCE.min(RADIUS_FRACTION * device.workspace_radius),
                speed: LARGEST_SPEED,
            },
            freedom,
            records: free.map(|free| Vec::with_capacity(if free { ticks_per_axis } else { 0 })),
            free,
            axis: 0,
            ticks: 0,
            ticks_per_axis,
            settle_ticks: ticks(SETTLE_TIME),
            rest_ticks,
            start: None,
            recent: [Vec3::zeros(); SPEED_SPAN],
            amplitude: AMPLITUDE.0,
            approach: 0.0,
            silent: 0,
            ended: None,
        };
        guide.skip_fixed_axes();
        Ok(guide)
    }

    /// Largest force (N), distance from the start (m) and speed (m/s) of the motion.
    pub fn limits(&self) -> (f64, f64, f64) {
        (self.limits.force, self.limits.distance, self.limits.speed)
    }

    /// Takes the reading of this tick and returns the wrench to write. The wrench is zero from the end on. It allocates
    /// nothing.
    pub fn tick(&mut self, reading: &Result<DeviceState, DeviceError>) -> Wrench {
        if self.ended.is_some() {
            return Wrench::zero();
        }
        let position = match reading {
            Ok(state) if state.is_finite() => Some(self.freedom.part(&state.pose.position)),
            _ => None,
        };
        match self.force(position) {
            Ok(_) if self.ended.is_some() => Wrench::zero(),
            Ok(force) => Wrench {
                force,
                moment: Vec3::zeros(),
            },
            Err(error) => {
                self.ended = Some(Err(error));
                Wrench::zero()
            }
        }
    }

    /// Fraction of the motion that is done, from 0 to 1.
    pub fn progress(&self) -> f64 {
        if self.ended.is_some() {
            return 1.0;
        }
        let each = (self.ticks_per_axis + self.rest_ticks) as f64;
        let axes = |free: &[bool]| free.iter().filter(|free| **free).count() as f64;
        let done = axes(self.free.get(..self.axis).unwrap_or(&self.free));
        ((done + self.ticks as f64 / each) / axes(&self.free).max(1.0)).min(1.0)
    }

    /// Whether the motion has ended, by itself or by an error.
    pub fn ended(&self) -> bool {
        self.ended.is_some()
    }

    /// The result; `None` before the end. The fit is computed in this call and takes too long for a tick.
    pub fn result(&self) -> Option<Result<Identified, IdentifyError>> {
        self.ended.map(|ended| {
            ended?;
            let records = self.records.iter().enumerate();
            let records: Vec<_> = records
                .filter(|(axis, _)| self.free.get(*axis) == Some(&true))
                .map(|(axis, samples)| (axis, samples.as_slice()))
                .collect();
            fit::identify(&records, self.period, self.limits.force)
        })
    }

    /// The force of this tick (N). Without a position it is zero, and the device is free until the next reading.
    fn force(&mut self, position: Option<Vec3>) -> Result<Vec3, IdentifyError> {
        let Some(position) = position else {
            self.silent = self.silent.saturating_add(1);
            if self.silent >= SILENT_TICKS {
                return Err(IdentifyError::Silent {
                    ticks: self.silent,
                    most: SILENT_TICKS,
                });
            }
            if self.start.is_some() {
                self.advance(f64::NAN, &Vec3::zeros());
            }
            return Ok(Vec3::zeros());
        };
        let start = *self.start.get_or_insert_with(|| {
            self.recent = [position; SPEED_SPAN];
            position
        });
        // A missed reading stands for an even motion.
        for _ in 0..=self.silent {
            self.recent.rotate_right(1);
        }
        let missed = self.silent as usize;
        let before = self.recent.get(missed + 1).copied().unwrap_or(position);
        for (k, slot) in self.recent.iter_mut().take(missed + 1).enumerate() {
            *slot = position + (before - position) * (k as f64 / (missed + 1) as f64);
        }
        self.silent = 0;
        let oldest = self.recent.last().copied().unwrap_or(position);
        let velocity = (position - oldest) / ((SPEED_SPAN - 1) as f64 * self.period);
        let offset = position - start;
        let Limits {
            force: most_force,
            distance,
            speed,
        } = self.limits;
        if offset.norm() > distance {
            return Err(IdentifyError::TooFar {
                found: offset.norm(),
                most: distance,
            });
        }
        if velocity.norm() > speed {
            return Err(IdentifyError::TooFast {
                found: velocity.norm(),
                most: speed,
            });
        }
        let stiffness = 0.5 * most_force / distance;
        let damping = 0.6 * most_force / speed;
        let mut force = -offset * stiffness - velocity * damping;
        let beyond = offset.norm() / distance - BAND.1;
        if beyond > 0.0 {
            let wall = most_force * (beyond / (1.0 - BAND.1));
            force -= offset * (wall / offset.norm());
        }
        let ahead = offset + velocity * AHEAD;
        let motion = (offset.norm().max(ahead.norm()) / distance).max(velocity.norm() / speed);
        if let Some(part) = force.get_mut(self.axis) {
            let fade = ((1.0 - motion) / (1.0 - BAND.1)).min(1.0);
            *part += stiffness * distance * self.amplitude * fade * self.sines();
        }
        let mut force = self.freedom.part(&force);
        let size = force.norm();
        self.adapt(motion);
        if size > most_force {
            // The factor keeps the rounded length below the limit.
            force *= most_force / size * (1.0 - 1e-12);
        }
        let along = offset.get(self.axis).copied().unwrap_or_default();
        self.advance(along, &force);
        Ok(force)
    }

    /// The sum of the sines at this tick, from -1 to 1, with its ramps.
    fn sines(&self) -> f64 {
        let t = self.ticks as f64 * self.period;
        let ramp = (t / RAMP).min((AXIS_TIME - t) / RAMP).clamp(0.0, 1.0);
        let smooth = ramp * ramp * (3.0 - 2.0 * ramp);
        let sum: f64 = SINES
            .iter()
            .map(|(hz, phase)| libm::sin(TAU * hz * t + phase))
            .sum();
        smooth * sum / SINES.len() as f64
    }

    /// Adapts the amplitude to the approach `near` to the limits.
    fn adapt(&mut self, near: f64) {
        self.approach = near.max(self.approach * libm::exp(-self.period / FORGET));
        let rate = if near > BAND.1 {
            -SHRINK
        } else if self.approach < BAND.0 {
            GROW
        } else {
            0.0
        };
        let grown = self.amplitude * libm::exp(rate * self.period);
        self.amplitude = grown.clamp(AMPLITUDE.0, AMPLITUDE.1);
    }

    /// Records this tick and advances to the next, on this axis or the next axis.
    fn advance(&mut self, offset: f64, force: &Vec3) {
        if (self.settle_ticks..self.ticks_per_axis).contains(&self.ticks) {
            let force = force.get(self.axis).copied().unwrap_or_default();
            if let Some(record) = self.records.get_mut(self.axis) {
                record.push(Sample { offset, force });
            }
        }
        self.ticks += 1;
        if self.ticks >= self.ticks_per_axis + self.rest_ticks {
            self.ticks = 0;
            self.axis += 1;
            self.amplitude = AMPLITUDE.0;
            self.approach = 0.0;
            self.skip_fixed_axes();
        }
    }

    /// Advances to the next free axis. The motion ends if no axis is left.
    fn skip_fixed_axes(&mut self) {
        while self.free.get(self.axis) == Some(&false) {
            self.axis += 1;
        }
        if self.axis >= self.free.len() {
            self.ended = Some(Ok(()));
        }
    }
}

#[cfg(test)]
mod tests;
