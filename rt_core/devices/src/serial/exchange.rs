//! The exchange with a device over a stream.

#![cfg_attr(
    not(test),
    deny(
        clippy::arithmetic_side_effects,
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used,
    )
)]

use crate::exchange::MotionSource;
use crate::firmware::{GreetingError, NO_DEVICE, TIMED_OUT, check, session};
use crate::hid::Reports;
use crate::stated::{Mismatch, Name};
use crate::{Exchange, Transport};
use core::time::Duration;
use firmware_proto::host::HostError;
use firmware_proto::report::ReportError;
use firmware_proto::stream::{Decoder, packet};
use rt_core::{Capabilities, DeviceError, DeviceState, Wrench};

/// Time within which a device must answer the greeting (ns).
pub const GREETING_NS: u64 = 1_000_000_000;
/// Number of periods of the device without a packet after which the device counts as disconnected.
pub const SILENT_PERIODS: u64 = 50;
/// The shortest and the longest silence after which a device counts as disconnected (ns). A loaded machine is late by
/// some periods of a fast device.
const SILENCE_NS: (u64, u64) = (50_000_000, 1_000_000_000);
/// Longest time that an exchange waits for a state (ns).
const WAIT_NS: u64 = 10_000_000;
/// Number of bytes in one read.
const BUFFER: usize = 1024;
/// Largest number of reads in one exchange, so that an endless stream cannot hold up the exchange. A serial line may
/// give its bytes one by one. This number of reads then covers three packets.
const READS: usize = 256;

/// Opens the connection of a device, or returns the error number of the system.
type Open<T> = dyn FnMut() -> Result<T, i32> + Send;
/// A clock (ns) that never goes back.
type Clock = dyn FnMut() -> u64 + Send;

/// A device that speaks the firmware protocol over a stream.
pub struct Serial<T> {
    /// `None` while the device is lost.
    transport: Option<T>,
    open: Box<Open<T>>,
    clock: Box<Clock>,
    profile: Capabilities,
    watchdog_us: u32,
    reports: Reports,
    /// The name that the device stated first. A device of another name is another device.
    name: Option<Name>,
    decoder: Decoder,
    /// Time of the last packet (ns).
    heard_ns: u64,
}

impl<T: Transport> Serial<T> {
    /// Opens a device by `open`, which [`Exchange::reopen`] calls again, and greets the device. Waits for its answer
    /// for a second. `profile` are the capabilities that the controller relies on, and `watchdog_us` is the watchdog
    /// that the device is asked for (see [`firmware_proto::report::HelloReport::watchdog_us`]).
    ///
    /// # Errors
    /// [`GreetingError`] if the connection fails, or if the device does not answer, speaks another version of the
    /// protocol, or is not the device of the profile.
    pub fn open(
        profile: Capabilities,
        watchdog_us: u32,
        open: impl FnMut() -> Result<T, i32> + Send + 'static,
        clock: impl FnMut() -> u64 + Send + 'static,
    ) -> Result<Self, GreetingError> {
        let mut new = Self {
            transport: None,
            open: Box::new(open),
            clock: Box::new(clock),
            profile,
            watchdog_us,
            reports: Reports::new(session(), watchdog_us),
            name: None,
            decoder: Decoder::new(),
            heard_ns: 0,
        };
        new.connect()?;
        Ok(new)
    }

    /// Counts of the reports of this session, the device's status, motion to force, and the host's side of the protocol.
    pub fn reports(&self) -> &Reports {
        &self.reports
    }

    /// Number of packets of this session that were no report.
    pub fn garbage(&self) -> u32 {
        self.decoder.refused()
    }

    /// Opens the connection, and begins a session.
    fn connect(&mut self) -> Result<(), GreetingError> {
        // No other program can open a tty before it is closed.
        self.transport = None;
        self.transport = Some((self.open)().map_err(GreetingError::Ended)?);
        self.reports.begin_session(session(), self.watchdog_us);
        self.decoder = Decoder::new();
        let start_ns = (self.clock)();
        self.heard_ns = start_ns;
        // The zero ends all earlier bytes.
        self.write(&[0]).map_err(GreetingError::Ended)?;
        loop {
            let now_ns = (self.clock)();
            if now_ns.saturating_sub(start_ns) >= GREETING_NS {
                return Err(self.no_answer());
            }
            self.command(&Wrench::zero(), now_ns)
                .map_err(GreetingError::Ended)?;
            if let Err(DeviceError::Disconnected(number)) = self.newest() {
                return Err(GreetingError::Ended(number));
            }
            if let Some(HostError::Report(error @ ReportError::Version { .. })) =
                self.reports.refused
            {
                return Err(GreetingError::Version(error));
            }
            if self.agree()? {
                return Ok(());
            }
        }
    }

    /// The reason why no answer came.
    fn no_answer(&self) -> GreetingError {
        match self.reports.refused {
            // The state of the device shows that it has no session.
            Some(HostError::Session { found: 0 }) => GreetingError::Deaf,
            Some(error) => GreetingError::Refused(error),
            None if self.decoder.refused() > 0 => GreetingError::Garbage,
            None => GreetingError::Silent,
        }
    }

    /// Whether the device has answered. The result is an error if the device is not that of the profile, or not the
    /// same as before.
    fn agree(&mut self) -> Result<bool, GreetingError> {
        let Some(report) = self.reports.host().capabilities() else {
            return Ok(false);
        };
        check(&report.model, &self.profile)?;
        let name = Name(report.model.name);
        match *self.name.get_or_insert(name) {
            first if first == name => Ok(true),
            _ => Err(Mismatch::Changed { name }.into()),
        }
    }

    /// The name of the device's model; `None` before its first answer.
    pub fn name(&self) -> Option<Name> {
        self.name
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        self.transport.as_mut().ok_or(NO_DEVICE)?.write(bytes)
    }

    /// Sends the wrench, or a hello that is due.
    fn command(&mut self, wrench: &Wrench, now_ns: u64) -> Result<(), i32> {
        match self.reports.command(wrench, now_ns) {
            Some(report) => self.write(&packet(&report)),
            None => Ok(()),
        }
    }

    /// The longest period of the device (ns). Until the device has answered, the period of the longest wait.
    fn period_ns(&self) -> u64 {
        let capabilities = self.reports.host().capabilities();
        let [rate, _] = capabilities.map_or([0; 2], |report| report.model.rate);
        1_000_000_000_u64
            .checked_div(rate.into())
            .unwrap_or(WAIT_NS)
    }

    /// Reads the bytes that have come, and waits if they contain no state. Returns the newest state.
    fn newest(&mut self) -> Result<DeviceState, DeviceError> {
        let wait_ns = self.period_ns().min(WAIT_NS);
        let transport = self.transport.as_mut();
        let transport = transport.ok_or(DeviceError::Disconnected(NO_DEVICE))?;
        let garbage = self.decoder.refused();
        let until_ns = (self.clock)().saturating_add(wait_ns);
        let mut newest = self.reports.begin();
        let mut buffer = [0; BUFFER];
        for _ in 0..READS {
            let left_ns = if newest.is_state() {
                0
            } else {
                until_ns.saturating_sub((self.clock)())
            };
            let count = match transport.read(&mut buffer, Duration::from_nanos(left_ns)) {
                Ok(0) => break,
                Ok(count) => count,
                // A state that came before the end is still good. The next exchange fails.
                Err(_) if newest.is_state() => break,
                Err(number) => return Err(DeviceError::Disconnected(number)),
            };
            let now_ns = (self.clock)();
            for &byte in buffer.get(..count).unwrap_or(&buffer) {
                if let Some(report) = self.decoder.push(byte) {
                    self.heard_ns = now_ns;
                    self.reports.receive(&mut newest, report, now_ns);
                }
            }
        }
        if self.decoder.refused() != garbage {
            newest.garbage();
        }
        self.reports.state(newest, self.profile.sensed)
    }
}

impl<T: Transport> Exchange for Serial<T> {
    fn exchange(&mut self, wrench: &Wrench) -> Result<DeviceState, DeviceError> {
        let result = self.exchanged(wrench);
        if let Err(DeviceError::Disconnected(_)) = result {
            // Its name is free for the device that comes back.
            self.transport = None;
        }
        result
    }

    fn release(&mut self) {
        let report = packet(&self.reports.release());
        // The device lets go by itself if the report does not reach it.
        let _ = self.write(&report);
    }

    fn reopen(&mut self) -> Result<(), DeviceError> {
        self.connect().map_err(|error| {
            self.transport = None;
            DeviceError::Disconnected(error.number())
        })
    }

    fn motion_to_force(&self) -> MotionSource {
        MotionSource::Device(self.reports.shown_ns())
    }

    fn refused_wrenches(&self) -> Option<u64> {
        Some(self.reports.refused_by_device)
    }
}

impl<T: Transport> Serial<T> {
    /// One exchange.
    fn exchanged(&mut self, wrench: &Wrench) -> Result<DeviceState, DeviceError> {
        let now_ns = (self.clock)();
        self.command(wrench, now_ns)
            .map_err(DeviceError::Disconnected)?;
        let state = self.newest();
        // A device that was restarted is greeted again, and may be another one.
        self.agree()
            .map_err(|error| DeviceError::Disconnected(error.number()))?;
        let (shortest, longest) = SILENCE_NS;
        let silence_ns = self.period_ns().saturating_mul(SILENT_PERIODS);
        let silent_ns = (self.clock)().saturating_sub(self.heard_ns);
        if silent_ns >= silence_ns.clamp(shortest, longest) {
            return Err(DeviceError::Disconnected(TIMED_OUT));
        }
        state
    }
}

#[cfg(test)]
mod tests;
