//! Engagement over whole ticks, on springs whose force is known: the force of a device before it is armed, while the
//! hand holds the dead-man button, and after an emergency stop.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use proptest::prelude::*;
use rt_core::Reading;
use rt_core::controller::DeviceConfig;
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::engage::{ARM_ORDER, EngageConfig, STOP_ORDER};
use rt_core::heat::HeatConfig;
use rt_core::safety::{SafetyConfig, SafetyState};
use rt_core::{
    Controller, ControllerConfig, DeviceError, DeviceState, Freedom, LocalModel, MAX_DEVICES,
    PassivityConfig, Pose, Scheme, Telemetry, Vec3, Wrench,
};

const PERIOD: f64 = 1e-3;
/// Stiffness of the spring between each handle and the world (N/m).
const SPRING: f64 = 200.0;
const RAMP: f64 = 0.1;
/// The buttons of a device in these tests.
const ARM: u32 = 0b001;
const DEAD_MAN: u32 = 0b010;
const STOP: u32 = 0b100;

/// Two devices, each on a spring of one body of its own.
fn controller(scheme: Scheme, engage: EngageConfig, heat: HeatConfig) -> Controller {
    let mut config = ControllerConfig::default();
    let mut model = LocalModel::empty();
    model.head.sequence = 1;
    model.head.time_ns = 1;
    model.head.period = PERIOD;
    model.head.handle_count = 1;
    for axis in 0..3 {
        model.stiffness[0][0][(axis, axis)] = SPRING;
    }
    for _ in 0..2 {
        let safety = SafetyConfig {
            actuated: Freedom::Three,
            max_force: 8.0,
            engage,
            heat,
            ..SafetyConfig::unlimited(PERIOD)
        };
        let frame = DeviceFrame::at(Vec3::zeros());
        let _ = config.devices.push(DeviceConfig { frame, safety });
        let _ = config.bodies.push(CouplingConfig {
            scheme,
            period: PERIOD,
            blend: 0.0,
            age_limit: 1e3,
            decay: 0.1,
            recovery: PERIOD,
            hold_damping: [0.0; MAX_DEVICES],
            passivity: PassivityConfig::new(PERIOD),
        });
    }
    let mut controller = Controller::new(&config);
    for device in 0..2 {
        model.handles[0].device = device;
        let accepted = controller.accept(usize::from(device), &model);
        accepted.expect("a sound model");
    }
    controller
}

fn engage() -> EngageConfig {
    EngageConfig {
        armed: false,
        arm: ARM,
        stop: STOP,
        ramp: RAMP,
        ..EngageConfig::default()
    }
}

/// One tick with each device at a place along x (m) and with its buttons.
fn tick(
    controller: &mut Controller,
    devices: [(f64, u32); 2],
) -> ([Wrench; MAX_DEVICES], Telemetry) {
    let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
    for (reading, (x, buttons)) in readings.iter_mut().zip(devices) {
        *reading = Ok(DeviceState {
            pose: Pose::at(Vec3::x() * x),
            buttons,
            ..DeviceState::resting()
        });
    }
    controller.tick(1, &readings)
}

/// The tick after `ticks` equal ticks.
fn after(
    controller: &mut Controller,
    ticks: usize,
    devices: [(f64, u32); 2],
) -> ([Wrench; MAX_DEVICES], Telemetry) {
    for _ in 0..ticks {
        tick(controller, devices);
    }
    tick(controller, devices)
}

#[test]
fn a_disarmed_device_gets_no_force_and_its_proxy_waits() {
    let config = EngageConfig {
        waits_at: Vec3::new(0.01, 0.0, 0.0),
        ..engage()
    };
    let mut controller = controller(Scheme::Linear, config, HeatConfig::default());
    for x in [0.03, 0.04, 0.05] {
        let (commands, telemetry) = after(&mut controller, 50, [(x, 0), (0.0, 0)]);
        assert_eq!(commands[0], Wrench::zero());
        assert_eq!(telemetry.devices[0].safety, SafetyState::Disarmed);
        // Rounding of a sum of displacements.
        let place = telemetry.devices[0].pose.position;
        assert!((place - config.waits_at).norm() < 1e-15);
    }
    // The hand arms the device at its present place. The proxy starts at the place where it waited, nearly without
    // force.
    let (commands, telemetry) = tick(&mut controller, [(0.05, ARM), (0.0, 0)]);
    assert_eq!(telemetry.devices[0].safety, SafetyState::Engaging);
    // A hundredth of the ramp is 0.0003 of its smooth step.
    assert!(commands[0].force.norm() < 4e-4 * SPRING * 0.01);
    // The other device stays disarmed.
    assert_eq!(telemetry.devices[1].safety, SafetyState::Disarmed);
    // After the ramp, 10 mm of the hand are 10 mm of the proxy.
    after(&mut controller, 110, [(0.05, 0), (0.0, 0)]);
    let (commands, telemetry) = tick(&mut controller, [(0.06, 0), (0.0, 0)]);
    assert_eq!(telemetry.devices[0].safety, SafetyState::Normal);
    // The proxy waited at 10 mm, which stretches the spring, and has moved by 10 mm since.
    assert!((commands[0].force.x + SPRING * 0.02).abs() < 1e-12);
}

#[test]
fn a_stop_of_one_device_stops_all_in_the_same_tick_until_each_is_armed_again() {
    let mut controller = controller(
        Scheme::Linear,
        EngageConfig {
            armed: true,
            ..engage()
        },
        HeatConfig::default(),
    );
    after(&mut controller, 150, [(0.0, 0); 2]);
    let (commands, _) = tick(&mut controller, [(0.01, 0); 2]);
    assert!((commands[1].force.x + SPRING * 0.01).abs() < 1e-12);
    for stop in [STOP, STOP_ORDER] {
        let (commands, telemetry) = tick(&mut controller, [(0.01, stop), (0.01, 0)]);
        for device in 0..2 {
            assert_eq!(commands[device], Wrench::zero());
            assert_eq!(telemetry.devices[device].safety, SafetyState::Stopped);
        }
        // Only an order or a button brings the force back.
        let (commands, _) = after(&mut controller, 300, [(0.01, 0); 2]);
        assert_eq!(commands[1], Wrench::zero());
        // One device by its button, the other by an order.
        after(&mut controller, 150, [(0.01, ARM), (0.01, ARM_ORDER)]);
        let (commands, telemetry) = tick(&mut controller, [(0.02, ARM), (0.02, ARM_ORDER)]);
        for device in 0..2 {
            assert_eq!(telemetry.devices[device].safety, SafetyState::Normal);
            assert!(commands[device].force.x < -1.0);
        }
        tick(&mut controller, [(0.01, 0); 2]);
    }
    let counts: Vec<_> = controller.safety_counters().collect();
    assert!(counts.iter().all(|counts| counts.stopped == 2));
}

#[test]
fn a_force_fades_in_20_ms_when_the_hand_lets_go_of_the_dead_man_button() {
    let config = EngageConfig {
        armed: true,
        dead_man: DEAD_MAN,
        ..engage()
    };
    let mut controller = controller(Scheme::Linear, config, HeatConfig::default());
    let (commands, telemetry) = after(&mut controller, 10, [(0.01, 0); 2]);
    assert_eq!(commands[0], Wrench::zero());
    assert_eq!(telemetry.devices[0].safety, SafetyState::HandsOff);
    after(&mut controller, 150, [(0.0, DEAD_MAN); 2]);
    let (held, _) = tick(&mut controller, [(0.01, DEAD_MAN); 2]);
    assert!(held[0].force.x < -1.0);
    let mut before = held[0].force.x;
    for _ in 0..20 {
        let (commands, _) = tick(&mut controller, [(0.01, 0), (0.01, DEAD_MAN)]);
        // A smooth step of 20 ticks: none changes the force by more than 1.5 times the mean change.
        let change = commands[0].force.x - before;
        assert!((-1e-12..=-held[0].force.x * 1.5 / 20.0 + 1e-12).contains(&change));
        before = commands[0].force.x;
    }
    assert_eq!(before, 0.0);
    let counts: Vec<_> = controller.safety_counters().collect();
    assert_eq!((counts[0].hands_off, counts[1].hands_off), (1, 0));
}

#[test]
fn the_weight_of_the_grip_is_borne_while_the_device_is_engaged_and_counts_for_no_hand() {
    let grip_force = Vec3::new(0.0, 0.0, 0.7);
    let config = EngageConfig {
        grip_force,
        ..engage()
    };
    let mut controller = controller(Scheme::Linear, config, HeatConfig::default());
    let (commands, _) = after(&mut controller, 10, [(0.0, 0); 2]);
    assert_eq!(commands[0], Wrench::zero());
    let (commands, telemetry) = after(&mut controller, 150, [(0.0, ARM); 2]);
    assert_eq!(commands[0].force, grip_force);
    assert_eq!(telemetry.devices[0].wrench, Wrench::zero());
    let (commands, _) = tick(&mut controller, [(0.0, STOP), (0.0, 0)]);
    assert_eq!(commands[0], Wrench::zero());
}

#[test]
fn hot_motors_get_the_continuous_force_and_the_state_says_so() {
    let config = EngageConfig::default();
    let heat = HeatConfig {
        continuous_force: 1.0,
        time: 0.5,
    };
    let mut controller = controller(Scheme::Linear, config, heat);
    let (commands, telemetry) = after(&mut controller, 5, [(0.03, 0), (0.0, 0)]);
    assert!((commands[0].force.x + SPRING * 0.03).abs() < 1e-12);
    assert_eq!(telemetry.devices[0].safety, SafetyState::Normal);
    let (commands, telemetry) = after(&mut controller, 5000, [(0.03, 0), (0.0, 0)]);
    assert_eq!(telemetry.devices[0].safety, SafetyState::Hot);
    assert_eq!(telemetry.devices[1].safety, SafetyState::Normal);
    // The mean square approaches its limit exponentially, over ten of its time constants.
    assert!((commands[0].force.x + 1.0).abs() < 1e-2);
    let trip = controller.first_trips().next().flatten().expect("a trip");
    assert_eq!(trip.state, SafetyState::Hot);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// For any buttons and orders while the hands move, the hands gain no energy: a stop, a release and an engagement
    /// take energy away or leave it in the body.
    #[test]
    fn no_engagement_gives_energy_to_a_hand(
        strokes in prop::collection::vec((-0.03..0.03_f64, 20..200_usize, any::<u32>()), 4..20),
        dead_man in any::<bool>(),
    ) {
        let config = EngageConfig {
            dead_man: if dead_man { DEAD_MAN } else { 0 },
            ..engage()
        };
        let mut controller = controller(Scheme::Capped, config, HeatConfig::default());
        let allowed = ARM | DEAD_MAN | STOP | ARM_ORDER | STOP_ORDER;
        let (mut x, mut force, mut given) = (0.0, 0.0, 0.0);
        for (to, ticks, buttons) in strokes {
            let from = x;
            for step in 1..=ticks {
                // A smooth stroke.
                let part = 0.5 - 0.5 * (std::f64::consts::PI * step as f64 / ticks as f64).cos();
                let now = from + (to - from) * part;
                given += force * (now - x);
                x = now;
                let (commands, _) = tick(&mut controller, [(x, buttons & allowed), (0.0, 0)]);
                force = commands[0].force.x;
                // The bar of the project for the net energy at a hand. Most of it is left unused: a sampled spring
                // gives at most half of its stiffness times the square of a tick's displacement before the cap acts.
                prop_assert!(given < 1e-3, "{} J", given);
            }
        }
    }
}

#[test]
fn a_stopped_device_that_is_lost_keeps_no_other_device_from_being_armed() {
    let armed = EngageConfig {
        armed: true,
        ..engage()
    };
    let mut controller = controller(Scheme::Linear, armed, HeatConfig::default());
    after(&mut controller, 150, [(0.0, 0); 2]);
    tick(&mut controller, [(0.01, STOP_ORDER), (0.01, STOP_ORDER)]);
    // The first device is lost with the order in its last state. The operator arms.
    let mut last = SafetyState::Normal;
    for k in 0..300 {
        let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
        readings[1] = Ok(DeviceState {
            pose: Pose::at(Vec3::x() * 0.01),
            buttons: if k < 50 { STOP_ORDER } else { ARM_ORDER },
            ..DeviceState::resting()
        });
        let (commands, telemetry) = controller.tick(1, &readings);
        assert_eq!(commands[0], Wrench::zero());
        last = telemetry.devices[1].safety;
        assert!(k >= 50 || last == SafetyState::Stopped, "{k}");
    }
    assert_eq!(last, SafetyState::Normal);
}
