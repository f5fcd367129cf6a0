//! The driver of an emulated device, with its threads in virtual time.

use super::link::{IMAGE, Link};
use crate::DeviceModel;
use crate::protocol::Protocol;
use core::num::NonZeroU32;
use devices::exchange::{Handed, Poller, Reply, SLOTS, Step, TickEnd, let_go_after};
use devices::falcon::{Falcon, Firmware, Settings, Tries};
use devices::ftdi::Chip;
use devices::serial::Serial;
use devices::woodenhaptics::{WoodenHaptics, WoodenHapticsConfig};
use devices::{Exchange, Transport, hid};
use firmware_proto::report::LENGTH;
use rt_core::{Reading, Vec3, Wrench};
use std::collections::VecDeque;
use std::path::Path;

/// Session of the driver over HID. The driver draws it anew at each start.
const SESSION: NonZeroU32 = NonZeroU32::MIN.saturating_add(6);

/// The driver, as the tick sees it.
pub enum Driver {
    /// A driver in a thread of its own.
    Exchanged(Box<Thread>),
    /// The driver over HID, which the tick reads itself.
    Reports(Box<Hid>),
}

impl Driver {
    /// Opens the device behind `link` for a loop of `period` (s). The driver uploads the firmware to a Falcon.
    ///
    /// # Panics
    /// If the device does not answer, which none does without a fault.
    pub fn open(protocol: Protocol, model: &DeviceModel, period: f64, link: &Link) -> Self {
        let let_go = let_go_after(period);
        // The watchdog that the driver asks of a device is as long.
        let watchdog_us = let_go.as_micros() as u32;
        let (opened, clocked) = (link.clone(), link.clone());
        let open = move || opened.open();
        let clock = move || clocked.now_ns();
        let threaded = |exchange: Box<dyn Exchange>| {
            Driver::Exchanged(Box::new(Thread {
                exchange,
                poller: Poller::new(link.now_ns(), let_go),
                end: TickEnd::default(),
                wrenches: VecDeque::new(),
                replies: VecDeque::new(),
            }))
        };
        match protocol {
            Protocol::Reports => {
                let mut end = hid::TickEnd::new(SESSION, watchdog_us, model.capabilities(), None);
                // If this write fails, the tick greets the device again.
                let _ = link.clone().write(&end.greet());
                Driver::Reports(Box::new(Hid {
                    end,
                    writing: hid::Writing::default(),
                }))
            }
            Protocol::Stream => {
                match Serial::open(model.capabilities(), watchdog_us, open, clock) {
                    Ok(driver) => threaded(Box::new(driver)),
                    Err(error) => panic!("{error}"),
                }
            }
            Protocol::WoodenHaptics => {
                let setup = WoodenHapticsConfig {
                    home: Some(Vec3::zeros()),
                    ..WoodenHapticsConfig::default()
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

    /// Number of wrenches that the device refused; `None` if the device does not report it.
    pub fn refused_wrenches(&self) -> Option<u64> {
        match self {
            Self::Exchanged(thread) => thread.end.refused_wrenches(),
            Self::Reports(hid) => Some(hid.end.refused_wrenches()),
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

/// The thread of a device that answers when it is asked, and its rings: [`devices::Exchanged`] in virtual time.
pub struct Thread {
    exchange: Box<dyn Exchange>,
    poller: Poller,
    end: TickEnd,
    wrenches: VecDeque<Handed>,
    /// Replies, each with its time (ns).
    replies: VecDeque<(u64, Reply)>,
}

impl Thread {
    /// Lets the thread work until `to_ns`, or until it has finished the work that it has begun by then.
    fn run(&mut self, link: &Link, to_ns: u64) {
        while link.now_ns() < to_ns {
            let newest = self.wrenches.drain(..).next_back();
            match self.poller.next(link.now_ns(), newest) {
                Step::Wait(until_ns) => link.run(to_ns.min(until_ns)),
                Step::Exchange(wrench) => {
                    let device = &mut self.exchange;
                    let answer = device.exchange(&wrench);
                    let (motion, refused) = (device.motion_to_force(), device.refused_wrenches());
                    let now_ns = link.now_ns();
                    let reply = self.poller.answered(now_ns, answer, motion, refused);
                    if self.replies.len() < SLOTS {
                        self.replies.push_back((now_ns, reply));
                    }
                }
                Step::Reopen => {
                    let result = self.exchange.reopen();
                    self.poller.reopened(link.now_ns(), result);
                }
            }
        }
    }

    fn read(&mut self, now_ns: u64) -> Reading {
        let come = self.replies.partition_point(|(at_ns, _)| *at_ns <= now_ns);
        let newest = self.replies.drain(..come).next_back();
        self.end.read(newest.map(|(_, reply)| reply))
    }

    fn write(&mut self, wrench: &Wrench) {
        if let Ok(handed) = self.end.hand(wrench)
            && self.wrenches.len() < SLOTS
        {
            self.wrenches.push_back(handed);
        }
    }
}

/// The driver over HID: [`devices::hid::HidDevice`] in virtual time. Its writing thread is never late.
pub struct Hid {
    end: hid::TickEnd,
    writing: hid::Writing,
}

impl Hid {
    /// Lets the writing thread work, to which the tick hands `newest` on.
    fn work(&mut self, link: &Link, now_ns: u64, newest: Option<[u8; LENGTH]>) {
        let lost = self.end.lost().is_some();
        match self.writing.next(now_ns, lost, newest) {
            hid::Step::Write(command) => {
                // A failure is that of a device that is gone, which the next read tells.
                let _ = link.clone().write(&command);
            }
            hid::Step::Wait(_) => {}
            hid::Step::Reopen => {
                let is_open = link.open().is_ok();
                self.writing.reopened(now_ns, is_open);
                if is_open {
                    self.end.reopened();
                }
            }
        }
    }

    fn read(&mut self, link: &Link, now_ns: u64) -> Reading {
        link.run(now_ns);
        self.work(link, now_ns, None);
        if let Some(error) = self.end.lost() {
            return Err(error);
        }
        let result = self.end.read(now_ns, |buffer| link.read_now(buffer));
        if self.end.lost().is_some() {
            self.work(link, now_ns, None);
        }
        result
    }

    fn write(&mut self, link: &Link, now_ns: u64, wrench: &Wrench) {
        if let Ok(Some(command)) = self.end.command(now_ns, wrench) {
            self.work(link, now_ns, Some(command));
        }
    }
}
