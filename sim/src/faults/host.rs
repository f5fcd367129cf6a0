//! The host of a run: the driver of the device, its thread in virtual time, and the controller with the wall.

use super::link::{IMAGE, Link};
use super::{DISTANCE, PATIENCE, PERIOD_NS, Protocol, WALL};
use crate::DeviceModel;
use core::num::NonZeroU32;
use devices::exchange::{LET_GO, RETRY};
use devices::falcon::{Falcon, Firmware, Settings, Tries};
use devices::ftdi::Chip;
use devices::hid::Reports;
use devices::serial::Serial;
use devices::woodenhaptics::{Setup, WoodenHaptics};
use devices::{Exchange, Transport};
use rt_core::controller::{DeviceConfig, Reading};
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::{SafetyConfig, SafetyState};
use rt_core::velocity::{VelocityEstimator, most_damping};
use rt_core::{
    Controller, ControllerConfig, DeviceError, Freedom, LocalModel, MAX_DEVICES, PassivityConfig,
    Port, Scheme, Vec3, Wrench,
};
use std::collections::VecDeque;
use std::path::Path;

/// Number of wrenches, and of answers, that may wait between the tick and the thread of a device.
const SLOTS: usize = 4;
/// Session of the driver over HID. The driver draws it anew at each start.
const SESSION: NonZeroU32 = NonZeroU32::MIN.saturating_add(6);
/// Watchdog of the firmware protocol that the driver asks for (µs).
const WATCHDOG_US: u32 = 10_000;
/// Period of the tick (s).
const PERIOD: f64 = PERIOD_NS as f64 * 1e-9;

/// The driver, as the tick sees it.
enum Driver {
    Exchanged(Thread),
    Reports(Box<Hid>),
}

/// The thread of a device that answers when it is asked: [`devices::Exchanged`] in virtual time.
struct Thread {
    exchange: Box<dyn Exchange>,
    wrenches: VecDeque<Wrench>,
    /// Answers, each with its time (ns).
    answers: VecDeque<(u64, Reading)>,
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
                    self.once(link, &Wrench::zero());
                } else {
                    self.retry_ns = Some(link.now_ns() + RETRY.as_nanos() as u64);
                }
            } else if let Some(wrench) = self.found(link.now_ns()) {
                self.once(link, &wrench);
            } else {
                let due_ns = self.since_ns + LET_GO.as_nanos() as u64;
                link.run(to_ns.min(due_ns));
                if to_ns < due_ns {
                    return;
                }
                self.once(link, &Wrench::zero());
            }
        }
    }

    /// The newest wrench that waits, unless it may be old.
    fn found(&mut self, now_ns: u64) -> Option<Wrench> {
        let away_ns = now_ns - self.looked_ns;
        self.looked_ns = now_ns;
        let newest = self.wrenches.pop_back();
        self.wrenches.clear();
        newest.filter(|_| away_ns <= 2 * LET_GO.as_nanos() as u64)
    }

    fn once(&mut self, link: &Link, wrench: &Wrench) {
        let answer = self.exchange.exchange(wrench);
        let now_ns = link.now_ns();
        self.since_ns = now_ns;
        if let Err(DeviceError::Disconnected(_)) = answer {
            self.retry_ns = Some(now_ns + RETRY.as_nanos() as u64);
        }
        if self.answers.len() < SLOTS {
            self.answers.push_back((now_ns, answer));
        }
    }

    fn read(&mut self, now_ns: u64) -> Reading {
        let mut newest = None;
        while let Some(&(at_ns, answer)) = self.answers.front()
            && at_ns <= now_ns
        {
            newest = Some(answer);
            self.answers.pop_front();
        }
        match newest {
            Some(Ok(state)) => {
                self.gone = None;
                Ok(state)
            }
            Some(Err(error)) => {
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
            self.wrenches.push_back(*wrench);
        }
    }
}

/// The driver over HID, whose writing thread writes at once.
struct Hid {
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

/// The host.
pub(super) struct Host {
    link: Link,
    driver: Driver,
    controller: Controller,
    commands: Vec<(u64, f64)>,
    missed: u64,
    /// Ticks in a row without a state; `None` before the first state.
    without: Option<u64>,
    from_ns: u64,
    /// Times that the controller took the device for silent, before the fault.
    trips_before: u64,
    jump: f64,
    /// What the last stage did in the last tick.
    safety: Option<SafetyState>,
}

impl Host {
    /// A host that has opened the device.
    pub(super) fn new(protocol: Protocol, model: &DeviceModel, link: &Link, from_ns: u64) -> Self {
        let (opened, clocked) = (link.clone(), link.clone());
        let open = move || opened.open();
        let clock = move || clocked.now_ns();
        let threaded = |exchange: Box<dyn Exchange>| {
            Driver::Exchanged(Thread {
                exchange,
                wrenches: VecDeque::new(),
                answers: VecDeque::new(),
                since_ns: link.now_ns(),
                retry_ns: None,
                gone: None,
                looked_ns: link.now_ns(),
            })
        };
        let driver = match protocol {
            Protocol::Reports => {
                let mut reports = Reports::new(SESSION, WATCHDOG_US);
                // Where this write fails, the tick greets the device again.
                let _ = link.clone().write(&reports.greet());
                Driver::Reports(Box::new(Hid {
                    reports,
                    sensed: model.freedom(),
                    retry_ns: None,
                }))
            }
            Protocol::Stream => {
                match Serial::open(model.capabilities(), WATCHDOG_US, open, clock) {
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
                    period: PERIOD,
                };
                match Falcon::connect(move || open().map(Chip::new), clock, settings) {
                    Ok(driver) => threaded(Box::new(driver)),
                    Err(error) => panic!("{error}"),
                }
            }
        };
        let mut controller = Controller::new(&config(model));
        if let Err(fault) = controller.accept(0, &wall()) {
            panic!("the wall is refused: {fault:?}");
        }
        Self {
            link: link.clone(),
            driver,
            controller,
            commands: Vec::new(),
            missed: 0,
            without: None,
            from_ns,
            trips_before: 0,
            jump: 0.0,
            safety: None,
        }
    }

    /// The process is stopped at `now_ns`.
    pub(super) fn stop(&mut self, now_ns: u64) {
        if let Driver::Exchanged(thread) = &mut self.driver {
            thread.run(&self.link, now_ns);
        }
    }

    /// One tick.
    pub(super) fn tick(&mut self, now_ns: u64) {
        let mut readings: [Reading; MAX_DEVICES] = [Err(DeviceError::NoReport); MAX_DEVICES];
        let reading = match &mut self.driver {
            Driver::Exchanged(thread) => {
                thread.run(&self.link, now_ns);
                thread.read(now_ns)
            }
            Driver::Reports(hid) => hid.read(&self.link, now_ns),
        };
        match (&reading, self.without) {
            (Ok(_), _) => self.without = Some(0),
            (Err(_), Some(without)) => {
                self.without = Some(without + 1);
                self.missed += 1;
            }
            (Err(_), None) => {}
        }
        readings[0] = reading;
        let (commands, telemetry) = self.controller.tick(now_ns, &readings);
        self.safety = telemetry.devices().next().map(|device| device.safety);
        let [command, ..] = commands;
        match &mut self.driver {
            Driver::Exchanged(thread) => thread.write(&command),
            Driver::Reports(hid) => hid.write(&self.link, now_ns, &command),
        }
        let force = command.force.norm();
        if now_ns >= self.from_ns {
            if let Some((_, last)) = self.commands.last() {
                self.jump = self.jump.max(force - last);
            }
            self.commands.push((now_ns, force));
        } else {
            self.trips_before = self.silences();
        }
    }

    /// When the first command of no force left after the fault began (ns).
    pub(super) fn gone_ns(&self) -> Option<u64> {
        let gone = self.commands.iter().find(|(_, force)| *force == 0.0);
        gone.map(|(at_ns, _)| *at_ns)
    }

    /// Largest growth of a command since the fault began, from one tick to the next (N).
    pub(super) fn jump(&self) -> f64 {
        self.jump
    }

    /// Number of ticks without a state, after the first state.
    pub(super) fn missed(&self) -> u64 {
        self.missed
    }

    /// Whether there has been no state for a while.
    pub(super) fn is_without_state(&self) -> bool {
        self.without.is_none_or(|ticks| ticks > 20)
    }

    /// Whether the last command passed, up to the largest force of the device.
    pub(super) fn is_back(&self) -> bool {
        matches!(
            self.safety,
            Some(SafetyState::Normal | SafetyState::Limited)
        )
    }

    /// Number of times that the controller took the device for silent since the fault began.
    pub(super) fn trips(&self) -> u64 {
        self.silences() - self.trips_before
    }

    fn silences(&self) -> u64 {
        self.controller
            .safety_counters()
            .map(|counts| counts.stale)
            .sum()
    }
}

/// The controller of one device and one body.
fn config(model: &DeviceModel) -> ControllerConfig {
    let mut passivity = PassivityConfig::new(PERIOD);
    // A wrench acts before the next tick but one.
    passivity.delay = 1;
    let late = VelocityEstimator::for_encoder(PERIOD, model.position_step).delay() + PERIOD;
    passivity.ports[0] = Port {
        damping: model.damping,
        friction: model.friction,
        count: model.position_step,
        most_damping: most_damping(model.mass, PERIOD, late),
        ..Port::UNKNOWN
    };
    let mut config = ControllerConfig::default();
    let device = DeviceConfig {
        frame: DeviceFrame::at(Vec3::new(0.0, 0.0, DISTANCE)),
        safety: SafetyConfig {
            actuated: Freedom::Three,
            // The driver of the Falcon asks for no more.
            max_force: model.max_force.min(5.0),
            max_moment: 0.0,
            max_speed: f64::INFINITY,
            max_reach: f64::INFINITY,
            max_slew: f64::INFINITY,
            patience: PATIENCE,
            decay: 0.1,
            recovery: 0.2,
            period: PERIOD,
        },
    };
    let body = CouplingConfig {
        scheme: Scheme::Capped,
        period: PERIOD,
        blend: 0.5,
        // The wall is published once, and stays valid.
        age_limit: 1e6,
        decay: 0.1,
        recovery: 0.2,
        hold_damping: [0.0; MAX_DEVICES],
        passivity,
    };
    // The lists have room for one.
    let _ = config.devices.push(device);
    let _ = config.bodies.push(body);
    config
}

/// A wall at the origin of the scene, which pushes towards positive z.
fn wall() -> LocalModel {
    let [stiffness, damping] = WALL;
    let mut model = LocalModel::empty();
    model.sequence = 1;
    model.time_ns = 1;
    model.period = PERIOD;
    model.handle_count = 1;
    model.handles[0].contact[2] = 1.0;
    model.stiffness[0][0][(2, 2)] = stiffness;
    model.damping[0][0][(2, 2)] = damping;
    model
}
