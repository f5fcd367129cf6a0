//! The driver `woodenhaptics`: finds and opens the device that a scene names.

use super::driver::{OpenError as DriverError, WoodenHaptics, WoodenHapticsConfig};
use super::geometry::Geometry;
use super::report::{Form, LENGTH};
use crate::exchange::{Exchanged, clock, first_then};
use crate::found::known::TEENSY;
use crate::found::listed::Listed;
use crate::found::{self, FindError, Which, hidraw_rule};
use crate::hid::{HidSelector, advice};
use crate::registry::{Driver, Kind, OpenError, Request, file_of, places_of};
use crate::transport::{Hidraw, Packets, Stream, Transport};
use rt_core::Vec3;
use runner::AnyDevice;
use std::path::Path;

/// Error number if no device is connected (ENODEV).
const NO_DEVICE: i32 = 19;
/// Speed of a serial line, which a pty ignores (bits a second).
const BAUD: u32 = 115_200;
/// The allowed addresses.
const ADDRESSES: &str = "woodenhaptics, where one such device is connected; woodenhaptics:SERIAL or \
                         woodenhaptics:@PORT, with the USB port that `palpate device list` prints; \
                         woodenhaptics:/dev/hidrawN or a link that leads there; or, for an emulator, \
                         woodenhaptics:tty:PATH or woodenhaptics:tcp:HOST:PORT";

/// WoodenHaptics over HID, or an emulated one over a stream. The operator calibrates the device: the operator holds the
/// handle at the origin of the device and presses the button for calibration. There is no force before the calibration.
///
/// Addresses: none if one device is connected; its serial number; `@PORT`, its port of USB; `/dev/hidrawN` or a link
/// that leads there; `tty:PATH` and `tcp:HOST:PORT` for an emulator, whose reports have 14 bytes.
#[derive(Clone, Copy, Debug, Default)]
pub struct WoodenHapticsDriver;

/// The address of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// HID, one of the connected boards.
    Board(Which),
    /// HID by its path.
    Hidraw(HidSelector),
    /// A serial line by its path.
    Tty(String),
    /// A host and a port.
    Tcp(String),
}

impl Address {
    /// The address that a text has; `None` if it has no form of an address.
    pub fn parse(text: &str) -> Option<Self> {
        if text.is_empty() {
            return Some(Self::Board(Which::Only));
        }
        if let Some(path) = text.strip_prefix("tty:") {
            return (!path.is_empty()).then(|| Self::Tty(path.to_owned()));
        }
        if let Some(address) = text.strip_prefix("tcp:") {
            return address.contains(':').then(|| Self::Tcp(address.to_owned()));
        }
        if text.starts_with('/') {
            return Some(Self::Hidraw(HidSelector::parse(text)?));
        }
        let which = Which::parse(text);
        let is_port = matches!(which, Which::Port(_));
        (is_port || !text.contains(':')).then_some(Self::Board(which))
    }

    /// The HID device that is meant.
    fn board(&self) -> Result<Listed, FindError> {
        let root = Path::new("/");
        match self {
            Self::Hidraw(selector) => selector.find(root),
            Self::Board(which) => found::woodenhaptics(root)
                .find(which, "WoodenHaptics")
                .cloned(),
            Self::Tty(path) | Self::Tcp(path) => Err(FindError::NotFound {
                called: format!("HID device {path}"),
                found: "it is no HID device".to_owned(),
            }),
        }
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
            Self::Hidraw(_) | Self::Board(_) => {
                let board = self.board()?;
                let form = if board.numbers == TEENSY.numbers {
                    Form::Long
                } else {
                    Form::Short
                };
                let device = Hidraw::open(&board.file).map_err(|error| {
                    let rule = hidraw_rule(Some(board.numbers));
                    format!(
                        "{}: {error}. {}",
                        board.file.display(),
                        advice(&error, &rule)
                    )
                })?;
                (Box::new(device), form)
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

    fn reaches(&self, address: &str) -> Vec<String> {
        match Address::parse(address) {
            None => Vec::new(),
            Some(Address::Tty(path)) => vec![file_of(Path::new(&path))],
            Some(Address::Tcp(address)) => places_of(&address),
            Some(Address::Hidraw(selector)) => vec![selector.reaches()],
            Some(board @ Address::Board(_)) => vec![match board.board() {
                Ok(found) => file_of(&found.file),
                Err(_) => format!("WoodenHaptics {address}"),
            }],
        }
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
        let setup = WoodenHapticsConfig {
            geometry: Geometry::default(),
            form,
            home: Some(Vec3::zeros()),
        };
        // The thread of the device makes the later attempts, and needs only a number.
        let again = move || match address.open() {
            Ok((transport, _)) => Ok(transport),
            Err(_) => Err(NO_DEVICE),
        };
        let device = WoodenHaptics::open(&setup, first_then(first, again), clock());
        let device = device.map_err(|error: DriverError| refused(Box::new(error)))?;
        let device = Exchanged::start(
            device,
            request.model.capabilities(),
            request.period,
            request.priority,
        );
        let device = device.map_err(|error| refused(Box::new(error)))?;
        Ok(Box::new(device))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_those_that_the_message_allows() {
        let parse = |text| Address::parse(text);
        let board = |which| Some(Address::Board(which));
        assert_eq!(parse(""), board(Which::Only));
        assert_eq!(parse("left"), board(Which::Serial("left".into())));
        assert_eq!(parse("@1-2"), board(Which::Port("1-2".into())));
        assert_eq!(parse("@1-2:1.0"), board(Which::Port("1-2:1.0".into())));
        for path in ["/dev/hidraw3", "/dev/lab/left"] {
            let selector = HidSelector::Path(path.into());
            assert_eq!(parse(path), Some(Address::Hidraw(selector)));
        }
        assert_eq!(
            parse("tty:/dev/pts/1"),
            Some(Address::Tty("/dev/pts/1".into()))
        );
        let tcp = "localhost:4000";
        assert_eq!(parse("tcp:localhost:4000"), Some(Address::Tcp(tcp.into())));
        for wrong in ["tty:", "tcp:localhost", "/", "a:b"] {
            assert_eq!(parse(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn the_driver_has_the_protocol_of_the_emulator() {
        let driver = WoodenHapticsDriver;
        assert_eq!(
            (driver.name(), driver.protocol()),
            ("woodenhaptics", Some("woodenhaptics"))
        );
    }

    #[test]
    fn an_address_of_a_line_or_a_place_is_no_board() {
        for text in [
            "tty:/dev/pts/1",
            "tcp:localhost:4000",
            "/no/such/file",
            "@999-9",
        ] {
            let address = Address::parse(text).expect("an address");
            assert!(address.board().is_err(), "{text}");
        }
    }
}
