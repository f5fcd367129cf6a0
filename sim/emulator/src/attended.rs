//! An emulated device with the person who attends it, for one host after the other.
//!
//! The person calibrates a WoodenHaptics by its button soon after a host has come. The hand of a device may have a motion
//! of its own: the motion begins when a host commands the device, anew with each host.

use crate::{Listener, Served, serve};
use devices::transport::Packets;
use devices::woodenhaptics::report::LENGTH;
use devices::woodenhaptics::{Form, Geometry, GeometryError};
use rt_core::Device;
use sim::SimDevice;
use sim::emulate::{Emulator, Firmware, Framing, WoodenHaptics};
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Period at which the device is asked for its state, when no bytes come.
const PERIOD: Duration = Duration::from_micros(500);
/// Time without bytes after which the next bytes are those of another host (ns). A host exchanges every 10 ms at least.
const GONE_NS: u64 = 200_000_000;
/// Time after the first bytes of a host at which the operator presses the button for calibration (ns).
const PRESS_NS: u64 = 300_000_000;

/// Why an emulated device no longer serves hosts.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The listener cannot wait for a host.
    #[error("the transport of the emulated device failed: {0}")]
    Host(io::Error),
    /// The transport of a listener that gives reports ended.
    #[error("the transport of the emulated device ended (system error {0})")]
    Ended(i32),
}

/// The device's side of a protocol.
enum Protocol {
    Firmware {
        device: Box<Firmware>,
        /// The session of which the hand has heard.
        session: u32,
    },
    WoodenHaptics {
        device: Box<WoodenHaptics>,
        /// The time of the first bytes of the host, and that of the last ones of any host (ns).
        first_ns: Option<u64>,
        last_ns: u64,
        /// Whether the operator has calibrated the device for this host.
        pressed: bool,
    },
}

/// An emulated device and the person who attends it.
pub struct Attended {
    protocol: Protocol,
    framing: Framing,
    /// Whether the hand has a motion of its own.
    moves: bool,
}

impl Attended {
    /// A device with the firmware protocol of Palpate. `name` is the name that the device tells.
    pub fn firmware(device: SimDevice, name: &str, framing: Framing) -> Self {
        let protocol = Protocol::Firmware {
            device: Box::new(Firmware::new(device, name, framing)),
            session: 0,
        };
        Self {
            protocol,
            framing,
            moves: false,
        }
    }

    /// A WoodenHaptics.
    ///
    /// # Errors
    /// [`GeometryError`] if the device cannot have the workspace of a WoodenHaptics.
    pub fn woodenhaptics(device: SimDevice, framing: Framing) -> Result<Self, GeometryError> {
        let device = WoodenHaptics::new(device, &Geometry::default(), Form::Short)?;
        let protocol = Protocol::WoodenHaptics {
            device: Box::new(device),
            first_ns: None,
            last_ns: 0,
            pressed: false,
        };
        Ok(Self {
            protocol,
            framing,
            moves: false,
        })
    }

    /// The same device, whose hand begins its motion when a host commands the device.
    #[must_use]
    pub fn moving(mut self) -> Self {
        self.moves = true;
        self.mechanism_mut().hold_hand();
        self
    }

    /// The device with the firmware protocol, if that is its protocol.
    pub fn as_firmware(&self) -> Option<&Firmware> {
        match &self.protocol {
            Protocol::Firmware { device, .. } => Some(device),
            Protocol::WoodenHaptics { .. } => None,
        }
    }

    /// How a scene connects to the device at `listener`.
    pub fn connection(&self, listener: &Listener) -> String {
        let address = listener.connection();
        match (&self.protocol, address.strip_prefix("hid:")) {
            (Protocol::Firmware { .. }, _) => address,
            // HID is the usual transport of this device, which is found by its numbers. Of several, each is named by its
            // serial number.
            (Protocol::WoodenHaptics { .. }, Some(numbers)) => match numbers.rsplit_once(':') {
                Some((_, serial)) => format!("woodenhaptics:{serial}"),
                None => "woodenhaptics".to_owned(),
            },
            (Protocol::WoodenHaptics { .. }, None) => format!("woodenhaptics:{address}"),
        }
    }

    /// The force that the motors hold (N).
    pub fn force(&self) -> f64 {
        let mechanism = match &self.protocol {
            Protocol::Firmware { device, .. } => device.device(),
            Protocol::WoodenHaptics { device, .. } => device.device(),
        };
        mechanism
            .probe()
            .map_or(0.0, |probe| probe.held.force.norm())
    }

    fn mechanism_mut(&mut self) -> &mut SimDevice {
        match &mut self.protocol {
            Protocol::Firmware { device, .. } => device.device_mut(),
            Protocol::WoodenHaptics { device, .. } => device.device_mut(),
        }
    }

    /// A new host has come. Hosts of the firmware protocol begin a session.
    fn begin(&mut self) {
        let Protocol::WoodenHaptics {
            device,
            first_ns,
            pressed,
            ..
        } = &mut self.protocol
        else {
            return;
        };
        (*first_ns, *pressed) = (None, false);
        if self.moves {
            device.device_mut().hold_hand();
        }
    }

    /// Lets time pass without a host: a device does not wait for one to let go.
    fn run(&mut self, now_ns: u64) {
        match &mut self.protocol {
            Protocol::Firmware { device, .. } => device.run(now_ns),
            Protocol::WoodenHaptics { device, .. } => device.run(now_ns),
        }
    }

    /// Serves the device at `listener` to one host after the other, until `stop`. `see` is given the device after each arrival
    /// of bytes (true), and from time to time (false).
    ///
    /// # Errors
    /// [`ServeError`]. The end of a stream of bytes is no error, because the next host may come.
    pub fn serve(
        &mut self,
        listener: &mut Listener,
        stop: &AtomicBool,
        served: &mut Served,
        see: &mut dyn FnMut(&Self, bool),
    ) -> Result<(), ServeError> {
        let reports = self.framing == Framing::Report;
        let packets = !reports && matches!(self.protocol, Protocol::WoodenHaptics { .. });
        let start = Instant::now();
        let now_ns = || u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        while !stop.load(Ordering::Relaxed) {
            let Some(mut transport) = listener.host(PERIOD).map_err(ServeError::Host)? else {
                self.run(now_ns());
                see(self, false);
                continue;
            };
            self.begin();
            let mut later = Later {
                device: self,
                by_ns: now_ns(),
                see,
            };
            let ended = if packets {
                let mut packets = Packets::new(&mut *transport, LENGTH);
                serve(&mut later, &mut packets, PERIOD, stop, served)
            } else {
                serve(&mut later, &mut *transport, PERIOD, stop, served)
            };
            drop(transport);
            if let Err(number) = ended
                && reports
            {
                return Err(ServeError::Ended(number));
            }
        }
        Ok(())
    }
}

impl Emulator for Attended {
    fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        // Hosts of a HID device follow each other without another sign.
        if let Protocol::WoodenHaptics { last_ns, .. } = &mut self.protocol {
            let silent = now_ns.saturating_sub(std::mem::replace(last_ns, now_ns));
            if silent > GONE_NS {
                self.begin();
            }
        }
        match &mut self.protocol {
            Protocol::Firmware { device, session } => {
                device.receive(bytes, now_ns);
                if !self.moves {
                    return;
                }
                let now = device.session();
                if std::mem::replace(session, now) != now {
                    device.device_mut().hold_hand();
                }
                if device.is_commanded() {
                    device.device_mut().begin_hand();
                }
            }
            Protocol::WoodenHaptics {
                device,
                first_ns,
                pressed,
                ..
            } => {
                let first = *first_ns.get_or_insert(now_ns);
                if self.moves && *pressed && !device.awaits_counters() {
                    device.device_mut().begin_hand();
                }
                if !*pressed && now_ns.saturating_sub(first) >= PRESS_NS {
                    *pressed = true;
                    device.press_calibration();
                }
                device.receive(bytes, now_ns);
            }
        }
    }

    fn send(&mut self, now_ns: u64, report: &mut [u8; 64]) -> Option<usize> {
        match &mut self.protocol {
            Protocol::Firmware { device, .. } => device.send(now_ns, report),
            Protocol::WoodenHaptics { device, .. } => device.send(now_ns, report),
        }
    }
}

/// An emulator whose time begins later: one device lives on over several connections.
struct Later<'a> {
    device: &'a mut Attended,
    by_ns: u64,
    see: &'a mut dyn FnMut(&Attended, bool),
}

impl Emulator for Later<'_> {
    fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        self.device
            .receive(bytes, now_ns.saturating_add(self.by_ns));
        (self.see)(self.device, true);
    }

    fn send(&mut self, now_ns: u64, report: &mut [u8; 64]) -> Option<usize> {
        let sent = self.device.send(now_ns.saturating_add(self.by_ns), report);
        (self.see)(self.device, false);
        sent
    }
}
