//! The controller over its devices: a device that was away comes back without a blow to the others.
// The lints of `rt_core/clippy.toml` are for the law, not for its tests.
#![allow(clippy::disallowed_macros, clippy::disallowed_types)]

use proptest::prelude::*;
use rt_core::Reading;
use rt_core::controller::{DeviceConfig, cycle, cycle_timed};
use rt_core::coupling::{CouplingConfig, HostState};
use rt_core::device_frame::DeviceFrame;
use rt_core::local_model::ModelFault;
use rt_core::safety::{SafetyConfig, SafetyState};
use rt_core::{
    Capabilities, Controller, ControllerConfig, Device, DeviceError, DeviceState, Freedom,
    LocalModel, MAX_DEVICES, PassivityConfig, Pose, Scheme, Telemetry, TickTime, Vec3, Wrench,
};
use std::cell::RefCell;

const PERIOD: f64 = 1e-3;
const PATIENCE: u32 = 10;
/// Stiffness of the spring between the two handles (N/m).
const SPRING: f64 = 200.0;

fn body(scheme: Scheme) -> CouplingConfig {
    CouplingConfig {
        scheme,
        period: PERIOD,
        blend: 0.0,
        age_limit: 1e3,
        decay: 0.1,
        recovery: PERIOD,
        hold_damping: [0.0; MAX_DEVICES],
        passivity: PassivityConfig::new(PERIOD),
    }
}

fn controller(scheme: Scheme) -> Controller {
    let mut config = ControllerConfig::default();
    for _ in 0..2 {
        let frame = DeviceFrame {
            motion_scale: 2.0,
            ..DeviceFrame::at(Vec3::zeros())
        };
        let safety = SafetyConfig {
            actuated: Freedom::Three,
            max_force: 8.0,
            max_moment: 0.0,
            patience: PATIENCE,
            decay: 0.1,
            recovery: 0.1,
            ..SafetyConfig::unlimited(PERIOD)
        };
        let _ = config.devices.push(DeviceConfig { frame, safety });
    }
    let _ = config.bodies.push(body(scheme));
    let mut controller = Controller::new(&config);
    controller
        .accept(0, &model(1, SPRING))
        .expect("a sound model");
    controller
}

/// A model with a spring between the two handles (N/m).
fn model(sequence: u64, spring: f64) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head.sequence = sequence;
    model.head.epoch = 3;
    model.head.time_ns = sequence;
    model.head.period = PERIOD;
    model.head.handle_count = 2;
    model.handles[1].device = 1;
    for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        model.stiffness[i][j][(0, 0)] = if i == j { spring } else { -spring };
    }
    model
}

/// One tick with the devices at these positions along x; `None` gives no state.
fn tick(
    controller: &mut Controller,
    places: [Option<f64>; 2],
) -> ([Wrench; MAX_DEVICES], Telemetry) {
    let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
    for (reading, x) in readings.iter_mut().zip(places) {
        *reading = x.ok_or(DeviceError::NoReport).map(|x| DeviceState {
            pose: Pose::at(Vec3::x() * x),
            ..DeviceState::resting()
        });
    }
    controller.tick(1, &readings)
}

#[test]
fn a_device_that_returns_elsewhere_continues_from_its_last_pose() {
    let mut controller = controller(Scheme::Linear);
    let apart = [Some(0.0), Some(2e-3)];
    for _ in 0..10 {
        tick(&mut controller, apart);
    }
    let (before, _) = tick(&mut controller, apart);
    // Stretched by 2 * 2 mm in the scene; the force is scaled once more from the proxy to the device.
    assert!((before[0].force.x - 2.0 * SPRING * 4e-3).abs() < 1e-12);
    for _ in 0..=PATIENCE {
        tick(&mut controller, [Some(0.0), None]);
    }
    // The device comes back 30 mm farther away.
    let (back, telemetry) = tick(&mut controller, [Some(0.0), Some(32e-3)]);
    assert_eq!(telemetry.devices[1].safety, SafetyState::Recovering);
    assert!((back[0].force - before[0].force).norm() < 1e-12);
    assert!((telemetry.devices[1].pose.position.x - 4e-3).abs() < 1e-12);
    // From here on, every millimetre counts as before.
    for _ in 0..200 {
        tick(&mut controller, [Some(0.0), Some(32e-3)]);
    }
    let (moved, _) = tick(&mut controller, [Some(0.0), Some(33e-3)]);
    let change = moved[0].force.x - before[0].force.x;
    assert!((change - 2.0 * SPRING * 2e-3).abs() < 1e-12);
    assert!((moved[1].force.x + moved[0].force.x).abs() < 1e-12);
}

#[test]
fn a_device_that_misses_a_few_reads_keeps_its_place() {
    let mut controller = controller(Scheme::Linear);
    tick(&mut controller, [Some(0.0), Some(0.0)]);
    for _ in 0..PATIENCE {
        tick(&mut controller, [Some(0.0), None]);
    }
    let (_, telemetry) = tick(&mut controller, [Some(0.0), Some(1e-3)]);
    assert_eq!(telemetry.devices[1].pose.position.x, 2e-3);
}

#[test]
fn a_device_that_was_absent_from_the_start_begins_at_its_place() {
    let mut controller = controller(Scheme::Linear);
    for _ in 0..100 {
        tick(&mut controller, [Some(0.0), None]);
    }
    let (_, telemetry) = tick(&mut controller, [Some(0.0), Some(5e-3)]);
    assert_eq!(telemetry.devices[1].pose.position.x, 10e-3);
}

#[test]
fn a_hold_after_a_device_came_back_is_as_stiff_as_before() {
    let mut controller = controller(Scheme::Capped);
    // The device is pulled at 5 cm/s (a tenth of a millimetre in the scene per tick) and goes away. It comes back 20 mm
    // farther away, and is pulled on while its force comes back.
    let mut x = 0.0;
    let pull = |controller: &mut Controller, x: &mut f64, ticks: u32| {
        let mut last = None;
        for _ in 0..ticks {
            *x += 5e-5;
            last = Some(tick(controller, [Some(0.0), Some(*x)]));
        }
        last.expect("some ticks")
    };
    pull(&mut controller, &mut x, 100);
    for _ in 0..=PATIENCE {
        tick(&mut controller, [Some(0.0), None]);
    }
    x += 20e-3;
    let (_, back) = tick(&mut controller, [Some(0.0), Some(x)]);
    assert!((back.devices[1].pose.position.x - 10e-3).abs() < 1e-12);
    let (_, halfway) = pull(&mut controller, &mut x, 50);
    // Halfway, a smooth step is at one half, and its mean up to there is 3/16: of 5 mm in the scene.
    assert!((halfway.devices[1].pose.position.x - 10e-3 - 0.1875 * 5e-3).abs() < 0.05e-3);
    let (wrenches, telemetry) = pull(&mut controller, &mut x, 100);
    let stretch = telemetry.devices[1].pose.position.x;
    // Half of 10 mm while the force came back, and 5 mm afterwards.
    assert!((stretch - 10e-3 - 5e-3 - 5e-3).abs() < 0.1e-3);
    // The force is whole, because the hands supplied all the stored energy. It is scaled once more from the proxy to
    // the device.
    let asked = 2.0 * SPRING * stretch;
    assert!((wrenches[0].force.x - asked).abs() < 0.01 * asked);
    let energy = telemetry.bodies[0].energy;
    assert_eq!(energy.capped, 0);
    // Half a step of each tick: `K D^2 / 2` each.
    assert!((energy.supplied - energy.stored).abs() < 0.2e-3);
}

proptest! {
    #[test]
    fn the_body_gets_the_energy_of_the_hands_while_a_device_comes_back(
        steps in prop::collection::vec((-2e-4..2e-4, -2e-4..2e-4), 150), elsewhere in -0.05..0.05,
    ) {
        let mut controller = controller(Scheme::Linear);
        let (mut places, mut commands) = ([0.0, 3e-3], [Wrench::zero(); MAX_DEVICES]);
        let mut given = 0.0;
        let mut telemetry = None;
        for (k, (one, other)) in steps.into_iter().enumerate() {
            // The device rests when it vanishes, and is at another place when it returns. No force acts meanwhile.
            let away = (30..30 + 2 * PATIENCE as usize).contains(&k);
            let moved = [one, if away { 0.0 } else { other }];
            if k == 30 + 2 * PATIENCE as usize {
                places[1] += elsewhere;
            }
            for ((place, moved), command) in places.iter_mut().zip(moved).zip(&commands) {
                *place += moved;
                given -= command.force.x * moved;
            }
            let seen = [Some(places[0]), Some(places[1]).filter(|_| !away)];
            let (next, record) = tick(&mut controller, seen);
            (commands, telemetry) = (next, Some(record));
        }
        let energy = telemetry.expect("some ticks").bodies[0].energy;
        // Rounding of a hundred and fifty products of newtons and tenths of millimetres.
        prop_assert!((energy.supplied - given).abs() < 1e-15, "{} {given}", energy.supplied);
    }
}

/// A device at a place along x (m) that notes its calls.
struct Noted<'a> {
    index: usize,
    x: f64,
    takes: bool,
    calls: &'a RefCell<Vec<String>>,
}

impl Device for Noted<'_> {
    fn capabilities(&self) -> Capabilities {
        unreachable!("the tick knows the limits of its devices")
    }
    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        self.calls
            .borrow_mut()
            .push(format!("read {} {now_ns}", self.index));
        Ok(DeviceState {
            pose: Pose::at(Vec3::x() * self.x),
            ..DeviceState::resting()
        })
    }
    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        let pushed = wrench.force.x != 0.0;
        self.calls
            .borrow_mut()
            .push(format!("write {} {now_ns} {pushed}", self.index));
        if self.takes {
            Ok(())
        } else {
            Err(DeviceError::Busy)
        }
    }
}

#[test]
fn a_cycle_reads_all_devices_then_computes_then_writes_all_devices() {
    for (took_ns, renders) in [(1_000_000, true), (9_000_000, false)] {
        let mut controller = controller(Scheme::Linear);
        tick(&mut controller, [Some(0.0), Some(2e-3)]);
        let calls = RefCell::new(Vec::new());
        let device = |index: usize| Noted {
            index,
            x: 2e-3 * index as f64,
            takes: index == 0,
            calls: &calls,
        };
        let (mut first, mut second) = (device(0), device(1));
        let time = TickTime {
            now_ns: 7,
            lateness_ns: 3,
        };
        let mut devices = [&mut first, &mut second];
        let (telemetry, refused) = cycle_timed(&mut controller, &mut devices, time, || {
            let calls = calls.borrow().len() as u64;
            calls + if calls < 2 { 0 } else { took_ns }
        });
        let expected = [
            "read 0 7".into(),
            "read 1 7".into(),
            format!("write 0 7 {renders}"),
            format!("write 1 7 {renders}"),
        ];
        assert_eq!(*calls.borrow(), expected);
        let stamps = &telemetry.stamps;
        assert_eq!((stamps.began_ns, stamps.read_ns[0]), (0, 1));
        assert_eq!(stamps.read_ns[1], took_ns + 2);
        assert_eq!(stamps.written_ns[..3], [took_ns + 3, took_ns + 4, 0]);
        assert_eq!(refused, 1);
        let times = (
            telemetry.time_ns,
            telemetry.lateness_ns,
            telemetry.took_ns,
            time.clock_ns(),
        );
        assert_eq!(times, (7, 3, took_ns + 2, 10));
        for device in telemetry.devices() {
            let state = if renders {
                SafetyState::Normal
            } else {
                SafetyState::Silent
            };
            assert_eq!(device.safety, state);
            assert_eq!(device.wrench.force.x != 0.0, renders);
        }
        let (telemetry, refused) = cycle(&mut controller, &mut devices, 1_000_007);
        assert_eq!(
            (telemetry.took_ns, telemetry.lateness_ns, refused),
            (0, 0, 1)
        );
    }
}

#[test]
fn the_record_of_a_tick_tells_what_each_device_and_body_did() {
    let mut controller = controller(Scheme::Linear);
    let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
    for k in 0..20_u64 {
        for (device, reading) in readings.iter_mut().enumerate().take(2) {
            let mut state = DeviceState {
                pose: Pose::at(Vec3::x() * (2e-3 * device as f64)),
                buttons: 5 + device as u32,
                device_time_ns: 100 * k + device as u64,
                ..DeviceState::resting()
            };
            state.twist.linear.x = 0.1;
            // The second device gives no state in the last tick.
            *reading = if device == 1 && k == 19 {
                Err(DeviceError::Busy)
            } else {
                Ok(state)
            };
        }
        let (commands, record) = controller.tick(1 + k * 1_000_000, &readings);
        assert_eq!((record.tick, record.time_ns), (k, 1 + k * 1_000_000));
        assert_eq!((record.device_count, record.body_count), (2, 1));
        assert_eq!(record.readings, readings);
        for (index, device) in record.devices().enumerate() {
            let fresh = readings[index].is_ok();
            let told = if fresh { k } else { k - 1 };
            assert_eq!(device.device_time_ns, 100 * told + index as u64);
            assert_eq!((device.buttons, device.fresh), (5 + index as u32, fresh));
            // The motion of the proxy is twice that of the device.
            assert_eq!(device.pose.position.x, 4e-3 * index as f64);
            assert_eq!(device.twist.linear.x, 0.2);
            assert_eq!(device.wrench, commands[index]);
            assert_eq!(device.safety, SafetyState::Normal);
        }
        let body = &record.bodies[0];
        assert_eq!((body.sequence, body.epoch), (1, 3));
        assert_eq!(body.age_ns, k * 1_000_000);
        assert_eq!(body.trust, 1.0);
        assert_eq!(body.state, HostState::Live);
        let energy = controller.energy().next().expect("a body");
        assert_eq!(body.energy, energy);
    }
}

#[test]
fn the_record_of_a_tick_tells_what_the_cap_withholds() {
    let mut controller = controller(Scheme::Capped);
    let place = |k: u32| [Some(0.0), Some(1e-4 * f64::from(k.min(100)))];
    let mut withheld = 0;
    for k in 0..200 {
        if k == 100 {
            // The spring is suddenly stiffer, so it would store more energy than the hands supplied.
            let accepted = controller.accept(0, &model(2, 5.0 * SPRING));
            accepted.expect("a sound model");
        }
        let (_, record) = tick(&mut controller, place(k));
        withheld += u64::from(record.bodies[0].withheld.is_noticeable());
    }
    let held_back = controller.held_back_by_bodies().next().expect("a body");
    assert!(withheld > 50 && withheld == held_back.capped.ticks);
}

#[test]
fn a_copy_into_another_controller_continues_as_the_original_does() {
    let run = |controller: &mut Controller, from: u32| {
        let place = |k: u32| f64::from(k) * 1e-4;
        let ticks = (from..from + 30).map(|k| tick(controller, [Some(place(k)), Some(-place(k))]));
        ticks.last().expect("some ticks")
    };
    let mut original = controller(Scheme::Capped);
    run(&mut original, 0);
    for body in 1..3 {
        let stray = original.accept(body, &LocalModel::empty());
        assert_eq!(stray, Err(ModelFault::Handles));
    }
    // Into one with as many bodies, into one with none, and into one with more.
    let mut more = ControllerConfig::default();
    for _ in 0..3 {
        let _ = more.bodies.push(body(Scheme::Linear));
    }
    let mut driven = controller(Scheme::Capped);
    run(&mut driven, 7);
    let empty = Controller::new(&ControllerConfig::default());
    for other in [&driven, &empty, &Controller::new(&more)] {
        let mut copy = other.clone();
        copy.clone_from(&original);
        assert_eq!((copy.stray_models(), original.stray_models()), (2, 2));
        assert_eq!(run(&mut copy, 30), run(&mut original.clone(), 30));
        assert_eq!(copy.energy().count(), 1);
    }
}
