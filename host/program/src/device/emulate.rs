//! `palpate device emulate`: an emulated device on a transport of this machine.

mod falcon;

use super::super::sets::Sets;
use super::super::signals::Ending;
use super::super::{CommandError, load};
use super::DeviceCommandError;
use devices::DeviceFile;
use emulator::uhid::Identity;
use emulator::{Attended, Listener, Served};
use host::run::simulated_hand;
use host::scene::NamedDevice;
use host::world::World;
use runner::schedule::realtime;
use sim::emulate::Framing;
use sim::{Hand, SimDevice, Trajectory, Tremor};
use std::path::{Path, PathBuf};

/// Period of the estimate of the velocity of the handle (s).
const PERIOD: f64 = 1e-3;
/// The numbers of an emulated HID device with the firmware protocol: those that pid.codes leaves for tests.
const VENDOR: u16 = 0x1209;
const PRODUCT: u16 = 0x0001;
/// Priority of the emulated device under SCHED_FIFO, if allowed: below the threads that exchange with devices.
const PRIORITY: u8 = 40;

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
enum ProtocolName {
    /// The firmware protocol of Palpate.
    Firmware,
    /// That of WoodenHaptics.
    Woodenhaptics,
    /// That of the Novint Falcon, on usb alone.
    Falcon,
}

/// The listener that `--on` names, for a device that is called `model`.
fn listener(
    arguments: &EmulateArguments,
    model: &str,
    protocol: ProtocolName,
) -> Result<Listener, DeviceCommandError> {
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
        None if arguments.on == "pty" => Ok(Listener::pty()?),
        None if arguments.on == "tcp" => Ok(Listener::tcp(0)?),
        None if arguments.on == "uhid" => Ok(Listener::uhid(identity)?),
        None if arguments.on == "usb" => Ok(Listener::usb(identity)?),
        Some(("tcp", port)) if port.parse::<u16>().is_ok() => {
            Ok(Listener::tcp(port.parse().unwrap_or(0))?)
        }
        _ => Err(DeviceCommandError::NotEmulated(format!(
            "--on: found {:?}, allowed: pty, tcp, tcp:PORT, uhid, usb",
            arguments.on
        ))),
    }
}

impl EmulateArguments {
    /// Whether the listener gives reports, and no stream of bytes.
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
        let device = SimDevice::new(file.model, (!arguments.free).then_some(hand), PERIOD);
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
        let device = SimDevice::new(loaded.models[index], hand, PERIOD)
            .and_then(|device| device.starting_at(start));
        Ok(Self {
            device: device.map_err(|error| refused(error.to_string()))?,
            name: loaded.profiles[index].name.clone(),
            file: loaded.profiles[index].clone(),
            moves,
        })
    }
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
    let mut emulated = match protocol {
        ProtocolName::Woodenhaptics => Attended::woodenhaptics(device, framing)
            .map_err(|error| DeviceCommandError::NotEmulated(error.to_string()))?,
        _ => Attended::firmware(device, &name, framing),
    };
    if moves {
        emulated = emulated.moving();
    }
    let mut listener = listener(arguments, &name, protocol)?;
    outln!("connect = \"{}\"", emulated.connection(&listener));
    errln!("emulating {name} until Ctrl-C");
    // The device stands for hardware, which no other program delays. A refusal makes it as late as any program.
    let _ = realtime(PRIORITY);
    let mut served = Served::default();
    let stop = ending.stop().flag();
    let unseen = &mut |_: &Attended, _| ();
    let ended = emulated.serve(&mut listener, &stop, &mut served, unseen);
    ended.map_err(DeviceCommandError::from)?;
    report(&served);
    if let Some(device) = emulated.as_firmware() {
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
