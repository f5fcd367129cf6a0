//! The drivers `tty` and `tcp`: they open the device that a scene names.

use super::Serial;
use crate::exchange::{Exchanged, clock, first_then};
use crate::firmware::watchdog_us;
use crate::registry::{Driver, Kind, OpenError, Request, file_of, places_of};
use crate::transport::Stream;
use runner::AnyDevice;
use std::fmt::Display;
use std::io;
use std::path::Path;

/// Speed of a serial line if the address names none (bits a second). On USB CDC and on a pty the speed has no effect.
const BAUD: u32 = 115_200;
/// Error number for a connection that has no error number of its own (ENODEV).
const NO_DEVICE: i32 = 19;
/// The allowed addresses.
const TTY: &str = "tty:PATH, the absolute path of a serial line or a pty (tty:/dev/ttyACM0), or tty:PATH@BAUD, with the speed of \
                   the line in bits a second (tty:/dev/ttyUSB0@1000000)";
/// The allowed addresses.
const TCP: &str = "tcp:HOST:PORT, with a port from 1 to 65535 (tcp:localhost:4000)";

/// Devices that speak the firmware protocol over a serial line: USB CDC, a UART behind a USB adapter, a pty.
///
/// Addresses: `PATH` or `PATH@BAUD`. The speed is 115200 if the address has none. The speed has no effect on USB CDC,
/// whose bytes pass at the speed of USB. A UART needs a higher speed: a packet of 66 bytes each way, a thousand times a
/// second, is 660,000 bits a second. Name 1000000 or more there.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tty;

/// Devices that speak the firmware protocol over TCP, such as an emulator or a bridge to a microcontroller. The
/// connection has neither authentication nor encryption: anyone with access to the network can read it and command the
/// device.
///
/// Addresses: `HOST:PORT`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tcp;

/// The path and the speed in an address; `None` if the address has neither form.
pub fn line(address: &str) -> Option<(&str, u32)> {
    let (path, baud) = match address.split_once('@') {
        Some((path, baud)) => (path, number(baud)?),
        None => (address, BAUD),
    };
    (path.len() > 1 && path.starts_with('/')).then_some((path, baud))
}

/// Whether an address is a host and a port.
pub fn is_port(address: &str) -> bool {
    let parts = address.rsplit_once(':');
    parts.is_some_and(|(host, port)| {
        !host.is_empty() && number(port).is_some_and(|port| port <= u16::MAX.into())
    })
}

/// A whole number above zero, in digits alone.
fn number(text: &str) -> Option<u32> {
    let digits = text.bytes().all(|byte| byte.is_ascii_digit());
    text.parse().ok().filter(|&number| digits && number > 0)
}

/// The remedy for an error of a tty.
fn advice(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::PermissionDenied => {
            ". Let your account use it: add your account to the group of the file (`ls -l`, often dialout)"
        }
        io::ErrorKind::NotFound => ". Check the cable, and `ls /dev/tty*` for the path",
        io::ErrorKind::ResourceBusy => ". Another program has it open; end that program",
        _ => "",
    }
}

impl Driver for Tty {
    fn name(&self) -> &'static str {
        "tty"
    }

    fn kind(&self) -> Kind {
        Kind::Real
    }

    fn reaches(&self, address: &str) -> Vec<String> {
        line(address).map_or_else(Vec::new, |(path, _)| vec![file_of(Path::new(path))])
    }

    fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError> {
        let (path, baud) = line(request.address).ok_or_else(|| wrong(request.address, TTY))?;
        let first = Stream::tty(Path::new(path), baud)
            .map_err(|error| refused(request.address, &format!("{error}{}", advice(&error))))?;
        let path = path.to_owned();
        start(request, first, move || Stream::tty(Path::new(&path), baud))
    }
}

impl Driver for Tcp {
    fn name(&self) -> &'static str {
        "tcp"
    }

    fn kind(&self) -> Kind {
        Kind::Real
    }

    fn reaches(&self, address: &str) -> Vec<String> {
        places_of(address)
    }

    fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError> {
        if !is_port(request.address) {
            return Err(wrong(request.address, TCP));
        }
        let first =
            Stream::tcp(request.address).map_err(|error| refused(request.address, &error))?;
        let address = request.address.to_owned();
        start(request, first, move || Stream::tcp(&address))
    }
}

/// Greets the device behind `first`, and starts its thread, which connects again by `open`.
fn start(
    request: &Request<'_>,
    first: Stream,
    open: impl Fn() -> io::Result<Stream> + Send + 'static,
) -> Result<AnyDevice, OpenError> {
    let again = move || open().map_err(|error| error.raw_os_error().unwrap_or(NO_DEVICE));
    let open = first_then(first, again);
    let capabilities = request.model.capabilities();
    let device = Serial::open(capabilities, watchdog_us(request.period), open, clock())
        .map_err(|error| refused(request.address, &error))?;
    if let Some(name) = device.name() {
        let agreed = request.name_agrees(name);
        agreed.map_err(|error| refused(request.address, &error))?;
    }
    let stated = device.reports().host().capabilities();
    request.has_firmware(stated.map(|report| report.model.firmware));
    let device = Exchanged::start(device, capabilities, request.period, request.priority);
    let device = device.map_err(|error| refused(request.address, &error))?;
    Ok(Box::new(device))
}

fn wrong(address: &str, allowed: &'static str) -> OpenError {
    let found = if address.is_empty() {
        "nothing"
    } else {
        address
    };
    OpenError::Address {
        found: found.to_owned(),
        allowed,
    }
}

fn refused(address: &str, source: &dyn Display) -> OpenError {
    OpenError::Refused {
        source: format!("{address}: {source}").into(),
        allowed: "a device that is connected, may be opened, and speaks the firmware protocol",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DeviceModel, Registry};

    fn open(driver: &str, address: &str) -> String {
        let model = DeviceModel::named("falcon").expect("a built-in device");
        let request = Request::new(&model, address);
        let registry = Registry::new().with(Tty).with(Tcp);
        match registry.open(driver, &request) {
            Ok(_) => "open".to_owned(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn an_address_has_a_path_and_perhaps_a_speed() {
        assert_eq!(line("/dev/ttyACM0"), Some(("/dev/ttyACM0", BAUD)));
        assert_eq!(
            line("/dev/ttyUSB0@1000000"),
            Some(("/dev/ttyUSB0", 1_000_000))
        );
        for right in ["localhost:4000", "[::1]:65535", "127.0.0.1:1"] {
            assert!(is_port(right), "{right}");
        }
    }

    #[test]
    fn a_wrong_address_is_refused_with_the_allowed_ones() {
        for address in [
            "",
            "/",
            "ttyACM0",
            "/dev/a@",
            "/dev/a@fast",
            "/dev/a@0",
            "/dev/a@+9",
        ] {
            let error = open("tty", address);
            let found = if address.is_empty() {
                "nothing"
            } else {
                address
            };
            let text = format!("address: found {found}, allowed: tty:PATH");
            assert!(error.starts_with(&text), "{error}");
        }
        for address in [
            "",
            "localhost",
            ":4000",
            "localhost:",
            "localhost:0",
            "a:65536",
        ] {
            let error = open("tcp", address);
            assert!(error.contains("allowed: tcp:HOST:PORT"), "{error}");
        }
    }

    #[test]
    fn what_cannot_be_opened_is_named_with_a_remedy() {
        let error = open("tty", "/dev/no_such_line");
        assert!(error.starts_with("/dev/no_such_line: "), "{error}");
        assert!(error.contains("Check the cable"), "{error}");
        // Some errors have a remedy of their own.
        for (kind, remedy) in [
            (io::ErrorKind::PermissionDenied, "dialout"),
            (io::ErrorKind::ResourceBusy, "end that program"),
            (io::ErrorKind::NotFound, "Check the cable"),
        ] {
            assert!(advice(&kind.into()).contains(remedy), "{kind}");
        }
        assert_eq!(advice(&io::ErrorKind::TimedOut.into()), "");
        // Nobody listens on port 1.
        let error = open("tcp", "127.0.0.1:1");
        assert!(error.starts_with("127.0.0.1:1: "), "{error}");
    }
}
