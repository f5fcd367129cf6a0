//! The choice of one of several devices of a kind, by its serial number or by its port of USB.
//!
//! Two devices of a kind may state the same serial number, or none. The port of USB always tells them apart.

use super::listed::Listed;
use std::fmt;

/// Which one of the connected devices of a kind.
///
/// ```
/// use devices::found::Which;
///
/// assert_eq!(Which::parse(""), Which::Only);
/// assert_eq!(Which::parse("left"), Which::Serial("left".into()));
/// assert_eq!(Which::parse("@1-2.3"), Which::Port("1-2.3".into()));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Which {
    /// The only one.
    Only,
    /// The one with this serial number.
    Serial(String),
    /// The one on this port of USB (`1-2.3`), or the interface of the device there (`1-2.3:1.0`).
    Port(String),
}

impl Which {
    /// The device that the end of an address names: nothing, `SERIAL` or `@PORT`.
    pub fn parse(text: &str) -> Self {
        let port = text.strip_prefix('@').filter(|port| is_port(port));
        match (text, port) {
            ("", _) => Self::Only,
            (_, Some(port)) => Self::Port(port.to_owned()),
            (serial, None) => Self::Serial(serial.to_owned()),
        }
    }

    /// Whether a device of the kind is the one.
    pub fn is(&self, device: &Listed) -> bool {
        match self {
            Self::Only => true,
            Self::Serial(serial) => *serial == device.serial,
            Self::Port(port) => *port == device.port || *port == device.interface,
        }
    }

    /// The connection of the device. `kind` is the connection of any device of the kind.
    pub fn connection(&self, kind: &str) -> String {
        match self {
            Self::Only => kind.to_owned(),
            Self::Serial(serial) => format!("{kind}:{serial}"),
            Self::Port(port) => format!("{kind}:@{port}"),
        }
    }
}

/// The text after the name of the kind in a message.
impl fmt::Display for Which {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Only => Ok(()),
            Self::Serial(serial) => write!(f, " with serial number {serial:?}"),
            Self::Port(port) => write!(f, " on the USB port {port}"),
        }
    }
}

/// Whether a text has the form in which the kernel names ports and interfaces of USB.
fn is_port(text: &str) -> bool {
    let known = |byte: u8| byte.is_ascii_digit() || b"-.:".contains(&byte);
    text.starts_with(|c: char| c.is_ascii_digit()) && text.contains('-') && text.bytes().all(known)
}

/// The connected devices of one kind: all devices that a connection without an end may mean.
pub struct Alike<'a> {
    /// The connection of any device of the kind, such as `hid:1209:c0de`.
    pub kind: &'a str,
    /// The driver that takes the path of a device as its address; `None` if it takes none.
    pub by_path: Option<&'a str>,
    /// The devices.
    pub devices: Vec<Listed>,
}

impl Alike<'_> {
    /// The shortest connection that names the device and no other.
    pub fn connection(&self, device: &Listed) -> String {
        let serial = Which::parse(&device.serial);
        // A serial number that looks like a port names none.
        let serial = matches!(serial, Which::Serial(_)).then_some(serial);
        let port = |place: &String| (!place.is_empty()).then(|| Which::Port(place.clone()));
        let ways = [
            serial,
            Some(Which::Only),
            port(&device.port),
            port(&device.interface),
        ];
        let alone = |way: &Which| self.devices.iter().filter(|other| way.is(other)).count() == 1;
        match (ways.into_iter().flatten().find(alone), self.by_path) {
            (Some(way), _) => way.connection(self.kind),
            (None, Some(driver)) => format!("{driver}:{}", device.file.display()),
            (None, None) => self.kind.to_owned(),
        }
    }

    /// The one device that is meant. Messages call the kind `called`, such as `HID device 1209:c0de`.
    ///
    /// # Errors
    /// [`FindError`].
    pub(crate) fn find(&self, which: &Which, called: &str) -> Result<&Listed, FindError> {
        let matching: Vec<_> = self.devices.iter().filter(|one| which.is(one)).collect();
        let called = format!("{called}{which}");
        match matching.as_slice() {
            [one] => Ok(one),
            [] => Err(FindError::NotFound {
                called,
                found: match self.devices.as_slice() {
                    [] => "and no other device of its kind".to_owned(),
                    others => format!(
                        "others of its kind: {}",
                        joined(others.iter().map(|one| self.connection(one)))
                    ),
                },
            }),
            several => Err(FindError::Several {
                called,
                count: several.len(),
                why: not_told_apart(several),
                ways: self.ways(several),
            }),
        }
    }

    /// The connections that distinguish devices.
    fn ways(&self, devices: &[&Listed]) -> String {
        let named = joined(devices.iter().map(|one| self.connection(one)));
        let Some(driver) = self.by_path else {
            return named;
        };
        let paths = devices
            .iter()
            .map(|one| format!("{driver}:{}", one.file.display()));
        let paths = joined(paths);
        format!("{named}; or by its path: {paths}, or a symlink that a udev rule makes")
    }
}

/// The reason, in words, why the serial numbers of some devices do not distinguish them; empty if they do.
fn not_told_apart(devices: &[&Listed]) -> String {
    let serials: Vec<_> = devices.iter().map(|one| one.serial.as_str()).collect();
    let mut each = serials.clone();
    each.sort_unstable();
    let equal = each.windows(2).find(|pair| pair[0] == pair[1]);
    match equal.map(|pair| pair[0]) {
        None => String::new(),
        Some("") => ", and they state no serial number".to_owned(),
        Some(serial) => format!(", and their serial numbers are equal ({serial:?})"),
    }
}

fn joined(texts: impl Iterator<Item = String>) -> String {
    texts.collect::<Vec<_>>().join(", ")
}

/// The reason why there is not exactly one such device.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FindError {
    /// No such device is connected.
    #[error(
        "no {called} is connected ({found}). Check its cable and power, and `lsusb` for its numbers; in a container or \
         virtual machine, check that its devices are passed on"
    )]
    NotFound {
        /// The device that was asked for.
        called: String,
        /// The devices that were found instead.
        found: String,
    },
    /// More than one such device is connected.
    #[error(
        "the {called} is not the only one: {count} are connected{why}; name one of them: {ways}"
    )]
    Several {
        /// The device that was asked for.
        called: String,
        /// Number of such devices.
        count: usize,
        /// The reason why their serial numbers do not distinguish them; empty if they do.
        why: String,
        /// Connections that name one device each.
        ways: String,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_what_the_kernel_calls_so() {
        for port in ["1-2", "1-2.4", "3-10.1:1.0"] {
            assert!(is_port(port), "{port}");
        }
        for other in ["", "left", "12", "1.2", "-1", "1-a", "0001", "A1-2"] {
            assert!(!is_port(other), "{other}");
        }
    }
}
