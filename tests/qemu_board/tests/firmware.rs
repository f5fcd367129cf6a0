//! Real firmware: the images for a Cortex-M4, in Rust and in C99 (`firmware_proto/board`), in QEMU.
//!
//! `tests/firmware` builds the images and names them in the environment; without them the tests skip themselves. Each
//! test starts QEMU, which passes the UART of the board on to a TCP connection. A second UART belongs to the simulated
//! mechanism behind the registers. Through it, the mechanism reports its true position and the true forces of the
//! motors to the test.
//!
//! QEMU does not keep the time of this machine: the device may run faster or slower. All times here are therefore read
//! from the clock of the device, and a test continues until the awaited event has come. Only a test that fails waits
//! for its time to be over.

use devices::conformance::Suite;
use devices::transport::Stream;
use devices::{AnyDevice, DeviceModel, Registry, Request, Tcp};
use emulator::{Listener, Served, serve};
use firmware_proto::report::{
    CapabilitiesReport, FirmwareVersion, HelloReport, LENGTH, Mode, Report, Sends, StateReport,
    VERSION, WATCHDOG_MOST_US, WrenchReport, axes, fault, flags, status,
};
use firmware_proto::stream::{Decoder, PACKET, packet};
use qemu_board::board::INSTRUCTION_NS;
use qemu_board::{Board, Paced, Truth};
use rt_core::{Vec3, Wrench};
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time after which a test has failed. Even a busy machine needs less time.
const PATIENCE: Duration = Duration::from_secs(600);
/// Number of states after which a test sends a report again, if the first had no effect.
const STATES: u32 = 300;
/// Longest time between two requests for bytes of a board.
const PERIOD: Duration = Duration::from_micros(500);
/// The period of the firmware's loop (us): the amplifiers are set so often.
const TICK_US: u32 = 250;
/// Cycles of the board's clock in a tick: 25 MHz.
const TICK_CYCLES: u32 = 6250;
/// A cycle of the board's clock (ns).
const CYCLE_NS: u32 = 40;
/// The simulated mechanism, as in its sources: mass (kg), damping (N s/m), friction of an axis (N).
const MASS: f64 = 0.2;
const DAMPING: f64 = 4.0;
const FRICTION: f64 = 0.05;

/// The images: for each the variable of the environment with its path, and the name in its capabilities.
const IMAGES: [(&str, &str); 2] = [
    ("PALPATE_FIRMWARE_RUST", "board rust"),
    ("PALPATE_FIRMWARE_C99", "board c99"),
];

/// Runs a test with each image.
fn each(test: fn(Tested)) {
    for (variable, name) in IMAGES {
        let Ok(image) = std::env::var(variable) else {
            skipped(name, variable);
            continue;
        };
        test(Tested::start(&image, name));
    }
}

/// Says once that there is no image.
fn skipped(name: &str, variable: &str) {
    static SAID: [Once; 2] = [Once::new(), Once::new()];
    let image = usize::from(variable == IMAGES[1].0);
    SAID[image].call_once(|| {
        let _ = writeln!(
            std::io::stderr(),
            "\n!! SKIPPED: the firmware \"{name}\" in QEMU: {variable} names no image (run tests/firmware)"
        );
    });
}

/// A board that a test uses.
struct Tested {
    name: &'static str,
    image: String,
    board: Board,
}

impl Tested {
    fn start(image: &str, name: &'static str) -> Self {
        let board =
            Board::start(Path::new(image)).unwrap_or_else(|error| panic!("{name}: {error}"));
        Self {
            name,
            image: image.to_owned(),
            board,
        }
    }

    /// Another board with the same image.
    fn again(&self) -> Self {
        Self::start(&self.image, self.name)
    }

    fn host(&self) -> Host {
        let stream = TcpStream::connect(self.board.line()).expect("QEMU listens");
        let patient = stream.set_read_timeout(Some(PATIENCE));
        patient
            .and_then(|()| stream.set_nodelay(true))
            .expect("a TCP stream");
        Host {
            name: self.name,
            stream,
            decoder: Decoder::new(),
            bytes: Vec::new(),
            session: 0,
            sequence: 0,
        }
    }

    /// Gives the mechanism a command; `firmware_proto/board/src/plant.rs` lists the commands.
    fn command(&mut self, command: u8) {
        let given = self.board.command(command);
        given.unwrap_or_else(|error| panic!("{}: {error}", self.name));
    }

    fn truth(&mut self) -> Truth {
        let truth = self.board.truth();
        truth.unwrap_or_else(|error| panic!("{}: {error}", self.name))
    }
}

/// A host. Each test decides which reports the host sends.
struct Host {
    name: &'static str,
    stream: TcpStream,
    decoder: Decoder,
    /// Received bytes that are not decoded yet, the last first.
    bytes: Vec<u8>,
    session: u32,
    /// Sequence number of the next report.
    sequence: u16,
}

impl Host {
    fn number(&mut self) -> u16 {
        self.sequence = self.sequence.wrapping_add(1);
        self.sequence
    }

    fn send(&mut self, report: &[u8; LENGTH]) {
        self.stream
            .write_all(&packet(report))
            .expect("QEMU reads the line");
    }

    /// Reads the bytes that have come, after waiting for the first.
    fn fill(&mut self) {
        let mut buffer = [0; 4096];
        let count = self
            .stream
            .read(&mut buffer)
            .expect("the firmware sends states");
        assert!(count > 0, "{}: the line ended", self.name);
        self.bytes = buffer[..count].iter().rev().copied().collect();
    }

    /// Waits for the next report.
    fn report(&mut self) -> Report {
        let start = Instant::now();
        loop {
            while let Some(byte) = self.bytes.pop() {
                if let Some(report) = self.decoder.push(byte) {
                    return Report::decode(report).expect("a report of the device is valid");
                }
            }
            assert!(start.elapsed() < PATIENCE, "{}: no report comes", self.name);
            self.fill();
        }
    }

    /// Waits for the next state.
    fn state(&mut self) -> StateReport {
        loop {
            if let Report::State(state) = self.report() {
                return state;
            }
        }
    }

    /// Waits for a fresh state: older states that wait on the line are left out.
    fn newest(&mut self) -> StateReport {
        self.bytes.clear();
        self.stream.set_nonblocking(true).expect("a TCP stream");
        let mut buffer = [0; 4096];
        loop {
            match self.stream.read(&mut buffer) {
                Ok(0) => panic!("{}: the line ended", self.name),
                Ok(_) => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) => panic!("{}: {error}", self.name),
            }
        }
        self.stream.set_nonblocking(false).expect("a TCP stream");
        // A part of a packet may be lost: begin after the next zero.
        self.decoder = Decoder::new();
        while !matches!(self.next_byte(), 0) {}
        self.state()
    }

    fn next_byte(&mut self) -> u8 {
        loop {
            match self.bytes.pop() {
                Some(byte) => return byte,
                None => self.fill(),
            }
        }
    }

    /// Waits for a state of which `holds` is true. Calls `again` now, and again after each [`STATES`] other states.
    fn until(
        &mut self,
        waits_for: &str,
        mut again: impl FnMut(&mut Self),
        mut holds: impl FnMut(&StateReport) -> bool,
    ) -> StateReport {
        let start = Instant::now();
        loop {
            again(self);
            for _ in 0..STATES {
                let state = self.state();
                if holds(&state) {
                    return state;
                }
                assert!(
                    start.elapsed() < PATIENCE,
                    "{}: waits for {waits_for}: {state:?}",
                    self.name
                );
            }
        }
    }

    /// Waits for a state of which `holds` is true.
    fn see(&mut self, waits_for: &str, holds: impl FnMut(&StateReport) -> bool) -> StateReport {
        self.until(waits_for, |_| {}, holds)
    }

    fn hello(&mut self, session: u32, watchdog_us: u32) {
        let sequence = self.number();
        let hello = HelloReport {
            sequence,
            session,
            newest: VERSION,
            watchdog_us,
        };
        self.send(&hello.encode());
    }

    /// Opens a session, once the device has found its reference.
    fn greet(&mut self, session: u32, watchdog_us: u32) -> CapabilitiesReport {
        self.see("the end of the search", |state| {
            state.condition.mode == Mode::Idle
        });
        self.session = session;
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            self.hello(session, watchdog_us);
            for _ in 0..STATES {
                match self.report() {
                    Report::Capabilities(report) if report.session == session => return report,
                    _ => {}
                }
            }
        }
        panic!("{}: no answer to the hello", self.name);
    }

    fn wrench(&mut self, answers: u16, force: [i32; 3]) -> WrenchReport {
        WrenchReport {
            sequence: self.number(),
            session: self.session,
            answers,
            force,
            moment: [0; 3],
            flags: flags::ENABLE,
        }
    }

    /// Sends wrenches with a force (uN) until a state names the last wrench as in force; returns this state. On a slow
    /// machine a wrench may come too late: the firmware refuses it, and the host sends another.
    fn push(&mut self, force: [i32; 3]) -> StateReport {
        let mut sent = 0;
        let again = |host: &mut Self| {
            let answers = host.newest().sequence;
            let wrench = host.wrench(answers, force);
            host.send(&wrench.encode());
        };
        let start = Instant::now();
        loop {
            again(self);
            sent += 1;
            let mine = self.sequence;
            for _ in 0..STATES {
                let state = self.state();
                if state.condition.in_force() == Some(mine) {
                    return state;
                }
            }
            assert!(
                start.elapsed() < PATIENCE,
                "{}: none of {sent} wrenches came into force",
                self.name
            );
        }
    }

    /// Waits until the handle rests without force.
    fn rest(&mut self) -> StateReport {
        let mut still = 0;
        let mut last = [0; 3];
        self.see("rest", |state| {
            let same = state.position == last && state.condition.in_force().is_none();
            still = if same { still + 1 } else { 0 };
            last = state.position;
            still > 100
        })
    }
}

#[test]
fn the_device_finds_its_reference_answers_and_sends_states_in_sequence() {
    each(|mut board| {
        let name = board.name;
        let mut host = board.host();
        // QEMU has waited for this host, so the first state is the first of the device.
        let first = host.state();
        assert_eq!((first.sequence, first.session), (0, 0), "{name}");
        assert_eq!(first.condition.mode, Mode::Homing, "{name}");
        assert_eq!(first.condition.status, 0, "{name}: {first:?}");
        let capabilities = host.greet(0x00C0_FFEE, 0);
        assert_eq!(capabilities.watchdog_us, 10_000, "{name}");
        let model = capabilities.model;
        let text = String::from_utf8_lossy(&model.name);
        assert_eq!(text.trim_end_matches('\0'), name);
        assert_eq!(model.sends, Sends::Poses);
        assert_eq!([model.sensed, model.actuated], [axes::TRANSLATIONS; 2]);
        assert_eq!((model.max_force, model.rate), (8_000_000, [1000; 2]));
        let version = FirmwareVersion {
            major: 1,
            minor: 0,
            patch: 0,
        };
        assert_eq!(model.firmware, version);

        let first = host.state();
        let mut last = first;
        for _ in 0..500 {
            let state = host.state();
            let step = state.sequence.wrapping_sub(last.sequence);
            assert_eq!(step, 1, "{name}: {last:?}, then {state:?}");
            let us = state.condition.time_us.wrapping_sub(last.condition.time_us);
            // A state may be a tick late.
            assert!((1000 - TICK_US..10_000).contains(&us), "{name}: {us} us");
            assert_eq!(state.session, 0x00C0_FFEE, "{name}");
            assert_eq!(
                state.condition.status,
                status::CALIBRATED | status::POWERED,
                "{name}"
            );
            last = state;
        }
        // The loop of an emulated processor may be held up at times.
        let us = last.condition.time_us.wrapping_sub(first.condition.time_us);
        assert!(
            (495_000..525_000).contains(&us),
            "{name}: 500 states in {us} us"
        );
        // The reference is right: the device reports the true position, to a count.
        let state = host.rest();
        let truth = board.truth();
        for (told, nm) in state.position.into_iter().zip(truth.position_nm) {
            assert!(
                (nm - told * 100).abs() <= 10_000,
                "{name}: {state:?} {truth:?}"
            );
        }
        board.command(b'b');
        host.see("the button", |state| state.condition.buttons == 1);
        board.command(b'B');
        host.see("no button", |state| state.condition.buttons == 0);
    });
}

#[test]
fn a_force_moves_the_handle_by_its_mass_and_ends_with_the_watchdog() {
    each(|mut board| {
        let name = board.name;
        let mut host = board.host();
        host.greet(7, WATCHDOG_MOST_US);
        let force = [3_000_000, -2_000_000, 1_000_000];
        let from = host.rest();
        // One wrench, and then silence: the wrench is in force for one watchdog, at any speed of QEMU.
        let first = host.push(force);
        let begin_us = first.condition.since_us;
        let after = |state: &StateReport| state.condition.time_us.wrapping_sub(begin_us);
        let moved = host.see("20 ms of motion", |state| after(state) >= 20_000);
        assert!(moved.condition.in_force().is_some(), "{name}: {moved:?}");
        let seconds = f64::from(after(&moved)) * 1e-6;
        for axis in 0..3 {
            let newtons = f64::from(force[axis]) * 1e-6;
            let metres = f64::from(moved.position[axis] - from.position[axis]) * 1e-7;
            // Force and friction over mass; damping takes a share that grows with time (the first term of its series).
            let free = (newtons.abs() - FRICTION) / MASS * newtons.signum();
            let expected = free * (1.0 - DAMPING / MASS * seconds / 3.0);
            let found = 2.0 * metres / (seconds * seconds);
            // In 20 ms, 1 N moves the handle by 0.8 mm. A count is 1.2 % of this path. The spring of the hand takes
            // 1.7 %, the next term of the series adds 1.3 %, and the force acts up to a tick later: 2.5 %.
            assert!(
                (found - expected).abs() <= 0.08 * expected.abs(),
                "{name}: axis {axis}: {found} m/s^2, expected {expected} m/s^2"
            );
        }
        assert_eq!(first.condition.mode, Mode::Active, "{name}");

        let end = host.see("no force", |state| state.condition.in_force().is_none());
        let lasted_us = end.condition.since_us.wrapping_sub(begin_us);
        // The firmware looks at its watchdog in each tick, so the end may be a tick late. A second tick is for delays
        // of the loop.
        let range_us = WATCHDOG_MOST_US - TICK_US..=WATCHDOG_MOST_US + 2 * TICK_US;
        assert!(range_us.contains(&lasted_us), "{name}: {lasted_us} us");
        assert_eq!(end.condition.mode, Mode::Idle, "{name}");
        assert!(
            end.condition.status & status::WATCHDOG != 0,
            "{name}: {end:?}"
        );
        let truth = board.truth();
        assert_eq!(truth.force, [0; 3], "{name}: {truth:?}");

        // The device comes back after the silence, with the true force.
        let mut felt = false;
        let start = Instant::now();
        while !felt {
            assert!(start.elapsed() < PATIENCE, "{name}: no force");
            host.push([500_000, 0, 0]);
            felt = board.truth().force == [500_000, 0, 0];
        }
        // A watchdog of another length, which the host asks for, ends the force as well.
        host.see("no force", |state| state.condition.in_force().is_none());
        let wanted_us = 40_000;
        host.greet(8, wanted_us);
        let begin_us = host.push([500_000, 0, 0]).condition.since_us;
        let end = host.see("no force", |state| state.condition.in_force().is_none());
        let lasted_us = end.condition.since_us.wrapping_sub(begin_us);
        let range_us = wanted_us - TICK_US..=wanted_us + 2 * TICK_US;
        assert!(range_us.contains(&lasted_us), "{name}: {lasted_us} us");
    });
}

/// A kind of error, and a report with this error, which the device must refuse.
type Wrong = (&'static str, fn(&mut Host, u16) -> [u8; LENGTH]);

const WRONG: [Wrong; 8] = [
    ("a changed bit", |host, answers| {
        let mut report = host.wrench(answers, [1_000_000; 3]).encode();
        report[14] ^= 1;
        report
    }),
    ("another session", |host, answers| {
        let wrench = host.wrench(answers, [1_000_000; 3]);
        let session = wrench.session + 1;
        WrenchReport { session, ..wrench }.encode()
    }),
    ("an old sequence number", |host, answers| {
        let wrench = host.wrench(answers, [1_000_000; 3]);
        let sequence = wrench.sequence.wrapping_sub(1000);
        WrenchReport { sequence, ..wrench }.encode()
    }),
    ("an old state", |host, answers| {
        host.wrench(answers.wrapping_sub(400), [1_000_000; 3])
            .encode()
    }),
    ("a state that was never sent", |host, answers| {
        host.wrench(answers.wrapping_add(20_000), [1_000_000; 3])
            .encode()
    }),
    ("too large a force", |host, answers| {
        host.wrench(answers, [8_000_002, 0, 0]).encode()
    }),
    ("another version", |host, answers| {
        let mut report = host.wrench(answers, [1_000_000; 3]).encode();
        report[0] = VERSION + 1;
        seal(report)
    }),
    ("a report of a device", |host, _| {
        let sequence = host.number();
        let mut state = host.newest();
        state.sequence = sequence;
        state.encode()
    }),
];

/// The report with the right check sum: CRC-16/IBM-3740, bit by bit.
fn seal(mut report: [u8; LENGTH]) -> [u8; LENGTH] {
    let (fields, sum) = report.split_at_mut(LENGTH - 2);
    let crc = fields.iter().fold(u16::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u16::from(byte) << 8, |crc, _| {
            (crc << 1) ^ if crc & 0x8000 == 0 { 0 } else { 0x1021 }
        })
    });
    sum.copy_from_slice(&crc.to_le_bytes());
    report
}

#[test]
fn nothing_wrong_is_ever_applied() {
    each(|mut board| {
        let name = board.name;
        let mut host = board.host();
        host.greet(7, WATCHDOG_MOST_US);
        host.sequence = 5000;
        // The device accepts this release, so an older number must not follow.
        let mut release = host.wrench(0, [0; 3]);
        release.flags = 0;
        host.send(&release.encode());
        for (what, make) in WRONG {
            for _ in 0..5 {
                let state = host.newest();
                let report = make(&mut host, state.sequence);
                let refused = state.condition.refused.wrapping_add(1);
                host.send(&report);
                let state = host.see(what, |state| {
                    assert_eq!(state.condition.in_force(), None, "{name}: {what}");
                    state.condition.refused == refused
                });
                assert_eq!(state.condition.mode, Mode::Idle, "{name}: {what}");
            }
            let truth = board.truth();
            assert_eq!(truth.force, [0; 3], "{name}: {what}: {truth:?}");
        }
        // Parts of packets and garbage are no reports, and the next packet after a zero is found.
        let answers = host.newest().sequence;
        let whole = packet(&host.wrench(answers, [1_000_000; 3]).encode());
        for length in [1, 2, 33, PACKET - 2] {
            let mut bytes = whole[..length].to_vec();
            bytes.push(0);
            host.stream.write_all(&bytes).expect("QEMU reads the line");
        }
        host.stream
            .write_all(&[0xA5; 200])
            .and_then(|()| host.stream.write_all(&[0]))
            .expect("QEMU reads the line");
        let refused = host.newest().condition.refused;
        let state = host.push([250_000, 0, 0]);
        assert_eq!(state.condition.mode, Mode::Active, "{name}");
        assert!(
            state.condition.refused.wrapping_sub(refused) < 128,
            "{name}: {state:?}"
        );
        // No other host takes an active device. If the watchdog was faster than the hello, try again.
        let start = Instant::now();
        loop {
            let begun = host.push([250_000, 0, 0]).condition.refused;
            host.hello(99, 0);
            let state = host.see("an answer to the hello", |state| {
                state.condition.refused != begun || state.session == 99
            });
            if state.session == 7 {
                assert_eq!(state.condition.mode, Mode::Active, "{name}");
                break;
            }
            assert!(
                start.elapsed() < PATIENCE,
                "{name}: the hello of another host is accepted"
            );
            host.greet(7, WATCHDOG_MOST_US);
        }
    });
}

#[test]
fn a_host_that_has_gone_leaves_no_force_and_another_host_comes() {
    each(|mut board| {
        let name = board.name;
        let mut host = board.host();
        for session in 1..4 {
            host.greet(session, WATCHDOG_MOST_US);
            host.push([400_000, 0, 0]);
            drop(host);
            // The connection has ended; the watchdog of the device lets go.
            let start = Instant::now();
            while board.truth().force != [0; 3] {
                assert!(start.elapsed() < PATIENCE, "{name}: the force stays");
            }
            host = board.host();
            // The device still has the session of the host that has gone.
            let state = host.newest();
            assert_eq!(state.session, session, "{name}: {state:?}");
            assert_eq!(state.condition.in_force(), None, "{name}: {state:?}");
        }
    });
}

#[test]
fn the_emergency_stop_cuts_the_amplifiers_and_its_release_begins_anew() {
    each(|mut board| {
        let name = board.name;
        let mut host = board.host();
        host.greet(7, WATCHDOG_MOST_US);
        host.push([400_000, 0, 0]);
        board.command(b'e');
        let state = host.see("a fault", |state| state.condition.mode == Mode::Fault);
        let stop = fault::EMERGENCY_STOP.get();
        assert_eq!(state.condition.fault, stop, "{name}");
        assert_eq!(
            state.condition.status & (status::POWERED | status::IN_FORCE),
            0,
            "{name}"
        );
        let truth = board.truth();
        assert!(!truth.enabled && truth.force == [0; 3], "{name}: {truth:?}");
        // A wrench is refused.
        let refused = state.condition.refused;
        let answers = host.newest().sequence;
        let wrench = host.wrench(answers, [400_000, 0, 0]);
        host.send(&wrench.encode());
        host.see("a refused wrench", |state| {
            assert_eq!(state.condition.in_force(), None, "{name}");
            state.condition.refused == refused.wrapping_add(1)
        });
        assert!(!board.truth().enabled, "{name}");
        board.command(b'E');
        host.see("the end of the session", |state| {
            state.condition.mode == Mode::Idle && state.session == 0
        });
        host.greet(8, WATCHDOG_MOST_US);
        host.push([400_000, 0, 0]);
    });
}

#[test]
fn a_firmware_that_fails_lets_go_and_says_so() {
    each(|mut board| {
        let name = board.name;
        // A panic, then an unknown instruction.
        for cause in *b"pt" {
            let mut host = board.host();
            host.greet(7, WATCHDOG_MOST_US);
            host.push([400_000, 0, 0]);
            board.command(cause);
            let failed = |state: &StateReport| {
                state.condition.mode == Mode::Fault && state.condition.fault >= 128
            };
            let state = host.see("a fault of its own", failed);
            assert_eq!(state.session, 0, "{name}");
            assert_eq!(
                state.condition.status & (status::POWERED | status::IN_FORCE),
                0,
                "{name}"
            );
            if cause == b'p' {
                // After a trap the mechanism does not answer: the fault has a higher priority than the tick.
                let truth = board.truth();
                assert!(!truth.enabled && truth.force == [0; 3], "{name}: {truth:?}");
            }
            // No greeting ends the fault.
            for _ in 0..3 {
                host.hello(8, 0);
                for _ in 0..50 {
                    let state = host.state();
                    assert!(failed(&state) && state.session == 0, "{name}: {state:?}");
                }
            }
            board = board.again();
        }
    });
}

/// Opens the board by address, as a scene does.
fn open(name: &str, address: &str) -> AnyDevice {
    let model = DeviceModel::named("falcon").expect("a built-in device");
    let registry = Registry::new().with(Tcp);
    let request = Request::new(&model, address);
    let start = Instant::now();
    loop {
        match registry.open("tcp", &request) {
            Ok(device) => return device,
            // The driver waits for a second; QEMU on a busy machine may need longer to start, or to end a connection.
            Err(error) => assert!(start.elapsed() < PATIENCE, "{name}: {error}"),
        }
    }
}

#[test]
fn the_driver_finds_that_the_firmware_conforms() {
    each(|board| {
        // The suite does not wait for states.
        Suite::new(board.name)
            .states(0)
            .check(|| open(board.name, &board.board.line().to_string()));
    });
}

#[test]
fn the_driver_moves_the_handle_of_the_firmware_through_a_paced_line() {
    each(|mut board| {
        let name = board.name;
        let mut listener = Listener::tcp(0).expect("a port");
        let connection = listener.connection();
        let address = connection.strip_prefix("tcp:").expect("a port");
        let line = Stream::tcp(&board.board.line().to_string()).expect("QEMU listens");
        let mut paced = Paced::new(line);
        let stop = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !stop.load(Ordering::Relaxed) {
                    paced.clear();
                    let host = listener.host(Duration::from_millis(1)).expect("a listener");
                    let Some(mut host) = host else { continue };
                    // An error is the end of a host.
                    let _ = serve(&mut paced, &mut host, PERIOD, &stop, &mut Served::default());
                }
            });
            let mut device = open(name, address);
            let force = Vec3::new(0.75, -0.5, 0.25);
            let wrench = Wrench {
                force,
                moment: Vec3::zeros(),
            };
            let (mut felt, mut moved) = (false, false);
            let start = Instant::now();
            while !felt || !moved {
                assert!(
                    start.elapsed() < PATIENCE,
                    "{name}: felt {felt}, moved {moved}"
                );
                let now_ns = start.elapsed().as_nanos() as u64;
                let state = device.read(now_ns);
                // The hand is a spring of 100 N/m: 0.75 N move the handle by 7 mm.
                moved |= state.is_ok_and(|state| state.pose.position.x > 3e-3);
                let _ = device.write(now_ns, &wrench);
                std::thread::sleep(PERIOD);
                felt |= board.truth().force == [750_000, -500_000, 250_000];
            }
            drop(device);
            // The driver lets go by its last report, or the watchdog does.
            while board.truth().force != [0; 3] {
                assert!(start.elapsed() < 2 * PATIENCE, "{name}: the force stays");
            }
            stop.store(true, Ordering::Relaxed);
        });
    });
}

#[test]
fn the_figures_leave_half_of_the_processor_free() {
    each(|mut board| {
        println!();
        let mut host = board.host();
        host.greet(7, WATCHDOG_MOST_US);
        // Instructions for each state, without a wrench, and with the wrenches that QEMU passes on.
        for busy in [false, true] {
            let before = board.truth();
            let first = host.newest();
            let (mut last, mut wrenches, mut delays) = (first, 0_u32, Vec::new());
            while last.sequence.wrapping_sub(first.sequence) < 500 {
                if busy {
                    let answered = host.newest();
                    let wrench = host.wrench(answered.sequence, [100_000, 0, 0]);
                    host.send(&wrench.encode());
                    for _ in 0..STATES {
                        last = host.state();
                        if last.condition.in_force() == Some(wrench.sequence) {
                            let since = last.condition.since_us;
                            delays.push(since.wrapping_sub(answered.condition.time_us));
                            wrenches += 1;
                            break;
                        }
                    }
                } else {
                    last = host.state();
                }
            }
            let after = board.truth();
            let steps = after.ticks.wrapping_sub(before.ticks);
            let slept = after.slept_cycles.wrapping_sub(before.slept_cycles);
            let worked = (steps * TICK_CYCLES).saturating_sub(slept);
            let states = f64::from(last.sequence.wrapping_sub(first.sequence));
            let instructions = f64::from(worked) * f64::from(CYCLE_NS) / f64::from(INSTRUCTION_NS);
            let share = instructions / f64::from(steps) * f64::from(1000 / TICK_US);
            println!(
                "{}: {share:.0} instructions for a state and its {} ticks",
                board.name,
                1000 / TICK_US
            );
            if busy {
                assert!(wrenches > 0, "{}: no wrench came into force", board.name);
                delays.sort_unstable();
                println!(
                    "{}: with {:.2} wrenches a state; motion to force {} us (median, device's clock)",
                    board.name,
                    f64::from(wrenches) / states,
                    delays[delays.len() / 2]
                );
            }
            // The count of instructions does not depend on the load of this machine.
            let cycles = worked / steps;
            assert!(
                cycles < TICK_CYCLES / 2,
                "{}: {cycles} cycles a tick",
                board.name
            );
        }
    });
}
