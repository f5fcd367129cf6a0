//! A device behind a slow line, as an emulated device: wrenches pass no faster than the line carries them.
//!
//! The UART of a board in QEMU takes about 10,000 bytes a second on a machine that emulates a thousand states a second.
//! The wrenches of a host would wait in the line until each of them is too old. [`Paced`] stands between: it passes a
//! wrench on when the device has answered the last, and of several wrenches that wait only the newest. A hello is never
//! left out. States pass unchanged.
//!
//! A report that the device must refuse does not come through, so a test of wrong reports uses the line itself.

use devices::Transport;
use firmware_proto::report::{HelloReport, Report, WrenchReport, flags};
use firmware_proto::stream::{Decoder, packet};
use sim::emulate::Emulator;
use std::collections::VecDeque;
use std::time::Duration;

/// Number of states after which a report counts as lost.
const LOST: u32 = 20;
/// Largest number of bytes that wait for the host. Later bytes are lost, as on a line that nobody reads.
const WAITING: usize = 65_536;

/// A report that was passed on, and has no answer yet.
#[derive(Clone, Copy, Debug)]
struct Passed {
    /// The sequence number of a wrench that is in force once it has come; none for a release.
    wrench: Option<u16>,
    /// The device's count of refused reports before, once a state has told it.
    refused: Option<u8>,
    /// States since.
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

    /// Forgets what waits in both directions: the host has gone, or a new host comes.
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

    /// A report of the device: is it the answer to the report that was passed on?
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
                || passed.refused != Some(condition.refused)
                || passed.states >= LOST;
            if answered {
                self.passed = None;
            }
        }
    }

    /// Passes the next report on, where the line is free.
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
