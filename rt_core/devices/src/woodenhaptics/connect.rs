//! The driver `woodenhaptics`: finds and opens the device that a scene names.

use super::driver::{OpenError as DriverError, Setup, WoodenHaptics};
use super::geometry::Geometry;
use super::report::{Form, LENGTH};
use crate::exchange::{Exchanged, clock, first_then};
use crate::hid::HidSelector;
use crate::registry::{Driver, Kind, OpenError, Request};
use crate::transport::{Hidraw, Packets, Stream, Transport};
use hidapi::HidApi;
use rt_core::Vec3;
use runner::AnyDevice;
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

/// The numbers of the two boards, each with the length of its reports.
const BOARDS: [(u16, u16, Form); 2] = [(0x1234, 0x0006, Form::Short), (0x16c0, 0x0486, Form::Long)];
/// Error number where no device is connected (ENODEV).
const NO_DEVICE: i32 = 19;
/// Speed of a serial line, which a pty ignores (bits a second).
const BAUD: u32 = 115_200;
/// The allowed addresses.
const ADDRESSES: &str = "woodenhaptics, where one such device is connected; woodenhaptics:SERIAL; \
                         woodenhaptics:/dev/hidrawN; or, for an emulator, woodenhaptics:tty:PATH or \
                         woodenhaptics:tcp:HOST:PORT";

/// WoodenHaptics over HID, or an emulated one over a stream. The operator calibrates the device: hold the handle at the
/// origin of the device and press the button for calibration. There is no force before.
///
/// Addresses: none, where one device is connected; its serial number; `/dev/hidrawN`; `tty:PATH` and `tcp:HOST:PORT` for
/// an emulator, whose reports have 14 bytes.
#[derive(Clone, Copy, Debug, Default)]
pub struct WoodenHapticsDriver;

/// Where a device is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Address {
    /// HID, with the serial number if there is one.
    Board(Option<String>),
    /// HID by its path, with short reports.
    Hidraw(String),
    Tty(String),
    Tcp(String),
}

impl Address {
    pub(crate) fn parse(text: &str) -> Option<Self> {
        if text.is_empty() {
            return Some(Self::Board(None));
        }
        if let Some(path) = text.strip_prefix("tty:") {
            return (!path.is_empty()).then(|| Self::Tty(path.to_owned()));
        }
        if let Some(address) = text.strip_prefix("tcp:") {
            return address.contains(':').then(|| Self::Tcp(address.to_owned()));
        }
        if text.starts_with('/') {
            let path = HidSelector::parse(text)?;
            return Some(Self::Hidraw(path.to_string()));
        }
        (!text.contains(':')).then(|| Self::Board(Some(text.to_owned())))
    }

    /// Finds the device, and returns its transport and the form of its reports.
    fn open(&self) -> Result<(Box<dyn Transport>, Form), Box<dyn std::error::Error + Send + Sync>> {
        let packets = |stream| -> (Box<dyn Transport>, Form) {
            (Box::new(Packets::new(stream, LENGTH)), Form::Short)
        };
        Ok(match self {
            Self::Tty(path) => packets(
                Stream::tty(Path::new(path), BAUD).map_err(|error| format!("{path}: {error}"))?,
            ),
            Self::Tcp(address) => {
                packets(Stream::tcp(address).map_err(|error| format!("{address}: {error}"))?)
            }
            Self::Hidraw(path) => {
                let device = Hidraw::open(Path::new(path));
                let device = device.map_err(|error| format!("{path}: {error}"))?;
                (Box::new(device), Form::Short)
            }
            Self::Board(serial) => {
                let api = HidApi::new()?;
                let mut last = None;
                for (vid, pid, form) in BOARDS {
                    let serial = serial.clone();
                    let selector = HidSelector::Numbers { vid, pid, serial };
                    match selector.find(&api) {
                        Ok(path) => {
                            let path = Path::new(OsStr::from_bytes(path.to_bytes()));
                            let device = Hidraw::open(path);
                            let device = device.map_err(|error| {
                                let rule = selector.udev();
                                format!(
                                    "{}: {error}. Let your account use it with a udev rule: \
                                     KERNEL==\"hidraw*\", {rule}, MODE=\"0660\", TAG+=\"uaccess\"",
                                    path.display()
                                )
                            })?;
                            return Ok((Box::new(device), form));
                        }
                        Err(error) => last = Some(error),
                    }
                }
                return Err(last.map_or_else(|| "no board is known".into(), Into::into));
            }
        })
    }
}

impl Driver for WoodenHapticsDriver {
    fn name(&self) -> &'static str {
        "woodenhaptics"
    }

    fn kind(&self) -> Kind {
        Kind::Real
    }

    fn protocol(&self) -> Option<&'static str> {
        Some("woodenhaptics")
    }

    fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError> {
        let refused = |source: Box<dyn std::error::Error + Send + Sync>| OpenError::Refused {
            source,
            allowed: "a WoodenHaptics that is connected and may be opened",
        };
        let Some(address) = Address::parse(request.address) else {
            return Err(OpenError::Address {
                found: request.address.to_owned(),
                allowed: ADDRESSES,
            });
        };
        let (first, form) = address.open().map_err(refused)?;
        let setup = Setup {
            geometry: Geometry::default(),
            form,
            home: Some(Vec3::zeros()),
        };
        // Later attempts are made by the thread of the device, which needs a number only.
        let again = move || match address.open() {
            Ok((transport, _)) => Ok(transport),
            Err(_) => Err(NO_DEVICE),
        };
        let device = WoodenHaptics::open(&setup, first_then(first, again), clock());
        let device = device.map_err(|error: DriverError| refused(Box::new(error)))?;
        let device = Exchanged::start(device, request.model.capabilities());
        let device = device.map_err(|error| refused(Box::new(error)))?;
        Ok(Box::new(device.for_loop(request.period)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_those_that_the_message_allows() {
        let parse = |text| Address::parse(text);
        assert_eq!(parse(""), Some(Address::Board(None)));
        assert_eq!(parse("left"), Some(Address::Board(Some("left".into()))));
        let path = "/dev/hidraw3";
        assert_eq!(parse(path), Some(Address::Hidraw(path.into())));
        assert_eq!(
            parse("tty:/dev/pts/1"),
            Some(Address::Tty("/dev/pts/1".into()))
        );
        let tcp = "localhost:4000";
        assert_eq!(parse("tcp:localhost:4000"), Some(Address::Tcp(tcp.into())));
        for wrong in ["tty:", "tcp:localhost", "/dev/sda", "a:b"] {
            assert_eq!(parse(wrong), None, "{wrong}");
        }
    }
}
