//! The device's side of the firmware protocol, under a hostile host.

use super::Input;
use firmware_proto::device::{Device, Geometry, Inputs, Measured, Wrench};
use firmware_proto::report::{
    HelloReport, LENGTH, Mode, Model, Report, StateReport, VERSION, WATCHDOG_US, WrenchReport,
    axes, flags,
};
use firmware_proto::stream::{Decoder, PACKET, packet};
use std::num::NonZeroU8;

/// Largest force of the device (µN).
const MOST: u32 = 8_000_000;
/// The number of runs of states that a device remembers.
const RUNS: usize = 32;

/// The rules of the protocol, written a second time: which wrench may be in force.
#[derive(Debug)]
struct Rules {
    now_us: u64,
    mode: Mode,
    session: u32,
    watchdog_us: u64,
    /// The states that a wrench may answer, oldest first: the sequence number of each, and the time of the first state of
    /// its run (µs).
    states: Vec<(u16, u64)>,
    /// Sequence number of the last wrench of this session.
    last: Option<u16>,
    /// The wrench in force, and when it came (µs).
    held: Option<(Wrench, u64)>,
}

impl Rules {
    fn expire(&mut self) {
        if let Some((_, came_us)) = self.held
            && self.now_us - came_us >= self.watchdog_us
        {
            self.let_go();
            self.states.clear();
        }
    }

    fn let_go(&mut self) {
        self.held = None;
        if self.mode == Mode::Active {
            self.mode = Mode::Idle;
        }
    }

    fn begin(&mut self, session: u32) {
        self.session = session;
        self.states.clear();
        self.last = None;
        self.held = None;
    }

    /// Takes the bytes of a whole report.
    fn take(&mut self, bytes: &[u8; LENGTH]) {
        let [body @ .., low, high] = bytes;
        if check_sum(body) != u16::from_le_bytes([*low, *high]) || body.first() != Some(&VERSION) {
            return;
        }
        match Report::decode(bytes) {
            Ok(Report::Hello(hello)) => {
                if hello.session != self.session {
                    if self.mode == Mode::Active {
                        return;
                    }
                    self.begin(hello.session);
                }
                let asked = match hello.watchdog_us {
                    0 => WATCHDOG_US,
                    asked => asked,
                };
                self.watchdog_us = asked.into();
            }
            Ok(Report::Wrench(wrench)) => self.wrench(&wrench),
            _ => {}
        }
    }

    fn wrench(&mut self, wrench: &WrenchReport) {
        if wrench.session != self.session {
            return;
        }
        let ahead = self
            .last
            .map_or(1, |last| wrench.sequence.wrapping_sub(last));
        let newer = ahead != 0 && ahead <= u16::MAX / 2;
        if wrench.flags & flags::ENABLE == 0 {
            if newer {
                self.last = Some(wrench.sequence);
            }
            self.let_go();
            return;
        }
        let may = matches!(self.mode, Mode::Idle | Mode::Active);
        let mut states = self.states.iter();
        let answers = states.any(|&(sequence, sent_us)| {
            sequence == wrench.answers && self.now_us - sent_us <= self.watchdog_us
        });
        let length = |vector: [i32; 3]| {
            let squares = vector.map(|x| f64::from(x) * f64::from(x));
            squares.iter().sum::<f64>().sqrt()
        };
        // A unit for the rounding of three components. The device has no moments.
        let within = length(wrench.force) <= f64::from(MOST) + 1.0 && length(wrench.moment) <= 1.0;
        if newer && may && answers && within {
            self.last = Some(wrench.sequence);
            self.mode = Mode::Active;
            let asked = Wrench {
                force: wrench.force,
                moment: wrench.moment,
            };
            self.held = Some((asked, self.now_us));
        }
    }
}

/// CRC-16/IBM-3740, bit by bit.
fn check_sum(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xFFFF, |crc: u16, &byte| {
        (0..8).fold(crc ^ u16::from(byte) << 8, |crc, _| {
            (crc << 1) ^ if crc & 0x8000 == 0 { 0 } else { 0x1021 }
        })
    })
}

/// A device over a stream of bytes, with the rules beside it.
struct World {
    device: Device,
    decoder: Decoder,
    rules: Rules,
    bytes: usize,
    reports: usize,
}

impl World {
    fn now_us(&self) -> u32 {
        self.rules.now_us as u32
    }

    fn push(&mut self, bytes: &[u8]) {
        let now_us = self.now_us();
        for &byte in bytes {
            self.bytes += 1;
            if let Some(report) = self.decoder.push(byte) {
                self.reports += 1;
                self.rules.expire();
                self.rules.take(report);
                let _ = self.device.receive(report, now_us);
            }
        }
        // A whole report takes its own bytes, and the zero behind them.
        assert!(self.reports * (PACKET - 1) <= self.bytes);
    }

    /// A packet, perhaps with one byte changed.
    fn push_packet(&mut self, report: &[u8; LENGTH], input: &mut Input) {
        let mut bytes = packet(report);
        let [damage, place, change] = input.array();
        if damage >= 0xC0 {
            bytes[usize::from(place) % PACKET] ^= change;
        }
        self.push(&bytes);
    }

    fn report(&mut self) {
        let now_us = self.now_us();
        self.rules.expire();
        let measured = Measured::Pose {
            position: [1, -2, 3],
            orientation: [32767, 0, 0, 0],
            velocity: [0; 3],
            angular_velocity: [0; 3],
        };
        let report = self.device.report(now_us, Inputs::default(), &measured);
        if let Ok(state) = StateReport::decode(&report) {
            assert_eq!(state.session, self.rules.session);
            let Rules {
                states,
                now_us,
                watchdog_us,
                ..
            } = &mut self.rules;
            // A state that follows the last one within a 31st part of the watchdog counts as old as the first such state.
            let begun_us = states.last().filter(|(last, begun_us)| {
                state.sequence == last.wrapping_add(1) && *now_us - begun_us <= *watchdog_us / 31
            });
            let begun_us = begun_us.map_or(*now_us, |(_, begun_us)| *begun_us);
            states.push((state.sequence, begun_us));
            let runs = states.chunk_by(|(a, at), (b, of)| at == of && *b == a.wrapping_add(1));
            let kept = runs.rev().take(RUNS).map(<[_]>::len).sum::<usize>();
            states.drain(..states.len() - kept);
        } else {
            // An answer to a hello has a number of its own, and cannot be answered.
            let decoded = Report::decode(&report);
            assert!(
                matches!(decoded, Ok(Report::Capabilities(_))),
                "{decoded:?}"
            );
        }
    }

    /// The device applies what the rules allow, and nothing else. Returns whether that is a force.
    fn check(&mut self) -> bool {
        self.rules.expire();
        let applied = self.device.actuate(self.rules.now_us as u32);
        let allowed = self.rules.held.map_or(Wrench::default(), |(held, _)| held);
        assert_eq!(applied, allowed, "{:?}", self.rules);
        assert_eq!(self.device.mode(), self.rules.mode);
        applied != Wrench::default()
    }
}

/// Runs the device's side of the firmware protocol over a stream, under a hostile host. Returns in how many steps a
/// force was applied.
///
/// # Panics
/// If the device applies a wrench that the rules do not allow, or not the wrench that they allow.
pub fn firmware_device(bytes: &[u8]) -> usize {
    let mut input = Input::new(bytes);
    let model = Model {
        sensed: axes::TRANSLATIONS,
        actuated: axes::TRANSLATIONS,
        max_force: MOST,
        rate: [1000; 2],
        name: *b"hostile\0\0\0\0\0\0\0\0\0",
        ..Model::default()
    };
    let mut world = World {
        device: Device::new(model, Geometry::default()),
        decoder: Decoder::new(),
        rules: Rules {
            // The clock of the device wraps soon.
            now_us: u64::from(u32::MAX) - 50_000,
            mode: Mode::Boot,
            session: 0,
            watchdog_us: WATCHDOG_US.into(),
            states: Vec::new(),
            last: None,
            held: None,
        },
        bytes: 0,
        reports: 0,
    };
    let mut forces = 0;
    while !input.is_over() {
        step(&mut world, &mut input);
        forces += usize::from(world.check());
    }
    // Every watchdog ends.
    world.rules.now_us += 1_000_000;
    assert!(!world.check());
    forces
}

fn step(world: &mut World, input: &mut Input) {
    let newest = world.rules.states.last().map_or(0, |(number, _)| *number);
    let last = world.rules.last.unwrap_or(0);
    match input.byte() % 8 {
        0 => {
            let count = usize::from(input.byte()) % 80;
            let bytes = input.some(count);
            world.push(&bytes);
        }
        1 => {
            let session = session(world, input);
            let watchdog_us = match input.byte() % 4 {
                0 => 0,
                1 => 10_000,
                2 => 100_000,
                _ => input.u32(),
            };
            let hello = HelloReport {
                sequence: input.u16(),
                session,
                newest: input.byte(),
                watchdog_us,
            };
            world.push_packet(&hello.encode(), input);
        }
        2 => {
            let session = session(world, input);
            let [ahead, behind, flags] = input.array();
            let wrench = WrenchReport {
                sequence: last.wrapping_add_signed(i16::from(ahead.cast_signed())),
                session,
                answers: newest.wrapping_sub(behind.into()),
                force: [input.i32(), i32::from(input.i16()), 0],
                moment: [i32::from(input.byte()) / 255 * 1000, 0, 0],
                flags,
            };
            world.push_packet(&wrench.encode(), input);
        }
        // Time passes: at most a tenth of a second, so that no state is as old as the clock is long.
        3 => world.rules.now_us += u64::from(input.u32() % 100_000),
        4 => world.report(),
        5 => {
            // As a host that keeps the rules sends it.
            let wrench = WrenchReport {
                sequence: last.wrapping_add(1),
                session: world.rules.session,
                answers: newest,
                force: [i32::from(input.byte()) * 10_000, 0, 1],
                moment: [0; 3],
                flags: flags::ENABLE,
            };
            world.push(&packet(&wrench.encode()));
        }
        6 => world.rules.now_us += u64::from(input.byte()) * 100,
        _ => switch(world, input.byte()),
    }
}

/// The session of the device, or another.
fn session(world: &World, input: &mut Input) -> u32 {
    match input.byte() % 4 {
        0 => world.rules.session,
        1 => 1,
        2 => 2,
        _ => input.u32(),
    }
}

/// What the firmware does by itself.
fn switch(world: &mut World, what: u8) {
    world.rules.expire();
    let rules = &mut world.rules;
    match what % 4 {
        0 => {
            let before = rules.mode;
            // The watchdog acts at the next call that has a time.
            world.device.actuate(rules.now_us as u32);
            if matches!(before, Mode::Boot | Mode::Idle) {
                rules.mode = Mode::Homing;
            }
            assert_eq!(world.device.home(), rules.mode != before);
        }
        1 => {
            assert_eq!(world.device.homed(), rules.mode == Mode::Homing);
            if rules.mode == Mode::Homing {
                rules.mode = Mode::Idle;
            }
        }
        2 => {
            world.device.fault(NonZeroU8::MIN);
            rules.held = None;
            rules.mode = Mode::Fault;
        }
        _ => {
            if world.device.reset() {
                assert_eq!(rules.mode, Mode::Fault);
                rules.mode = Mode::Boot;
                rules.begin(0);
            }
        }
    }
}
