//! A device behind a slow line, as an emulated device. Wrenches pass no faster than the line carries them.
//!
//! The UART of a board in QEMU takes about 10,000 bytes a second on a machine that emulates a thousand states a second.
//! The wrenches of a host would wait in the line until each of them is too old. [`Paced`] is between the host and the
//! line. It passes a wrench on when the device has answered the last one. Of several wrenches that wait, it passes only
//! the newest. It never leaves out a hello. States pass unchanged.
//!
//! [`Paced`] does not pass a report that the device must refuse, so a test of wrong reports uses the line itself.

use devices::Transport;
use firmware_proto::report::{HelloReport, Report, WrenchReport, flags};
use firmware_proto::stream::{Decoder, packet};
use sim::emulate::Emulator;
use std::collections::VecDeque;
use std::time::Duration;

/// Number of states after which a report counts as lost.
const LOST: u32 = 20;
/// Largest number of bytes that wait for the host. Later bytes are lost, as on a line without a reader.
const WAITING: usize = 65_536;

/// A report that was passed on, and has no answer yet.
#[derive(Clone, Copy, Debug)]
struct Passed {
    /// The sequence number of a wrench that is in force after its arrival; none for a release.
    wrench: Option<u16>,
    /// The device's count of refused reports before this report, once a state has shown it.
    refused: Option<u8>,
    /// Number of states since the report was passed on.
    states: u32,
}

/// A device behind a slow line.
#[derive(Debug)]
pub struct Paced<T> {
    line: T,
    from_host: Decoder,
    from_device: Decoder,
    hello: Option<HelloReport>,
    wrench: Option<WrenchReport>,
    passed: Option<Passed>,
    refused: Option<u8>,
    outgoing: VecDeque<u8>,
}

impl<T: Transport> Paced<T> {
    /// A device behind `line`.
    pub fn new(line: T) -> Self {
        Self {
            line,
            from_host: Decoder::new(),
            from_device: Decoder::new(),
            hello: None,
            wrench: None,
            passed: None,
            refused: None,
            outgoing: VecDeque::new(),
        }
    }

    /// Drops the bytes that wait in both directions, because the host has gone, or a new host comes.
    pub fn clear(&mut self) {
        self.listen();
        (self.hello, self.wrench) = (None, None);
        self.from_host = Decoder::new();
        self.outgoing.clear();
    }

    /// Reads the line.
    fn listen(&mut self) {
        let mut buffer = [0; 1024];
        // A line that has ended gives no bytes; the host then finds a silent device.
        while let Ok(count @ 1..) = self.line.read(&mut buffer, Duration::ZERO) {
            for &byte in buffer.get(..count).unwrap_or(&buffer) {
                if self.outgoing.len() < WAITING {
                    self.outgoing.push_back(byte);
                }
                if let Some(report) = self.from_device.push(byte) {
                    let report = Report::decode(report);
                    self.heard(report.ok());
                }
            }
        }
        self.pass();
    }

    /// Takes a report of the device, and decides whether it answers the report that was passed on.
    fn heard(&mut self, report: Option<Report>) {
        let condition = match report {
            Some(Report::State(state)) => state.condition,
            Some(Report::Encoders(state)) => state.condition,
            Some(Report::Capabilities(_)) => {
                self.passed = None;
                return;
            }
            _ => return,
        };
        self.refused = Some(condition.refused);
        if let Some(passed) = &mut self.passed {
            passed.states += 1;
            let answered = condition.in_force() == passed.wrench
                || passed
                    .refused
                    .is_some_and(|before| before != condition.refused)
                || passed.states >= LOST;
            passed.refused = Some(condition.refused);
            if answered {
                self.passed = None;
            }
        }
    }

    /// Passes the next report on, if the line is free.
    fn pass(&mut self) {
        if self.passed.is_some() {
            return;
        }
        let (report, wrench) = if let Some(hello) = self.hello.take() {
            (hello.encode(), None)
        } else if let Some(wrench) = self.wrench.take() {
            let applied = wrench.flags & flags::ENABLE != 0;
            (wrench.encode(), applied.then_some(wrench.sequence))
        } else {
            return;
        };
        self.passed = Some(Passed {
            wrench,
            refused: self.refused,
            states: 0,
        });
        // A line that has ended takes no bytes; the host then finds a silent device.
        let _ = self.line.write(&packet(&report));
    }
}

impl<T: Transport> Emulator for Paced<T> {
    fn receive(&mut self, bytes: &[u8], _: u64) {
        for &byte in bytes {
            if let Some(report) = self.from_host.push(byte) {
                match Report::decode(report) {
                    Ok(Report::Hello(hello)) => self.hello = Some(hello),
                    Ok(Report::Wrench(wrench)) => self.wrench = Some(wrench),
                    _ => {}
                }
            }
        }
        self.pass();
    }

    fn send(&mut self, _: u64, report: &mut [u8; 64]) -> Option<usize> {
        if self.outgoing.is_empty() {
            self.listen();
        }
        let count = self.outgoing.len().min(report.len());
        for (to, from) in report.iter_mut().zip(self.outgoing.drain(..count)) {
            *to = from;
        }
        (count > 0).then_some(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use firmware_proto::report::{Condition, StateReport, VERSION, status};

    /// A line of which the test holds the other end.
    #[derive(Debug, Default)]
    struct Line {
        taken: Vec<u8>,
        given: VecDeque<u8>,
    }

    impl Transport for Line {
        fn read(&mut self, buffer: &mut [u8], _: Duration) -> Result<usize, i32> {
            let count = self.given.len().min(buffer.len());
            for (to, from) in buffer.iter_mut().zip(self.given.drain(..count)) {
                *to = from;
            }
            Ok(count)
        }

        fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
            self.taken.extend(bytes);
            Ok(())
        }
    }

    fn wrench(sequence: u16, flags: u8) -> [u8; 64] {
        WrenchReport {
            sequence,
            session: 7,
            answers: 0,
            force: [1, 2, 3],
            moment: [0; 3],
            flags,
        }
        .encode()
    }

    fn hello(sequence: u16) -> [u8; 64] {
        HelloReport {
            sequence,
            session: 7,
            newest: VERSION,
            watchdog_us: 0,
        }
        .encode()
    }

    /// A state that names a wrench as in force.
    fn state(in_force: Option<u16>, refused: u8) -> [u8; 64] {
        let condition = Condition {
            status: in_force.map_or(0, |_| status::IN_FORCE),
            wrench: in_force.unwrap_or(0),
            refused,
            ..Condition::default()
        };
        StateReport {
            sequence: 0,
            session: 7,
            condition,
            position: [0; 3],
            orientation: [i16::MAX, 0, 0, 0],
            velocity: [0; 3],
            angular_velocity: [0; 3],
        }
        .encode()
    }

    impl Paced<Line> {
        /// Takes reports from the host, and then reports from the device. Returns the reports that went to the device.
        fn turn(&mut self, host: &[[u8; 64]], device: &[[u8; 64]]) -> Vec<[u8; 64]> {
            for report in host {
                self.receive(&packet(report), 0);
            }
            for report in device {
                self.line.given.extend(packet(report));
            }
            let mut bytes = Vec::new();
            let mut buffer = [0; 64];
            while let Some(count) = self.send(0, &mut buffer) {
                bytes.extend_from_slice(&buffer[..count]);
            }
            let sent: Vec<_> = device.iter().flat_map(packet).collect();
            assert_eq!(bytes, sent, "all reports of the device reach the host");
            let mut decoder = Decoder::new();
            let taken = std::mem::take(&mut self.line.taken);
            let reports = taken.iter().filter_map(|&byte| decoder.push(byte).copied());
            reports.collect()
        }
    }

    #[test]
    fn of_the_wrenches_that_wait_the_newest_passes_once_the_last_has_an_answer() {
        let mut paced = Paced::new(Line::default());
        let on = |sequence| wrench(sequence, flags::ENABLE);
        // The first passes at once, and the next ones wait.
        assert_eq!(paced.turn(&[on(1), on(2), on(3)], &[]), [on(1)]);
        assert!(paced.turn(&[on(4)], &[state(None, 0)]).is_empty());
        assert_eq!(paced.turn(&[], &[state(Some(1), 0)]), [on(4)]);
        // A refusal is an answer, too.
        assert_eq!(paced.turn(&[on(5)], &[state(Some(1), 1)]), [on(5)]);
        // A lost report blocks the line for some states only.
        let states = [state(None, 1); LOST as usize];
        assert!(paced.turn(&[on(6)], &states[1..]).is_empty());
        assert_eq!(paced.turn(&[], &states[..1]), [on(6)]);
    }

    #[test]
    fn a_hello_and_a_release_are_not_left_out() {
        let mut paced = Paced::new(Line::default());
        let on = |sequence| wrench(sequence, flags::ENABLE);
        assert_eq!(paced.turn(&[on(1), hello(2), on(3)], &[]), [on(1)]);
        assert_eq!(paced.turn(&[], &[state(Some(1), 0)]), [hello(2)]);
        // After these states without an answer, the hello counts as lost.
        let states = [state(Some(1), 0); LOST as usize];
        assert_eq!(paced.turn(&[], &states), [on(3)]);
        let release = wrench(4, 0);
        assert_eq!(paced.turn(&[release], &[state(Some(3), 0)]), [release]);
        assert!(paced.turn(&[on(5)], &[state(Some(3), 0)]).is_empty());
        assert_eq!(paced.turn(&[], &[state(None, 0)]), [on(5)]);
        // A new host begins with nothing of the old one.
        paced.receive(&packet(&on(6)), 0);
        paced.clear();
        assert!(paced.turn(&[], &[state(Some(5), 0)]).is_empty());
    }

    #[test]
    fn garbage_does_not_pass() {
        let mut paced = Paced::new(Line::default());
        let mut broken = wrench(1, flags::ENABLE);
        broken[20] ^= 1;
        assert!(paced.turn(&[broken, state(None, 0)], &[]).is_empty());
        assert_eq!(
            paced.turn(&[wrench(2, flags::ENABLE)], &[]),
            [wrench(2, flags::ENABLE)]
        );
    }
}
