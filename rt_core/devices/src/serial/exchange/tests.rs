//! The exchange over a device's side of the protocol, in memory and under virtual time. `sim/tests/streams.rs` tests
//! the exchange against an emulated device.

use super::*;
use firmware_proto::device::{Device as Firmware, Geometry, Inputs, Measured};
use firmware_proto::report::{Model, axes};
use rt_core::{Corruption, Freedom, Rendering, Vec3};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

const MS: u64 = 1_000_000;

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

/// A device of this name that sends `rate` states a second.
fn model(name: u8, rate: u16) -> Model {
    Model {
        sensed: axes::TRANSLATIONS,
        actuated: axes::TRANSLATIONS,
        max_force: 8_000_000,
        workspace_radius: 500_000,
        position_step_nm: 10_000,
        rate: [rate; 2],
        name: [name; 16],
        ..Model::default()
    }
}

/// The bytes that the device sends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sends {
    States,
    Nothing,
    /// Bytes that are no packets.
    Garbage,
    /// States of a device of another version of the protocol.
    OtherVersion,
}

/// A device with its line.
struct World {
    now_ns: u64,
    firmware: Firmware,
    period_ns: u64,
    /// Time of the next state.
    next_ns: u64,
    /// The number of states; also their position along x (0.1 um).
    states: i32,
    sends: Sends,
    /// Whether the device receives nothing.
    is_deaf: bool,
    /// Bytes on their way to the host.
    bytes: VecDeque<u8>,
    /// Largest number of bytes in one read.
    chunk: usize,
    gone: Option<i32>,
    /// Whether the device is gone as soon as its bytes were read.
    is_last: bool,
    /// Whether the device goes while the host waits for its bytes.
    goes: bool,
    decoder: Decoder,
}

impl World {
    fn new(model: Model) -> Self {
        let mut firmware = Firmware::new(model, Geometry::default());
        assert!(firmware.home() && firmware.homed());
        Self {
            now_ns: 0,
            firmware,
            period_ns: 1_000_000_000 / u64::from(model.rate[0]),
            next_ns: 0,
            states: 0,
            sends: Sends::States,
            is_deaf: false,
            bytes: VecDeque::new(),
            chunk: usize::MAX,
            gone: None,
            is_last: false,
            goes: false,
            decoder: Decoder::new(),
        }
    }

    fn time_us(&self) -> u32 {
        (self.now_ns / 1000) as u32
    }

    /// Lets time pass until bytes wait, at most to `to_ns`.
    fn run(&mut self, to_ns: u64) {
        while self.bytes.is_empty() && self.next_ns <= to_ns {
            self.now_ns = self.now_ns.max(self.next_ns);
            self.send();
        }
        if self.bytes.is_empty() {
            self.now_ns = self.now_ns.max(to_ns);
        }
    }

    /// The device sends its next state.
    fn send(&mut self) {
        self.next_ns += self.period_ns;
        self.states += 1;
        let still = Measured::Pose {
            position: [self.states, 0, 0],
            orientation: [32767, 0, 0, 0],
            velocity: [0; 3],
            angular_velocity: [0; 3],
        };
        let inputs = Inputs {
            powered: true,
            ..Inputs::default()
        };
        let time_us = self.time_us();
        self.firmware.actuate(time_us);
        let mut report = self.firmware.report(time_us, inputs, &still);
        match self.sends {
            Sends::States => self.bytes.extend(packet(&report)),
            Sends::Nothing => {}
            Sends::Garbage => self.bytes.extend([1, 2, 3, 0]),
            Sends::OtherVersion => {
                report[0] += 1;
                let sum = check_sum(&report[..62]).to_le_bytes();
                report[62..].copy_from_slice(&sum);
                self.bytes.extend(packet(&report));
            }
        }
    }
}

/// The check sum of a report: CRC-16/IBM-3740.
fn check_sum(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xFFFF, |sum, &byte| {
        (0..8).fold(sum ^ u16::from(byte) << 8, |sum, _| {
            let carry = if sum & 0x8000 == 0 { 0 } else { 0x1021 };
            sum << 1 ^ carry
        })
    })
}

/// The line. Each opening counts as open until it is dropped.
struct Line(Arc<Mutex<World>>);

impl Transport for Line {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        let mut world = self.0.lock().expect("one thread");
        if let Some(number) = world.gone {
            return Err(number);
        }
        if world.goes {
            world.gone = Some(7);
            return Err(7);
        }
        let until_ns = world.now_ns + wait.as_nanos() as u64;
        world.run(until_ns);
        let count = world.bytes.len().min(buffer.len()).min(world.chunk);
        for (to, from) in buffer.iter_mut().zip(world.bytes.drain(..count)) {
            *to = from;
        }
        if world.is_last && world.bytes.is_empty() {
            world.gone = Some(5);
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        let mut world = self.0.lock().expect("one thread");
        let world = &mut *world;
        if let Some(number) = world.gone {
            return Err(number);
        }
        for &byte in bytes.iter().filter(|_| !world.is_deaf) {
            if let Some(report) = world.decoder.push(byte) {
                let _ = world.firmware.receive(report, (world.now_ns / 1000) as u32);
            }
        }
        let time_us = world.time_us();
        world.firmware.actuate(time_us);
        Ok(())
    }
}

/// A device and the host that has a line to it.
#[derive(Clone)]
struct Rig(Arc<Mutex<World>>);

impl Rig {
    fn new(model: Model) -> Self {
        Self(Arc::new(Mutex::new(World::new(model))))
    }

    fn world<R>(&self, f: impl FnOnce(&mut World) -> R) -> R {
        f(&mut self.0.lock().expect("one thread"))
    }

    fn open(&self) -> Result<Serial<Line>, GreetingError> {
        let (world, clock) = (self.clone(), self.clone());
        let open = move || match world.world(|world| world.gone) {
            Some(number) => Err(number),
            None => Ok(Line(Arc::clone(&world.0))),
        };
        Serial::open(profile(), 0, open, move || {
            clock.world(|world| world.now_ns)
        })
    }

    /// The force that the motors hold along x (N).
    fn force(&self) -> f64 {
        self.world(|world| {
            let time_us = world.time_us();
            f64::from(world.firmware.actuate(time_us).force[0]) * 1e-6
        })
    }
}

fn push(force: f64) -> Wrench {
    Wrench {
        force: Vec3::new(force, 0.0, 0.0),
        moment: Vec3::zeros(),
    }
}

/// Two devices on two lines: each renders its own wrench, and is released by its own host.
#[test]
fn each_device_renders_its_own_wrench_until_it_is_released() {
    let rigs = [1000, 500].map(|rate| Rig::new(model(b'a', rate)));
    let mut drivers = [0, 1].map(|k: usize| rigs[k].open().expect("a device"));
    for (driver, force) in drivers.iter_mut().zip([1.0, 2.0]) {
        assert_eq!(driver.name(), Some(Name([b'a'; 16])));
        for _ in 0..5 {
            let state = driver.exchange(&push(force)).expect("a state");
            assert_eq!(state.rendering, Rendering::Commanded);
        }
    }
    assert_eq!([rigs[0].force(), rigs[1].force()], [1.0, 2.0]);
    // The wrench is in force at the moment of its arrival, a period after the state that it answers.
    for (driver, period_ns) in drivers.iter().zip([MS, 2 * MS]) {
        let shown = driver.motion_to_force();
        let is_one = matches!(shown, MotionSource::Device(Some(ns)) if ns <= period_ns);
        assert!(is_one, "{shown:?}");
        assert_eq!((driver.refused_wrenches(), driver.garbage()), (Some(0), 0));
    }
    drivers[0].release();
    assert_eq!([rigs[0].force(), rigs[1].force()], [0.0, 2.0]);
}

#[test]
fn the_refusals_of_the_device_are_told() {
    let rig = Rig::new(model(b'a', 1000));
    let mut driver = rig.open().expect("a device");
    for _ in 0..3 {
        driver.exchange(&push(1.0)).expect("a state");
    }
    for refused in [7, 14] {
        rig.world(|world| {
            let time_us = world.time_us();
            for _ in 0..7 {
                assert!(world.firmware.receive(&[0; 64], time_us).is_err());
            }
        });
        for _ in 0..2 {
            driver.exchange(&push(1.0)).expect("a state");
        }
        assert_eq!(driver.refused_wrenches(), Some(refused));
    }
}

/// The reason why a device is not opened, and the system's number that the thread gets when it tries to reopen the
/// device.
#[test]
fn a_greeting_without_an_answer_says_what_came() {
    let opened = |change: &dyn Fn(&mut World)| {
        let rig = Rig::new(model(b'a', 1000));
        rig.world(|world| change(world));
        let error = rig.open().err().expect("no device");
        (error, rig.world(|world| world.now_ns))
    };
    let silent = opened(&|world| world.sends = Sends::Nothing);
    assert_eq!(silent.0, GreetingError::Silent);
    let garbage = opened(&|world| world.sends = Sends::Garbage);
    assert_eq!(garbage.0, GreetingError::Garbage);
    let deaf = opened(&|world| world.is_deaf = true);
    assert_eq!(deaf.0, GreetingError::Deaf);
    for (error, now_ns) in [silent, garbage, deaf] {
        // The last wait may end ten milliseconds later.
        assert!(
            (GREETING_NS..=GREETING_NS + WAIT_NS).contains(&now_ns),
            "{error}"
        );
        assert_eq!(error.number(), TIMED_OUT, "{error}");
    }
    let (gone, _) = opened(&|world| world.gone = Some(7));
    assert_eq!((gone.number(), gone), (7, GreetingError::Ended(7)));
    let (version, now_ns) = opened(&|world| world.sends = Sends::OtherVersion);
    assert!(matches!(version, GreetingError::Version(_)), "{version}");
    assert!(version.number() == NO_DEVICE && now_ns < GREETING_NS);
}

/// The device comes back as itself, after another device was plugged in at its place.
#[test]
fn a_lost_device_comes_back_as_itself_alone() {
    let rig = Rig::new(model(b'a', 1000));
    let mut driver = rig.open().expect("a device");
    for _ in 0..5 {
        driver.exchange(&push(1.0)).expect("a state");
    }
    rig.world(|world| world.gone = Some(5));
    assert_eq!(
        driver.exchange(&push(1.0)),
        Err(DeviceError::Disconnected(5))
    );
    // The test and the two closures of the driver: no line is open.
    assert_eq!(Arc::strong_count(&rig.0), 3);
    assert_eq!(driver.reopen(), Err(DeviceError::Disconnected(5)));
    for (name, result) in [
        (b'b', Err(DeviceError::Disconnected(NO_DEVICE))),
        (b'a', Ok(())),
    ] {
        let now_ns = rig.world(|world| world.now_ns);
        rig.world(|world| *world = World::new(model(name, 1000)));
        rig.world(|world| (world.now_ns, world.next_ns) = (now_ns, now_ns));
        assert_eq!(driver.reopen(), result);
        assert_eq!(
            Arc::strong_count(&rig.0),
            if result.is_ok() { 4 } else { 3 }
        );
        if result.is_err() {
            assert_eq!(
                driver.exchange(&push(1.0)),
                Err(DeviceError::Disconnected(NO_DEVICE))
            );
        }
        assert_eq!(rig.force(), 0.0);
    }
    for _ in 0..5 {
        driver.exchange(&push(1.0)).expect("a state");
    }
    assert_eq!(rig.force(), 1.0);
}

/// A device may be exchanged for another on an open line, as behind a bridge.
#[test]
fn another_device_on_the_open_line_is_a_lost_device() {
    let rig = Rig::new(model(b'a', 1000));
    let mut driver = rig.open().expect("a device");
    driver.exchange(&push(1.0)).expect("a state");
    let now_ns = rig.world(|world| world.now_ns);
    rig.world(|world| *world = World::new(model(b'b', 1000)));
    rig.world(|world| (world.now_ns, world.next_ns) = (now_ns, now_ns));
    let lost = (0..100).find_map(|_| match driver.exchange(&push(1.0)) {
        Err(DeviceError::Disconnected(number)) => Some(number),
        _ => None,
    });
    assert_eq!((lost, rig.force()), (Some(NO_DEVICE), 0.0));
}

/// The silence after which a device counts as lost: 50 of its periods, but neither less than 50 ms nor more than a second.
#[test]
fn a_device_that_falls_silent_is_lost_after_a_time() {
    for (rate, silence_ns, wait_ns) in [
        (4000, 50 * MS, MS / 4),
        (1000, 50 * MS, MS),
        (200, 250 * MS, 5 * MS),
        (20, 1000 * MS, 10 * MS),
    ] {
        let rig = Rig::new(model(b'a', rate));
        let mut driver = rig.open().expect("a device");
        while driver.exchange(&push(1.0)).is_err() {}
        let start_ns = rig.world(|world| {
            world.sends = Sends::Nothing;
            world.now_ns
        });
        let mut waits = 0;
        while driver.exchange(&push(1.0)) == Err(DeviceError::NoReport) {
            waits += 1;
        }
        let after_ns = rig.world(|world| world.now_ns) - start_ns;
        // Each exchange waits for one period of the device, at most for ten milliseconds.
        assert_eq!(
            (after_ns, (waits + 1) * wait_ns),
            (silence_ns, silence_ns),
            "{rate} Hz"
        );
        let closed = Err(DeviceError::Disconnected(NO_DEVICE));
        assert_eq!(driver.exchange(&push(1.0)), closed, "{rate} Hz");
    }
}

/// The newest state that has come is taken without a wait for another.
#[test]
fn the_newest_state_is_taken_and_the_last_before_the_end_is_good() {
    let rig = Rig::new(model(b'a', 1000));
    let mut driver = rig.open().expect("a device");
    driver.exchange(&push(1.0)).expect("a state");
    let (newest, now_ns) = rig.world(|world| {
        for _ in 0..5 {
            world.now_ns = world.next_ns;
            world.send();
        }
        (world.states, world.now_ns)
    });
    let state = driver.exchange(&push(1.0)).expect("a state");
    assert_eq!(state.pose.position.x, f64::from(newest) * 1e-7);
    assert_eq!(rig.world(|world| world.now_ns), now_ns);
    // Garbage beside a state is counted, and is no error.
    rig.world(|world| world.bytes.extend([1, 2, 3, 0]));
    rig.world(|world| {
        world.now_ns = world.next_ns;
        world.send();
    });
    assert!(driver.exchange(&push(1.0)).is_ok() && driver.garbage() == 1);
    rig.world(|world| world.bytes.extend([1, 2, 3, 0]));
    rig.world(|world| world.sends = Sends::Nothing);
    let corrupt = Err(DeviceError::Corrupt(Corruption::Length));
    assert_eq!(driver.exchange(&push(1.0)), corrupt);
    rig.world(|world| {
        world.sends = Sends::States;
        world.next_ns = world.now_ns;
        world.send();
        world.is_last = true;
    });
    assert!(driver.exchange(&push(1.0)).is_ok());
    assert_eq!(
        driver.exchange(&push(1.0)),
        Err(DeviceError::Disconnected(5))
    );
}

/// A slow line may give its bytes one by one. An endless stream must not hold up the exchange.
#[test]
fn an_exchange_reads_a_bounded_number_of_times() {
    let rig = Rig::new(model(b'a', 1000));
    let mut driver = rig.open().expect("a device");
    rig.world(|world| world.chunk = 1);
    for _ in 0..20 {
        let _ = driver.exchange(&push(1.0));
    }
    assert!(driver.exchange(&push(1.0)).is_ok());
    let left = rig.world(|world| {
        world.bytes = [1; 1000].into();
        world.bytes.len()
    });
    let _ = driver.exchange(&push(1.0));
    assert_eq!(rig.world(|world| left - world.bytes.len()), READS);
}

#[test]
fn a_device_that_goes_while_it_is_waited_for_is_lost_at_once() {
    let rig = Rig::new(model(b'a', 1000));
    let mut driver = rig.open().expect("a device");
    driver.exchange(&push(1.0)).expect("a state");
    rig.world(|world| world.goes = true);
    let lost = Err(DeviceError::Disconnected(7));
    assert_eq!(driver.exchange(&push(1.0)), lost);
}
