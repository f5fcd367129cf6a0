//! Which devices are connected to this machine, and why a device cannot be used.
//!
//! All facts come from sysfs (`/sys/class/hidraw`, `/sys/bus/usb/devices`, `/sys/class/tty`) and from an attempt to open
//! the file of the device (of a serial line, its rights alone), so nothing is sent to any device. The root of the file system is an argument, so that a test
//! can make a tree of its own.

use rustix::io::Errno;
use std::fmt;
use std::fs::{self, OpenOptions};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

/// HID devices with a public protocol: vendor, product, driver, name.
const HID: [(u16, u16, &str, &str); 2] = [
    (0x1234, 0x0006, "woodenhaptics", "WoodenHaptics (mbed)"),
    (0x16c0, 0x0486, "woodenhaptics", "WoodenHaptics (Teensy)"),
];
/// USB devices with a public protocol that the kernel does not show as HID: vendor, product, driver, name.
const USB: [(u16, u16, &str, &str); 1] = [(0x0403, 0xcb48, "falcon", "Novint Falcon")];

/// A device that is connected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// The connection that a scene names.
    pub connect: String,
    /// Name of the device, as it states it.
    pub name: String,
    /// Numbers of the USB device; `None` for a device on another bus.
    pub numbers: Option<(u16, u16)>,
    /// Serial number; empty where the device states none.
    pub serial: String,
    /// The file of the device.
    pub file: PathBuf,
    /// Whether the device is also a keyboard, a mouse or a joystick. Such a device is hardly a haptic one.
    pub input: bool,
    /// Why the device cannot be opened; `None` where it can.
    pub trouble: Option<Trouble>,
    /// Whether the device is behind a hub, which it shares with other devices.
    pub behind_hub: bool,
}

/// Why a device cannot be opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// The account may not open the file.
    Permission,
    /// Another program has the device.
    Busy,
    /// A driver of the kernel has the device.
    Driver(String),
    /// The file does not exist, as in a container.
    NoFile,
    /// Another error of the system.
    Other(i32),
}

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Permission => f.write_str(
                "this account may not open it; add a udev rule with MODE=\"0660\", TAG+=\"uaccess\", and plug it in again",
            ),
            Self::Busy => f.write_str("another program uses it"),
            Self::Driver(driver) => write!(
                f,
                "the kernel's driver {driver} has it; unbind it, or blacklist the driver"
            ),
            Self::NoFile => f.write_str(
                "its file is missing; a container or a virtual machine needs the device from its host",
            ),
            Self::Other(number) => write!(f, "it cannot be opened (system error {number})"),
        }
    }
}

/// The devices of the machine whose file system has this root (`/`), by connection.
pub fn list(root: &Path) -> Vec<Found> {
    let mut all = hid(root);
    all.extend(usb(root));
    all.extend(serial(root));
    all.sort_by(|a, b| a.connect.cmp(&b.connect));
    all
}

/// HID devices.
fn hid(root: &Path) -> Vec<Found> {
    let each = entries(&root.join("sys/class/hidraw"));
    let each = each.into_iter().filter_map(|(name, path)| {
        let device = path.join("device");
        let facts = fs::read_to_string(device.join("uevent")).ok()?;
        let facts = HidFacts::parse(&facts)?;
        let file = root.join("dev").join(&name);
        let (vid, pid) = facts.numbers;
        let serial = facts.serial;
        let known = HID.iter().find(|known| (known.0, known.1) == (vid, pid));
        let connect = match known {
            Some((_, _, driver, _)) => with_serial(driver, &serial),
            None => with_serial(&format!("hid:{vid:04x}:{pid:04x}"), &serial),
        };
        Some(Found {
            connect,
            name: known.map_or(facts.name, |known| known.3.to_owned()),
            numbers: facts.on_usb.then_some((vid, pid)),
            serial,
            trouble: trouble(&file),
            file,
            input: device.join("input").exists(),
            behind_hub: facts.behind_hub,
        })
    });
    each.collect()
}

/// What the kernel tells of a HID device in its file `uevent`. The name and the serial number are what the device
/// states, so they may be any text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct HidFacts {
    /// Vendor and product.
    pub(crate) numbers: (u16, u16),
    /// Whether the device is on USB.
    pub(crate) on_usb: bool,
    pub(crate) name: String,
    pub(crate) serial: String,
    pub(crate) behind_hub: bool,
}

impl HidFacts {
    /// The facts in a text; `None` where it does not name a vendor and a product.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let fact = |key: &str| {
            let lines = text.lines().filter_map(|line| line.split_once('='));
            let mut values = lines.filter(|(found, _)| *found == key);
            values.next().map_or("", |(_, value)| value)
        };
        // HID_ID is bus, vendor and product, in 4, 8 and 8 hexadecimal digits.
        let mut id = fact("HID_ID").split(':');
        let bus = id.next().map(|bus| u16::from_str_radix(bus, 16));
        let mut number = || {
            let wide = u32::from_str_radix(id.next()?, 16).ok()?;
            u16::try_from(wide).ok()
        };
        let numbers = number().zip(number())?;
        Some(Self {
            numbers,
            on_usb: bus == Some(Ok(3)),
            name: printable(fact("HID_NAME")),
            serial: printable(fact("HID_UNIQ")),
            behind_hub: fact("HID_PHYS").split('/').next().is_some_and(behind_hub),
        })
    }
}

/// A text of a device, without the control characters that would reach the terminal of a person who lists it.
fn printable(text: &str) -> String {
    text.trim().chars().filter(|c| !c.is_control()).collect()
}

/// USB devices that the kernel does not show as HID.
fn usb(root: &Path) -> Vec<Found> {
    let each = entries(&root.join("sys/bus/usb/devices"));
    let each = each.into_iter().filter_map(|(name, path)| {
        let text = |file: &str| {
            let text = fs::read_to_string(path.join(file)).ok()?;
            Some(printable(&text))
        };
        let number = |file: &str| u16::from_str_radix(&text(file)?, 16).ok();
        let numbers = (number("idVendor")?, number("idProduct")?);
        let known = USB.iter().find(|known| (known.0, known.1) == numbers)?;
        let place = |file: &str| text(file)?.parse::<u16>().ok();
        let (bus, device) = (place("busnum")?, place("devnum")?);
        let file = root.join(format!("dev/bus/usb/{bus:03}/{device:03}"));
        let driver = fs::read_link(path.join(format!("{name}:1.0/driver"))).ok();
        let driver = driver.and_then(|path| Some(path.file_name()?.to_string_lossy().into_owned()));
        // A program that has claimed the device appears as the driver `usbfs`.
        let trouble = match driver.as_deref() {
            Some("usbfs") => Some(Trouble::Busy),
            Some(driver) => Some(Trouble::Driver(driver.to_owned())),
            None => trouble(&file),
        };
        let serial = text("serial").unwrap_or_default();
        Some(Found {
            connect: with_serial(known.2, &serial),
            name: known.3.to_owned(),
            numbers: Some(numbers),
            serial,
            file,
            input: false,
            trouble,
            behind_hub: behind_hub(&name),
        })
    });
    each.collect()
}

/// Serial lines over USB, which a device with the firmware protocol may have.
fn serial(root: &Path) -> Vec<Found> {
    let each = entries(&root.join("sys/class/tty"));
    let each = each.into_iter().filter_map(|(name, path)| {
        if !name.starts_with("ttyACM") && !name.starts_with("ttyUSB") {
            return None;
        }
        let file = root.join("dev").join(&name);
        // The interface's folder lies in the folder of the USB device.
        let device = fs::canonicalize(path.join("device")).ok();
        let usb = device.as_deref().and_then(|at| {
            at.ancestors()
                .find(|folder| folder.join("idVendor").exists())
        });
        let text = |file: &str| {
            let text = fs::read_to_string(usb?.join(file)).ok()?;
            Some(printable(&text))
        };
        let number = |file: &str| u16::from_str_radix(&text(file)?, 16).ok();
        let place = usb.and_then(Path::file_name).and_then(|name| name.to_str());
        Some(Found {
            connect: format!("tty:/dev/{name}"),
            name: text("product").unwrap_or_else(|| "serial line".to_owned()),
            numbers: number("idVendor").zip(number("idProduct")),
            serial: text("serial").unwrap_or_default(),
            trouble: line_trouble(&file),
            file,
            input: false,
            behind_hub: place.is_some_and(behind_hub),
        })
    });
    each.collect()
}

pub(crate) fn with_serial(connect: &str, serial: &str) -> String {
    if serial.is_empty() {
        connect.to_owned()
    } else {
        format!("{connect}:{serial}")
    }
}

/// Whether the place of a USB device (`1-2.3`, or `usb-0000:00:14.0-2.3` in the words of a HID device) has a hub in it:
/// the last part is the path of ports, with a dot for each hub.
fn behind_hub(place: &str) -> bool {
    place
        .rsplit('-')
        .next()
        .is_some_and(|ports| ports.contains('.'))
}

/// Why a serial line cannot be used. The line is not opened: that would raise its control lines, which restart many
/// boards. Whether another program has the line is therefore not found.
fn line_trouble(file: &Path) -> Option<Trouble> {
    use rustix::fs::{Access, access};
    let refusal = access(file, Access::READ_OK | Access::WRITE_OK).err()?;
    Some(trouble_of(refusal.raw_os_error()))
}

/// Why a file cannot be opened for reading and writing.
fn trouble(file: &Path) -> Option<Trouble> {
    use rustix::fs::OFlags;
    let flags = (OFlags::NONBLOCK | OFlags::NOCTTY).bits() as i32;
    let mut options = OpenOptions::new();
    let opened = options
        .read(true)
        .write(true)
        .custom_flags(flags)
        .open(file);
    Some(trouble_of(opened.err()?.raw_os_error().unwrap_or_default()))
}

/// The trouble with an error number of the system.
fn trouble_of(number: i32) -> Trouble {
    match Errno::from_raw_os_error(number) {
        Errno::ACCESS | Errno::PERM => Trouble::Permission,
        Errno::BUSY => Trouble::Busy,
        Errno::NOENT | Errno::NXIO => Trouble::NoFile,
        _ => Trouble::Other(number),
    }
}

/// The names and paths in a folder, sorted; none where the folder does not exist.
fn entries(folder: &Path) -> Vec<(String, PathBuf)> {
    let Ok(each) = fs::read_dir(folder) else {
        return Vec::new();
    };
    let each = each.filter_map(Result::ok);
    let mut all: Vec<_> = each
        .map(|entry| {
            (
                entry.file_name().to_string_lossy().into_owned(),
                entry.path(),
            )
        })
        .collect();
    all.sort();
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    /// A file with a text, in folders that are made.
    fn put(root: &Path, file: &str, text: &str) {
        let path = root.join(file);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a temporary folder");
        fs::write(path, text).expect("a temporary folder");
    }

    /// A machine with a WoodenHaptics, a device of ours without a file, a mouse, a Falcon and a serial line.
    fn machine(root: &Path) {
        let hid = |name: &str, id: &str, called: &str, serial: &str, place: &str| {
            let facts = format!(
                "HID_ID=0003:{id}\nHID_NAME={called}\nHID_PHYS={place}/input0\nHID_UNIQ={serial}\n"
            );
            put(
                root,
                &format!("sys/class/hidraw/{name}/device/uevent"),
                &facts,
            );
        };
        hid(
            "hidraw0",
            "00001234:00000006",
            "mbed",
            "",
            "usb-0000:00:14.0-1",
        );
        put(root, "dev/hidraw0", "");
        hid(
            "hidraw1",
            "00001209:0000C0DE",
            "Ours",
            "left",
            "usb-0000:00:14.0-2.3",
        );
        hid(
            "hidraw2",
            "0000046D:0000C077",
            "Mouse",
            "",
            "usb-0000:00:14.0-4",
        );
        put(root, "dev/hidraw2", "");
        fs::create_dir_all(root.join("sys/class/hidraw/hidraw2/device/input")).expect("ours");
        for (file, text) in [
            ("idVendor", "0403\n"),
            ("idProduct", "cb48\n"),
            ("busnum", "1\n"),
            ("devnum", "7\n"),
            ("serial", "FA123\n"),
        ] {
            put(root, &format!("sys/bus/usb/devices/1-5/{file}"), text);
        }
        put(root, "dev/bus/usb/001/007", "");
        put(root, "sys/devices/usb1/1-6/idVendor", "2341\n");
        put(root, "sys/devices/usb1/1-6/idProduct", "0043\n");
        put(root, "sys/devices/usb1/1-6/product", "Arduino\n");
        put(root, "sys/devices/usb1/1-6/1-6:1.0/interface", "x");
        put(root, "sys/class/tty/ttyACM0/dev", "166:0\n");
        let interface = root.join("sys/devices/usb1/1-6/1-6:1.0");
        symlink(interface, root.join("sys/class/tty/ttyACM0/device")).expect("ours");
        put(root, "dev/ttyACM0", "");
        put(root, "sys/class/tty/tty0/dev", "4:0\n");
    }

    #[test]
    fn devices_are_listed_with_their_connection_and_their_trouble() {
        let folder = std::env::temp_dir().join(format!("palpate-found-{}", std::process::id()));
        machine(&folder);
        let all = list(&folder);
        let short: Vec<_> = all
            .iter()
            .map(|found| {
                (
                    found.connect.as_str(),
                    found.name.as_str(),
                    found.input,
                    found.behind_hub,
                    found.trouble.clone(),
                )
            })
            .collect();
        assert_eq!(
            short,
            [
                ("falcon:FA123", "Novint Falcon", false, false, None),
                ("hid:046d:c077", "Mouse", true, false, None),
                (
                    "hid:1209:c0de:left",
                    "Ours",
                    false,
                    true,
                    Some(Trouble::NoFile)
                ),
                ("tty:/dev/ttyACM0", "Arduino", false, false, None),
                ("woodenhaptics", "WoodenHaptics (mbed)", false, false, None),
            ]
        );
        assert_eq!(all[3].numbers, Some((0x2341, 0x0043)));
        // A driver of the kernel has the Falcon.
        let interface = folder.join("sys/bus/usb/devices/1-5/1-5:1.0");
        fs::create_dir_all(&interface).expect("ours");
        symlink("../../drivers/ftdi_sio", interface.join("driver")).expect("ours");
        let falcon = list(&folder).into_iter().next().expect("it is listed");
        assert_eq!(falcon.trouble, Some(Trouble::Driver("ftdi_sio".into())));
        fs::remove_dir_all(&folder).expect("ours");
        assert!(list(&folder).is_empty());
    }
}
