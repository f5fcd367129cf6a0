//! The slips of proxies. A hold whose energy no hand has supplied becomes the true force of another pose, no hand gains
//! energy by the slip, and the slip ends.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use nalgebra::UnitQuaternion;
use proptest::prelude::*;
use rt_core::Reading;
use rt_core::controller::DeviceConfig;
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::SafetyConfig;
use rt_core::{
    Axes, Controller, ControllerConfig, DeviceError, DeviceState, Freedom, LocalModel, MAX_DEVICES,
    PassivityConfig, Pose, Scheme, Telemetry, Vec3, Wrench,
};

const PERIOD: f64 = 1e-3;
const TICK_NS: u64 = 1_000_000;
/// Stiffness of the springs (N/m).
const SPRING: f64 = 500.0;
/// Stiffness against turns (N m/rad).
const TURNING: f64 = 0.5;
/// Orientation of the devices in the scene: a rotation vector (rad).
const TURNED: Vec3 = Vec3::new(0.3, -0.2, 0.1);
/// Scene metres per device metre.
const SCALE: f64 = 2.0;

/// A controller, its clock and its models.
struct Rig {
    controller: Controller,
    tick: u64,
    /// The newest model of each body; a host that stalls does not renew it.
    models: Vec<LocalModel>,
    sequence: u64,
}

impl Rig {
    /// `devices` devices of the same degrees of freedom, and `models` of as many bodies.
    fn new(devices: usize, actuated: Freedom, models: Vec<LocalModel>) -> Self {
        let mut config = ControllerConfig::default();
        for _ in 0..devices {
            let frame = DeviceFrame {
                motion_scale: SCALE,
                rotation: UnitQuaternion::from_scaled_axis(TURNED),
                ..DeviceFrame::at(Vec3::zeros())
            };
            let safety = SafetyConfig {
                actuated,
                patience: 10,
                decay: 0.05,
                recovery: 0.05,
                ..SafetyConfig::unlimited(PERIOD)
            };
            config
                .devices
                .push(DeviceConfig { frame, safety })
                .expect("room");
        }
        for _ in &models {
            let body = CouplingConfig {
                scheme: Scheme::Capped,
                period: PERIOD,
                blend: 0.5,
                age_limit: 0.05,
                decay: 0.05,
                recovery: 0.05,
                hold_damping: [0.0; MAX_DEVICES],
                passivity: PassivityConfig::new(PERIOD),
            };
            config.bodies.push(body).expect("room");
        }
        Self {
            controller: Controller::new(&config),
            tick: 0,
            models,
            sequence: 0,
        }
    }

    /// Publishes the newest models, unless the host is stalled.
    fn publish(&mut self) {
        self.sequence += 1;
        for (body, model) in self.models.iter_mut().enumerate() {
            model.head.sequence = self.sequence;
            model.head.time_ns = self.tick * TICK_NS;
            self.controller.accept(body, model).expect("a sound model");
        }
    }

    /// One tick with the proxies' hands at these poses of the scene, as if no clutch and no slip acted; `None` gives no
    /// state.
    fn tick(
        &mut self,
        stalled: bool,
        poses: &[Option<Pose>],
    ) -> ([Wrench; MAX_DEVICES], Telemetry) {
        if !stalled && self.tick.is_multiple_of(10) {
            self.publish();
        }
        let frame = UnitQuaternion::from_scaled_axis(TURNED);
        let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
        for (reading, pose) in readings.iter_mut().zip(poses) {
            *reading = pose.ok_or(DeviceError::NoReport).map(|pose| DeviceState {
                pose: Pose {
                    position: frame.inverse() * pose.position / SCALE,
                    rotation: frame.inverse() * pose.rotation * frame,
                },
                ..DeviceState::resting()
            });
        }
        let found = self.controller.tick(self.tick * TICK_NS, &readings);
        self.tick += 1;
        found
    }

    /// Ticks until the force is whole, then a stall in which the hands move from `home` to `there`, then `ticks` of rest.
    /// Returns the telemetry of the first tick of the rest with the whole trust, and of the last.
    fn press_in_a_stall(
        &mut self,
        home: &[Option<Pose>],
        there: &[Option<Pose>],
        ticks: u32,
    ) -> [Telemetry; 2] {
        for _ in 0..200 {
            self.tick(false, home);
        }
        for k in 0..300 {
            let part = (f64::from(k) / 200.0 - 0.5).clamp(0.0, 1.0);
            let poses: Vec<_> = home
                .iter()
                .zip(there)
                .map(|(home, there)| between(*home, *there, part))
                .collect();
            self.tick(true, &poses);
        }
        let mut first = None;
        let mut last = Telemetry::empty();
        for _ in 0..ticks {
            let (_, telemetry) = self.tick(false, there);
            if telemetry.bodies().all(|body| body.trust >= 1.0) {
                first.get_or_insert(telemetry);
            }
            last = telemetry;
        }
        [first.expect("the force comes back"), last]
    }
}

/// A part of the way from one pose to another.
fn between(home: Option<Pose>, there: Option<Pose>, part: f64) -> Option<Pose> {
    let (home, there) = (home?, there?);
    Some(Pose {
        position: home.position + (there.position - home.position) * part,
        rotation: home.rotation.slerp(&there.rotation, part),
    })
}

/// A reading of a hand at this place.
#[expect(clippy::unnecessary_wraps, reason = "a hand may be away")]
fn at(x: f64, y: f64, z: f64) -> Option<Pose> {
    Some(Pose::at(Vec3::new(x, y, z)))
}

/// A body of springs from the handle of each of `devices` to the ground, at rest if the hands are at the origin.
fn grounded(devices: &[u8]) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head.period = 10.0 * PERIOD;
    model.head.horizon = model.head.period;
    model.head.handle_count = devices.len() as u8;
    for (index, device) in devices.iter().enumerate() {
        model.handles[index].device = *device;
        for axis in 0..3 {
            model.stiffness[index][index][(axis, axis)] = SPRING;
            model.stiffness[index][index][(3 + axis, 3 + axis)] = TURNING;
        }
    }
    model
}

/// The force on the proxy of a device in a tick (N): that on its hand, without the scale of the motion.
fn on_proxy(telemetry: &Telemetry, device: usize) -> Vec3 {
    telemetry.devices[device].wrench.force / SCALE
}

#[test]
fn a_hold_that_was_not_paid_for_becomes_the_force_of_the_slipped_pose() {
    for freedom in [Freedom::Three, Freedom::Six] {
        let mut rig = Rig::new(1, freedom, vec![grounded(&[0])]);
        let there = at(0.0, 8e-3, -6e-3);
        let [first, last] = rig.press_in_a_stall(&[at(0.0, 0.0, 0.0)], &[there], 1000);
        // At first the force is far from that of the body, which stores 25 mJ.
        let whole = SPRING * 0.01;
        assert!(on_proxy(&first, 0).norm() < 0.3 * whole);
        // The force is that of the body at the present pose of the proxy, and points along the slip.
        let device = &last.devices[0];
        assert_eq!(last.bodies[0].withheld.force, 0.0);
        let force = on_proxy(&last, 0);
        // Rounding.
        assert!((force + device.pose.position * SPRING).norm() < 1e-9);
        let hand = there.expect("a pose").position;
        assert!((device.pose.position - hand - device.slip).norm() < 1e-12);
        assert!(device.slip.dot(&force) > 0.999_999 * device.slip.norm() * force.norm());
        assert!(
            device.slip.norm() > 5e-3 && force.norm() > 0.1,
            "{:?}",
            device.slip
        );
        // The slip gains and spends no credit of a hand that rests.
        let credit = |telemetry: &Telemetry| telemetry.bodies[0].energy.available;
        assert!((credit(&last) - credit(&first)).abs() < 1e-15);
        let supplied = |telemetry: &Telemetry| telemetry.bodies[0].energy.supplied;
        assert!((supplied(&last) - supplied(&first)).abs() < 1e-15);
        // Once the hand has come home, the slip ends, and the next press is felt whole.
        for k in 0..3000 {
            rig.tick(
                false,
                &[between(there, at(0.0, 0.0, 0.0), f64::from(k) / 300.0)
                    .map(|pose| if k < 300 { pose } else { Pose::identity() })],
            );
        }
        let (_, telemetry) = rig.tick(false, &[at(0.0, 0.0, 0.0)]);
        assert_eq!(telemetry.devices[0].slip, Vec3::zeros());
        for k in 0..=1000 {
            rig.tick(false, &[at(4e-3 * f64::from(k) / 1000.0, 0.0, 0.0)]);
        }
        let (_, telemetry) = rig.tick(false, &[at(4e-3, 0.0, 0.0)]);
        assert!((on_proxy(&telemetry, 0).x + SPRING * 4e-3).abs() < 1e-9);
        assert!(telemetry.bodies[0].energy.least > -1e-3);
    }
}

#[test]
fn a_hand_that_goes_on_pressing_pays_and_feels_the_whole_stiffness() {
    let mut rig = Rig::new(1, Freedom::Three, vec![grounded(&[0])]);
    let [_, before] = rig.press_in_a_stall(&[at(0.0, 0.0, 0.0)], &[at(0.0, 0.0, -8e-3)], 1500);
    for k in 0..=500 {
        rig.tick(false, &[at(0.0, 0.0, -8e-3 - 4e-6 * f64::from(k))]);
    }
    let (_, after) = rig.tick(false, &[at(0.0, 0.0, -10e-3)]);
    let (before, after) = (on_proxy(&before, 0).z, on_proxy(&after, 0).z);
    // 2 mm against the spring, less a slip that may still come or go by its hysteresis of some percent.
    assert!(
        (after - before - SPRING * 2e-3).abs() < 0.1 * SPRING * 2e-3,
        "{before} {after}"
    );
}

#[test]
fn two_hands_on_one_body_slip_along_their_forces_and_a_body_of_their_own_pays_nothing_for_that() {
    // The spring between the hands was stretched in a stall; a second body holds the first device as well, along x.
    let mut between_hands = grounded(&[0, 1]);
    for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        for axis in 0..3 {
            let sign = if i == j { 1.0 } else { -1.0 };
            between_hands.stiffness[i][j][(axis, axis)] = sign * SPRING;
        }
    }
    let mut other = grounded(&[0]);
    other.stiffness[0][0] *= 0.01;
    let mut rig = Rig::new(2, Freedom::Three, vec![between_hands, other]);
    let home = [at(0.0, 0.0, 0.0), at(0.0, 0.0, 0.0)];
    let there = [at(0.0, 6e-3, 0.0), at(0.0, -6e-3, 0.0)];
    let [first, last] = rig.press_in_a_stall(&home, &there, 1500);
    let [left, right] = [0, 1].map(|device| last.devices[device].slip.y);
    // The second body pulls the first device home with a hundredth of the force, and holds no credit either.
    assert!(
        left < -2e-3 && right > 2e-3 && (left + right).abs() < 0.1 * right,
        "{left} {right}"
    );
    let stretch = last.devices[0].pose.position.y - last.devices[1].pose.position.y;
    assert!((on_proxy(&last, 1).y - SPRING * stretch).abs() < 1e-9);
    for body in 0..2 {
        let supplied = |telemetry: &Telemetry| telemetry.bodies[body].energy.supplied;
        // The hands rest; positions round.
        assert!((supplied(&last) - supplied(&first)).abs() < 1e-15);
    }
}

#[test]
fn a_hand_that_turned_in_a_stall_slips_by_an_angle_and_feels_the_true_moment() {
    let turned = |angle: f64| {
        Some(Pose {
            position: Vec3::zeros(),
            rotation: UnitQuaternion::from_scaled_axis(Vec3::new(0.0, 0.0, angle)),
        })
    };
    let mut rig = Rig::new(1, Freedom::Six, vec![grounded(&[0])]);
    let [first, last] = rig.press_in_a_stall(&[turned(0.0)], &[turned(0.3)], 1500);
    assert!(first.devices[0].wrench.moment.norm() < 0.5 * TURNING * 0.3);
    let device = &last.devices[0];
    let angle = device.pose.rotation.scaled_axis().z;
    assert!(
        device.slip_angle > 0.05 && (angle + device.slip_angle - 0.3).abs() < 1e-6,
        "{angle} {}",
        device.slip_angle
    );
    // The blend of quaternions errs by the cube of an angle of a tick.
    assert!((device.wrench.moment.z + TURNING * angle).abs() < 1e-9);
    // Home, the slip ends.
    for k in 0..3000 {
        rig.tick(
            false,
            &[turned(0.3 * (1.0 - f64::from(k) / 300.0).max(0.0))],
        );
    }
    let (_, telemetry) = rig.tick(false, &[turned(0.0)]);
    assert_eq!(telemetry.devices[0].slip_angle, 0.0);
    assert!(telemetry.devices[0].pose.rotation.angle() < 1e-12);
}

#[test]
fn a_proxy_slips_along_the_axes_of_its_device_alone() {
    let axes = Axes::new([true, false, false]).expect("one axis");
    let mut rig = Rig::new(1, Freedom::Along(axes), vec![grounded(&[0])]);
    let along = UnitQuaternion::from_scaled_axis(TURNED) * Vec3::x();
    let pose = |x: f64| Some(Pose::at(along * x));
    let [_, last] = rig.press_in_a_stall(&[pose(0.0)], &[pose(8e-3)], 1000);
    let slip = last.devices[0].slip;
    assert!(
        slip.norm() > 1e-3 && slip.cross(&along).norm() < 1e-12,
        "{slip:?}"
    );
}

#[test]
fn the_proxy_of_a_device_that_is_away_does_not_slip() {
    let mut rig = Rig::new(1, Freedom::Three, vec![grounded(&[0])]);
    let there = at(0.0, 0.0, -8e-3);
    let [first, _] = rig.press_in_a_stall(&[at(0.0, 0.0, 0.0)], &[there], 60);
    let slipped = |telemetry: &Telemetry| telemetry.devices[0].slip;
    assert_ne!(slipped(&rig.tick(false, &[there]).1), slipped(&first));
    for _ in 0..20 {
        rig.tick(false, &[None]);
    }
    let away = rig.tick(false, &[None]).1;
    for _ in 0..200 {
        let (_, telemetry) = rig.tick(false, &[None]);
        assert_eq!(telemetry.devices[0].pose, away.devices[0].pose);
    }
    // After the return, the slip continues, and the force becomes true.
    for _ in 0..1500 {
        rig.tick(false, &[there]);
    }
    let (_, telemetry) = rig.tick(false, &[there]);
    assert_eq!(telemetry.bodies[0].withheld.force, 0.0);
    let force = on_proxy(&telemetry, 0);
    assert!((force + telemetry.devices[0].pose.position * SPRING).norm() < 1e-9);
}

#[test]
fn an_energy_that_no_motion_can_take_out_leads_to_no_force_at_rest_and_a_bounded_slip() {
    // The body claims an energy that its handle cannot get back, as a strip does that is held in a buckled state.
    for claimed in [1.0, 1e300, f64::MAX] {
        let mut model = grounded(&[0]);
        model.head.energy = claimed;
        model.head.released = model.head.energy;
        let mut rig = Rig::new(1, Freedom::Three, vec![grounded(&[0])]);
        for _ in 0..100 {
            rig.tick(false, &[at(0.0, 0.0, 0.0)]);
        }
        rig.models = vec![model];
        let pose = at(0.0, 0.0, -3e-3);
        let mut forces = Vec::new();
        for _ in 0..5000 {
            let (_, telemetry) = rig.tick(false, &[pose]);
            let slip = telemetry.devices[0].slip.norm();
            // The proxy yields to the force, and stops at the pose without force.
            assert!(slip < 3e-3 + 1e-5, "{slip} {claimed}");
            forces.push(on_proxy(&telemetry, 0));
        }
        let ripple = forces[4000..]
            .array_windows()
            .map(|[before, after]| (after - before).norm());
        assert!(ripple.fold(0.0, f64::max) < 1e-6, "{claimed}");
    }
}

#[test]
fn a_force_that_no_motion_lowers_does_not_carry_the_proxy_away() {
    let mut rig = Rig::new(1, Freedom::Three, vec![grounded(&[0])]);
    for _ in 0..100 {
        rig.tick(false, &[at(0.0, 0.0, 0.0)]);
    }
    let mut model = LocalModel::empty();
    model.head.period = 10.0 * PERIOD;
    model.head.handle_count = 1;
    model.handles[0].wrench.force = Vec3::new(0.0, 0.6, 0.8);
    model.head.energy = 1.0;
    model.head.released = model.head.energy;
    rig.models = vec![model];
    let mut last = Vec3::zeros();
    for _ in 0..5000 {
        let (_, telemetry) = rig.tick(false, &[at(0.0, 0.0, 0.0)]);
        let slip = telemetry.devices[0].slip;
        // 50 mm/s, as felt at the device.
        assert!((slip - last).norm() < 0.05 * SCALE * PERIOD * 1.000_001);
        last = slip;
    }
    // 50 mm, as felt at the device, less a step.
    assert!(
        last.norm() <= 0.05 * SCALE && last.norm() > 0.049 * SCALE,
        "{last:?}"
    );
}

proptest! {
    /// Random hands, models that contradict each other, and stalls: no more energy than twice the allowance comes out
    /// at the hands, although the proxies slip.
    #[test]
    fn slips_give_no_energy_to_hands(
        stiff in prop::collection::vec((0.1..10.0_f64, 0.0..0.5_f64, prop::bool::weighted(0.2)), 20),
        steps in prop::collection::vec((-1.0..1.0_f64, -1.0..1.0_f64), 60),
        two in prop::bool::ANY,
    ) {
        let devices = if two { 2 } else { 1 };
        let holds: &[u8] = if two { &[0, 1] } else { &[0] };
        let mut rig = Rig::new(devices, Freedom::Three, vec![grounded(holds)]);
        let mut hands = [Vec3::zeros(); 2];
        let mut speed = Vec3::zeros();
        let (mut out, mut most, mut slipped) = (0.0_f64, 0.0_f64, 0.0_f64);
        let mut held = [Wrench::zero(); MAX_DEVICES];
        for k in 0..1200_usize {
            let (factor, energy, stalled) = stiff[k / 60];
            let mut model = grounded(holds);
            for (i, row) in model.stiffness.iter_mut().enumerate() {
                row[i] *= factor;
            }
            if k >= 60 {
                model.head.energy = energy * energy * 0.1;
            }
            rig.models = vec![model];
            // A hand has inertia.
            let (x, z) = steps[k / 20];
            speed += (Vec3::new(x, 0.0, z) * 0.2 - speed) * 0.05;
            let frame = UnitQuaternion::from_scaled_axis(TURNED);
            for ((hand, held), sign) in hands.iter_mut().zip(&held).zip([1.0, -0.7]) {
                let by = Vec3::new(speed.x * sign, 0.0, speed.z) * PERIOD;
                *hand += by;
                out += held.force.dot(&(frame.inverse() * by)) / SCALE;
            }
            let poses: Vec<_> = hands.iter().take(devices).map(|hand| Some(Pose::at(*hand))).collect();
            most = most.max(out);
            let (commands, telemetry) = rig.tick(stalled && k >= 60, &poses);
            held = commands;
            slipped = slipped.max(telemetry.devices[0].slip.norm());
        }
        // The first model stores nothing. Twice the allowance, and the first quick step, which is a surprise.
        prop_assert!(most < 1e-3, "{most} J");
        prop_assert!(slipped < 0.05 * SCALE + 1e-9, "{slipped} m");
    }
}
