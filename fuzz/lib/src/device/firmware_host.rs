//! The host's side of the firmware protocol over a stream, under a hostile device.

use super::Input;
use devices::serial::Serial;
use devices::{DeviceModel, Exchange, Transport};
use firmware_proto::report::{
    CapabilitiesReport, Condition, LENGTH, Mode, Model, Report, ReportError, Sends, StateReport,
};
use firmware_proto::stream::{Decoder, packet};
use rt_core::{Capabilities, DeviceError, DeviceState, Freedom, Vec3, Wrench};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Most reads in one exchange: as many as the driver allows itself.
const READS: u64 = 256;
/// Longest time of an exchange (ns): the wait for a state, and a microsecond for each read.
const LONGEST_NS: u64 = 10_000_000 + READS * READ_NS;
/// Time of a read (ns).
const READ_NS: u64 = 1000;
/// Most exchanges of a run.
const EXCHANGES: usize = 200;

/// What the device sends and when, and what the driver wrote.
struct World {
    input: Input,
    profile: Capabilities,
    now_ns: u64,
    reads: u64,
    waiting: VecDeque<u8>,
    /// Of the device.
    sequence: u16,
    /// Of the driver's last hello.
    session: u32,
    hello: u16,
    written: Decoder,
    /// The wrenches that the driver sent (µN).
    forces: Vec<[i32; 3]>,
}

#[derive(Clone)]
struct Link(Arc<Mutex<World>>);

impl Link {
    fn world(&self) -> MutexGuard<'_, World> {
        // Another panic is under way already.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl World {
    /// The next bytes of the device. `None` if it sends nothing.
    fn next(&mut self) -> Result<Option<Vec<u8>>, i32> {
        if self.input.is_over() {
            return Ok(None);
        }
        Ok(Some(match self.input.byte() % 8 {
            0 => {
                let count = usize::from(self.input.byte()) % 80;
                self.input.some(count)
            }
            1 => {
                let report = self.state();
                self.packet(&report)
            }
            2 => {
                let report = self.capabilities();
                self.packet(&report)
            }
            3 => {
                // The answer to the hello, as a sound device gives it.
                let report = self.answer();
                packet(&report).to_vec()
            }
            4 | 5 => {
                let report = self.sound_state();
                packet(&report).to_vec()
            }
            6 => return Ok(None),
            _ => match self.input.byte() {
                0..=15 => return Err(19),
                16..=31 => return Err(5),
                count => vec![count; usize::from(count)],
            },
        }))
    }

    fn session(&mut self) -> u32 {
        match self.input.byte() % 8 {
            0 => 0,
            1 => self.input.u32(),
            _ => self.session,
        }
    }

    fn number(&mut self) -> u16 {
        let ahead = self.input.byte().cast_signed();
        self.sequence = self.sequence.wrapping_add_signed(i16::from(ahead));
        self.sequence
    }

    fn state(&mut self) -> [u8; LENGTH] {
        let (sequence, session) = (self.number(), self.session());
        let [buttons, status, mode, refused, fault] = self.input.array();
        let condition = Condition {
            time_us: self.input.u32(),
            since_us: self.input.u32(),
            wrench: self.input.u16(),
            buttons: buttons.into(),
            status,
            mode: Mode::of(mode % 6).unwrap_or(Mode::Active),
            refused,
            fault,
        };
        let three = |input: &mut Input| [input.i32(), input.i32(), input.i32()];
        StateReport {
            sequence,
            session,
            condition,
            position: three(&mut self.input),
            orientation: match self.input.byte() % 4 {
                0 => std::array::from_fn(|_| self.input.i16()),
                1 => [18918, 18918, -18918, 0],
                _ => [32767, 0, 0, 0],
            },
            velocity: three(&mut self.input),
            angular_velocity: std::array::from_fn(|_| self.input.i16()),
        }
        .encode()
    }

    fn sound_state(&mut self) -> [u8; LENGTH] {
        self.sequence = self.sequence.wrapping_add(1);
        StateReport {
            sequence: self.sequence,
            session: self.session.max(1),
            condition: Condition {
                time_us: (self.now_ns / 1000) as u32,
                status: 1,
                mode: Mode::Idle,
                ..Condition::default()
            },
            position: [i32::from(self.input.i16()), 0, 0],
            orientation: [32767, 0, 0, 0],
            velocity: [0; 3],
            angular_velocity: [0; 3],
        }
        .encode()
    }

    fn model(&self) -> Model {
        Model {
            sensed: devices::wire::axes_of(self.profile.sensed),
            actuated: devices::wire::axes_of(self.profile.actuated),
            max_force: (self.profile.max_force * 1e6).ceil() as u32,
            max_moment: (self.profile.max_moment * 1e6).ceil() as u32,
            rate: [1000; 2],
            name: *b"hostile\0\0\0\0\0\0\0\0\0",
            ..Model::default()
        }
    }

    fn answer(&mut self) -> [u8; LENGTH] {
        self.sequence = self.sequence.wrapping_add(1);
        CapabilitiesReport {
            sequence: self.sequence,
            session: self.session.max(1),
            hello: self.hello,
            hello_time_us: (self.now_ns / 1000) as u32,
            watchdog_us: 10_000,
            model: self.model(),
        }
        .encode()
    }

    fn capabilities(&mut self) -> [u8; LENGTH] {
        let (sequence, session) = (self.number(), self.session());
        let sound = self.model();
        let [sensed, actuated, encoders] = self.input.array();
        CapabilitiesReport {
            sequence,
            session,
            hello: self.input.u16(),
            hello_time_us: self.input.u32(),
            watchdog_us: 10_000,
            model: Model {
                sensed: sound.sensed ^ (sensed & 0x3F),
                actuated: sound.actuated ^ (actuated & 0x3F),
                max_force: self.input.u32(),
                rate: [self.input.u16(), self.input.u16()],
                sends: match encoders % 10 {
                    0 => Sends::Poses,
                    encoders => Sends::Counts { encoders },
                },
                name: self.input.array(),
                ..sound
            },
        }
        .encode()
    }

    /// A packet, perhaps with one byte of its report changed, with the check sum made right or not, and perhaps cut.
    fn packet(&mut self, report: &[u8; LENGTH]) -> Vec<u8> {
        let mut report = *report;
        let [damage, place, change] = self.input.array();
        if damage >= 0xC0 {
            report[usize::from(place) % LENGTH] ^= change;
            if damage >= 0xE0
                && let Err(ReportError::Crc { expected, .. }) = Report::decode(&report)
            {
                report[LENGTH - 2..].copy_from_slice(&expected.to_le_bytes());
            }
        }
        let mut bytes = packet(&report).to_vec();
        if damage == 0xBF {
            bytes.truncate(usize::from(place));
        }
        bytes
    }

    /// Reads what the driver wrote: only sound reports, of the session of its last hello.
    fn take(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            let Some(report) = self.written.push(byte) else {
                continue;
            };
            match Report::decode(report) {
                Ok(Report::Hello(hello)) => {
                    (self.session, self.hello) = (hello.session, hello.sequence);
                }
                Ok(Report::Wrench(wrench)) => {
                    assert_eq!(wrench.session, self.session);
                    self.forces.push(wrench.force);
                }
                other => panic!("the driver wrote {other:?}"),
            }
        }
        assert_eq!(
            self.written.refused(),
            0,
            "the driver wrote a broken packet"
        );
    }
}

impl Transport for Link {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        let mut world = self.world();
        world.reads += 1;
        world.now_ns += READ_NS;
        if world.waiting.is_empty() {
            let Some(bytes) = world.next()? else {
                world.now_ns += wait.as_nanos() as u64;
                return Ok(0);
            };
            world.waiting.extend(bytes);
        }
        let count = world.waiting.len().min(buffer.len());
        for (place, byte) in buffer.iter_mut().zip(world.waiting.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        self.world().take(bytes);
        Ok(())
    }
}

/// Runs the driver of the firmware protocol over a stream, under a hostile device. Returns the number of states that the
/// driver passed on.
///
/// # Panics
/// If a state is no state, its clock goes back, an exchange does not end, or the driver commands what it was not
/// asked for.
pub fn firmware_host(bytes: &[u8]) -> usize {
    let mut input = Input::new(bytes);
    let names = ["falcon", "virtuose6d", "hapkit"];
    let name = names[usize::from(input.byte()) % names.len()];
    let Some(model) = DeviceModel::named(name) else {
        panic!("{name} is a built-in device");
    };
    let profile = model.capabilities();
    let link = Link(Arc::new(Mutex::new(World {
        input,
        profile,
        now_ns: 0,
        reads: 0,
        waiting: VecDeque::new(),
        sequence: 0,
        session: 0,
        hello: 0,
        written: Decoder::new(),
        forces: Vec::new(),
    })));
    let (near, clock) = (link.clone(), link.clone());
    let opened = Serial::open(
        profile,
        0,
        move || Ok(near.clone()),
        move || clock.world().now_ns,
    );
    let Ok(mut driver) = opened else { return 0 };
    let push = Wrench {
        force: Vec3::new(1.0, 0.0, 0.0),
        moment: Vec3::zeros(),
    };
    let (mut states, mut clock_ns, mut lost) = (0, 0, false);
    for _ in 0..EXCHANGES {
        let (reads, start_ns) = {
            let mut world = link.world();
            world.forces.clear();
            (world.reads, world.now_ns)
        };
        let result = driver.exchange(&push);
        {
            let world = link.world();
            let reads = world.reads - reads;
            assert!(reads <= READS, "{reads} reads in one exchange");
            let took_ns = world.now_ns - start_ns;
            assert!(took_ns <= LONGEST_NS, "an exchange took {took_ns} ns");
            assert!(world.forces.iter().all(|force| *force == [1_000_000, 0, 0]));
            assert!(world.forces.len() <= 1);
        }
        match result {
            Ok(state) => {
                check(&state, profile.sensed);
                assert!(state.device_time_ns >= clock_ns, "its clock went back");
                clock_ns = state.device_time_ns;
                states += 1;
            }
            Err(DeviceError::Disconnected(_)) => {
                lost = driver.reopen().is_err();
                if lost && link.world().input.is_over() {
                    break;
                }
                // The driver's counters and clocks begin anew.
                clock_ns = 0;
            }
            Err(_) => {}
        }
        if link.world().input.is_over() && result.is_err() {
            break;
        }
    }
    driver.release();
    let released = link.world().forces.last().copied();
    // The file of a lost device is closed: the device lets go by itself.
    assert!(lost || released.is_none_or(|force| force == [0; 3]));
    states
}

/// Checks a state of the firmware protocol: it is finite, within the range of a report, and moves along the axes that
/// the device senses.
fn check(state: &DeviceState, sensed: Freedom) {
    assert!(state.is_finite(), "{state:?}");
    // The largest numbers of a report: 2^31 times 0.1 um, 2^31 um/s, 2^15 mrad/s.
    let most = |vector: &Vec3, most: f64| vector.amax() <= most * (1.0 + 1e-12);
    assert!(most(&state.pose.position, 214.748_364_8), "{state:?}");
    assert!(most(&state.twist.linear, 2_147.483_648), "{state:?}");
    assert!(most(&state.twist.angular, 32.768), "{state:?}");
    assert_eq!(sensed.part(&state.pose.position), state.pose.position);
    assert_eq!(sensed.part(&state.twist.linear), state.twist.linear);
    let turn = state.pose.rotation.coords.norm();
    assert!((turn - 1.0).abs() < 1e-9, "{state:?}");
    if !sensed.turns() {
        assert_eq!(state.pose.rotation.scaled_axis(), Vec3::zeros());
    }
}
