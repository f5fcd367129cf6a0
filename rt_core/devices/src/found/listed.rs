//! The kernel's lists of devices (sysfs). No device is opened, so a list may be made at any time, even while a device
//! is in use.

use std::fs;
use std::path::{Path, PathBuf};

/// A device in a list of the kernel.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Listed {
    /// Name of the device, as it states it.
    pub name: String,
    /// Vendor and product.
    pub numbers: (u16, u16),
    /// Whether the device is on USB.
    pub on_usb: bool,
    /// Serial number; empty if the device states none.
    pub serial: String,
    /// The port of USB (`1-2.3`); empty for a device on another bus. The port belongs to the socket, so it stays when
    /// the device is plugged in again.
    pub port: String,
    /// The interface of the USB device (`1-2.3:1.0`); empty if the device was not listed by its interface.
    pub interface: String,
    /// The file of the device.
    pub file: PathBuf,
    /// Whether the device is also a keyboard, a mouse or a joystick.
    pub input: bool,
    /// The driver of the kernel that has the first interface of a USB device.
    pub driver: Option<String>,
    /// Whether the device is behind a hub.
    pub behind_hub: bool,
}

/// The HID devices of the machine whose file system has this root.
pub(crate) fn hid(root: &Path) -> Vec<Listed> {
    let each = entries(&root.join("sys/class/hidraw"));
    let each = each.into_iter().filter_map(|(name, path)| {
        let device = path.join("device");
        let facts = fs::read_to_string(device.join("uevent")).ok()?;
        let facts = HidFacts::parse(&facts)?;
        let folders = UsbFolders::of(&device).filter(|_| facts.on_usb);
        let (port, interface) = folders.map_or_else(Default::default, UsbFolders::names);
        Some(Listed {
            name: facts.name,
            numbers: facts.numbers,
            on_usb: facts.on_usb,
            serial: facts.serial,
            behind_hub: facts.behind_hub || behind_hub(&port),
            port,
            interface,
            file: root.join("dev").join(&name),
            input: device.join("input").exists(),
            driver: None,
        })
    });
    each.collect()
}

/// The USB devices.
pub(crate) fn usb(root: &Path) -> Vec<Listed> {
    let each = entries(&root.join("sys/bus/usb/devices"));
    let each = each.into_iter().filter_map(|(name, path)| {
        let number = |file: &str| text(&path, file)?.parse::<u16>().ok();
        let (bus, device) = (number("busnum")?, number("devnum")?);
        let driver = fs::read_link(path.join(format!("{name}:1.0/driver"))).ok();
        Some(Listed {
            name: text(&path, "product").unwrap_or_default(),
            numbers: numbers(&path)?,
            on_usb: true,
            serial: text(&path, "serial").unwrap_or_default(),
            behind_hub: behind_hub(&name),
            port: name,
            interface: String::new(),
            file: root.join(format!("dev/bus/usb/{bus:03}/{device:03}")),
            input: false,
            driver: driver.and_then(|path| Some(path.file_name()?.to_string_lossy().into_owned())),
        })
    });
    each.collect()
}

/// The serial lines over USB. The file is the one of the kernel (`/dev/ttyACM0`).
pub(crate) fn lines(root: &Path) -> Vec<Listed> {
    let each = entries(&root.join("sys/class/tty"));
    let each = each.into_iter().filter_map(|(name, path)| {
        if !name.starts_with("ttyACM") && !name.starts_with("ttyUSB") {
            return None;
        }
        let folders = UsbFolders::of(&path.join("device"));
        let fact = |file: &str| text(&folders.as_ref()?.device, file);
        let product = fact("product").unwrap_or_else(|| "serial line".to_owned());
        let serial = fact("serial").unwrap_or_default();
        let numbers = folders
            .as_ref()
            .and_then(|folders| numbers(&folders.device));
        let on_usb = numbers.is_some();
        let (port, interface) = folders.map_or_else(Default::default, UsbFolders::names);
        Some(Listed {
            name: product,
            numbers: numbers.unwrap_or_default(),
            on_usb,
            serial,
            behind_hub: behind_hub(&port),
            port,
            interface,
            file: root.join("dev").join(&name),
            input: false,
            driver: None,
        })
    });
    each.collect()
}

/// The folders of a device on USB.
struct UsbFolders {
    /// The folder of the USB device.
    device: PathBuf,
    /// The name of the folder of its interface.
    interface: String,
}

impl UsbFolders {
    /// The folders of a device whose folder is below that of a USB device; `None` on another bus.
    fn of(folder: &Path) -> Option<Self> {
        let folder = fs::canonicalize(folder).ok()?;
        let is_device = |folder: &&Path| folder.join("idVendor").exists();
        let device = folder.ancestors().find(is_device)?;
        let below = folder.strip_prefix(device).ok()?;
        let interface = below.iter().next().unwrap_or_default();
        Some(Self {
            device: device.to_owned(),
            interface: interface.to_string_lossy().into_owned(),
        })
    }

    /// The names of the port and of the interface.
    fn names(self) -> (String, String) {
        let port = self.device.file_name().unwrap_or_default();
        (port.to_string_lossy().into_owned(), self.interface)
    }
}

/// The text of a file of a device.
fn text(folder: &Path, file: &str) -> Option<String> {
    let text = fs::read_to_string(folder.join(file)).ok()?;
    Some(printable(&text))
}

/// Vendor and product of the USB device in a folder.
fn numbers(folder: &Path) -> Option<(u16, u16)> {
    let number = |file: &str| u16::from_str_radix(&text(folder, file)?, 16).ok();
    number("idVendor").zip(number("idProduct"))
}

/// The facts about a HID device in the kernel's file `uevent`. The device itself states its name and its serial number,
/// so these may be any text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HidFacts {
    /// Vendor and product.
    pub numbers: (u16, u16),
    /// Whether the device is on USB.
    pub on_usb: bool,
    /// Name of the device, without control characters.
    pub name: String,
    /// Serial number, without control characters; empty if the device states none.
    pub serial: String,
    /// Whether the device is behind a hub.
    pub behind_hub: bool,
}

impl HidFacts {
    /// The facts in a text; `None` if the text does not name a vendor and a product.
    pub fn parse(text: &str) -> Option<Self> {
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

/// Whether the place of a USB device (`1-2.3`, or `usb-0000:00:14.0-2.3` in the words of a HID device) has a hub in it:
/// the last part is the path of ports, with a dot for each hub.
fn behind_hub(place: &str) -> bool {
    place
        .rsplit('-')
        .next()
        .is_some_and(|ports| ports.contains('.'))
}

/// The names and paths in a folder, sorted; none if the folder does not exist.
pub(super) fn entries(folder: &Path) -> Vec<(String, PathBuf)> {
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
