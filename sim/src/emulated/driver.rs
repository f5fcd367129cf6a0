//! The driver of an emulated device, with its threads in virtual time.

use super::link::{IMAGE, Link};
use crate::DeviceModel;
use crate::protocol::Protocol;
use core::num::NonZeroU32;
use devices::exchange::{Gate, RETRY, let_go_after};
use devices::falcon::{Falcon, Firmware, Settings, Tries};
use devices::ftdi::Chip;
use devices::hid::Reports;
use devices::serial::Serial;
use devices::woodenhaptics::{Setup, WoodenHaptics};
use devices::{Exchange, Transport};
use rt_core::Reading;
use rt_core::{DeviceError, Freedom, Vec3, Wrench};
use std::collections::VecDeque;
use std::path::Path;

/// Number of wrenches, and of answers, that may wait between the tick and the thread of a device.
const SLOTS: usize = 4;
/// Session of the driver over HID. The driver draws it anew at each start.
const SESSION: NonZeroU32 = NonZeroU32::MIN.saturating_add(6);

/// The driver, as the tick sees it.
pub enum Driver {
    /// A driver in a thread of its own.
    Exchanged(Thread),
    /// The driver over HID, which the tick reads itself.
    Reports(Box<Hid>),
}

impl Driver {
    /// Opens the device behind `link` for a loop of `period` (s). It brings a Falcon its firmware.
    ///
    /// # Panics
    /// Where the device does not answer, which none does without a fault.
    pub fn open(protocol: Protocol, model: &DeviceModel, period: f64, link: &Link) -> Self {
        let let_go = let_go_after(period);
        // The watchdog that the driver asks of a device is as long.
        let watchdog_us = let_go.as_micros() as u32;
        let (opened, clocked) = (link.clone(), link.clone());
        let open = move || opened.open();
        let clock = move || clocked.now_ns();
        let threaded = |exchange: Box<dyn Exchange>| {
            Driver::Exchanged(Thread {
                exchange,
                gate: Gate::default(),
                let_go_ns: let_go.as_nanos() as u64,
                wrenches: VecDeque::new(),
                answers: VecDeque::new(),
                seen: 0,
                since_ns: link.now_ns(),
                retry_ns: None,
                gone: None,
                looked_ns: link.now_ns(),
            })
        };
        match protocol {
            Protocol::Reports => {
                let mut reports = Reports::new(SESSION, watchdog_us);
                // Where this write fails, the tick greets the device again.
                let _ = link.clone().write(&reports.greet());
                Driver::Reports(Box::new(Hid {
                    reports,
                    sensed: model.freedom(),
                    retry_ns: None,
                }))
            }
            Protocol::Stream => {
                match Serial::open(model.capabilities(), watchdog_us, open, clock) {
                    Ok(driver) => threaded(Box::new(driver)),
                    Err(error) => panic!("{error}"),
                }
            }
            Protocol::WoodenHaptics => {
                let setup = Setup {
                    home: Some(Vec3::zeros()),
                    ..Setup::default()
                };
                match WoodenHaptics::open(&setup, open, clock) {
                    Ok(driver) => threaded(Box::new(driver)),
                    Err(error) => panic!("{error}"),
                }
            }
            Protocol::Falcon => {
                let firmware = match Firmware::new(Path::new("faults"), IMAGE.to_vec()) {
                    Ok(firmware) => firmware,
                    Err(error) => panic!("{error}"),
                };
                let settings = Settings {
                    firmware,
                    tries: Tries::default(),
                    period,
                };
                match Falcon::connect(move || open().map(Chip::new), clock, settings) {
                    Ok(driver) => threaded(Box::new(driver)),
                    Err(error) => panic!("{error}"),
                }
            }
        }
    }

    /// Lets the driver work until `now_ns`.
    pub fn run(&mut self, link: &Link, now_ns: u64) {
        if let Self::Exchanged(thread) = self {
            thread.run(link, now_ns);
        }
    }

    /// The reading of the tick at `now_ns`.
    ///
    /// # Errors
    /// If the device has no new state.
    pub fn read(&mut self, link: &Link, now_ns: u64) -> Reading {
        match self {
            Self::Exchanged(thread) => {
                thread.run(link, now_ns);
                thread.read(now_ns)
            }
            Self::Reports(hid) => hid.read(link, now_ns),
        }
    }

    /// Number of wrenches that the device refused; `None` where it does not tell.
    pub fn refused_wrenches(&self) -> Option<u64> {
        match self {
            Self::Exchanged(thread) => thread.exchange.refused_wrenches(),
            Self::Reports(hid) => Some(hid.reports.refused_by_device),
        }
    }

    /// Takes the wrench of the tick at `now_ns`.
    pub fn write(&mut self, link: &Link, now_ns: u64, wrench: &Wrench) {
        match self {
            Self::Exchanged(thread) => thread.write(wrench),
            Self::Reports(hid) => hid.write(link, now_ns, wrench),
        }
    }
}

/// The thread of a device that answers when it is asked: [`devices::Exchanged`] in virtual time.
pub struct Thread {
    exchange: Box<dyn Exchange>,
    gate: Gate,
    /// Time without a wrench after which the thread commands zero (ns).
    let_go_ns: u64,
    /// Wrenches, each with the number of the newest exchange whose state the tick had read.
    wrenches: VecDeque<(Wrench, u64)>,
    /// Answers, each with its time (ns) and the number of its exchange.
    answers: VecDeque<(u64, u64, Reading)>,
    /// The number of the newest exchange whose state the tick has read.
    seen: u64,
    /// Since when the thread waits for a wrench (ns).
    since_ns: u64,
    /// When a lost device is opened again (ns).
    retry_ns: Option<u64>,
    gone: Option<i32>,
    /// When the thread last looked for a wrench (ns).
    looked_ns: u64,
}

impl Thread {
    /// Lets the thread work until `to_ns`, or until what it has begun by then is done.
    fn run(&mut self, link: &Link, to_ns: u64) {
        while link.now_ns() < to_ns {
            if let Some(retry_ns) = self.retry_ns {
                link.run(to_ns.min(retry_ns));
                if to_ns < retry_ns {
                    return;
                }
                if self.exchange.reopen().is_ok() {
                    self.retry_ns = None;
                    self.wrenches.clear();
                    self.once(link, None);
                } else {
                    self.retry_ns = Some(link.now_ns() + RETRY.as_nanos() as u64);
                }
            } else if let Some(handed) = self.found(link.now_ns()) {
                self.once(link, Some(handed));
            } else {
                let due_ns = self.since_ns + self.let_go_ns;
                link.run(to_ns.min(due_ns));
                if to_ns < due_ns {
                    return;
                }
                self.once(link, None);
            }
        }
    }

    /// The newest wrench that waits, unless it may be old.
    fn found(&mut self, now_ns: u64) -> Option<(Wrench, u64)> {
        let away_ns = now_ns - self.looked_ns;
        self.looked_ns = now_ns;
        let newest = self.wrenches.pop_back();
        self.wrenches.clear();
        newest.filter(|_| away_ns <= 2 * self.let_go_ns)
    }

    /// One exchange, with zero where the tick has handed over no wrench.
    fn once(&mut self, link: &Link, handed: Option<(Wrench, u64)>) {
        let wrench = match handed {
            Some((wrench, seen)) => self.gate.pass(&wrench, seen),
            None => self.gate.let_go(),
        };
        let mut answer = self.exchange.exchange(&wrench);
        self.gate.end(&mut answer);
        let now_ns = link.now_ns();
        self.since_ns = now_ns;
        if let Err(DeviceError::Disconnected(_)) = answer {
            self.retry_ns = Some(now_ns + RETRY.as_nanos() as u64);
        }
        if self.answers.len() < SLOTS {
            self.answers.push_back((now_ns, self.gate.number(), answer));
        }
    }

    fn read(&mut self, now_ns: u64) -> Reading {
        let mut newest = None;
        while let Some(&(at_ns, number, answer)) = self.answers.front()
            && at_ns <= now_ns
        {
            newest = Some((number, answer));
            self.answers.pop_front();
        }
        match newest {
            Some((number, Ok(state))) => {
                self.gone = None;
                self.seen = number;
                Ok(state)
            }
            Some((_, Err(error))) => {
                if let DeviceError::Disconnected(number) = error {
                    self.gone = Some(number);
                }
                Err(error)
            }
            None => Err(self
                .gone
                .map_or(DeviceError::NoReport, DeviceError::Disconnected)),
        }
    }

    fn write(&mut self, wrench: &Wrench) {
        if self.gone.is_none() && self.wrenches.len() < SLOTS {
            self.wrenches.push_back((*wrench, self.seen));
        }
    }
}

/// The driver over HID, whose writing thread writes at once.
pub struct Hid {
    reports: Reports,
    sensed: Freedom,
    retry_ns: Option<u64>,
}

impl Hid {
    fn read(&mut self, link: &Link, now_ns: u64) -> Reading {
        link.run(now_ns);
        if let Some(retry_ns) = self.retry_ns {
            if now_ns < retry_ns || link.open().is_err() {
                return Err(DeviceError::NoReport);
            }
            self.retry_ns = None;
        }
        let next = |buffer: &mut [u8]| link.read_now(buffer).map_err(DeviceError::Disconnected);
        let result = self.reports.newest(self.sensed, now_ns, next);
        if let Err(DeviceError::Disconnected(_)) = result {
            self.retry_ns = Some(now_ns + RETRY.as_nanos() as u64);
        }
        result
    }

    fn write(&mut self, link: &Link, now_ns: u64, wrench: &Wrench) {
        if self.retry_ns.is_none()
            && let Some(command) = self.reports.command(wrench, now_ns)
        {
            // A failure is that of a device that is gone, which the next read tells.
            let _ = link.clone().write(&command);
        }
    }
}
