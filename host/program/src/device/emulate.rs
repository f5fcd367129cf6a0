//! `palpate device emulate`: an emulated device on a transport of this machine.

mod falcon;

use super::super::sets::Sets;
use super::super::signals::Ending;
use super::super::{CommandError, load};
use super::DeviceCommandError;
use devices::DeviceFile;
use devices::transport::Packets;
use devices::woodenhaptics::report::LENGTH;
use devices::woodenhaptics::{Form, Geometry};
use emulator::uhid::Identity;
use emulator::{Place, Served, serve};
use host::run::simulated_hand;
use host::scene::NamedDevice;
use host::world::World;
use rt_core::Device;
use runner::schedule::realtime;
use sim::emulate::firmware::{Firmware, Framing};
use sim::emulate::{Emulator, WoodenHaptics};
use sim::{Hand, SimDevice, Trajectory, Tremor};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Period of the estimate of the velocity of the handle (s).
const PERIOD_S: f64 = 1e-3;
/// Period at which the emulated device is asked for its state, when no bytes come.
const PERIOD: Duration = Duration::from_micros(500);
/// The numbers of an emulated HID device with the firmware protocol: those that pid.codes leaves for tests.
const VENDOR: u16 = 0x1209;
const PRODUCT: u16 = 0x0001;
/// Priority of the emulated device under SCHED_FIFO, if allowed: below the threads that exchange with devices.
const PRIORITY: u8 = 40;
/// Time without bytes after which the next bytes are those of another host (ns). A host exchanges every 10 ms at least.
const GONE_NS: u64 = 200_000_000;
/// Time after the first bytes of a host at which the operator presses the button for calibration (ns).
const PRESS_NS: u64 = 300_000_000;

/// Arguments of `palpate device emulate`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct EmulateArguments {
    /// The device: a built-in device, or a device file
    #[arg(required_unless_present = "scene", conflicts_with = "scene")]
    model: Option<String>,
    /// Emulate a device of this scene, in the scene's hand: its motion begins when the program that holds the device
    /// commands it
    #[arg(long, value_name = "FILE", conflicts_with_all = ["free", "tremor"])]
    scene: Option<PathBuf>,
    /// The name of that device. Default: the only device of the scene
    #[arg(long, value_name = "DEVICE", requires = "scene")]
    name: Option<String>,
    /// The protocol of the emulated device. Default: that of the device if it is woodenhaptics, or falcon on usb;
    /// else firmware, the firmware protocol of Palpate
    #[arg(long, value_enum)]
    protocol: Option<ProtocolName>,
    /// Where the device is found: pty, tcp (any free port), tcp:PORT, uhid (a HID device of the kernel, which needs the
    /// right to write to /dev/uhid), or usb (a USB device of the kernel, which needs root and `modprobe -a dummy_hcd
    /// libcomposite usb_f_hid usb_f_fs`)
    #[arg(long, value_name = "PLACE")]
    on: String,
    /// The file whose upload an emulated Falcon expects: the file that the scene names. Any file will do for a rehearsal
    #[arg(long, value_name = "FILE")]
    firmware: Option<PathBuf>,
    /// Leave the device to itself: no hand holds it
    #[arg(long, conflicts_with = "tremor")]
    free: bool,
    /// Root mean square of the tremor of the simulated hand (m), which holds the device at its origin
    #[arg(long, value_name = "METRES", default_value_t = 0.0)]
    tremor: f64,
    /// Serial number of a device on uhid or usb
    #[arg(long, value_name = "SERIAL", default_value = "emulated")]
    serial: String,
    /// Seed of the tremor and of the motion of a scene's hand. Default: 1, or the seed of the scene
    #[arg(long, value_parser = crate::seed)]
    seed: Option<u64>,
}

/// The protocols that can be emulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum ProtocolName {
    /// The firmware protocol of Palpate.
    Firmware,
    /// That of WoodenHaptics.
    Woodenhaptics,
    /// That of the Novint Falcon, on usb alone.
    Falcon,
}

impl ProtocolName {
    /// How a scene connects to a device at a place.
    pub(crate) fn connect(self, address: &str) -> String {
        match (self, address.strip_prefix("hid:")) {
            (Self::Firmware | Self::Falcon, _) => address.to_owned(),
            // HID is the usual transport of this device, which is found by its numbers. Of several, each is named by its
            // serial number.
            (Self::Woodenhaptics, Some(numbers)) => match numbers.rsplit_once(':') {
                Some((_, serial)) => format!("woodenhaptics:{serial}"),
                None => "woodenhaptics".to_owned(),
            },
            (Self::Woodenhaptics, None) => format!("woodenhaptics:{address}"),
        }
    }
}

/// An emulated device of any protocol but that of the Falcon.
pub(crate) enum Emulated {
    Firmware(Box<Sessions>),
    WoodenHaptics(Box<Operated>),
}

/// A device of the firmware protocol. Its hand may begin its motion again with each session.
pub(crate) struct Sessions {
    device: Firmware,
    moves: bool,
    session: u32,
}

impl Emulator for Sessions {
    fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        self.device.receive(bytes, now_ns);
        if !self.moves {
            return;
        }
        let session = self.device.session();
        if std::mem::replace(&mut self.session, session) != session {
            self.device.device_mut().hold_hand();
        }
        if self.device.is_commanded() {
            self.device.device_mut().begin_hand();
        }
    }

    fn send(&mut self, now_ns: u64, report: &mut [u8; 64]) -> Option<usize> {
        self.device.send(now_ns, report)
    }
}

impl Emulator for Emulated {
    fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        match self {
            Self::Firmware(device) => device.receive(bytes, now_ns),
            Self::WoodenHaptics(device) => device.receive(bytes, now_ns),
        }
    }

    fn send(&mut self, now_ns: u64, report: &mut [u8; 64]) -> Option<usize> {
        match self {
            Self::Firmware(device) => device.send(now_ns, report),
            Self::WoodenHaptics(device) => device.send(now_ns, report),
        }
    }
}

impl Emulated {
    /// The mechanism `device` with its protocol. `name` is the name that the device tells.
    ///
    /// # Errors
    /// [`DeviceCommandError::NotEmulated`] for the protocol of the Falcon.
    pub(crate) fn new(
        device: SimDevice,
        name: &str,
        protocol: ProtocolName,
        framing: Framing,
    ) -> Result<Self, DeviceCommandError> {
        let refused = |problem: String| DeviceCommandError::NotEmulated(problem);
        match protocol {
            ProtocolName::Firmware => Ok(Self::Firmware(Box::new(Sessions {
                device: Firmware::new(device, name, framing),
                moves: false,
                session: 0,
            }))),
            ProtocolName::Woodenhaptics => {
                let device = WoodenHaptics::new(device, &Geometry::default(), Form::Short);
                Ok(Self::WoodenHaptics(Box::new(Operated {
                    device: device.map_err(|error| refused(error.to_string()))?,
                    first_ns: None,
                    last_ns: 0,
                    pressed: false,
                    moves: false,
                })))
            }
            ProtocolName::Falcon => Err(refused("a Falcon is emulated on usb alone".to_owned())),
        }
    }

    /// Lets the hand begin its motion when a host commands the device, again with each host.
    fn moving(mut self) -> Self {
        match &mut self {
            Self::Firmware(device) => {
                device.moves = true;
                device.device.device_mut().hold_hand();
            }
            Self::WoodenHaptics(device) => {
                device.moves = true;
                device.device.device_mut().hold_hand();
            }
        }
        self
    }

    /// The force that the motors hold (N).
    pub(crate) fn force(&self) -> f64 {
        let device = match self {
            Self::Firmware(device) => device.device.device(),
            Self::WoodenHaptics(device) => device.device.device(),
        };
        device.probe().map_or(0.0, |probe| probe.held.force.norm())
    }

    /// A new host has come.
    fn begin(&mut self) {
        if let Self::WoodenHaptics(device) = self {
            device.begin();
        }
    }

    /// Lets time pass without a host: a device does not wait for one to let go.
    fn run(&mut self, now_ns: u64) {
        match self {
            Self::Firmware(device) => device.device.run(now_ns),
            Self::WoodenHaptics(device) => device.device.run(now_ns),
        }
    }
}

/// A device with the operator who calibrates it, soon after a host has come.
pub(crate) struct Operated {
    device: WoodenHaptics,
    first_ns: Option<u64>,
    last_ns: u64,
    pressed: bool,
    /// Whether the hand has a motion of its own, which begins after the calibration.
    moves: bool,
}

impl Operated {
    /// A new host has come.
    fn begin(&mut self) {
        (self.first_ns, self.pressed) = (None, false);
        if self.moves {
            self.device.device_mut().hold_hand();
        }
    }
}

impl Emulator for Operated {
    fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        // Hosts of a HID device follow each other without another sign.
        if now_ns.saturating_sub(self.last_ns) > GONE_NS {
            self.begin();
        }
        self.last_ns = now_ns;
        let first = *self.first_ns.get_or_insert(now_ns);
        if self.moves && self.pressed && !self.device.awaits_counters() {
            self.device.device_mut().begin_hand();
        }
        if !self.pressed && now_ns.saturating_sub(first) >= PRESS_NS {
            self.pressed = true;
            self.device.press_calibration();
        }
        self.device.receive(bytes, now_ns);
    }

    fn send(&mut self, now_ns: u64, report: &mut [u8; 64]) -> Option<usize> {
        self.device.send(now_ns, report)
    }
}

/// The place that `--on` names, for a device that is called `model`.
fn place(
    arguments: &EmulateArguments,
    model: &str,
    protocol: ProtocolName,
) -> Result<Place, DeviceCommandError> {
    let (vid, pid, report) = match protocol {
        ProtocolName::Woodenhaptics => (0x1234, 0x0006, 14),
        _ => (VENDOR, PRODUCT, 64),
    };
    let identity = Identity {
        name: format!("Palpate's emulated {model}"),
        serial: arguments.serial.clone(),
        vid,
        pid,
        report,
    };
    match arguments.on.split_once(':') {
        None if arguments.on == "pty" => Ok(Place::pty()?),
        None if arguments.on == "tcp" => Ok(Place::tcp(0)?),
        None if arguments.on == "uhid" => Ok(Place::uhid(identity)?),
        None if arguments.on == "usb" => Ok(Place::usb(identity)?),
        Some(("tcp", port)) if port.parse::<u16>().is_ok() => {
            Ok(Place::tcp(port.parse().unwrap_or(0))?)
        }
        _ => Err(DeviceCommandError::NotEmulated(format!(
            "--on: found {:?}, allowed: pty, tcp, tcp:PORT, uhid, usb",
            arguments.on
        ))),
    }
}

impl EmulateArguments {
    /// Whether the place gives reports, and no stream of bytes.
    fn has_reports(&self) -> bool {
        matches!(self.on.as_str(), "uhid" | "usb")
    }
}

/// The mechanism in its hand.
struct Simulated {
    device: SimDevice,
    /// The name of the model, and its file.
    name: String,
    file: DeviceFile,
    /// Whether the hand is that of a scene, which waits for a host.
    moves: bool,
}

impl Simulated {
    fn new(arguments: &EmulateArguments) -> Result<Self, CommandError> {
        let refused =
            |problem: String| CommandError::from(DeviceCommandError::NotEmulated(problem));
        if let Some(scene) = &arguments.scene {
            return Self::of_scene(arguments, scene);
        }
        // The parser requires one of the two.
        let model = arguments.model.as_deref().unwrap_or_default();
        let NamedDevice { name, file, .. } = NamedDevice::load(model)?;
        let mut hand = Hand::new(Trajectory::still());
        if arguments.tremor != 0.0 {
            let tremor = Tremor::new(arguments.tremor, arguments.seed.unwrap_or(1));
            hand = hand.with_tremor(tremor.map_err(|error| refused(format!("--tremor: {error}")))?);
        }
        let device = SimDevice::new(file.model, (!arguments.free).then_some(hand), PERIOD_S);
        Ok(Self {
            device: device.map_err(|error| refused(error.to_string()))?,
            name,
            file,
            moves: false,
        })
    }

    /// The device of a scene in its hand.
    fn of_scene(arguments: &EmulateArguments, scene: &Path) -> Result<Self, CommandError> {
        let refused =
            |problem: String| CommandError::from(DeviceCommandError::NotEmulated(problem));
        let loaded = load(Some(scene), &Sets::default())?;
        let devices = &loaded.scene.devices;
        let index = match &arguments.name {
            None if devices.len() == 1 => Some(0),
            None => None,
            Some(name) => devices.iter().position(|device| device.name == *name),
        };
        let index = index.ok_or_else(|| {
            let names: Vec<_> = devices.iter().map(|device| &*device.name).collect();
            let found = arguments.name.as_deref().unwrap_or("none");
            refused(format!(
                "--name: found {found}, allowed: the devices of the scene: {}",
                names.join(", ")
            ))
        })?;
        let seed = arguments.seed.unwrap_or(loaded.scene.seed);
        let (hand, start) = simulated_hand(&World::new(&loaded)?, index, seed)?;
        let moves = hand.is_some();
        let device = SimDevice::new(loaded.models[index], hand, PERIOD_S)
            .and_then(|device| device.starting_at(start));
        Ok(Self {
            device: device.map_err(|error| refused(error.to_string()))?,
            name: loaded.profiles[index].name.clone(),
            file: loaded.profiles[index].clone(),
            moves,
        })
    }
}

/// Serves a device at a place to one host after the other, until `stop`. `packets`: the place gives a stream of bytes, and
/// the protocol has packets of one length. `see` is given the device after each arrival of bytes (true), and from time to
/// time (false).
///
/// # Errors
/// The transport cannot wait for a host; if the place gives reports (`reports`), also the end of the transport.
pub(crate) fn serve_at(
    emulated: &mut Emulated,
    place: &mut Place,
    (packets, reports): (bool, bool),
    stop: &AtomicBool,
    served: &mut Served,
    see: &mut dyn FnMut(&Emulated, bool),
) -> Result<(), DeviceCommandError> {
    let start = Instant::now();
    let now_ns = || u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
    while !stop.load(Ordering::Relaxed) {
        let host = place.host(PERIOD).map_err(DeviceCommandError::Host)?;
        let Some(mut transport) = host else {
            emulated.run(now_ns());
            see(emulated, false);
            continue;
        };
        emulated.begin();
        let mut shifted = Later {
            device: emulated,
            by_ns: now_ns(),
            see,
        };
        // A host that goes away ends its connection, and the next may come.
        let ended = if packets {
            let mut packets = Packets::new(&mut *transport, LENGTH);
            serve(&mut shifted, &mut packets, PERIOD, stop, served)
        } else {
            serve(&mut shifted, &mut *transport, PERIOD, stop, served)
        };
        drop(transport);
        if let Err(number) = ended
            && reports
        {
            return Err(DeviceCommandError::Ended(number));
        }
    }
    Ok(())
}

pub(super) fn run(arguments: &EmulateArguments) -> Result<(), CommandError> {
    // A signal is the usual end.
    let ending = Ending::begin(false)?;
    let simulated = Simulated::new(arguments)?;
    let own = match simulated.file.protocol.as_deref() {
        Some("woodenhaptics") => ProtocolName::Woodenhaptics,
        Some("falcon") if arguments.on == "usb" => ProtocolName::Falcon,
        _ => ProtocolName::Firmware,
    };
    let protocol = arguments.protocol.unwrap_or(own);
    if protocol == ProtocolName::Falcon {
        return falcon::run(arguments, simulated, &ending);
    }
    if arguments.firmware.is_some() {
        let problem = "--firmware is for the protocol of the Falcon (--on usb --protocol falcon)";
        return Err(DeviceCommandError::NotEmulated(problem.to_owned()).into());
    }
    let framing = if arguments.has_reports() {
        Framing::Report
    } else {
        Framing::Stream
    };
    let Simulated {
        device,
        name,
        moves,
        ..
    } = simulated;
    let mut emulated = Emulated::new(device, &name, protocol, framing)?;
    if moves {
        emulated = emulated.moving();
    }
    let mut place = place(arguments, &name, protocol)?;
    outln!("connect = \"{}\"", protocol.connect(&place.connection()));
    errln!("emulating {name} until Ctrl-C");
    // The device stands for hardware, which no other program delays. A refusal makes it as late as any program.
    let _ = realtime(PRIORITY);
    let mut served = Served::default();
    let reports = arguments.has_reports();
    let packets = protocol == ProtocolName::Woodenhaptics && !reports;
    serve_at(
        &mut emulated,
        &mut place,
        (packets, reports),
        &ending.stop().flag(),
        &mut served,
        &mut |_, _| (),
    )?;
    report(&served);
    if let Emulated::Firmware(device) = &emulated {
        let device = &device.device;
        errln!(
            "the watchdog let go {} time{}, at most {:.2} ms after the last wrench",
            device.counters().watchdog,
            if device.counters().watchdog == 1 {
                ""
            } else {
                "s"
            },
            device.let_go_ns() as f64 * 1e-6
        );
    }
    Ok(())
}

/// Tells how much has passed.
fn report(served: &Served) {
    errln!(
        "{} commands received, {} reports sent, {} not taken",
        served.received,
        served.sent,
        served.refused
    );
}

/// An emulator whose time begins later: one device lives on over several connections.
struct Later<'a> {
    device: &'a mut Emulated,
    by_ns: u64,
    see: &'a mut dyn FnMut(&Emulated, bool),
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
