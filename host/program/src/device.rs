//! `palpate device`: the devices of this machine, and emulated ones.

mod emulate;
mod identify;
mod list;
mod open;
mod probe;

use super::CommandError;

const EXAMPLES: &str = "\
Examples:
  palpate device list                                          print what is connected, and how a scene names it
  palpate device emulate woodenhaptics --on tcp:4000           emulate a device, in a simulated hand
  palpate device probe woodenhaptics:tcp:localhost:4000 --model woodenhaptics
                                                               measure the rate and the jitter of a device, without force
  sudo palpate device emulate falcon --on usb --firmware novint.bin
                                                               emulate a Falcon as a USB device of the kernel, with its upload";

/// Arguments of `palpate device`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct DeviceArguments {
    #[command(subcommand)]
    command: DeviceCommand,
}

#[derive(Clone, Debug, clap::Subcommand)]
enum DeviceCommand {
    /// List the devices that are connected, how a scene names them, and why one cannot be used
    List(list::ListArguments),
    /// Open a device and measure the rate, the jitter and the resolution of its states. It gets no force
    Probe(probe::ProbeArguments),
    /// Measure mass, damping and friction of a device by a guided motion that nobody holds, for its profile
    Identify(identify::IdentifyArguments),
    /// Emulate a device in a simulated hand, on a transport of this machine, until Ctrl-C
    Emulate(emulate::EmulateArguments),
}

/// Why a command of `palpate device` ended without its result.
#[derive(Debug, thiserror::Error)]
pub(super) enum DeviceCommandError {
    #[error("found the driver {found:?}, allowed: {allowed}")]
    Driver { found: String, allowed: String },
    #[error("{connect}: {problem}")]
    Open { connect: String, problem: String },
    #[error(transparent)]
    Listener(#[from] emulator::ListenerError),
    #[error(transparent)]
    Gadget(#[from] emulator::usb::GadgetError),
    #[error(transparent)]
    Firmware(#[from] devices::falcon::FirmwareError),
    #[error("{0}")]
    NotEmulated(String),
    #[error(transparent)]
    Served(#[from] emulator::ServeError),
    #[error(
        "the device will move by itself: put it down freely, with 20 mm of room, and confirm by --nobody-holds-it"
    )]
    Unconfirmed,
    #[error("{0}")]
    Unidentified(String),
    #[error("no delay from force to motion: {0}")]
    NoMotion(String),
    #[error("the device gave no state in {0} s; see the errors above")]
    NoState(f64),
    #[error("the device is not ready for a run; the verdict above says why")]
    NotReady,
}

impl DeviceCommandError {
    /// 2 for a wrong argument, 1 for a failure.
    pub(super) fn exit_code(&self) -> u8 {
        match self {
            Self::Driver { .. } | Self::NotEmulated(_) | Self::Unconfirmed => 2,
            _ => 1,
        }
    }
}

pub(super) fn run(arguments: &DeviceArguments) -> Result<(), CommandError> {
    match &arguments.command {
        DeviceCommand::List(arguments) => list::run(arguments),
        DeviceCommand::Probe(arguments) => probe::run(arguments),
        DeviceCommand::Identify(arguments) => identify::run(arguments),
        DeviceCommand::Emulate(arguments) => emulate::run(arguments),
    }
}
