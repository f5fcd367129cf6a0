//! An emulated device that speaks the firmware protocol: its firmware and its mechanism over a simulated device.
//!
//! The firmware is [`firmware_proto::device::Device`], as on a microcontroller: a loop that sets the amplifiers every
//! [`LOOP_NS`], and a state each period. The device sends poses, and names the limits of its device model. It starts in
//! the mode `Boot`, and finds its reference after a settable time. Its clock starts at zero and counts whole
//! microseconds, as the emulator's time does.
//!
//! Reports go alone ([`Framing::Report`], HID) or in packets ([`Framing::Stream`]; see [`firmware_proto::stream`]). A
//! packet of 66 bytes is sent in two pieces.
//!
//! **Our choices**, which the protocol leaves open: the device searches its reference by itself after each start and each
//! fault; a host that does not read has at most [`WAITING`] reports wait, and newer ones are lost.

use super::Emulator;
use crate::SimDevice;
use crate::firmware::state_si;
use core::num::NonZeroU8;
use devices::wire::axes_of;
use firmware_proto::device::{self, Accepted, Counters, Geometry, Inputs, Measured};
use firmware_proto::report::{Condition, LENGTH, Mode, Model, StateReport};
use firmware_proto::stream::{Decoder, PACKET, packet};
use rt_core::{Capabilities, Device, Vec3, Wrench};
use std::collections::VecDeque;

/// Time between two settings of the amplifiers (ns), and largest delay of the watchdog.
pub const LOOP_NS: u64 = 50_000;
/// Largest number of reports that wait for the host.
pub const WAITING: usize = 64;
/// Longest time that the firmware runs in one call (ns). A longer gap means that the process was stopped. The firmware
/// then runs for this time, in which every watchdog lets go, and its clock jumps over the rest.
const LONGEST_NS: u64 = 200_000_000;

/// The framing of the reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Framing {
    /// Single reports: HID.
    Report,
    /// In packets, in a stream of bytes.
    Stream,
}

/// An emulated device that speaks the firmware protocol.
#[derive(Clone, Debug)]
pub struct Firmware {
    device: SimDevice,
    model: Model,
    framing: Framing,
    period_ns: u64,
    homing_ns: u64,
    protocol: device::Device,
    now_ns: u64,
    /// Time of the start of the firmware (ns).
    start_ns: u64,
    /// Time at which the reference is found (ns), while it is searched.
    homed_ns: Option<u64>,
    /// Time of the next state (ns).
    due_ns: u64,
    decoder: Decoder,
    buttons: u16,
    /// Whether the amplifiers have power.
    powered: bool,
    /// Time at which the last wrench was accepted (ns).
    commanded_ns: u64,
    /// Longest time from a wrench to its end by the watchdog (ns).
    let_go_ns: u64,
    /// Bytes that wait for the host.
    outgoing: VecDeque<u8>,
}

impl Firmware {
    /// A device that starts at time zero, whose mechanism and hand are `device`. It has found its reference at once, and
    /// sends states at the rate of its device model. The device sends the first 16 printable ASCII characters of
    /// `name`.
    pub fn new(device: SimDevice, name: &str, framing: Framing) -> Self {
        let rate = device.model().rate_hz;
        let model = model_of(&device.capabilities(), rate, name);
        let mut new = Self {
            device,
            model,
            framing,
            period_ns: period_ns(rate),
            homing_ns: 0,
            protocol: device::Device::new(model, Geometry::default()),
            now_ns: 0,
            start_ns: 0,
            homed_ns: None,
            due_ns: 0,
            decoder: Decoder::new(),
            buttons: 0,
            powered: true,
            commanded_ns: 0,
            let_go_ns: 0,
            outgoing: VecDeque::new(),
        };
        new.start();
        new
    }

    /// The same device with another rate of states (Hz, at least 1) than its model has. The capabilities still name the
    /// rate of the model.
    #[must_use]
    pub fn with_rate(mut self, rate_hz: u32) -> Self {
        self.period_ns = period_ns(rate_hz);
        self.due_ns = self.now_ns.saturating_add(self.period_ns);
        self
    }

    /// The same device, which finds its reference `homing_ns` after each start (ns).
    #[must_use]
    pub fn with_homing_ns(mut self, homing_ns: u64) -> Self {
        self.homing_ns = homing_ns;
        self.start();
        self
    }

    /// The mechanism and the hand.
    pub fn device(&self) -> &SimDevice {
        &self.device
    }

    /// The mechanism and the hand, for code that guides the hand.
    pub fn device_mut(&mut self) -> &mut SimDevice {
        &mut self.device
    }

    /// The properties that the device names.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The mode of the firmware.
    pub fn mode(&self) -> Mode {
        self.protocol.mode()
    }

    /// Whether the wrench of a host is in force.
    pub fn is_commanded(&self) -> bool {
        self.mode() == Mode::Active
    }

    /// Counts of the reports from the host.
    pub fn counters(&self) -> &Counters {
        self.protocol.counters()
    }

    /// Longest time from the last wrench of a host to the moment at which the watchdog let go (ns); zero if the
    /// watchdog never let go.
    pub fn let_go_ns(&self) -> u64 {
        self.let_go_ns
    }

    /// The session; zero before the first hello.
    pub fn session(&self) -> u32 {
        self.protocol.session()
    }

    /// Presses the buttons of the handle, lowest bit first.
    pub fn press(&mut self, buttons: u16) {
        self.buttons = buttons;
    }

    /// Switches the power of the amplifiers off or on. The firmware continues, and its states report the power.
    pub fn power(&mut self, on: bool, now_ns: u64) {
        self.run(now_ns);
        self.powered = on;
        self.actuate();
    }

    /// Switches the device off and on: there is no session and no force, and the clock starts at zero.
    pub fn restart(&mut self, now_ns: u64) {
        self.run(now_ns);
        self.start();
        self.actuate();
    }

    /// The firmware finds a fault.
    pub fn fault(&mut self, fault: NonZeroU8, now_ns: u64) {
        self.run(now_ns);
        self.protocol.fault(fault);
        self.actuate();
    }

    /// Ends a fault and the session.
    pub fn reset(&mut self, now_ns: u64) {
        self.run(now_ns);
        if self.protocol.reset() {
            self.search();
        }
    }

    /// Runs the firmware and the mechanism up to `now_ns`.
    pub fn run(&mut self, now_ns: u64) {
        let end = now_ns.max(self.now_ns);
        let stop = end.min(self.now_ns.saturating_add(LONGEST_NS));
        while self.now_ns < stop {
            let next = self.now_ns.saturating_add(LOOP_NS).min(self.due_ns);
            // The state that is due lies ahead, so each step is at least one nanosecond long.
            self.step(next.clamp(self.now_ns.saturating_add(1), stop));
        }
        if stop < end {
            self.due_ns = end.saturating_add(self.period_ns);
            self.step(end);
        }
    }

    fn start(&mut self) {
        self.protocol = device::Device::new(self.model, Geometry::default());
        self.decoder = Decoder::new();
        self.outgoing.clear();
        if self.framing == Framing::Stream {
            // The zero ends all earlier bytes.
            self.outgoing.push_back(0);
        }
        self.start_ns = self.now_ns;
        self.due_ns = self.now_ns.saturating_add(self.period_ns);
        self.search();
    }

    fn search(&mut self) {
        self.protocol.home();
        self.homed_ns = Some(self.now_ns.saturating_add(self.homing_ns));
        self.find();
    }

    fn find(&mut self) {
        if self.homed_ns.is_some_and(|at| at <= self.now_ns) {
            self.protocol.homed();
            self.homed_ns = None;
        }
    }

    /// The firmware's own time (µs), which wraps.
    fn time_us(&self) -> u32 {
        (self.now_ns.saturating_sub(self.start_ns) / 1000) as u32
    }

    /// One turn of the firmware's loop, at `now_ns`.
    fn step(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
        self.find();
        self.actuate();
        if now_ns >= self.due_ns {
            self.due_ns = self
                .due_ns
                .saturating_add(self.period_ns)
                .max(now_ns.saturating_add(1));
            self.report();
        }
    }

    /// Gives a report to the firmware, which counts refused reports.
    fn take(&mut self, report: &[u8]) {
        let time_us = self.time_us();
        if let Ok(Accepted::Wrench) = self.protocol.receive(report, time_us) {
            self.commanded_ns = self.now_ns;
        }
    }

    /// Sets the amplifiers. The force before acts up to now.
    fn actuate(&mut self) {
        let before = self.counters().watchdog;
        let wrench = self.protocol.actuate(self.time_us());
        if self.counters().watchdog > before {
            let held_ns = self.now_ns.saturating_sub(self.commanded_ns);
            self.let_go_ns = self.let_go_ns.max(held_ns);
        }
        let wrench = if self.powered {
            wrench
        } else {
            device::Wrench::default()
        };
        let si = |vector: [i32; 3]| Vec3::from(vector.map(|x| f64::from(x) / 1e6));
        let wrench = Wrench {
            force: si(wrench.force),
            moment: si(wrench.moment),
        };
        // Neither a write nor a read of a simulated device fails.
        let _ = self.device.write(self.now_ns, &wrench);
    }

    fn report(&mut self) {
        let Ok(state) = self.device.read(self.now_ns) else {
            return;
        };
        let units = StateReport::from_si(0, 0, Condition::default(), &state_si(&state));
        let measured = Measured::Pose {
            position: units.position,
            orientation: units.orientation,
            velocity: units.velocity,
            angular_velocity: units.angular_velocity,
        };
        let inputs = Inputs {
            buttons: self.buttons | state.buttons as u16,
            powered: self.powered && self.protocol.mode() != Mode::Fault,
            limited: false,
        };
        let report = self.protocol.report(self.time_us(), inputs, &measured);
        match self.framing {
            Framing::Report if self.outgoing.len() < WAITING * LENGTH => {
                self.outgoing.extend(report);
            }
            Framing::Stream if self.outgoing.len() < WAITING * PACKET => {
                self.outgoing.extend(packet(&report));
            }
            // The report is lost.
            _ => {}
        }
    }
}

impl Emulator for Firmware {
    fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        self.run(now_ns);
        match self.framing {
            Framing::Report => self.take(bytes),
            Framing::Stream => {
                for &byte in bytes {
                    if let Some(report) = self.decoder.push(byte).copied() {
                        self.take(&report);
                    }
                }
            }
        }
        self.actuate();
    }

    fn send(&mut self, now_ns: u64, report: &mut [u8; 64]) -> Option<usize> {
        self.run(now_ns);
        let count = self.outgoing.len().min(LENGTH);
        for (to, from) in report.iter_mut().zip(self.outgoing.drain(..count)) {
            *to = from;
        }
        (count > 0).then_some(count)
    }
}

/// The period of a rate (ns).
fn period_ns(rate_hz: u32) -> u64 {
    1_000_000_000 / u64::from(rate_hz.max(1))
}

/// The properties that a device of these capabilities names.
fn model_of(capabilities: &Capabilities, rate_hz: u32, text: &str) -> Model {
    // The conversions saturate.
    let units = |si: f64, scale: f64| libm::round(si * scale) as u32;
    let printable = text.bytes().filter(|byte| matches!(byte, b' '..=b'~'));
    let mut name = *b"x\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0";
    for (to, from) in name.iter_mut().zip(printable) {
        *to = from;
    }
    let rate = u16::try_from(rate_hz).unwrap_or(u16::MAX).max(1);
    Model {
        sensed: axes_of(capabilities.sensed),
        actuated: axes_of(capabilities.actuated),
        max_force: units(capabilities.max_force, 1e6),
        max_moment: units(capabilities.max_moment, 1e6),
        workspace_radius: units(capabilities.workspace_radius, 1e7),
        position_step_nm: units(capabilities.position_step, 1e9),
        rate: [rate; 2],
        name,
        ..Model::default()
    }
}
