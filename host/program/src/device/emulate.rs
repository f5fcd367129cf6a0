//! `palpate device emulate`: an emulated device on a transport of this machine.

use super::super::CommandError;
use super::super::signals;
use super::{DeviceCommandError, profile};
use devices::woodenhaptics::{Form, Geometry};
use emulator::uhid::Identity;
use emulator::{Place, Served, serve};
use runner::Stop;
use sim::emulate::{Emulator, WoodenHaptics};
use sim::{Hand, SimDevice, Trajectory, Tremor};
use std::time::{Duration, Instant};

/// Period at which the emulated device is asked for its state, where no bytes come.
const PERIOD: Duration = Duration::from_micros(500);
/// Time after the first bytes of a host at which the operator presses the button for calibration (ns).
const PRESS_NS: u64 = 300_000_000;

/// Arguments of `palpate device emulate`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct EmulateArguments {
    /// The device: a built-in device, or a device file. Its protocol decides what is emulated
    model: String,
    /// Where the device is found: pty, tcp (any free port), tcp:PORT, or uhid (a HID device of the kernel, which needs
    /// the right to write to /dev/uhid)
    #[arg(long, value_name = "PLACE")]
    on: String,
    /// Root mean square of the tremor of the simulated hand (m), which holds the device at its origin
    #[arg(long, value_name = "METRES", default_value_t = 0.0)]
    tremor: f64,
    /// Serial number of a HID device
    #[arg(long, value_name = "SERIAL", default_value = "emulated")]
    serial: String,
    /// Seed of the tremor
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// A device with the operator who calibrates it, soon after a host has come.
struct Operated {
    device: WoodenHaptics,
    first_ns: Option<u64>,
    pressed: bool,
}

impl Emulator for Operated {
    fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        let first = *self.first_ns.get_or_insert(now_ns);
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

/// The place that `--on` names.
fn place(arguments: &EmulateArguments) -> Result<Place, DeviceCommandError> {
    match arguments.on.split_once(':') {
        None if arguments.on == "pty" => Ok(Place::pty()?),
        None if arguments.on == "tcp" => Ok(Place::tcp(0)?),
        None if arguments.on == "uhid" => Ok(Place::uhid(Identity {
            name: format!("Palpate's emulated {}", arguments.model),
            serial: arguments.serial.clone(),
            vid: 0x1234,
            pid: 0x0006,
            report: 14,
        })?),
        Some(("tcp", port)) if port.parse::<u16>().is_ok() => {
            Ok(Place::tcp(port.parse().unwrap_or(0))?)
        }
        _ => Err(DeviceCommandError::NotEmulated(format!(
            "--on: found {:?}, allowed: pty, tcp, tcp:PORT, uhid",
            arguments.on
        ))),
    }
}

/// The device in its hand.
fn device(arguments: &EmulateArguments) -> Result<Operated, CommandError> {
    let file = profile(&arguments.model)?;
    let refused = |problem: String| CommandError::from(DeviceCommandError::NotEmulated(problem));
    if file.protocol.as_deref() != Some("woodenhaptics") {
        return Err(refused(format!(
            "{}: found a device without an emulated protocol on these transports, allowed: woodenhaptics",
            arguments.model
        )));
    }
    let mut hand = Hand::new(Trajectory::still());
    if arguments.tremor != 0.0 {
        let tremor = Tremor::new(arguments.tremor, arguments.seed);
        hand = hand.with_tremor(tremor.map_err(|error| refused(format!("--tremor: {error}")))?);
    }
    let device = SimDevice::new(file.model, Some(hand), 1e-3);
    let device = device.map_err(|error| refused(error.to_string()))?;
    let emulated = WoodenHaptics::new(device, &Geometry::default(), Form::Short);
    Ok(Operated {
        device: emulated.map_err(|error| refused(error.to_string()))?,
        first_ns: None,
        pressed: false,
    })
}

pub(super) fn run(arguments: &EmulateArguments) -> Result<(), CommandError> {
    let mut emulated = device(arguments)?;
    let mut place = place(arguments)?;
    let stop = Stop::new();
    let signal = signals::end_in_order(&stop).map_err(CommandError::Signals)?;
    let address = place.connection();
    // The driver of the device comes first, and HID is its usual transport.
    let connect = match address.strip_prefix("hid:") {
        Some(_) => "woodenhaptics".to_owned(),
        None => format!("woodenhaptics:{address}"),
    };
    outln!("connect = \"{connect}\"");
    errln!("emulating {} until Ctrl-C", arguments.model);
    let start = Instant::now();
    let mut served = Served::default();
    let flag = stop.flag();
    while !flag.load(std::sync::atomic::Ordering::Relaxed) {
        let host = place.host(PERIOD).map_err(DeviceCommandError::Host)?;
        let Some(mut transport) = host else { continue };
        emulated.first_ns = None;
        emulated.pressed = false;
        let before = start.elapsed();
        let mut shifted = Later {
            device: &mut emulated,
            by_ns: u64::try_from(before.as_nanos()).unwrap_or(u64::MAX),
        };
        // A host that goes away ends its connection, and the next may come.
        let ended = serve(&mut shifted, &mut *transport, PERIOD, &flag, &mut served);
        drop(transport);
        if let Err(number) = ended
            && !arguments.on.starts_with("tcp")
        {
            return Err(DeviceCommandError::Ended(number).into());
        }
    }
    errln!(
        "{} commands received, {} reports sent, {} not taken",
        served.received,
        served.sent,
        served.refused
    );
    // The signal is the usual end.
    let _ = signal.number();
    Ok(())
}

/// An emulator whose time begins later: one device lives on over several connections.
struct Later<'a, E> {
    device: &'a mut E,
    by_ns: u64,
}

impl<E: Emulator> Emulator for Later<'_, E> {
    fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        self.device
            .receive(bytes, now_ns.saturating_add(self.by_ns));
    }
    fn send(&mut self, now_ns: u64, report: &mut [u8; 64]) -> Option<usize> {
        self.device.send(now_ns.saturating_add(self.by_ns), report)
    }
}
