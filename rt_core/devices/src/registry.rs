//! Drivers by name, and the interface of a driver.
//!
//! A scene names a **connection** (`connect`): a driver, and the address that only the driver reads
//! (`"hid:1209:c0de"`). The program that runs the scene registers its drivers. It gives each driver the further data that
//! the driver needs: the hands of simulated devices, the readings of a replay. It then opens every device by the name of
//! its driver.

use crate::models::{DeviceFile, DeviceModel};
use runner::AnyDevice;
use std::error::Error;
use std::fmt;
use std::path::Path;

/// The name of a driver and the address of a device, as a scene gives them: `driver`, or `driver:address`.
///
/// ```
/// use devices::registry::Connection;
///
/// let hid = Connection::parse("hid:1209:c0de");
/// assert_eq!((hid.driver.as_str(), hid.address.as_str()), ("hid", "1209:c0de"));
/// assert_eq!(hid.to_string(), "hid:1209:c0de");
/// assert_eq!(Connection::parse("falcon").address, "");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Connection {
    /// The name of the driver.
    pub driver: String,
    /// The address, which only the driver reads; empty where there is none.
    pub address: String,
}

impl Connection {
    /// Splits a text at its first colon.
    pub fn parse(text: &str) -> Self {
        let (driver, address) = text.split_once(':').unwrap_or((text, ""));
        Self {
            driver: driver.to_owned(),
            address: address.to_owned(),
        }
    }
}

impl fmt::Display for Connection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.driver)?;
        if !self.address.is_empty() {
            write!(f, ":{}", self.address)?;
        }
        Ok(())
    }
}

/// The kind of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A simulation. A simulated hand holds the device, and any clock serves.
    Simulated,
    /// A real device. A person holds it, it needs the real clock, and its driver makes system calls.
    Real,
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
    /// The address of the device, which only the driver reads; empty where the scene gives none.
    pub address: &'a str,
    /// The firmware that the scene names for the device.
    pub firmware: Option<&'a Path>,
}

/// A driver: the code that opens devices of one kind.
pub trait Driver {
    /// The name of the driver in scenes.
    fn name(&self) -> &'static str;

    /// The kind of its devices.
    fn kind(&self) -> Kind;

    /// The protocol of its devices, where they are devices of one kind. A device's profile must then name this protocol.
    fn protocol(&self) -> Option<&'static str> {
        None
    }

    /// Opens a device.
    ///
    /// # Errors
    /// [`OpenError`], which has the address, or states what the device lacks.
    fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError>;
}

impl dyn Driver + '_ {
    /// Refuses the profile of another device than those of the driver.
    ///
    /// # Errors
    /// [`OpenError::Profile`].
    pub fn accepts(&self, profile: &DeviceFile) -> Result<(), OpenError> {
        match self.protocol() {
            Some(protocol) if profile.protocol.as_deref() != Some(protocol) => {
                Err(OpenError::Profile {
                    found: profile.name.clone(),
                    protocol,
                })
            }
            _ => Ok(()),
        }
    }
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
    /// The address is missing, unnecessary or wrong.
    #[error("address: found {found}, allowed: {allowed}")]
    Address {
        /// The address in the scene.
        found: String,
        /// The allowed addresses, each with its driver, as a scene names them.
        allowed: &'static str,
    },
    /// The profile is that of another device than those of the driver.
    #[error("profile: found {found}, allowed: a device file with `protocol = \"{protocol}\"`")]
    Profile {
        /// Name of the device in the profile.
        found: String,
        /// The protocol of the driver's devices.
        protocol: &'static str,
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
/// use devices::registry::{Driver, Kind, OpenError, Registry, Request};
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
/// let request = Request { index: 0, model: &model, period: 1e-3, address: "", firmware: None };
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

impl Request<'_> {
    /// Refuses an address, for a driver whose devices have none.
    ///
    /// # Errors
    /// [`OpenError::Address`].
    pub fn no_address(&self) -> Result<(), OpenError> {
        if self.address.is_empty() {
            return Ok(());
        }
        Err(OpenError::Address {
            found: self.address.to_owned(),
            allowed: "no address for this driver",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Hid, ReplayDevice};

    /// A driver whose devices have no address.
    struct Plain;

    impl Driver for Plain {
        fn name(&self) -> &'static str {
            "plain"
        }

        fn kind(&self) -> Kind {
            Kind::Simulated
        }

        fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError> {
            request.no_address()?;
            let capabilities = request.model.capabilities();
            Ok(Box::new(ReplayDevice::new(capabilities, [])))
        }
    }

    fn open(connection: &str) -> String {
        let registry = Registry::new().with(Hid).with(Plain);
        let model = DeviceModel::named("touch").expect("it is carried along");
        let connection = Connection::parse(connection);
        let request = Request {
            index: 0,
            model: &model,
            period: 1e-3,
            address: &connection.address,
            firmware: None,
        };
        match registry.open(&connection.driver, &request) {
            Ok(_) => "open".to_owned(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn a_device_is_opened_by_the_name_of_its_driver() {
        assert_eq!(open("plain"), "open");
        assert_eq!(
            open("hdi:1"),
            "found the driver \"hdi\", allowed: hid, plain"
        );
        assert_eq!(
            open("plain:2"),
            "address: found 2, allowed: no address for this driver"
        );
    }

    #[test]
    fn a_wrong_address_is_refused_with_the_allowed_ones() {
        for address in [
            "hid",
            "hid:",
            "hid:1209",
            "hid:1209:",
            "hid:1209:10000",
            "hid:+209:c0de",
            "hid:12 9:c0de",
            "hid:/dev/hidraw",
            "hid:/dev/hidraw1/..",
            "hid:/dev/sda",
        ] {
            let error = open(address);
            let found = Connection::parse(address).address;
            let found = if found.is_empty() { "nothing" } else { &found };
            assert!(
                error.starts_with(&format!("address: found {found}, allowed: hid:VID:PID")),
                "{address}: {error}"
            );
        }
        // Vendor 0 is not assigned. A system without sysfs lists no devices at all.
        let nobody = open("hid:0000:0bad:left");
        assert!(nobody.contains("HID device"), "{nobody}");
    }

    #[test]
    fn a_driver_replaces_a_driver_of_the_same_name() {
        let registry = Registry::new().with(Hid).with(Hid);
        assert_eq!(registry.names().collect::<Vec<_>>(), ["hid"]);
        assert_eq!(registry.driver("hid").map(Driver::kind), Some(Kind::Real));
    }
}
