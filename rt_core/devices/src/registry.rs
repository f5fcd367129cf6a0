//! Drivers by name, and the interface of a driver.
//!
//! A scene names a driver and a model, and has settings that only the driver reads. The program that runs the scene
//! registers its drivers. It gives each driver the further data that the driver needs: the hands of simulated devices,
//! the readings of a replay. It then opens every device by the name of its driver.

use crate::models::DeviceModel;
use runner::AnyDevice;
use std::error::Error;
use std::fmt;
use toml::{Table, Value};

/// The kind of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A simulation. A simulated hand holds the device, and any clock serves.
    Simulated,
    /// A real device. A person holds it, it needs the real clock, and its driver makes system calls.
    Real,
    /// A recording.
    Recorded,
}

/// A request to a driver to open a device.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Index of the device in its scene.
    pub index: usize,
    /// The model of the device.
    pub model: &'a DeviceModel,
    /// Period of the tick (s).
    pub period: f64,
    /// The settings in the scene for this driver.
    pub settings: Settings<'a>,
}

/// A driver: the code that opens devices of one kind.
pub trait Driver {
    /// The name of the driver in scenes.
    fn name(&self) -> &'static str;

    /// The kind of its devices.
    fn kind(&self) -> Kind;

    /// Opens a device.
    ///
    /// # Errors
    /// [`OpenError`], which names the setting, or states what the device lacks.
    fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError>;
}

/// Why a device could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// No driver of that name is registered.
    #[error("found the driver {found:?}, allowed: {known}")]
    UnknownDriver {
        /// The name that was given.
        found: String,
        /// The names of the registered drivers.
        known: String,
    },
    /// A setting is missing, unknown or wrong.
    #[error("settings.{field}: found {found}, allowed: {allowed}")]
    Setting {
        /// Name of the setting.
        field: String,
        /// The value in the scene.
        found: String,
        /// The allowed values.
        allowed: String,
    },
    /// The driver cannot open such a device.
    #[error("{source}; allowed: {allowed}")]
    Refused {
        /// The cause.
        source: Box<dyn Error + Send + Sync>,
        /// The devices that the driver can open.
        allowed: &'static str,
    },
}

/// Drivers by name.
///
/// ```
/// use devices::registry::{Driver, Kind, OpenError, Registry, Request, Settings};
/// use devices::{AnyDevice, DeviceModel, Scripted};
/// use rt_core::{Device, DeviceState};
///
/// /// Opens devices that never move.
/// struct Resting;
///
/// impl Driver for Resting {
///     fn name(&self) -> &'static str {
///         "resting"
///     }
///     fn kind(&self) -> Kind {
///         Kind::Simulated
///     }
///     fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError> {
///         let capabilities = request.model.capabilities();
///         let read = |_| Ok(DeviceState::resting());
///         Ok(Box::new(Scripted::new(capabilities, read, |_, _| Ok(()))))
///     }
/// }
///
/// let registry = Registry::new().with(Resting);
/// let model = DeviceModel::named("falcon").expect("a built-in device");
/// let request = Request { index: 0, model: &model, period: 1e-3, settings: Settings::none() };
/// let mut device = registry.open("resting", &request)?;
/// assert_eq!(device.capabilities().max_force, 8.0);
/// assert!(device.read(0).is_ok());
///
/// // The error for an unknown driver lists the known ones.
/// let error = registry.open("falkon", &request).err().expect("no such driver");
/// assert_eq!(error.to_string(), "found the driver \"falkon\", allowed: resting");
/// # Ok::<(), OpenError>(())
/// ```
#[derive(Default)]
pub struct Registry {
    drivers: Vec<Box<dyn Driver>>,
}

impl Registry {
    /// A registry without drivers.
    pub fn new() -> Self {
        Self::default()
    }

    /// The same registry with one more driver, which replaces a driver of the same name.
    pub fn with(mut self, driver: impl Driver + 'static) -> Self {
        self.drivers.retain(|known| known.name() != driver.name());
        self.drivers.push(Box::new(driver));
        self
    }

    /// The names of all drivers, in the order in which they were registered.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.drivers.iter().map(|driver| driver.name())
    }

    /// The driver of that name.
    pub fn driver(&self, name: &str) -> Option<&dyn Driver> {
        let found = self.drivers.iter().find(|driver| driver.name() == name);
        found.map(|driver| &**driver)
    }

    /// Opens a device through the driver of that name.
    ///
    /// # Errors
    /// [`OpenError`].
    pub fn open(&self, driver: &str, request: &Request<'_>) -> Result<AnyDevice, OpenError> {
        let Some(found) = self.driver(driver) else {
            return Err(OpenError::UnknownDriver {
                found: driver.to_owned(),
                known: self.names().collect::<Vec<_>>().join(", "),
            });
        };
        found.open(request)
    }
}

impl fmt::Debug for Registry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.names()).finish()
    }
}

/// The settings in a scene for a driver, read field by field.
#[derive(Clone, Copy, Debug)]
pub struct Settings<'a>(Option<&'a Table>);

impl<'a> Settings<'a> {
    /// The settings in a table.
    pub fn new(table: &'a Table) -> Self {
        Self(Some(table))
    }

    /// No settings.
    pub fn none() -> Self {
        Self(None)
    }

    fn get(self, field: &str) -> Option<&'a Value> {
        self.0.and_then(|table| table.get(field))
    }

    /// Refuses a setting whose name is not in `known`.
    ///
    /// # Errors
    /// [`OpenError::Setting`] with the first unknown setting.
    pub fn only(self, known: &[&str]) -> Result<(), OpenError> {
        let mut keys = self.0.into_iter().flat_map(Table::keys);
        let Some(field) = keys.find(|key| !known.contains(&key.as_str())) else {
            return Ok(());
        };
        let allowed = match known {
            [] => "no settings for this driver".to_owned(),
            known => known.join(", "),
        };
        Err(refused(field, "an unknown setting".into(), &allowed))
    }

    /// A required setting: an integer of 16 bits.
    ///
    /// # Errors
    /// [`OpenError::Setting`] where the setting is missing, of another type or out of range.
    pub fn number_u16(self, field: &str) -> Result<u16, OpenError> {
        let value = self.get(field);
        let number = value
            .and_then(Value::as_integer)
            .and_then(|n| n.try_into().ok());
        number.ok_or_else(|| {
            let found = value.map_or("nothing".into(), described);
            refused(field, found, "a whole number from 0 to 0xffff")
        })
    }

    /// An optional setting: a text.
    ///
    /// # Errors
    /// [`OpenError::Setting`] where the setting is of another type.
    pub fn text(self, field: &str) -> Result<Option<String>, OpenError> {
        match self.get(field) {
            None => Ok(None),
            Some(Value::String(text)) => Ok(Some(text.clone())),
            Some(other) => Err(refused(field, described(other), "a text in quotes")),
        }
    }
}

/// A value as a message quotes it: a scalar in full, any other value by its type.
fn described(value: &Value) -> String {
    match value {
        Value::Integer(number) => number.to_string(),
        Value::Float(number) => format!("{number:?}"),
        Value::Boolean(is) => is.to_string(),
        Value::String(text) => format!("{text:?}"),
        Value::Datetime(_) => "a date".to_owned(),
        Value::Array(_) => "a list".to_owned(),
        Value::Table(_) => "a table".to_owned(),
    }
}

fn refused(field: &str, found: String, allowed: &str) -> OpenError {
    OpenError::Setting {
        field: field.to_owned(),
        found,
        allowed: allowed.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Hid, Replay};

    fn open(driver: &str, settings: &str) -> String {
        let registry = Registry::new().with(Hid).with(Replay::new(Vec::new()));
        let model = DeviceModel::named("touch").expect("it is carried along");
        let table: Table = settings.parse().expect("sound TOML");
        let request = Request {
            index: 0,
            model: &model,
            period: 1e-3,
            settings: Settings::new(&table),
        };
        match registry.open(driver, &request) {
            Ok(_) => "open".to_owned(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn a_device_is_opened_by_the_name_of_its_driver() {
        assert_eq!(open("replay", ""), "open");
        assert_eq!(
            open("hdi", ""),
            "found the driver \"hdi\", allowed: hid, replay"
        );
        assert_eq!(
            open("replay", "speed = 2"),
            "settings.speed: found an unknown setting, allowed: no settings for this driver"
        );
    }

    #[test]
    fn settings_are_refused_with_what_was_found() {
        for (settings, expected) in [
            (
                "",
                "settings.vendor: found nothing, allowed: a whole number from 0 to 0xffff",
            ),
            (
                "vendor = 0x10000",
                "settings.vendor: found 65536, allowed: a whole number from 0 to 0xffff",
            ),
            (
                "vendor = 1\nproduct = 2\nserial = 3",
                "settings.serial: found 3, allowed: a text in quotes",
            ),
            (
                "vendor = 1\nport = 2",
                "settings.port: found an unknown setting, allowed: vendor, product, serial",
            ),
        ] {
            assert_eq!(open("hid", settings), expected);
        }
        // Vendor 0 is not assigned. A system without sysfs lists no devices at all.
        let nobody = open("hid", "vendor = 0\nproduct = 0x0bad");
        assert!(nobody.contains("HID device"), "{nobody}");
    }

    #[test]
    fn a_driver_replaces_a_driver_of_the_same_name() {
        let registry = Registry::new().with(Hid).with(Hid);
        assert_eq!(registry.names().collect::<Vec<_>>(), ["hid"]);
        assert_eq!(registry.driver("hid").map(Driver::kind), Some(Kind::Real));
    }
}
