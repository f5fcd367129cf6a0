//! Every device and every wrapper passes the one suite of `devices::conformance`.

use devices::conformance::Suite;
use devices::hid::{Command, HidDevice, ReadReport, WriteReport};
use devices::panel::{Operated, Panel};
use devices::scripted::{Scripted, small};
use devices::{AnyDevice, DeviceModel, Registry, ReplayDevice, Request};
use firmware_proto::device::{Device as Firmware, Geometry, Inputs, Measured};
use firmware_proto::report::{Model, StateReport, axes};
use rt_core::{Corruption, Device, DeviceError, DeviceState, Freedom, Rendering, Vec3, Wrench};
use sim::firmware::state_bytes;
use sim::protocol::Protocol;
use sim::{
    Delayed, EmulatedDriver, Fault, Faulty, Hand, Held, SimDevice, Simulated, Task, TaskKind,
    Tremor, Wired,
};
use std::sync::{Arc, Mutex};

const MS: u64 = 1_000_000;

fn model(name: &str) -> DeviceModel {
    DeviceModel::named(name).expect("it is carried along")
}

/// A hand that is never still.
fn hand() -> Hand {
    let task = Task::new(TaskKind::Rub, Vec3::new(0.0, 0.0, -1.0));
    let path = task.trajectory(7).expect("a hand can follow it");
    Hand::new(path).with_tremor(Tremor::new(1e-4, 7).expect("a sound tremor"))
}

fn simulated(name: &str) -> SimDevice {
    SimDevice::new(model(name), Some(hand()), 1e-3).expect("a sound device")
}

#[test]
fn simulated_devices_of_every_model_conform() {
    for (name, model) in DeviceModel::all() {
        Suite::new(name).check(|| Box::new(simulated(name)));
        // A free device.
        let free = || SimDevice::new(model, None, 1e-3).expect("a sound device");
        Suite::new(name).check(|| Box::new(free()));
    }
}

#[test]
fn devices_behind_the_firmware_protocol_conform() {
    for name in ["omega3", "virtuose6d"] {
        Suite::new("wired").check(|| Box::new(Wired::new(simulated(name))));
    }
}

#[test]
fn devices_that_fail_on_time_conform() {
    let faults = [
        (50 * MS..100 * MS, Fault::Silent),
        (120 * MS..150 * MS, Fault::Gone),
        (200 * MS..210 * MS, Fault::Corrupt(Corruption::CheckSum)),
        (300 * MS..350 * MS, Fault::RefusesCommands),
    ];
    for name in ["falcon", "virtuose6d"] {
        let make = || {
            Box::new(Faulty::new(
                Box::new(Wired::new(simulated(name))),
                faults.to_vec(),
            ))
        };
        Suite::new("faulty").states(500 - 90).check(make);
    }
}

#[test]
fn a_faulty_device_follows_its_list() {
    let faults = vec![
        (10 * MS..20 * MS, Fault::Gone),
        (30 * MS..40 * MS, Fault::NotANumber),
        (50 * MS..60 * MS, Fault::RefusesCommands),
    ];
    let mut device = Faulty::new(Box::new(simulated("touch")), faults);
    let push = Wrench {
        force: Vec3::new(0.5, 0.0, 0.0),
        moment: Vec3::zeros(),
    };
    for k in 0..70 {
        let (now, gone) = (k * MS, (10..20).contains(&k));
        let state = device.read(now);
        assert_eq!(state.is_err(), gone, "tick {k}");
        let finite = state.is_ok_and(|state| state.is_finite());
        assert_eq!(finite, !gone && !(30..40).contains(&k), "tick {k}");
        let taken = device.write(now, &push).is_ok();
        assert_eq!(taken, !gone && !(50..60).contains(&k), "tick {k}");
        // A device that is gone lets go. A device that takes no wrench holds its last wrench.
        let held = device.probe().expect("a simulation knows").held.force;
        let expected = if gone { Vec3::zeros() } else { push.force };
        assert_eq!(held, expected, "tick {k}");
    }
}

/// A device that let go, or that has a fault, reports it through every wrapper: the wire, the delay and the operator.
#[test]
fn a_device_that_lets_go_says_so_behind_every_wrapper() {
    let faults = vec![
        (10 * MS..20 * MS, Fault::LetsGo),
        (30 * MS..40 * MS, Fault::Broken(4)),
    ];
    let faulty = Faulty::new(Box::new(simulated("touch")), faults);
    let delayed = Delayed::new(Wired::new(faulty), 0.0);
    let mut device = Operated::new(Box::new(delayed), Panel::default(), &[]);
    let push = Wrench {
        force: Vec3::new(0.5, 0.0, 0.0),
        moment: Vec3::zeros(),
    };
    for k in 0..50 {
        let expected = match k {
            10..20 => Rendering::LetGo,
            30..40 => Rendering::Fault(4),
            _ => Rendering::Commanded,
        };
        let state = device.read(k * MS).expect("it is there");
        assert_eq!(state.rendering, expected, "tick {k}");
        device.write(k * MS, &push).expect("it takes any wrench");
        // The delay gives the wrench to the device at the next read.
        device.read(k * MS).expect("it is there");
        let held = device.probe().expect("a simulation knows").held.force;
        assert_eq!(
            held != Vec3::zeros(),
            expected == Rendering::Commanded,
            "tick {k}"
        );
    }
    assert_eq!(device.refused_wrenches(), Some(20));
}

#[test]
fn recordings_conform() {
    let mut hand = simulated("delta3");
    let readings: Vec<_> = (0..500).map(|k| hand.read(k * MS)).collect();
    let holes = readings.iter().enumerate().map(|(k, reading)| match k {
        100..130 => Err(DeviceError::NoReport),
        _ => *reading,
    });
    let recordings = [
        (readings.clone(), 500),
        (holes.collect(), 470),
        (Vec::new(), 0),
    ];
    for (readings, states) in recordings {
        let make = || Box::new(ReplayDevice::new(hand.capabilities(), readings.clone()));
        Suite::new("replay").states(states).check(make);
    }
}

/// A delta.3, opened through the registry.
fn open(registry: &Registry, driver: &str, index: usize) -> AnyDevice {
    opened(registry, driver, index, "delta3")
}

/// A device of that name, opened through the registry.
fn opened(registry: &Registry, driver: &str, index: usize, name: &str) -> AnyDevice {
    let model = model(name);
    let request = Request {
        index,
        ..Request::new(&model, "")
    };
    registry.open(driver, &request).expect("it can be opened")
}

#[test]
fn simulated_devices_through_the_door_conform() {
    let held = |wired| Held {
        hand: Some(hand()),
        wired,
        start: Vec3::zeros(),
        protocol: Protocol::Reports,
    };
    let registry = Registry::new().with(Simulated::new(vec![held(false), held(true)]));
    // The third device is free.
    for index in 0..3 {
        Suite::new("door").check(|| open(&registry, "sim", index));
    }
}

#[test]
fn emulated_devices_through_the_door_conform() {
    let held = |protocol| Held {
        hand: Some(hand()),
        wired: false,
        start: Vec3::zeros(),
        protocol,
    };
    let devices = [
        ("delta3", Protocol::Reports),
        ("omega3", Protocol::Stream),
        ("woodenhaptics", Protocol::WoodenHaptics),
        ("falcon", Protocol::Falcon),
    ];
    let protocols = devices.map(|(_, protocol)| held(protocol)).to_vec();
    let registry = Registry::new().with(EmulatedDriver::new(protocols));
    for (index, (name, _)) in devices.into_iter().enumerate() {
        // A torque of the Falcon is a whole number of 0.1 mN m, and a current of WoodenHaptics one of milliamperes: each is
        // some millinewtons at the handle.
        let suite = Suite::new(name).rounded(1e-3);
        suite.check(|| opened(&registry, "emulated", index, name));
    }
}

/// The far end of a fake HID: a simulated device behind the device's side of the protocol. It sends a report each time
/// it is asked, and goes away after a number of reports.
struct FarEnd {
    device: SimDevice,
    firmware: Firmware,
    asked: u16,
    /// A report was read, and the next has not come yet.
    read: bool,
    most: u16,
}

impl FarEnd {
    fn new(device: SimDevice, most: u16) -> Self {
        let capabilities = device.capabilities();
        let model = Model {
            sensed: axes::ALL,
            actuated: axes::ALL,
            max_force: (capabilities.max_force * 1e6) as u32,
            max_moment: (capabilities.max_moment * 1e6) as u32,
            rate: [1, 1000],
            name: [b'x'; 16],
            ..Model::default()
        };
        let mut firmware = Firmware::new(model, Geometry::default());
        assert!(firmware.home() && firmware.homed());
        Self {
            device,
            firmware,
            asked: 0,
            read: false,
            most,
        }
    }

    fn now_us(&self) -> u32 {
        u32::from(self.asked) * 1000
    }

    fn send(&mut self, buffer: &mut [u8]) -> Result<usize, i32> {
        if self.asked >= self.most {
            return Err(19);
        }
        self.read = !self.read;
        if !self.read {
            return Ok(0);
        }
        let now_us = self.now_us();
        let state = self.device.read(u64::from(now_us) * 1000).map_err(|_| 5)?;
        let report = StateReport::decode(&state_bytes(&state, 0)).map_err(|_| 71)?;
        let measured = Measured::Pose {
            position: report.position,
            orientation: report.orientation,
            velocity: report.velocity,
            angular_velocity: report.angular_velocity,
        };
        let mut report = self.firmware.report(now_us, Inputs::default(), &measured);
        self.asked += 1;
        // Now and then one is damaged on its path.
        if self.asked.is_multiple_of(50) {
            report[20] ^= 1;
        }
        buffer[..report.len()].copy_from_slice(&report);
        Ok(report.len())
    }

    fn take(&mut self, command: &Command) -> Result<(), i32> {
        let now_us = self.now_us();
        let taken = self.firmware.receive(&command[1..], now_us);
        let wrench = self.firmware.actuate(now_us);
        let [force, moment] =
            [wrench.force, wrench.moment].map(|v| Vec3::from(v.map(|x| f64::from(x) / 1e6)));
        let now_ns = u64::from(now_us) * 1000;
        let held = self.device.write(now_ns, &Wrench { force, moment });
        held.map_err(|_| 5)?;
        taken.map(drop).map_err(|_| 71)
    }
}

#[test]
fn hid_devices_conform_over_a_fake_transport() {
    for (most, states) in [(u16::MAX, 489), (300, 293)] {
        Suite::new("hid").states(states).check(|| {
            let device = simulated("virtuose6d");
            let capabilities = device.capabilities();
            let far = Arc::new(Mutex::new(FarEnd::new(device, most)));
            let near = Arc::clone(&far);
            let read = move |buffer: &mut [u8]| near.lock().map_err(|_| 5)?.send(buffer);
            let write = move |command: &Command| far.lock().map_err(|_| 5)?.take(command);
            let device = HidDevice::over(read, write, capabilities);
            Box::new(device.expect("the system gives a thread"))
        });
    }
}

#[test]
fn a_hid_device_that_is_unplugged_comes_back_without_a_restart() {
    // Each connection is a device that was just switched on, and goes away after 200 reports.
    let make = || {
        let capabilities = simulated("virtuose6d").capabilities();
        let open = move || {
            let far = Arc::new(Mutex::new(FarEnd::new(simulated("virtuose6d"), 200)));
            let near = Arc::clone(&far);
            let read: Box<ReadReport> =
                Box::new(move |buffer| near.lock().map_err(|_| 5)?.send(buffer));
            let write: Box<WriteReport> =
                Box::new(move |command| far.lock().map_err(|_| 5)?.take(command));
            Ok((read, write))
        };
        HidDevice::reopened(open, capabilities).expect("the system gives a thread")
    };
    Suite::new("unplugged")
        .states(190)
        .check(|| Box::new(make()));

    let mut device = make();
    let push = Wrench {
        force: Vec3::new(1.0, 0.0, 0.0),
        moment: Vec3::zeros(),
    };
    let (mut losses, mut was_there, mut clock, mut told) = (0, false, 0, 0);
    // Until it has come back twice, and moves under a force again.
    for now in (0..).map(|tick| tick * MS) {
        match device.read(now) {
            Ok(state) => {
                assert!(state.device_time_ns >= clock);
                clock = state.device_time_ns;
                was_there = true;
                told += u32::from(device.motion_to_force_ns().is_some());
                if losses == 2 && state.pose.position.x > 1e-4 {
                    break;
                }
            }
            Err(DeviceError::Disconnected(_)) if was_there => {
                (losses, was_there) = (losses + 1, false);
            }
            Err(_) => {
                // The time that an earlier read showed is not reported again.
                assert_eq!(device.motion_to_force_ns(), None);
                std::thread::yield_now();
            }
        }
        let _ = device.write(now, &push);
    }
    assert!(told > 0, "no wrench came into force");
}

#[test]
fn a_device_made_of_two_functions_conforms() {
    for freedom in [Freedom::Three, Freedom::Six] {
        Suite::new("scripted").check(|| {
            let read = |device_time_ns| {
                // Its clock, like that of any device, stands still when the loop's clock goes back.
                Ok(DeviceState {
                    device_time_ns,
                    ..DeviceState::resting()
                })
            };
            let mut latest = 0;
            let read = move |now: u64| {
                latest = latest.max(now);
                read(latest)
            };
            Box::new(Scripted::new(small(freedom), read, |_, _| Ok(())))
        });
    }
}

#[test]
#[should_panic(expected = "its clock went back")]
fn the_suite_finds_a_clock_that_goes_back() {
    let read = |now| {
        Ok(DeviceState {
            device_time_ns: now,
            ..DeviceState::resting()
        })
    };
    let make = || Box::new(Scripted::new(small(Freedom::Three), read, |_, _| Ok(())));
    Suite::new("broken").check(make);
}

#[test]
#[should_panic(expected = "not finite")]
fn the_suite_finds_a_state_that_is_not_a_number() {
    let faults = vec![(0..MS, Fault::NotANumber)];
    Suite::new("broken")
        .check(|| Box::new(Faulty::new(Box::new(simulated("touch")), faults.clone())));
}

#[test]
#[should_panic(expected = "200 states in 500 ticks")]
fn the_suite_finds_a_device_that_falls_silent() {
    let faults = vec![(200 * MS..u64::MAX, Fault::Silent)];
    Suite::new("broken")
        .check(|| Box::new(Faulty::new(Box::new(simulated("touch")), faults.clone())));
}
