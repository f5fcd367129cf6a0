//! Opens the device of a connection, outside of a scene.

use super::super::CommandError;
use super::DeviceCommandError;
use devices::registry::{Identity, Notes};
use devices::{Connection, DeviceFile, OpenError, Request};
use host::scene::NamedDevice;
use rt_core::{Device, Wrench};
use runner::{AnyDevice, Stop};
use std::path::Path;
use std::time::{Duration, Instant};

/// Longest time that a device may take until its first state: the operator has to calibrate it (s).
const FIRST: f64 = 60.0;

/// A device of a connection.
pub(super) struct Opened {
    /// The device.
    pub(super) device: AnyDevice,
    /// Its profile.
    pub(super) file: DeviceFile,
    /// The identity that the device states.
    pub(super) identity: Option<Identity>,
}

/// The device of a connection, and its profile.
///
/// # Errors
/// [`DeviceCommandError`], which names the connection, the driver or the profile that is wrong.
pub(super) fn device(
    connect: &str,
    model: &str,
    firmware: Option<&Path>,
) -> Result<Opened, CommandError> {
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
            connect: connect.to_owned(),
            problem: rest.unwrap_or(&problem).to_owned(),
        }
    };
    driver.accepts(&file).map_err(refused)?;
    let notes = Notes::default();
    let request = Request {
        name: &file.name,
        firmware,
        notes: Some(&notes),
        ..Request::new(&file.model, &connection.address)
    };
    let device = driver.open(&request).map_err(refused)?;
    let identity = notes.identity();
    for note in notes.into_vec() {
        errln!("note: {note}");
    }
    Ok(Opened {
        device,
        file,
        identity,
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
