//! The choice of the HID device to open, by the numbers of the USB device or by its path.

use crate::found::listed::{self, Listed};
use crate::found::which::{Alike, FindError};
use crate::found::{Which, hidraw_rule};
use crate::registry::file_of;
use std::fmt;
use std::fs;
use std::path::Path;

/// Selects the device to open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HidSelector {
    /// By the numbers of the USB device.
    Numbers {
        /// Vendor of the USB device.
        vid: u16,
        /// Product of the USB device.
        pid: u16,
        /// Which one of the devices with these numbers.
        which: Which,
    },
    /// By its path: `/dev/hidrawN`, whose number may change when the device is plugged in again, or a link that leads
    /// there.
    Path(String),
}

impl HidSelector {
    /// The selector with the address `VID:PID`, `VID:PID:SERIAL`, `VID:PID:@PORT` or an absolute path; `None` for any
    /// other text.
    ///
    /// ```
    /// use devices::hid::HidSelector;
    ///
    /// let left = HidSelector::parse("1209:c0de:left").unwrap();
    /// assert_eq!(left.to_string(), "1209:c0de with serial number \"left\"");
    /// assert_eq!(HidSelector::parse("1209"), None);
    /// ```
    pub fn parse(address: &str) -> Option<Self> {
        if address.starts_with('/') {
            return (address.len() > 1).then(|| Self::Path(address.to_owned()));
        }
        let mut parts = address.splitn(3, ':');
        let vid = four_digits(parts.next()?)?;
        let pid = four_digits(parts.next()?)?;
        let which = match parts.next() {
            Some("") => return None,
            end => Which::parse(end.unwrap_or_default()),
        };
        Some(Self::Numbers { vid, pid, which })
    }

    /// The one connected device that is selected, on the machine whose file system has this root.
    ///
    /// # Errors
    /// [`FindError`].
    pub(crate) fn find(&self, root: &Path) -> Result<Listed, FindError> {
        let devices = listed::hid(root);
        match self {
            Self::Numbers { vid, pid, which } => {
                let numbers = (*vid, *pid);
                let kind = format!("hid:{vid:04x}:{pid:04x}");
                let alike = Alike {
                    kind: &kind,
                    by_path: Some("hid"),
                    devices: devices
                        .into_iter()
                        .filter(|one| one.numbers == numbers)
                        .collect(),
                };
                let called = format!("HID device {vid:04x}:{pid:04x}");
                alike.find(which, &called).cloned()
            }
            Self::Path(path) => {
                let leads_to = fs::canonicalize(path);
                let is_it = |one: &Listed| {
                    let file = fs::canonicalize(&one.file);
                    file.ok()
                        .is_some_and(|file| leads_to.as_ref().ok() == Some(&file))
                };
                let found = devices.into_iter().find(is_it);
                found.ok_or_else(|| FindError::NotFound {
                    called: format!("HID device {path}"),
                    found: match leads_to {
                        Ok(file) if file != Path::new(path) => {
                            format!("the path leads to {}", file.display())
                        }
                        Ok(_) => "the file is none of a HID device".to_owned(),
                        Err(error) => format!("there is no such file: {error}"),
                    },
                })
            }
        }
    }

    /// The file of the device that the selector names, if it is connected; see
    /// [`Driver::reaches`](crate::Driver::reaches).
    pub(crate) fn reaches(&self) -> String {
        match (self.find(Path::new("/")), self) {
            (Ok(found), _) => file_of(&found.file),
            (Err(_), Self::Path(path)) => file_of(Path::new(path)),
            (Err(_), numbers) => format!("HID {numbers}"),
        }
    }

    /// The beginning of a udev rule that matches the device.
    pub(crate) fn udev(&self) -> String {
        hidraw_rule(match self {
            Self::Numbers { vid, pid, .. } => Some((*vid, *pid)),
            Self::Path(_) => None,
        })
    }
}

impl fmt::Display for HidSelector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Path(path) => f.write_str(path),
            Self::Numbers { vid, pid, which } => write!(f, "{vid:04x}:{pid:04x}{which}"),
        }
    }
}

/// A number of four hexadecimal digits.
fn four_digits(text: &str) -> Option<u16> {
    let digits = text.len() == 4 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    digits.then(|| u16::from_str_radix(text, 16).ok()).flatten()
}
