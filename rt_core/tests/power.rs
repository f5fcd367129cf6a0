//! The sum of the accounts of all bodies is exactly the work of the hands on their devices, whatever the last stage and
//! the clutch do to the wrenches. The tests use two devices of six degrees of freedom, each of which holds two bodies.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use nalgebra::UnitQuaternion;
use proptest::prelude::*;
use rt_core::Reading;
use rt_core::controller::DeviceConfig;
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::engage::{ARM_ORDER, EngageConfig, STOP_ORDER};
use rt_core::heat::HeatConfig;
use rt_core::safety::{SafetyConfig, SafetyState};
use rt_core::{
    Controller, ControllerConfig, DeviceError, DeviceState, LocalModel, MAX_DEVICES,
    PassivityConfig, Pose, Scheme, Vec3, Wrench,
};
use std::collections::BTreeSet;

const MS: u64 = 1_000_000;
const PERIOD: f64 = 1e-3;
/// Ticks of a stroke, and the part of them in which an event acts.
const STROKE: [u64; 2] = [200, 30];
/// The second hand moves by this multiple of the first hand's motion.
const SIGNS: [f64; 2] = [1.0, -0.7];

fn controller(safety: SafetyConfig) -> Controller {
    let mut config = ControllerConfig::default();
    for device in 0..2 {
        let frame = DeviceFrame {
            rotation: UnitQuaternion::from_scaled_axis(Vec3::new(0.3, -0.7, f64::from(device))),
            motion_scale: 1.0 + 0.5 * f64::from(device),
            ..DeviceFrame::at(Vec3::new(0.1 * f64::from(device), 0.0, 0.0))
        };
        let _ = config.devices.push(DeviceConfig { frame, safety });
        let _ = config.bodies.push(CouplingConfig {
            scheme: Scheme::Linear,
            period: PERIOD,
            blend: 0.5,
            age_limit: 1e3,
            decay: 0.1,
            recovery: 0.01,
            hold_damping: [0.5; MAX_DEVICES],
            passivity: PassivityConfig::new(PERIOD),
        });
    }
    let mut controller = Controller::new(&config);
    for body in 0..2 {
        let mut model = LocalModel::empty();
        model.head.sequence = 1;
        model.head.period = PERIOD;
        model.head.handle_count = 2;
        for i in 0..2 {
            model.handles[i].device = i as u8;
            model.handles[i].pose = Pose::at(Vec3::new(0.1 * i as f64, 0.01, 0.0));
            model.handles[i].wrench.force = Vec3::new(0.3, -0.2, 0.1) * (1.0 + body as f64);
            for axis in 0..3 {
                let spring = 100.0 + 50.0 * (axis + body) as f64;
                model.stiffness[i][i][(axis, axis)] = spring;
                model.stiffness[i][1 - i][(axis, axis)] = -0.3 * spring;
                model.stiffness[i][i][(3 + axis, 3 + axis)] = 0.05 + 0.02 * body as f64;
                model.damping[i][i][(axis, axis)] = 1.0;
            }
        }
        controller.accept(body, &model).expect("a sound model");
    }
    controller
}

/// Moves both hands by strokes, each with an event at its beginning: 1, the first device moves too fast; 2, an order
/// stops both devices, and another one arms them. Returns the work of the hands (J), the sum of the accounts (J), and the
/// states of the last stage that were seen.
fn works(safety: SafetyConfig, strokes: &[(u8, Vec3, Vec3)]) -> (f64, f64, BTreeSet<String>) {
    let mut controller = controller(safety);
    let mut poses = [Pose::identity(); 2];
    let mut held = [Wrench::zero(); 2];
    let (mut given, mut arm, mut seen, mut now_ns) = (0.0, 0, BTreeSet::new(), MS);
    for (event, translation, turn) in strokes {
        let [ticks, acting] = STROKE;
        for k in 0..ticks {
            if k == acting && *event == 2 {
                arm ^= ARM_ORDER;
            }
            let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
            for device in 0..2 {
                let [by, turn] =
                    [translation, turn].map(|all| all * (SIGNS[device] / ticks as f64));
                let pose = &mut poses[device];
                pose.position += by;
                pose.rotation = UnitQuaternion::from_scaled_axis(turn) * pose.rotation;
                let mut state = DeviceState {
                    pose: *pose,
                    buttons: arm,
                    ..DeviceState::resting()
                };
                if k < acting && *event == 1 && device == 0 {
                    state.twist.linear.x = 3.0;
                }
                if k < acting && *event == 2 {
                    state.buttons |= STOP_ORDER;
                }
                readings[device] = Ok(state);
                given -= held[device].force.dot(&by) + held[device].moment.dot(&turn);
            }
            let (_, telemetry) = controller.tick(now_ns, &readings);
            for device in 0..2 {
                let record = &telemetry.devices[device];
                // The wrench without the weight of the grip, in the axes of the device.
                let axes = Vec3::new(0.3, -0.7, device as f64);
                let back = UnitQuaternion::from_scaled_axis(axes).inverse();
                held[device] = Wrench {
                    force: back * record.wrench.force,
                    moment: back * record.wrench.moment,
                };
                seen.insert(format!("{:?}", record.safety));
            }
            now_ns += MS;
        }
    }
    let supplied = controller.energy().map(|account| account.supplied).sum();
    (given, supplied, seen)
}

fn limits() -> SafetyConfig {
    SafetyConfig {
        max_force: 6.0,
        max_moment: 0.02,
        max_speed: 1.0,
        max_slew: 100.0,
        decay: 0.05,
        recovery: 0.05,
        engage: EngageConfig {
            grip_force: Vec3::new(0.0, 0.0, 0.5),
            ramp: 0.1,
            armed: true,
            ..EngageConfig::default()
        },
        heat: HeatConfig {
            continuous_force: 2.0,
            time: 0.2,
        },
        ..SafetyConfig::unlimited(PERIOD)
    }
}

/// A stroke so long that the hands meet every limit.
fn far(event: u8, sign: f64) -> (u8, Vec3, Vec3) {
    let translation = Vec3::new(0.03, -0.02, 0.02) * sign;
    (event, translation, Vec3::new(0.3, 0.2, -0.4) * sign)
}

#[test]
fn the_strokes_meet_every_limit() {
    let strokes = [
        far(2, 1.0),
        far(0, 1.0),
        far(1, -1.0),
        far(2, -1.0),
        far(0, 1.0),
    ];
    let (given, supplied, seen) = works(limits(), &strokes);
    let states = [
        SafetyState::Limited,
        SafetyState::Hot,
        SafetyState::Slewed,
        SafetyState::TooFast,
        SafetyState::Stopped,
        SafetyState::Engaging,
    ];
    for state in states {
        assert!(seen.contains(&format!("{state:?}")), "{state:?}: {seen:?}");
    }
    assert!(given.abs() > 0.01, "{given}");
    // The clutch turns a proxy by blending, which errs by the cube of half the angle of a tick.
    assert!((given - supplied).abs() < 1e-7, "{given} {supplied}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn the_accounts_hold_the_work_of_the_hands(
        strokes in prop::collection::vec(
            (0..3_u8, [-0.03..0.03_f64, -0.03..0.03, -0.03..0.03], [-0.4..0.4_f64, -0.4..0.4, -0.4..0.4]), 1..6,
        ),
    ) {
        let strokes: Vec<_> = strokes
            .into_iter()
            .map(|(event, by, turn)| (event, Vec3::from(by), Vec3::from(turn)))
            .collect();
        let (given, supplied, _) = works(limits(), &strokes);
        prop_assert!((given - supplied).abs() < 1e-7, "{} {}", given, supplied);
    }
}
