//! Which HID device to open: by the numbers of the USB device, or by its path.

use hidapi::HidApi;
use std::collections::BTreeMap;
use std::ffi::CString;
use std::fmt;

use super::HidError;

/// The paths of HID devices begin with this text, and end with a number.
const PATH: &str = "/dev/hidraw";

/// Selects the device to open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HidSelector {
    /// By the numbers of the USB device.
    Numbers {
        /// Vendor of the USB device.
        vid: u16,
        /// Product of the USB device.
        pid: u16,
        /// Serial number, which distinguishes two devices of the same kind.
        serial: Option<String>,
    },
    /// By its path, `/dev/hidrawN`. The number may change when the device is plugged in again.
    Path(String),
}

impl HidSelector {
    /// The selector with the address `VID:PID`, `VID:PID:SERIAL` or `/dev/hidrawN`; `None` for any other text.
    ///
    /// ```
    /// use devices::hid::HidSelector;
    ///
    /// let left = HidSelector::parse("1209:c0de:left").unwrap();
    /// assert_eq!(left.to_string(), "1209:c0de with serial number \"left\"");
    /// assert_eq!(HidSelector::parse("1209"), None);
    /// ```
    pub fn parse(address: &str) -> Option<Self> {
        if let Some(number) = address.strip_prefix(PATH) {
            let digits = !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit());
            return digits.then(|| Self::Path(address.to_owned()));
        }
        let mut parts = address.splitn(3, ':');
        let vid = four_digits(parts.next()?)?;
        let pid = four_digits(parts.next()?)?;
        let serial = match parts.next() {
            Some("") => return None,
            serial => serial.map(str::to_owned),
        };
        Some(Self::Numbers { vid, pid, serial })
    }

    /// The path of the one connected device that is selected.
    ///
    /// # Errors
    /// [`HidError::NotFound`] or [`HidError::Several`].
    pub(crate) fn find(&self, api: &HidApi) -> Result<CString, HidError> {
        // A device is listed once for each of its usages; the path is the same.
        let alike: BTreeMap<CString, String> = api
            .device_list()
            .filter(|device| match self {
                Self::Numbers { vid, pid, .. } => {
                    (device.vendor_id(), device.product_id()) == (*vid, *pid)
                }
                Self::Path(path) => device.path().to_bytes() == path.as_bytes(),
            })
            .map(|device| {
                let serial = device.serial_number().unwrap_or_default();
                (device.path().to_owned(), serial.to_owned())
            })
            .collect();
        let wanted = |found: &String| match self {
            Self::Numbers {
                serial: Some(wanted),
                ..
            } => wanted == found,
            _ => true,
        };
        let matching: Vec<_> = alike.iter().filter(|(_, serial)| wanted(serial)).collect();
        match matching.as_slice() {
            [(path, _)] => Ok((*path).clone()),
            [] => Err(HidError::NotFound {
                selector: self.clone(),
                found: match alike.len() {
                    0 => "and no other device of its kind".into(),
                    _ => format!(
                        "others of its kind have the serial numbers {}",
                        quoted(alike.values())
                    ),
                },
            }),
            several => Err(HidError::Several {
                selector: self.clone(),
                count: several.len(),
                serials: quoted(several.iter().map(|(_, serial)| *serial)),
            }),
        }
    }

    /// The condition of a udev rule that matches the device.
    pub(crate) fn udev(&self) -> String {
        match self {
            Self::Numbers { vid, pid, .. } => {
                format!("ATTRS{{idVendor}}==\"{vid:04x}\", ATTRS{{idProduct}}==\"{pid:04x}\"")
            }
            Self::Path(_) => {
                "ATTRS{idVendor}==\"VID\", ATTRS{idProduct}==\"PID\" (see `lsusb`)".to_owned()
            }
        }
    }
}

impl fmt::Display for HidSelector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Path(path) => f.write_str(path),
            Self::Numbers { vid, pid, serial } => {
                write!(f, "{vid:04x}:{pid:04x}")?;
                match serial {
                    Some(serial) => write!(f, " with serial number {serial:?}"),
                    None => Ok(()),
                }
            }
        }
    }
}

/// A number of four hexadecimal digits.
fn four_digits(text: &str) -> Option<u16> {
    let digits = text.len() == 4 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    digits.then(|| u16::from_str_radix(text, 16).ok()).flatten()
}

fn quoted<'a>(serials: impl Iterator<Item = &'a String>) -> String {
    let each: Vec<_> = serials.map(|serial| format!("{serial:?}")).collect();
    each.join(", ")
}
