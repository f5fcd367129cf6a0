//! The connection between a driver and an emulated device, with a fault on it.
//!
//! The world of a run is the device, the bytes on their way, and the time. Every action of a driver takes its time in
//! this world. The fault changes the packets on their way, or the device itself.

use super::fault::{Injected, Kind};
use crate::emulate::falcon::{Falcon, Settings};
use crate::emulate::{Emulator, Firmware, Framing, WoodenHaptics};
use crate::protocol::Protocol;
use crate::{NetEnergy, SimDevice};
use devices::Transport;
use devices::ftdi::{PACKET, STATUS, SetupPacket, Usb};
use devices::woodenhaptics::{Form, Geometry};
use firmware_proto::report::fault::EMERGENCY_STOP;
use rand_core::Rng;
use rand_pcg::Pcg64;
use rt_core::{Device, Probe};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Time from one observed force to the next (ns).
const OBSERVED_NS: u64 = 1_000_000;
/// Longest step between two looks at the device (ns).
const STEP_NS: u64 = 50_000;
/// Time of a packet on its way (ns), by protocol: a packet of the firmware protocol, a report of WoodenHaptics, a USB
/// transfer to the Falcon.
const WAY_NS: [u64; 3] = [50_000, 450_000, 125_000];
/// Largest number of reports that the kernel keeps for a reader.
const QUEUE: usize = 64;
/// Number of copies of each packet in a flood.
const FLOOD: u32 = 20;
/// Error number of a device that is not connected (ENODEV).
const NO_DEVICE: i32 = 19;
/// Time in which a device of the firmware protocol finds its reference after a start (ns).
const HOMING_NS: u64 = 100_000_000;
/// The image that the Falcon takes.
pub(super) const IMAGE: [u8; 64] = [0x5A; 64];

/// The observations of the device.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Force at the fault (N).
    pub before: f64,
    /// Force now (N).
    pub force: f64,
    /// When the force was first zero after the fault began (ns).
    pub gone_ns: Option<u64>,
    /// Time (ns) and force (N) of each millisecond since the fault began.
    pub forces: Vec<(u64, f64)>,
    /// Net energy at the hand.
    pub energy: NetEnergy,
    /// The time of the next millisecond (ns).
    due_ns: u64,
}

#[derive(Clone, Debug)]
enum Emulated {
    Firmware(Box<Firmware>),
    WoodenHaptics(Box<WoodenHaptics>),
    Falcon(Box<Falcon>),
}

impl Emulated {
    fn device(&self) -> &SimDevice {
        match self {
            Self::Firmware(device) => device.device(),
            Self::WoodenHaptics(device) => device.device(),
            Self::Falcon(device) => device.device(),
        }
    }

    fn end(&mut self) -> &mut dyn Emulator {
        match self {
            Self::Firmware(device) => &mut **device,
            Self::WoodenHaptics(device) => &mut **device,
            Self::Falcon(device) => &mut **device,
        }
    }

    fn run(&mut self, now_ns: u64) {
        match self {
            Self::Firmware(device) => device.run(now_ns),
            Self::WoodenHaptics(device) => device.run(now_ns),
            Self::Falcon(device) => device.receive(&[], now_ns),
        }
    }
}

/// One direction of the connection.
#[derive(Clone, Debug, Default)]
struct Way {
    /// The last packet before the fault.
    last: Option<Vec<u8>>,
    /// A packet that waits for a later one, which passes it.
    held: Option<Vec<u8>>,
}

impl Way {
    /// Passes a packet, whose first `kept` bytes no fault changes. Returns the packets that arrive.
    fn pass(
        &mut self,
        mut packet: Vec<u8>,
        kept: usize,
        fault: &Injected,
        now_ns: u64,
        random: &mut Pcg64,
    ) -> Vec<Vec<u8>> {
        let is = |kind| fault.is(kind, now_ns);
        if is(Kind::Unplugged) || is(Kind::Silent) {
            return Vec::new();
        }
        if is(Kind::Stale) {
            return self.last.clone().into_iter().collect();
        }
        if is(Kind::Reordered) {
            let Some(held) = self.held.take() else {
                self.held = Some(packet);
                return Vec::new();
            };
            return vec![packet, held];
        }
        if is(Kind::Corrupt) {
            let [place, change] = [0; 2].map(|_: u8| random.next_u32() as usize);
            let room = packet.len().saturating_sub(kept).max(1);
            if let Some(byte) = packet.get_mut(kept + place % room) {
                *byte ^= (1 + change % 255) as u8;
            }
            return vec![packet];
        }
        self.last = Some(packet.clone());
        self.held.take().into_iter().chain([packet]).collect()
    }
}

/// The world of a run.
#[derive(Debug)]
pub struct World {
    protocol: Protocol,
    emulated: Emulated,
    fault: Injected,
    random: Pcg64,
    now_ns: u64,
    /// Packets for the host that have arrived.
    arrived: VecDeque<Vec<u8>>,
    /// The bytes of a packet of a stream whose end has not come.
    part: Vec<u8>,
    to_host: Way,
    to_device: Way,
    seen: Seen,
}

impl World {
    /// The world of `device`, which speaks `protocol`, with a fault whose choices come from `random`.
    ///
    /// # Panics
    /// If WoodenHaptics is refused, which its built-in geometry never causes.
    pub fn new(protocol: Protocol, device: SimDevice, fault: Injected, random: Pcg64) -> Self {
        let emulated = match protocol {
            Protocol::Reports | Protocol::Stream => {
                let framing = if protocol == Protocol::Stream {
                    Framing::Stream
                } else {
                    Framing::Report
                };
                let device = Firmware::new(device, "faults", framing);
                // A device that knows its place at once after an emergency stop is back the soonest.
                let homing_ns = match fault.kind {
                    Kind::EmergencyStop => 0,
                    _ => HOMING_NS,
                };
                Emulated::Firmware(Box::new(device.with_homing_ns(homing_ns)))
            }
            Protocol::WoodenHaptics => {
                match WoodenHaptics::new(device, &Geometry::default(), Form::Short) {
                    Ok(device) => Emulated::WoodenHaptics(Box::new(device)),
                    Err(error) => panic!("{error}"),
                }
            }
            Protocol::Falcon => {
                let standard = Settings::default();
                // An exchange of 1.1 ms, or one that is far shorter than the tick in any case.
                let answer_ns = match fault.kind {
                    Kind::Slow => 750_000,
                    Kind::Fast => standard.answer_ns / 2,
                    _ => standard.answer_ns,
                };
                let settings = Settings {
                    answer_ns,
                    ..standard
                };
                Emulated::Falcon(Box::new(Falcon::new(device, &IMAGE, settings)))
            }
        };
        Self {
            protocol,
            emulated,
            fault,
            random,
            now_ns: 0,
            arrived: VecDeque::new(),
            part: Vec::new(),
            to_host: Way::default(),
            to_device: Way::default(),
            seen: Seen {
                before: 0.0,
                force: 0.0,
                gone_ns: None,
                forces: Vec::new(),
                energy: NetEnergy::new(0.0),
                due_ns: 0,
            },
        }
    }

    fn way_ns(&self) -> u64 {
        let [firmware, report, transfer] = WAY_NS;
        match self.protocol {
            Protocol::Reports | Protocol::Stream => firmware,
            // An exchange has a way there and a way back: 0.9 ms, or 1.1 ms.
            Protocol::WoodenHaptics if self.fault.is(Kind::Slow, self.now_ns) => 550_000,
            Protocol::WoodenHaptics => report,
            Protocol::Falcon => transfer,
        }
    }

    fn is_unplugged(&self) -> bool {
        self.fault.is(Kind::Unplugged, self.now_ns)
    }

    /// Lets the device run, and the fault begin and end.
    fn run(&mut self, to_ns: u64) {
        let Injected {
            from_ns,
            to_ns: end_ns,
            ..
        } = self.fault;
        while self.now_ns < to_ns {
            let mut next_ns = to_ns.min(self.now_ns + STEP_NS);
            for at_ns in [from_ns, end_ns] {
                if self.now_ns < at_ns {
                    next_ns = next_ns.min(at_ns);
                }
            }
            self.emulated.run(next_ns);
            self.now_ns = next_ns;
            if next_ns == from_ns {
                self.seen.before = self.emulated.device().force().norm();
                self.begin();
            } else if next_ns == end_ns {
                self.end();
            }
            self.observe();
        }
    }

    /// Applies the effect of the fault on the device itself.
    fn begin(&mut self) {
        let now_ns = self.now_ns;
        match (&mut self.emulated, self.fault.kind) {
            (Emulated::Firmware(device), Kind::Reset) => device.restart(now_ns),
            (Emulated::WoodenHaptics(device), Kind::Reset) => device.restart(now_ns),
            (Emulated::Falcon(device), Kind::Reset) => device.power(false, now_ns),
            (Emulated::Firmware(device), Kind::EmergencyStop) => {
                device.fault(EMERGENCY_STOP, now_ns);
            }
            (Emulated::Firmware(device), Kind::MotorsOff) => device.power(false, now_ns),
            (Emulated::WoodenHaptics(device), Kind::EmergencyStop | Kind::MotorsOff) => {
                device.stop(true, now_ns);
            }
            (Emulated::Falcon(device), Kind::EmergencyStop | Kind::MotorsOff) => {
                device.stop(true, now_ns);
            }
            (Emulated::Firmware(device), Kind::Flooding) => {
                **device = (**device).clone().with_rate(1000 * FLOOD);
            }
            (Emulated::Firmware(device), Kind::Fast) => {
                **device = (**device).clone().with_rate(1100);
            }
            (Emulated::Firmware(device), Kind::Slow) => {
                **device = (**device).clone().with_rate(900);
            }
            _ => {}
        }
    }

    fn end(&mut self) {
        let now_ns = self.now_ns;
        match (&mut self.emulated, self.fault.kind) {
            (Emulated::Falcon(device), Kind::Reset) => device.power(true, now_ns),
            (Emulated::Firmware(device), Kind::EmergencyStop) => device.reset(now_ns),
            (Emulated::Firmware(device), Kind::MotorsOff) => device.power(true, now_ns),
            (Emulated::WoodenHaptics(device), Kind::EmergencyStop | Kind::MotorsOff) => {
                device.stop(false, now_ns);
            }
            (Emulated::Falcon(device), Kind::EmergencyStop | Kind::MotorsOff) => {
                device.stop(false, now_ns);
            }
            (Emulated::Firmware(device), Kind::Flooding) => {
                **device = (**device).clone().with_rate(1000);
            }
            _ => {}
        }
    }

    fn observe(&mut self) {
        let device = self.emulated.device();
        let seen = &mut self.seen;
        seen.force = device.force().norm();
        seen.energy.observe([device.energy().on_hand()]);
        if self.now_ns < self.fault.from_ns {
            return;
        }
        if seen.force == 0.0 && seen.gone_ns.is_none() {
            seen.gone_ns = Some(self.now_ns);
        }
        if self.now_ns >= seen.due_ns {
            seen.forces.push((self.now_ns, seen.force));
            seen.due_ns = self.now_ns + OBSERVED_NS;
        }
    }

    /// Takes the bytes that the device has sent.
    fn collect(&mut self) {
        let mut piece = [0; 64];
        while let Some(count) = self.emulated.end().send(self.now_ns, &mut piece) {
            let bytes = piece.get(..count).unwrap_or(&piece);
            if self.protocol != Protocol::Stream {
                self.arrive(bytes.to_vec());
                continue;
            }
            for &byte in bytes {
                self.part.push(byte);
                if byte == 0 {
                    let packet = std::mem::take(&mut self.part);
                    self.arrive(packet);
                }
            }
        }
    }

    fn arrive(&mut self, packet: Vec<u8>) {
        let kept = if self.protocol == Protocol::Falcon {
            STATUS
        } else {
            0
        };
        let passed = self
            .to_host
            .pass(packet, kept, &self.fault, self.now_ns, &mut self.random);
        let asked = matches!(self.protocol, Protocol::WoodenHaptics | Protocol::Falcon);
        let copies = if asked && self.fault.is(Kind::Flooding, self.now_ns) {
            FLOOD
        } else {
            1
        };
        for packet in passed {
            for _ in 0..copies {
                // The kernel drops the newest report if there is no reader. A stream has room for as many reports here.
                if self.arrived.len() < QUEUE {
                    self.arrived.push_back(packet.clone());
                }
            }
        }
    }

    /// The next packet for the host, waited for at most until `end_ns`.
    fn next(&mut self, end_ns: u64) -> Result<Option<Vec<u8>>, i32> {
        loop {
            if self.is_unplugged() {
                self.arrived.clear();
                return Err(NO_DEVICE);
            }
            self.collect();
            if let Some(packet) = self.arrived.pop_front() {
                return Ok(Some(packet));
            }
            if self.now_ns >= end_ns {
                return Ok(None);
            }
            self.run(end_ns.min(self.now_ns + STEP_NS));
        }
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), i32> {
        if self.is_unplugged() {
            return Err(NO_DEVICE);
        }
        self.run(self.now_ns + self.way_ns());
        let (fault, now_ns) = (self.fault, self.now_ns);
        if fault.is(Kind::Deaf, now_ns) || fault.is(Kind::BrieflyDeaf, now_ns) {
            return Ok(());
        }
        let passed = self
            .to_device
            .pass(bytes.to_vec(), 0, &fault, now_ns, &mut self.random);
        for packet in passed {
            self.emulated.end().receive(&packet, now_ns);
        }
        self.observe();
        Ok(())
    }
}

/// A connection to the world.
#[derive(Clone, Debug)]
pub struct Link(Arc<Mutex<World>>);

impl Link {
    /// A connection to `world`.
    pub fn new(world: World) -> Self {
        Self(Arc::new(Mutex::new(world)))
    }

    fn world(&self) -> MutexGuard<'_, World> {
        // Another panic is under way already.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The time (ns).
    pub fn now_ns(&self) -> u64 {
        self.world().now_ns
    }

    /// Lets time pass without an exchange with the device.
    pub fn run(&self, to_ns: u64) {
        self.world().run(to_ns);
    }

    /// The observations of the device so far.
    pub fn seen(&self) -> Seen {
        self.world().seen.clone()
    }

    /// The operator presses the button for calibration, if the device has such a button.
    pub fn press(&self) {
        if let Emulated::WoodenHaptics(device) = &mut self.world().emulated {
            device.press_calibration();
        }
    }

    /// The quantities of the device that only the simulation knows.
    pub fn probe(&self) -> Option<Probe> {
        self.world().emulated.device().probe()
    }

    /// Opens the connection.
    pub(crate) fn open(&self) -> Result<Self, i32> {
        let mut world = self.world();
        if world.is_unplugged() {
            return Err(NO_DEVICE);
        }
        // Bytes from before the connection was opened are lost.
        world.collect();
        world.arrived.clear();
        Ok(self.clone())
    }

    /// The next report that has come; zero if none waits.
    pub(crate) fn read_now(&self, buffer: &mut [u8]) -> Result<usize, i32> {
        let mut world = self.world();
        let now_ns = world.now_ns;
        Ok(world
            .next(now_ns)?
            .map_or(0, |packet| fill(buffer, &packet)))
    }
}

fn fill(buffer: &mut [u8], packet: &[u8]) -> usize {
    for (to, from) in buffer.iter_mut().zip(packet) {
        *to = *from;
    }
    packet.len().min(buffer.len())
}

impl Transport for Link {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        let mut world = self.world();
        let end_ns = world.now_ns + wait.as_nanos() as u64;
        let Some(mut packet) = world.next(end_ns)? else {
            return Ok(0);
        };
        if world.protocol == Protocol::WoodenHaptics {
            let way_ns = world.way_ns();
            // Reports that already wait at the host come at once.
            if !wait.is_zero() {
                let now_ns = world.now_ns;
                world.run(now_ns + way_ns);
            }
        }
        let count = fill(buffer, &packet);
        if world.protocol == Protocol::Stream && count < packet.len() {
            let rest = packet.split_off(count);
            world.arrived.push_front(rest);
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        self.world().send(bytes)
    }
}

impl Usb for Link {
    fn request(&mut self, setup: SetupPacket) -> Result<(), i32> {
        let mut world = self.world();
        if world.is_unplugged() {
            return Err(NO_DEVICE);
        }
        let now_ns = world.now_ns + world.way_ns();
        world.run(now_ns);
        match &mut world.emulated {
            Emulated::Falcon(device) => device.control(setup, now_ns),
            _ => Ok(()),
        }
    }

    fn bulk_in(&mut self, packet: &mut [u8; PACKET], wait: Duration) -> Result<usize, i32> {
        let mut world = self.world();
        let end_ns = world.now_ns + wait.as_nanos() as u64;
        let next = world.next(end_ns)?;
        Ok(next.map_or(0, |bytes| fill(packet, &bytes)))
    }

    fn bulk_out(&mut self, bytes: &[u8]) -> Result<(), i32> {
        self.world().send(bytes)
    }
}
