//! The guide, tick by tick against the formulas of its module, and on a plant whose numbers are known.

use super::*;
use crate::scripted::small;
use rt_core::{Axes, Pose};

const PERIOD: f64 = 1e-3;
/// The limits, stiffness and damping of a guide for [`small`].
const MOST: f64 = 2.4;
const DISTANCE: f64 = 0.02;
const STIFFNESS: f64 = 60.0;
const DAMPING: f64 = 4.8;

fn guide() -> Guide {
    Guide::new(&small(Freedom::Three), PERIOD).unwrap()
}

/// The reading of a handle at a position; `None` for a lost one.
fn at(position: impl Into<Option<Vec3>>) -> Result<DeviceState, DeviceError> {
    let position = position.into().ok_or(DeviceError::NoReport)?;
    Ok(DeviceState {
        pose: Pose {
            position,
            ..Pose::identity()
        },
        ..DeviceState::resting()
    })
}

/// A force is as expected, up to rounding.
#[track_caller]
fn same(found: Vec3, expected: Vec3) {
    assert!((found - expected).norm() < 1e-9, "{found} {expected}");
}

/// The sum of the four sines at a tick, with its ramp of half a second: as the head of the module states them.
fn sines(tick: usize) -> f64 {
    let t = tick as f64 * PERIOD;
    let turn = |hz: f64, phase: f64| (TAU * hz * t + phase).sin();
    let sum = turn(1.1, 0.0) + turn(1.9, 2.0) + turn(3.7, 4.0) + turn(7.9, 1.0);
    let u = (t / 0.5).min((20.0 - t) / 0.5).clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u) * sum / 4.0
}

#[test]
fn the_limits_are_those_of_the_device_and_of_the_method() {
    let limits = |device: Capabilities| Guide::new(&device, PERIOD).unwrap().limits();
    assert_eq!(limits(small(Freedom::Three)), (MOST, DISTANCE, 0.3));
    let near = Capabilities {
        workspace_radius: 0.04,
        ..small(Freedom::Six)
    };
    assert_eq!(limits(near), (MOST, 0.01, 0.3));
}

#[test]
fn a_number_that_the_motion_needs_and_that_is_not_above_zero_is_named() {
    let whole = small(Freedom::Three);
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let cases = [
            (
                "largest force",
                Capabilities {
                    max_force: wrong,
                    ..whole
                },
                PERIOD,
            ),
            (
                "workspace radius",
                Capabilities {
                    workspace_radius: wrong,
                    ..whole
                },
                PERIOD,
            ),
            (
                "position step",
                Capabilities {
                    position_step: wrong,
                    ..whole
                },
                PERIOD,
            ),
            ("period", whole, wrong),
        ];
        for (name, device, period) in cases {
            let error = Guide::new(&device, period).unwrap_err();
            assert!(
                matches!(error, IdentifyError::Senseless { field, .. } if field == name),
                "{error}"
            );
        }
    }
}

#[test]
fn a_weak_spring_holds_every_axis_where_the_handle_started() {
    let mut guide = guide();
    let start = Vec3::new(0.01, -0.02, 0.03);
    guide.tick(&at(start));
    let off = Vec3::new(0.0, 1e-3, -5e-4);
    let mut force = Vec3::zeros();
    for _ in 0..8 {
        force = guide.tick(&at(start + off)).force;
    }
    // Eight equal positions: no speed.
    assert!((force.yz() + off.yz() * STIFFNESS).norm() < 1e-9, "{force}");
}

#[test]
fn a_damper_acts_on_the_mean_speed_of_seven_periods() {
    let mut guide = guide();
    guide.tick(&at(Vec3::zeros()));
    for k in 1..=20_u32 {
        let y = f64::from(k) * 1e-4;
        let force = guide.tick(&at(Vec3::y() * y)).force;
        // The handle had rested before the first seven positions.
        let speed = 0.1 * f64::from(k.min(7)) / 7.0;
        assert!(
            (force.y + STIFFNESS * y + DAMPING * speed).abs() < 1e-9,
            "{k} {force}"
        );
    }
}

/// Moves a handle slowly to an offset and lets it rest there. Returns the number of ticks.
fn moved(guide: &mut Guide, offset: Vec3) -> usize {
    let steps = (offset.norm() / 1e-4).ceil() as usize;
    for k in 0..=steps {
        guide.tick(&at(offset * (k as f64 / steps.max(1) as f64)));
    }
    for _ in 0..8 {
        guide.tick(&at(offset));
    }
    steps + 9
}

#[test]
fn near_the_largest_distance_a_stiffer_spring_pushes_back() {
    for (part, wall) in [(0.69, 0.0), (0.75, 0.4), (0.85, 1.2)] {
        let offset = Vec3::z() * (part * DISTANCE);
        let mut guide = guide();
        moved(&mut guide, offset);
        let force = guide.tick(&at(offset)).force;
        assert!(
            (force.z + STIFFNESS * offset.z + wall).abs() < 1e-9,
            "{part} {force}"
        );
    }
}

#[test]
fn the_sines_grow_by_the_second_and_end_before_the_axis_rests() {
    let mut guide = guide();
    // 20 s of sines and half a second of rest along each of three axes.
    for tick in 0..3 * 20_500 {
        assert!(!guide.ended());
        let progress = tick as f64 / 61_500.0;
        assert!((guide.progress() - progress).abs() < 1e-12, "{tick}");
        let force = guide.tick(&at(Vec3::zeros())).force;
        let (axis, tick) = (tick / 20_500, tick % 20_500);
        let amplitude = (0.1 * (tick as f64 * PERIOD).exp()).min(3.0);
        let wanted = STIFFNESS * DISTANCE * amplitude * sines(tick);
        let mut expected = Vec3::zeros();
        // In the last tick of the motion the force is zero already.
        expected[axis] = wanted.clamp(-MOST, MOST);
        same(force, expected);
        assert!(force.norm() <= MOST);
    }
    assert!(guide.ended());
    assert_eq!(guide.progress(), 1.0);
    assert_eq!(guide.tick(&at(Vec3::y() * 0.01)), Wrench::zero());
}

/// The amplitude of the sines, from the force along the first axis of a handle that rests at an offset beside it.
fn amplitude(guide: &mut Guide, tick: usize, offset: Vec3, fade: f64) -> f64 {
    let along = guide.tick(&at(offset)).force.x + STIFFNESS * offset.x;
    along / (STIFFNESS * DISTANCE * fade * sines(tick))
}

/// Rests at the start for some ticks, then goes to an offset within the plane across the first axis. Returns the guide
/// and the tick.
fn grown_then_moved(ticks: usize, part: f64) -> (Guide, usize) {
    let mut guide = guide();
    for _ in 0..ticks {
        guide.tick(&at(Vec3::zeros()));
    }
    let tick = ticks + moved(&mut guide, Vec3::y() * (part * DISTANCE));
    (guide, tick)
}

#[test]
fn near_a_limit_the_sines_fade_and_the_amplitude_shrinks() {
    let offset = |part: f64| Vec3::y() * (part * DISTANCE);
    // Between the two fractions of a limit the amplitude stays; below, it grows by 1/s; above, it shrinks by 40/s.
    for (part, rate) in [(0.5, 1.0), (0.62, 0.0), (0.75, -40.0)] {
        let (mut guide, tick) = grown_then_moved(2000, part);
        let fade = ((1.0 - part) / 0.3_f64).min(1.0);
        let first = amplitude(&mut guide, tick, offset(part), fade);
        let second = amplitude(&mut guide, tick + 1, offset(part), fade);
        let expected = (rate * PERIOD).exp();
        assert!(
            first > 0.15 && (second / first - expected).abs() < 1e-6,
            "{part}: {first} {second}"
        );
    }
    // The amplitude keeps to its least value.
    let (mut guide, tick) = grown_then_moved(0, 0.8);
    let least = amplitude(&mut guide, tick, offset(0.8), 0.2 / 0.3);
    assert!((least - 0.1).abs() < 1e-9, "{least}");
}

#[test]
fn an_approach_to_a_limit_is_forgotten_in_a_second_and_a_half() {
    // At 0.1 m/s the approach is seen a millimetre ahead: the nearest is 0.67 of the distance, nine ticks ago.
    let (mut guide, mut tick) = grown_then_moved(1000, 0.62);
    let nearest = tick - 9;
    for k in (0..124).rev() {
        guide.tick(&at(Vec3::y() * (f64::from(k) * 1e-4)));
        tick += 1;
    }
    // 0.67 falls to 0.6 in 165.5 ticks.
    let mut last = amplitude(&mut guide, tick, Vec3::zeros(), 1.0);
    for tick in tick + 1..nearest + 300 {
        let now = amplitude(&mut guide, tick, Vec3::zeros(), 1.0);
        let grows = tick - nearest > 166;
        let expected = if grows { PERIOD.exp() } else { 1.0 };
        assert!((now / last - expected).abs() < 1e-6, "{}", tick - nearest);
        last = now;
    }
}

#[test]
fn an_approach_is_seen_ten_milliseconds_ahead_and_the_speed_has_a_limit_as_well() {
    // From rest at three quarters of the distance: outward at 0.08 m/s, and inward at nine tenths of the largest speed.
    for (speed, near) in [(0.08, 0.79 + 0.04), (-0.27, 0.9)] {
        let (mut guide, rest) = grown_then_moved(0, 0.75);
        let path = |k: usize| Vec3::y() * (0.75 * DISTANCE + k as f64 * speed * PERIOD);
        for k in 1..10 {
            guide.tick(&at(path(k)));
        }
        let least = amplitude(&mut guide, rest + 9, path(10), (1.0 - near) / 0.3);
        assert!((least - 0.1).abs() < 1e-9, "{speed}: {least}");
    }
}

#[test]
fn a_limit_that_is_passed_ends_the_motion_with_both_numbers() {
    let mut far = guide();
    moved(&mut far, Vec3::z() * DISTANCE);
    assert!(!far.ended(), "at the limit the motion goes on");
    assert_eq!(far.tick(&at(Vec3::z() * (DISTANCE + 1e-6))), Wrench::zero());
    let error = far.result().unwrap().unwrap_err();
    assert!(matches!(error, IdentifyError::TooFar { found, most }
        if (found - 0.020_001).abs() < 1e-12 && most == DISTANCE));
    // A step of 2.1 mm over seven periods is 0.3 m/s.
    let mut fast = guide();
    fast.tick(&at(Vec3::zeros()));
    fast.tick(&at(Vec3::x() * 2.09e-3));
    assert!(!fast.ended());
    let mut fast = guide();
    fast.tick(&at(Vec3::zeros()));
    assert_eq!(fast.tick(&at(Vec3::x() * 2.11e-3)), Wrench::zero());
    assert!(fast.ended());
    assert_eq!(fast.progress(), 1.0);
    let error = fast.result().unwrap().unwrap_err();
    assert!(matches!(error, IdentifyError::TooFast { found, most }
        if (found - 2.11 / 7.0).abs() < 1e-9 && most == 0.3));
}

#[test]
fn lost_readings_get_no_force_and_a_motion_goes_on_evenly_over_them() {
    let mut guide = guide();
    guide.tick(&at(Vec3::zeros()));
    for k in 1..=10 {
        guide.tick(&at(Vec3::y() * (f64::from(k) * 1e-4)));
    }
    for _ in 0..4 {
        assert_eq!(guide.tick(&at(None)), Wrench::zero());
    }
    for k in 15..=25_u32 {
        let y = f64::from(k) * 1e-4;
        let force = guide.tick(&at(Vec3::y() * y)).force;
        assert!(
            (force.y + STIFFNESS * y + DAMPING * 0.1).abs() < 1e-9,
            "{k} {force}"
        );
    }
    // A state that is not finite is no reading.
    for _ in 0..4 {
        assert_eq!(guide.tick(&at(Vec3::x() * f64::NAN)), Wrench::zero());
    }
    assert!(!guide.ended());
    guide.tick(&at(None));
    assert_eq!(
        guide.result(),
        Some(Err(IdentifyError::Silent { ticks: 5, most: 5 }))
    );
}

#[test]
fn the_motion_begins_with_the_first_reading() {
    let mut guide = guide();
    for _ in 0..4 {
        guide.tick(&at(None));
    }
    assert_eq!(guide.progress(), 0.0);
    guide.tick(&at(Vec3::zeros()));
    guide.tick(&at(None));
    assert!((guide.progress() - 2.0 / 61_500.0).abs() < 1e-12);
}

#[test]
fn only_the_free_axes_move_and_count() {
    let axes = Axes::new([false, true, true]).unwrap();
    let mut guide = Guide::new(&small(Freedom::Along(axes)), PERIOD).unwrap();
    for tick in 0..2 * 20_500_u32 {
        assert!((guide.progress() - f64::from(tick) / 41_000.0).abs() < 1e-12);
        // What such a device reads along its other axis is no motion. In the last tick, not even a spring pulls.
        let is_last = tick == 2 * 20_500 - 1;
        let offset = if is_last { 1e-4 } else { 0.0 };
        let force = guide.tick(&at(Vec3::new(1.0, offset, 0.0))).force;
        assert!(force.x == 0.0 && !(is_last && force != Vec3::zeros()));
        assert_eq!(if tick < 20_500 { force.z } else { force.y }, 0.0);
    }
    assert!(guide.ended());
}

/// A mass with viscous damping, Coulomb friction and a constant force along each axis, whose position is counted.
struct Plant {
    mass: Vec3,
    damping: f64,
    friction: f64,
    bias: Vec3,
    stiffness: f64,
    step: f64,
    x: Vec3,
    v: Vec3,
    /// Time from the write of a force to its start (periods), and the last forces, newest first.
    delay: f64,
    forces: [Vec3; 7],
}

impl Plant {
    fn new() -> Self {
        Self {
            mass: Vec3::repeat(0.2),
            damping: 1.5,
            friction: 0.15,
            bias: Vec3::zeros(),
            stiffness: 0.0,
            step: 1e-5,
            x: Vec3::zeros(),
            v: Vec3::zeros(),
            delay: 0.0,
            forces: [Vec3::zeros(); 7],
        }
    }

    fn reading(&self) -> Result<DeviceState, DeviceError> {
        at(self.x.map(|x| (x / self.step).round() * self.step))
    }

    /// The motion of a period after the write of a force, in a hundred steps.
    fn advance(&mut self, force: Vec3) {
        const STEPS: usize = 100;
        self.forces.rotate_right(1);
        self.forces[0] = force;
        for k in 0..STEPS {
            let older = (self.delay - k as f64 / STEPS as f64).ceil().max(0.0) as usize;
            let force = self.forces[older] + self.bias;
            let dt = PERIOD / STEPS as f64;
            for axis in 0..3 {
                let (x, v) = (self.x[axis], self.v[axis]);
                let free = force[axis] - self.damping * v - self.stiffness * x;
                let slows = if v == 0.0 {
                    free.clamp(-self.friction, self.friction)
                } else {
                    self.friction * v.signum()
                };
                let next = v + (free - slows) / self.mass[axis] * dt;
                self.v[axis] = if next * v < 0.0 { 0.0 } else { next };
                self.x[axis] += 0.5 * (v + self.v[axis]) * dt;
            }
        }
    }

    fn identified(
        mut self,
        freedom: Freedom,
        lost: fn(usize) -> bool,
    ) -> Result<Identified, IdentifyError> {
        let mut guide = Guide::new(&small(freedom), PERIOD).unwrap();
        for tick in 0.. {
            let reading = if lost(tick) { at(None) } else { self.reading() };
            let force = guide.tick(&reading).force;
            if let Some(result) = guide.result() {
                return result;
            }
            self.advance(force);
        }
        unreachable!("the motion ends by itself")
    }
}

/// The number is within a part of the truth, and its interval as well and contains it.
#[track_caller]
fn close(found: &super::super::Estimate, truth: f64, part: f64) {
    println!("{found:?} {truth}");
    let off = |value: f64| (value / truth - 1.0).abs();
    assert!(
        off(found.value) < part && off(found.low) < 3.0 * part && off(found.high) < 3.0 * part,
        "{found:?} {truth}"
    );
}

fn along(axis: usize) -> Freedom {
    Freedom::Along(Axes::new(core::array::from_fn(|k| k == axis)).unwrap())
}

#[test]
fn a_plant_is_identified_along_each_axis() {
    let plant = Plant {
        mass: Vec3::new(0.15, 0.2, 0.25),
        bias: Vec3::new(0.0, 0.0, -0.1),
        ..Plant::new()
    };
    let (mass, damping, friction, bias) = (plant.mass, plant.damping, plant.friction, plant.bias);
    let found = plant.identified(Freedom::Three, |_| false).unwrap();
    println!("{found:?}");
    for (k, axis) in found.axes.iter().enumerate() {
        assert_eq!(axis.axis, k);
        close(&axis.mass, mass[k], 0.01);
        close(&axis.damping, damping, 0.05);
        close(&axis.friction, friction, 0.05);
        assert!((axis.bias - bias[k]).abs() < 0.01);
        let counts = axis.residual / 1e-5;
        assert!((0.25..0.35).contains(&counts), "{counts}");
    }
    assert!((found.position_step / 1e-5 - 1.0).abs() < 1e-9);
    assert_eq!((found.delay_periods, found.period), (Some(0.0), PERIOD));
}

#[test]
fn a_delay_is_found_to_a_twentieth_of_a_period() {
    for delay in [0.4, 2.0, 3.65] {
        let plant = Plant {
            delay,
            ..Plant::new()
        };
        let found = plant.identified(along(1), |_| false).unwrap();
        println!("{found:?}");
        assert!(
            (found.delay_periods.unwrap() - delay).abs() < 0.051,
            "{found:?}"
        );
        close(&found.mass, 0.2, 0.02);
        close(&found.damping, 1.5, 0.1);
    }
}

#[test]
fn a_handle_that_a_spring_holds_is_refused() {
    let plant = Plant {
        stiffness: 30.0,
        ..Plant::new()
    };
    let error = plant.identified(along(0), |_| false).unwrap_err();
    println!("{error}");
    assert!(
        matches!(error, IdentifyError::Held { axis: 0, stiffness } if (25.0..35.0).contains(&stiffness)),
        "{error}"
    );
}

#[test]
fn lost_readings_do_not_disturb_the_numbers() {
    let found = Plant::new()
        .identified(along(2), |tick| tick % 50 < 4)
        .unwrap();
    close(&found.mass, 0.2, 0.02);
    close(&found.damping, 1.5, 0.1);
    close(&found.friction, 0.15, 0.1);
}
