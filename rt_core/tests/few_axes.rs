//! The controller over devices of one and two degrees of freedom. The commands lie along the axes of the device, and no
//! account takes a force across these axes as rendered.
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
    Axes, Controller, ControllerConfig, DeviceError, DeviceState, EnergyAccount, Freedom,
    LocalModel, MAX_DEVICES, PassivityConfig, Pose, Scheme, Vec3,
};

const PERIOD: f64 = 1e-3;

fn controller(free: [bool; 3], turn: Vec3, max_force: f64, max_slew: f64) -> Controller {
    let mut config = ControllerConfig::default();
    let frame = DeviceFrame {
        rotation: UnitQuaternion::from_scaled_axis(turn),
        motion_scale: 1.5,
        ..DeviceFrame::at(Vec3::new(0.1, -0.2, 0.3))
    };
    let safety = SafetyConfig {
        actuated: Freedom::Along(Axes::new(free).unwrap()),
        max_force,
        max_moment: 0.0,
        max_slew,
        patience: 10,
        decay: 0.1,
        recovery: 0.1,
        ..SafetyConfig::unlimited(PERIOD)
    };
    let _ = config.devices.push(DeviceConfig { frame, safety });
    let _ = config.bodies.push(CouplingConfig {
        scheme: Scheme::Linear,
        period: PERIOD,
        blend: 0.5,
        age_limit: 1e3,
        decay: 0.1,
        recovery: 0.01,
        hold_damping: [1.0; MAX_DEVICES],
        passivity: PassivityConfig::new(PERIOD),
    });
    Controller::new(&config)
}

fn vector(size: f64) -> impl Strategy<Value = Vec3> {
    [-size..size, -size..size, -size..size].prop_map(|[x, y, z]| Vec3::new(x, y, z))
}

proptest! {
    #[test]
    fn commands_are_along_the_axes_and_the_account_is_the_work_of_the_device(
        axes in 1..7_u8,
        turn in vector(2.0),
        // A force across the axes, and a stiffness that turns motions along them into forces across them.
        force in vector(3.0),
        shear in vector(300.0),
        max_force in 0.2..20.0,
        max_slew in prop_oneof![Just(f64::INFINITY), 20.0..2000.0],
    ) {
        let free = [axes & 1 != 0, axes & 2 != 0, axes & 4 != 0];
        let freedom = Freedom::Along(Axes::new(free).unwrap());
        let mut controller = controller(free, turn, max_force, max_slew);
        let mut model = LocalModel::empty();
        model.head.sequence = 1;
        model.head.time_ns = 1;
        model.head.handle_count = 1;
        model.handles[0].pose = Pose::at(Vec3::new(0.1, -0.2, 0.3));
        model.handles[0].wrench.force = force;
        for axis in 0..3 {
            model.stiffness[0][0][(axis, axis)] = 400.0;
            model.stiffness[0][0][(axis, (axis + 1) % 3)] = shear[axis];
            model.stiffness[0][0][((axis + 1) % 3, axis)] = shear[axis];
        }
        prop_assert!(controller.accept(0, &model).is_ok());
        let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
        let (mut supplied, mut last, mut held) = (0.0, None, Vec3::zeros());
        let mut largest: f64 = 0.0;
        for k in 0..300_u64 {
            let t = k as f64 * PERIOD;
            let place = Vec3::new(libm::sin(31.0 * t), libm::sin(47.0 * t), libm::sin(23.0 * t)) * 5e-3;
            let place = freedom.part(&place);
            readings[0] = Ok(DeviceState { pose: Pose::at(place), ..DeviceState::resting() });
            if let Some(last) = last.replace(place) {
                supplied -= held.dot(&(place - last));
            }
            let (commands, telemetry) = controller.tick(1 + k * 1_000_000, &readings);
            held = commands[0].force;
            // To the last bit.
            prop_assert_eq!(freedom.part(&held), held);
            prop_assert!(held.norm() <= max_force * (1.0 + 1e-12));
            largest = largest.max(held.norm());
            // Rounding of works of order 0.1 J.
            let account = telemetry.bodies[0].energy.supplied;
            prop_assert!((account - supplied).abs() < 1e-13, "{account} {supplied}");
        }
        prop_assert!(largest > 0.0);
    }
}

#[test]
fn the_account_raises_the_part_of_a_weight_that_the_device_bears() {
    // The weight is 1.5 N at the hand. The device senses motions across its axis, but renders no force along them. A
    // force across the axis is no part of the force asked for.
    for (max_force, part) in [(20.0, 1.0), (0.75, 0.5)] {
        let free = [true, false, false];
        let mut controller = controller(free, Vec3::zeros(), max_force, f64::INFINITY);
        let mut model = LocalModel::empty();
        model.head.sequence = 1;
        model.head.time_ns = 1;
        model.head.period = PERIOD;
        model.head.handle_count = 1;
        model.handles[0].wrench.force = Vec3::new(-1.0, 3.0, 0.0);
        model.handles[0].weight = Vec3::x() * -1.0;
        controller.accept(0, &model).expect("a sound model");
        let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
        let mut energy = EnergyAccount::default();
        for k in 0..200_u64 {
            // The hand waits for the whole force, and then lifts the weight by 15 mm of the scene.
            let x = 1e-4 * k.saturating_sub(100).min(100) as f64;
            readings[0] = Ok(DeviceState {
                pose: Pose::at(Vec3::new(x, x, -x)),
                ..DeviceState::resting()
            });
            let (commands, telemetry) = controller.tick(1 + k * 1_000_000, &readings);
            energy = telemetry.bodies[0].energy;
            let force = commands[0].force.x;
            assert!(k < 50 || (force + 1.5 * part).abs() < 1e-12, "{k} {force}");
        }
        // Rounding of a hundred products.
        let lifted = 1.5 * 99e-4;
        for work in [energy.raised, energy.supplied] {
            assert!((work - part * lifted).abs() < 1e-12, "{energy:?} {part}");
        }
    }
}
