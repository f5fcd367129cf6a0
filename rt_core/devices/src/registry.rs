//! Drivers by name, and the interface of a driver.
//!
//! A scene names a **connection** (`connect`): a driver, and the address that only the driver reads
//! (`"hid:1209:c0de"`). The program that runs the scene registers its drivers. It gives each driver the further data that
//! the driver needs: the hands of simulated devices, the readings of a replay. It then opens every device by the name of
//! its driver.

use crate::models::{DeviceFile, DeviceModel};
use crate::stated::{Mismatch, Name, Stated};
use firmware_proto::report::FirmwareVersion;
use rt_core::Capabilities;
use runner::AnyDevice;
use runner::schedule::DEVICE_PRIORITY;
use std::cell::RefCell;
use std::error::Error;
use std::fmt;
use std::net::{IpAddr, Ipv4Addr, ToSocketAddrs};
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
    /// The address, which only the driver reads; empty if there is none.
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

/// The identity that a device states.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// The name of its model.
    pub name: String,
    /// The version of its firmware; `None` if the device states none.
    pub firmware: Option<String>,
}

/// The notes of a driver on a device that it opens, beside errors: one sentence each, and the identity that the device
/// states.
#[derive(Debug, Default)]
pub struct Notes {
    told: RefCell<Vec<String>>,
    identity: RefCell<Option<Identity>>,
}

impl Notes {
    /// Adds a note.
    pub fn add(&self, note: String) {
        self.told.borrow_mut().push(note);
    }

    /// The identity that the device states; `None` if it states none.
    pub fn identity(&self) -> Option<Identity> {
        self.identity.borrow().clone()
    }

    /// The notes so far.
    pub fn into_vec(self) -> Vec<String> {
        self.told.into_inner()
    }
}

/// A request to a driver to open a device.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Index of the device in its scene.
    pub index: usize,
    /// The model of the device.
    pub model: &'a DeviceModel,
    /// The name of the device in its profile, which a device that states a name must not contradict; empty if the
    /// caller knows none.
    pub name: &'a str,
    /// Period of the tick (s).
    pub period: f64,
    /// Priority of the device's thread under SCHED_FIFO (1 to 99), if it has one.
    pub priority: u8,
    /// The address of the device, which only the driver reads; empty if the scene gives none.
    pub address: &'a str,
    /// The firmware that the scene names for the device.
    pub firmware: Option<&'a Path>,
    /// Takes the notes of the driver.
    pub notes: Option<&'a Notes>,
}

/// A driver: the code that opens devices of one kind.
pub trait Driver {
    /// The name of the driver in scenes.
    fn name(&self) -> &'static str;

    /// The kind of its devices.
    fn kind(&self) -> Kind;

    /// The protocol of its devices, if they are devices of one kind. A device's profile must then name this protocol.
    fn protocol(&self) -> Option<&'static str> {
        None
    }

    /// The names of the place to which an address leads, as known before any device is opened: the file of a device, or
    /// a place in the network. Two addresses that have a name in common reach one device, whatever their drivers. Empty
    /// if any number of devices may have the address.
    fn reaches(&self, address: &str) -> Vec<String>;

    /// Opens a device.
    ///
    /// # Errors
    /// [`OpenError`], which contains the address, or names what the device lacks.
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

/// The reason why a device could not be opened.
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
///     fn reaches(&self, _: &str) -> Vec<String> {
///         Vec::new()
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
/// let request = Request::new(&model, "");
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

    /// Whether two connections reach one device, as known before any device is opened.
    pub fn reach_the_same(&self, one: &Connection, other: &Connection) -> bool {
        let reached = |connection: &Connection| {
            let driver = self.driver(&connection.driver);
            driver.map_or_else(Vec::new, |driver| driver.reaches(&connection.address))
        };
        let known = reached(one);
        !known.is_empty() && reached(other).iter().any(|name| known.contains(name))
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

/// The name of a path for [`Driver::reaches`]: the file to which the path leads, or the path itself if it leads
/// nowhere.
pub(crate) fn file_of(path: &Path) -> String {
    let leads_to = std::fs::canonicalize(path);
    leads_to
        .as_deref()
        .unwrap_or(path)
        .to_string_lossy()
        .into_owned()
}

/// The names of a host and a port for [`Driver::reaches`]: all addresses of the host, and the text itself.
pub(crate) fn places_of(address: &str) -> Vec<String> {
    let found = address.to_socket_addrs().into_iter().flatten();
    let each = found.map(|place| {
        // Any address of this machine is reached at this machine.
        let ip = match place.ip().to_canonical() {
            ip if ip.is_unspecified() => IpAddr::V4(Ipv4Addr::LOCALHOST),
            ip => ip,
        };
        format!("{ip} port {}", place.port())
    });
    each.chain([address.to_ascii_lowercase()]).collect()
}

impl fmt::Debug for Registry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.names()).finish()
    }
}

impl<'a> Request<'a> {
    /// A request for the first device of a scene, with this address, at 1 kHz.
    pub fn new(model: &'a DeviceModel, address: &'a str) -> Self {
        Self {
            index: 0,
            model,
            name: "",
            period: 1e-3,
            priority: DEVICE_PRIORITY,
            address,
            firmware: None,
            notes: None,
        }
    }

    /// Compares the statements of a device with its profile (see [`Stated::agree`]). Notes for the user whether the
    /// name is unknown or the device is weaker, and returns the limits that hold.
    ///
    /// # Errors
    /// [`Mismatch`].
    pub(crate) fn agree(&self, stated: &Stated, least: f64) -> Result<Capabilities, Mismatch> {
        let profile = self.model.capabilities();
        let limits = stated.agree(&profile, least)?;
        self.name_agrees(stated.name)?;
        for (quantity, unit, holds, profile) in [
            ("force", "N", limits.max_force, profile.max_force),
            ("moment", "N m", limits.max_moment, profile.max_moment),
        ] {
            if holds < profile {
                self.note(format!(
                    "the device {} states a largest {quantity} of {holds} {unit}, and its profile {profile} {unit}: the \
                     lower limit holds",
                    stated.name
                ));
            }
        }
        Ok(limits)
    }

    /// Compares the name that a device states with its profile (see [`Stated::name_agrees`]).
    ///
    /// # Errors
    /// [`Mismatch::Name`].
    pub(crate) fn name_agrees(&self, stated: Name) -> Result<(), Mismatch> {
        if let Some(notes) = self.notes {
            notes.identity.borrow_mut().get_or_insert_default().name = stated.text();
        }
        if let Some(note) = stated.agrees(self.name)? {
            self.note(note);
        }
        Ok(())
    }

    /// Notes for the user the version of the firmware that a device states.
    pub(crate) fn has_firmware(&self, version: Option<FirmwareVersion>) {
        if let (Some(notes), Some(version)) = (self.notes, version) {
            let FirmwareVersion {
                major,
                minor,
                patch,
            } = version;
            notes.identity.borrow_mut().get_or_insert_default().firmware =
                Some(format!("{major}.{minor}.{patch}"));
        }
    }

    fn note(&self, note: String) {
        if let Some(notes) = self.notes {
            notes.add(note);
        }
    }

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

        fn reaches(&self, _: &str) -> Vec<String> {
            Vec::new()
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
        let request = Request::new(&model, &connection.address);
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
            "hid:/",
            "hid:dev/hidraw1",
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
        assert!(open("hid:/dev/null").contains("the file is none of a HID device"));
        // Any path may be a link that leads to a device; these do not.
        for path in ["/dev/null", "/dev/hidraw1/..", "/dev/no/such/link"] {
            let refused = open(&format!("hid:{path}"));
            assert!(
                refused.contains(&format!("no HID device {path} is connected")),
                "{refused}"
            );
        }
    }

    #[test]
    fn two_texts_that_name_one_device_are_known() {
        use crate::falcon::FalconDriver;
        use crate::plugin::Plugins;
        use crate::woodenhaptics::WoodenHapticsDriver;
        use crate::{Tcp, Tty};
        use std::os::unix::fs::symlink;
        let folder = std::env::temp_dir().join(format!("palpate-same-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(folder.join("by-id")).expect("a temporary folder");
        std::fs::write(folder.join("line"), "").expect("ours");
        symlink("../line", folder.join("by-id/left")).expect("ours");
        let registry = Registry::new()
            .with(Hid)
            .with(Tty)
            .with(Tcp)
            .with(WoodenHapticsDriver)
            .with(FalconDriver)
            .with(Plugins::new(&folder))
            .with(Plain);
        let at = folder.display();
        let same = |one: &str, other: &str| {
            let (one, other) = (Connection::parse(one), Connection::parse(other));
            let found = registry.reach_the_same(&one, &other);
            assert_eq!(
                registry.reach_the_same(&other, &one),
                found,
                "{one} {other}"
            );
            found
        };
        for (one, other) in [
            ("falcon".to_owned(), "falcon".to_owned()),
            ("woodenhaptics".to_owned(), "woodenhaptics".to_owned()),
            (
                "hid:/dev/hidraw97".to_owned(),
                "hid:/dev/hidraw97".to_owned(),
            ),
            // Whatever the protocol, the file is one.
            (
                "hid:/dev/hidraw97".to_owned(),
                "woodenhaptics:/dev/hidraw97".to_owned(),
            ),
            ("hid:1209:c0de".to_owned(), "hid:1209:C0DE".to_owned()),
            (format!("tty:{at}/line"), format!("tty:{at}/by-id/left")),
            (
                format!("tty:{at}/line"),
                format!(
                    "tty:{at}/../{}/line@1000000",
                    folder.file_name().unwrap().display()
                ),
            ),
            (
                format!("woodenhaptics:tty:{at}/by-id/left"),
                format!("tty:{at}/line@9600"),
            ),
            (
                "tcp:localhost:4000".to_owned(),
                "tcp:127.0.0.1:4000".to_owned(),
            ),
            (
                "tcp:0.0.0.0:4000".to_owned(),
                "woodenhaptics:tcp:localhost:4000".to_owned(),
            ),
            (
                "tcp:no.such.host.invalid:4000".to_owned(),
                "tcp:NO.such.host.invalid:4000".to_owned(),
            ),
            ("plugin:line".to_owned(), "plugin:by-id/left".to_owned()),
            ("plugin:line:1".to_owned(), format!("plugin:{at}/line:1")),
        ] {
            assert!(same(&one, &other), "{one} {other}");
        }
        for (one, other) in [
            ("falcon:a", "falcon:b"),
            ("hid:1209:c0de:a", "hid:1209:c0de:b"),
            ("hid:1209:c0de:@1-1", "hid:1209:c0de:@1-2"),
            ("hid:/dev/hidraw97", "hid:/dev/hidraw98"),
            ("tcp:localhost:4000", "tcp:localhost:4001"),
            ("tcp:127.0.0.1:4000", "tcp:127.0.0.2:4000"),
            ("tty:/dev/ttyUSB97", "tty:/dev/ttyUSB98"),
            // The plug-in tells its devices apart by their address.
            ("plugin:line:1", "plugin:line:2"),
            ("plugin:line", "plugin:line:1"),
            // Any number of devices may be simulated or recorded.
            ("plain", "plain"),
        ] {
            assert!(!same(one, other), "{one} {other}");
        }
        std::fs::remove_dir_all(&folder).expect("ours");
    }

    /// A host has several addresses: one in common is enough.
    #[test]
    fn a_device_is_the_same_by_any_of_its_names() {
        struct Named;
        impl Driver for Named {
            fn name(&self) -> &'static str {
                "named"
            }
            fn kind(&self) -> Kind {
                Kind::Real
            }
            fn reaches(&self, address: &str) -> Vec<String> {
                address.split(' ').map(str::to_owned).collect()
            }
            fn open(&self, _: &Request<'_>) -> Result<AnyDevice, OpenError> {
                unreachable!("nothing is opened")
            }
        }
        let registry = Registry::new().with(Named);
        let same = |one, other| {
            let [one, other] = [one, other].map(Connection::parse);
            registry.reach_the_same(&one, &other)
        };
        assert!(same("named:a b", "named:c b") && same("named:a b", "named:b c"));
        assert!(!same("named:a b", "named:c d"));
    }

    #[test]
    fn a_driver_replaces_a_driver_of_the_same_name() {
        let registry = Registry::new().with(Hid).with(Hid);
        assert_eq!(registry.names().collect::<Vec<_>>(), ["hid"]);
        assert_eq!(registry.driver("hid").map(Driver::kind), Some(Kind::Real));
    }

    #[test]
    fn a_driver_of_one_kind_of_devices_takes_their_profiles_alone() {
        use crate::falcon::FalconDriver;
        let profile = |name| DeviceFile::named(name).expect("it is carried along");
        let falcon: &dyn Driver = &FalconDriver;
        assert!(falcon.accepts(&profile("falcon")).is_ok());
        let refused = falcon.accepts(&profile("touch")).expect_err("another kind");
        assert!(
            matches!(&refused, OpenError::Profile { found, .. } if *found == profile("touch").name)
        );
        // A driver of any device takes any profile.
        let plain: &dyn Driver = &Plain;
        assert_eq!(plain.protocol(), None);
        assert!(plain.accepts(&profile("touch")).is_ok());
    }

    #[test]
    fn a_person_is_told_of_a_weaker_device_and_of_an_unknown_name() {
        let model = DeviceModel::named("virtuose6d").expect("it is carried along");
        let profile = model.capabilities();
        let told = |name: &str, force: f64, moment: f64| {
            let notes = Notes::default();
            let request = Request {
                name: "My arm",
                notes: Some(&notes),
                ..Request::new(&model, "")
            };
            let stated = Capabilities {
                max_force: force * profile.max_force,
                max_moment: moment * profile.max_moment,
                ..profile
            };
            let limits = request.agree(&Stated::new(name, &stated), 0.5);
            (
                limits.map(|limits| {
                    (
                        limits.max_force / profile.max_force,
                        limits.max_moment / profile.max_moment,
                    )
                }),
                notes.into_vec(),
            )
        };
        assert_eq!(told("my-arm", 1.0, 1.0), (Ok((1.0, 1.0)), vec![]));
        assert_eq!(told("my-arm", 2.0, 3.0), (Ok((1.0, 1.0)), vec![]));
        let (limits, notes) = told("my-arm", 0.75, 0.5);
        assert_eq!(limits, Ok((0.75, 0.5)));
        assert_eq!(notes.len(), 2);
        assert!(
            notes[0].contains("a largest force of") && notes[1].contains("a largest moment of")
        );
        assert!(told("my-arm", 0.25, 1.0).0.is_err());
        let (limits, notes) = told("stranger", 1.0, 1.0);
        assert!(
            limits.is_ok() && notes.len() == 1 && notes[0].contains("calls itself \"stranger\"")
        );
    }
}
