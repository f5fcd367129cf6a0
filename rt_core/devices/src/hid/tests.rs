//! The device over a device's side of the protocol that the test holds.

use super::*;
use firmware_proto::device::{Device as Firmware, Geometry, Inputs, Measured};
use firmware_proto::report::{Model, axes};
use rt_core::{Freedom, Vec3};
use std::sync::{Arc, Mutex};

const MS: u64 = 1_000_000;
/// A pose at the origin.
const STILL: Measured = Measured::Pose {
    position: [0; 3],
    orientation: [32767, 0, 0, 0],
    velocity: [0; 3],
    angular_velocity: [0; 3],
};

fn profile() -> Capabilities {
    Capabilities {
        sensed: Freedom::Three,
        actuated: Freedom::Three,
        max_force: 8.0,
        max_moment: 0.0,
        workspace_radius: 0.05,
        position_step: 1e-5,
    }
}

fn model(name: &str) -> Model {
    let mut bytes = [0; 16];
    for (to, from) in bytes.iter_mut().zip(name.bytes()) {
        *to = from;
    }
    Model {
        sensed: axes::TRANSLATIONS,
        actuated: axes::TRANSLATIONS,
        max_force: 8_000_000,
        workspace_radius: 500_000,
        position_step_nm: 10_000,
        rate: [1000; 2],
        name: bytes,
        ..Model::default()
    }
}

/// A device that is plugged in, and the effect of its commands.
struct Plugged {
    firmware: Firmware,
    time_us: u32,
    gone: bool,
    /// The largest force in force so far (uN).
    force: i32,
}

impl Plugged {
    fn new(model: Model) -> Self {
        let mut firmware = Firmware::new(model, Geometry::default());
        assert!(firmware.home() && firmware.homed());
        Self {
            firmware,
            time_us: 0,
            gone: false,
            force: 0,
        }
    }
}

/// The socket: the device that is plugged in now.
type Socket = Arc<Mutex<Plugged>>;

/// The ends of the device in the socket. Each end holds the token, as an open file.
fn ends_of(socket: &Socket, token: &Arc<()>) -> Ends {
    let (near, far) = (Arc::clone(socket), Arc::clone(socket));
    let (held, also) = (Arc::clone(token), Arc::clone(token));
    let mut has_sent = false;
    let read = move |buffer: &mut [u8]| {
        std::hint::black_box(&held);
        let mut device = near.lock().expect("a thread");
        if device.gone {
            return Err(NO_DEVICE);
        }
        has_sent = !has_sent;
        if !has_sent {
            return Ok(0);
        }
        device.time_us += 1000;
        let time_us = device.time_us;
        let report = device.firmware.report(time_us, Inputs::default(), &STILL);
        buffer[..report.len()].copy_from_slice(&report);
        Ok(report.len())
    };
    let write = move |command: &Command| {
        std::hint::black_box(&also);
        let mut device = far.lock().expect("a thread");
        if device.gone {
            return Err(NO_DEVICE);
        }
        let time_us = device.time_us + 100;
        let _ = device.firmware.receive(&command[1..], time_us);
        let force = device.firmware.actuate(time_us).force;
        device.force = device.force.max(force[0]);
        Ok(())
    };
    (Box::new(read), Box::new(write))
}

fn push() -> Wrench {
    Wrench {
        force: Vec3::new(1.0, 0.0, 0.0),
        moment: Vec3::zeros(),
    }
}

/// Ticks until `done` accepts a result. The thread that writes needs time.
fn until(
    device: &mut HidDevice,
    now_ns: &mut u64,
    done: impl Fn(&Result<DeviceState, DeviceError>, &HidDevice) -> bool,
) {
    loop {
        let result = device.read(*now_ns);
        let is_done = done(&result, device);
        let _ = device.write(*now_ns, &push());
        *now_ns += MS;
        if is_done {
            return;
        }
        std::thread::yield_now();
    }
}

/// The device in a socket, and the number of its ends that are open when it is looked for, each time.
fn open(socket: &Socket) -> (HidDevice, Arc<Mutex<Vec<usize>>>) {
    let token = Arc::new(());
    let counts = Arc::new(Mutex::new(Vec::new()));
    let (seen, again) = (Arc::clone(&counts), Arc::clone(socket));
    let open = move || {
        // This closure has one.
        seen.lock()
            .expect("a thread")
            .push(Arc::strong_count(&token) - 1);
        let is_gone = again.lock().expect("a thread").gone;
        if is_gone {
            Err(NO_DEVICE)
        } else {
            Ok(ends_of(&again, &token))
        }
    };
    let device = HidDevice::reopened(open, profile()).expect("a thread");
    (device, counts)
}

fn has_force(socket: &Socket) -> bool {
    socket.lock().expect("a thread").force > 0
}

/// A device whose file is open under a name that the kernel gives to nobody else cannot come back under its path.
#[test]
fn a_lost_device_is_closed_at_both_ends_before_it_is_looked_for() {
    let socket = Arc::new(Mutex::new(Plugged::new(model("arm"))));
    let (mut device, counts) = open(&socket);
    let mut now_ns = 0;
    until(&mut device, &mut now_ns, |_, _| has_force(&socket));
    socket.lock().expect("a thread").gone = true;
    until(&mut device, &mut now_ns, |result, _| {
        result == &Err(DeviceError::Disconnected(19))
    });
    while counts.lock().expect("a thread").len() < 3 {
        std::thread::yield_now();
    }
    *socket.lock().expect("a thread") = Plugged::new(model("arm"));
    until(&mut device, &mut now_ns, |_, _| has_force(&socket));
    let counts = counts.lock().expect("a thread");
    assert!(counts.iter().all(|&open| open == 0), "{counts:?}");
}

#[test]
fn a_device_that_is_not_that_of_its_profile_gets_no_force() {
    let other = [
        Model {
            max_force: 7_000_000,
            ..model("arm")
        },
        Model {
            sensed: axes::ALL,
            ..model("arm")
        },
        Model {
            actuated: axes::X,
            ..model("arm")
        },
        Model {
            workspace_radius: u32::MAX,
            ..model("arm")
        },
    ];
    for other in other {
        // It is refused when it answers in time.
        let socket = Arc::new(Mutex::new(Plugged::new(other)));
        let mut ends = ends_of(&socket, &Arc::new(()));
        let error = answer(&mut ends, &profile(), 0).expect_err("another device");
        assert!(
            error.to_string().contains("another device's profile"),
            "{error}"
        );
        // It is lost if it answers later.
        let (mut device, _) = open(&socket);
        let mut now_ns = 0;
        until(&mut device, &mut now_ns, |_, device| {
            device.name().is_some()
        });
        for _ in 0..100 {
            let lost = Err(DeviceError::Disconnected(19));
            assert_eq!(device.read(now_ns), lost);
            assert_eq!(device.write(now_ns, &push()), lost.map(drop));
            now_ns += MS;
        }
        assert!(!has_force(&socket));
    }
}

#[test]
fn the_device_that_is_meant_is_greeted_and_named() {
    let socket = Arc::new(Mutex::new(Plugged::new(model("arm"))));
    let mut ends = ends_of(&socket, &Arc::new(()));
    let stated = answer(&mut ends, &profile(), 0).expect("it is the device");
    assert_eq!(stated.map(|model| Name(model.name)), Some(Name::new("arm")));
}

/// The device that answered the greeting is exchanged for another one before the first tick.
#[test]
fn a_device_that_is_not_the_one_that_was_greeted_gets_no_force() {
    let socket = Arc::new(Mutex::new(Plugged::new(model("right"))));
    let ends = ends_of(&socket, &Arc::new(()));
    let greeted = Some(model("left"));
    let device = HidDevice::start(
        ends,
        Box::new(|| Err(NO_DEVICE)),
        profile(),
        0,
        greeted,
        DEVICE_PRIORITY,
    );
    let mut device = device.expect("a thread");
    let mut now_ns = 0;
    until(&mut device, &mut now_ns, |_, device| {
        device.reports().host().ready()
    });
    for _ in 0..100 {
        assert_eq!(device.read(now_ns), Err(DeviceError::Disconnected(19)));
        let _ = device.write(now_ns, &push());
        now_ns += MS;
    }
    assert!(!has_force(&socket));
}

/// A device that two hosts reach obeys one of them: it knows its host by the session.
#[test]
fn each_host_has_a_session_of_its_own() {
    assert_ne!(session(), session());
}

/// Another device of the same kind is plugged into the socket of the lost one, and then the lost one again.
#[test]
fn a_device_that_comes_back_as_another_gets_no_force_until_it_is_itself_again() {
    let socket = Arc::new(Mutex::new(Plugged::new(model("left"))));
    let (mut device, _) = open(&socket);
    let mut now_ns = 0;
    until(&mut device, &mut now_ns, |_, _| has_force(&socket));
    let lost = Err(DeviceError::Disconnected(19));
    for other in [
        model("right"),
        Model {
            max_force: 2_000_000,
            ..model("left")
        },
    ] {
        socket.lock().expect("a thread").gone = true;
        until(&mut device, &mut now_ns, |result, _| *result == lost);
        *socket.lock().expect("a thread") = Plugged::new(other);
        until(&mut device, &mut now_ns, |_, device| {
            device.reports().host().ready()
        });
        for _ in 0..100 {
            // No state is believed. Until the thread has opened the device, none has come.
            assert!(device.read(now_ns).is_err());
            let _ = device.write(now_ns, &push());
            now_ns += MS;
        }
        assert!(!has_force(&socket));
        socket.lock().expect("a thread").gone = true;
        until(&mut device, &mut now_ns, |_, device| {
            device.end.lost().is_some()
        });
        *socket.lock().expect("a thread") = Plugged::new(model("left"));
        until(&mut device, &mut now_ns, |_, _| has_force(&socket));
    }
}

#[test]
fn a_missing_device_is_named_with_a_remedy() {
    // Vendor 0 is not assigned.
    let selector = HidSelector::parse("0000:0bad:left").expect("an address");
    let capabilities = Capabilities {
        sensed: Freedom::Three,
        actuated: Freedom::Three,
        max_force: 1.0,
        max_moment: 0.0,
        workspace_radius: 0.1,
        position_step: 1e-5,
    };
    match HidDevice::open(&selector, capabilities, 0, DEVICE_PRIORITY) {
        Ok(_) => panic!("no such device exists"),
        Err(error) => {
            let text = error.to_string();
            assert!(
                text.contains("0000:0bad") && text.contains("\"left\""),
                "{text}"
            );
            assert!(text.contains("lsusb"), "{text}");
        }
    }
}

#[test]
fn a_device_that_may_not_be_opened_comes_with_its_udev_rule() {
    let error = HidError::Open {
        selector: HidSelector::parse("1209:c0de").expect("an address"),
        path: "/dev/hidraw3".into(),
        source: std::io::ErrorKind::PermissionDenied.into(),
    };
    let text = error.to_string();
    for part in [
        "1209:c0de",
        "/dev/hidraw3",
        "ATTRS{idVendor}==\"1209\"",
        "permission denied",
        "rules.d/70-palpate.rules",
    ] {
        assert!(text.contains(part), "{part} in {text}");
    }
    let error = HidError::Open {
        selector: HidSelector::parse("1209:c0de").expect("an address"),
        path: "/dev/hidraw3".into(),
        source: std::io::ErrorKind::ResourceBusy.into(),
    };
    assert!(
        error.to_string().contains("Another run has it open"),
        "{error}"
    );
}

#[test]
fn motion_to_force_and_refusals_are_those_that_the_device_tells() {
    let socket = Arc::new(Mutex::new(Plugged::new(model("arm"))));
    let (mut device, _) = open(&socket);
    let mut now_ns = 0;
    // The device puts a wrench in force 100 us after a state.
    until(&mut device, &mut now_ns, |_, device| {
        device
            .motion_to_force_ns()
            .is_some_and(|ns| ns % MS == 100_000)
    });
    for _ in 0..2 {
        // On a busy machine, the device may refuse an old wrench, too.
        let before = device.refused_wrenches().expect("the device tells");
        let mut plugged = socket.lock().expect("a thread");
        let time_us = plugged.time_us;
        for _ in 0..5 {
            assert!(plugged.firmware.receive(&[0; 64], time_us).is_err());
        }
        drop(plugged);
        until(&mut device, &mut now_ns, |_, device| {
            device.refused_wrenches() >= Some(before + 5)
        });
    }
}
