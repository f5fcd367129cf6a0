//! Opens the device of a connection, outside of a scene.

use super::super::CommandError;
use super::super::settings::SettingsFile;
use super::DeviceCommandError;
use devices::registry::{Identity, Notes};
use devices::{Connection, DeviceFile, OpenError, Request};
use host::scene::NamedDevice;
use rt_core::{Device, Wrench};
use runner::{AnyDevice, Stop};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Longest time that a device may take until its first state: the operator has to calibrate it (s).
const FIRST: f64 = 60.0;

/// The arguments that name a device.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct DeviceArguments {
    /// The connection of the device, as a scene names it: hid:VID:PID, woodenhaptics, falcon, tty:PATH, tcp:HOST:PORT,
    /// plugin:FILE
    pub(super) connect: String,
    /// The present profile of the device: a built-in device, or a device file
    #[arg(long, value_name = "MODEL")]
    model: String,
    /// The firmware file, for a Falcon
    #[arg(long, value_name = "FILE")]
    firmware: Option<PathBuf>,
    #[command(flatten)]
    settings: SettingsFile,
}

/// A device of a connection.
pub(super) struct Opened {
    /// The device.
    pub(super) device: AnyDevice,
    /// Its profile.
    pub(super) file: DeviceFile,
    /// The identity that the device states.
    pub(super) identity: Option<Identity>,
    /// Priority of a tick under SCHED_FIFO, by the settings.
    pub(super) priority: u8,
}

/// The device of a connection, and its profile. Its threads run as the settings of the machine say.
///
/// # Errors
/// [`DeviceCommandError`], which names the connection, the driver or the profile that is wrong; an error of the settings.
pub(super) fn device(arguments: &DeviceArguments) -> Result<Opened, CommandError> {
    let DeviceArguments {
        connect,
        model,
        firmware,
        settings,
    } = arguments;
    let settings = settings.resolve()?;
    let threads = settings.device_threads();
    let registry = host::scene::real_drivers(Path::new(""));
    let connection = Connection::parse(connect);
    let file = NamedDevice::load(model)?.file;
    let Some(driver) = registry.driver(&connection.driver) else {
        return Err(DeviceCommandError::Driver {
            found: connection.driver,
            allowed: registry.names().collect::<Vec<_>>().join(", "),
        }
        .into());
    };
    let refused = |error: OpenError| {
        let problem = error.to_string();
        // The connection names the address already.
        let rest = problem.strip_prefix(&format!("{}: ", connection.address));
        DeviceCommandError::Open {
            connect: connect.clone(),
            problem: rest.unwrap_or(&problem).to_owned(),
        }
    };
    driver.accepts(&file).map_err(refused)?;
    let notes = Notes::default();
    let request = Request {
        name: &file.name,
        firmware: firmware.as_deref(),
        notes: Some(&notes),
        priority: threads.priority,
        ..Request::new(&file.model, &connection.address)
    };
    let confined = threads.confine();
    if let Err(degradation) = &confined {
        errln!("note: {degradation}");
    }
    let device = driver.open(&request).map_err(refused)?;
    drop(confined);
    let identity = notes.identity();
    for note in notes.into_vec() {
        errln!("note: {note}");
    }
    Ok(Opened {
        device,
        file,
        identity,
        priority: settings.priority.value,
    })
}

/// Waits for the first state of a device, or for `stop`, with zero force. The operator may have to calibrate or home the
/// device.
///
/// # Errors
/// [`DeviceCommandError::NoState`] if none comes within a minute.
pub(super) fn wait_for_state(
    device: &mut (impl Device + ?Sized),
    period: f64,
    stop: &Stop,
) -> Result<(), CommandError> {
    let start = Instant::now();
    while start.elapsed().as_secs_f64() < FIRST {
        let now = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        let reading = device.read(now);
        let _ = device.write(now, &Wrench::zero());
        if reading.is_ok() || stop.is_requested() {
            return Ok(());
        }
        std::thread::sleep(Duration::from_secs_f64(period));
    }
    Err(DeviceCommandError::NoState(FIRST).into())
}
