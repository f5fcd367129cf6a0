//! The devices that are connected to this machine, and the reasons why a device cannot be used.
//!
//! All facts come from sysfs (`/sys/class/hidraw`, `/sys/bus/usb/devices`, `/sys/class/tty`) and from an attempt to
//! open the file of the device. Of a serial line, only the rights are checked. Nothing is therefore sent to any device.
//! The root of the file system is an argument, so that a test can make its own tree.
//!
//! - [`listed`]: the kernel's lists. [`known`]: the numbers of the devices that are known by name.
//! - [`which`]: the choice of one of several devices of a kind.

pub mod known;
pub mod listed;
pub mod which;

pub use which::{FindError, Which};

use listed::{Listed, entries};
use rustix::fs::FlockOperation;
use rustix::io::Errno;
use std::fmt;
use std::fs::{self, OpenOptions};
use std::path::{Path, PathBuf};
use which::Alike;

/// Folders of the links that udev makes for serial lines, best first: by the serial number of the device, and by its port.
const LINKS: [&str; 2] = ["dev/serial/by-id", "dev/serial/by-path"];

/// A device that is connected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// The connection that a scene names. It names this device and no other.
    pub connect: String,
    /// Name of the device, as it states it.
    pub name: String,
    /// Numbers of the USB device; `None` for a device on another bus.
    pub numbers: Option<(u16, u16)>,
    /// Serial number; empty if the device states none.
    pub serial: String,
    /// The port of USB (`1-2.3`), which stays when the device is plugged in again; empty for a device on another bus.
    pub port: String,
    /// The file of the device.
    pub file: PathBuf,
    /// Whether the device is also a keyboard, a mouse or a joystick. Such a device is hardly a haptic device.
    pub input: bool,
    /// The reason why the device cannot be opened; `None` if it can.
    pub trouble: Option<Trouble>,
    /// Whether the device is behind a hub, which it shares with other devices.
    pub behind_hub: bool,
}

/// The reason why a device cannot be opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// The account may not open the file. The text is the beginning of a udev rule for the device.
    Permission(String),
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
            Self::Permission(begin) => {
                write!(f, "this account may not open it. {}", udev_rule(begin))
            }
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

/// The remedy if this account may not open a device: the udev rule that begins with `begin`. The rules
/// `73-seat-late.rules` of systemd give devices with the tag `uaccess` to the person at the seat, so the rule must come
/// before these.
pub(crate) fn udev_rule(begin: &str) -> String {
    format!(
        "Let your account use it with a udev rule in /etc/udev/rules.d/70-palpate.rules (a number below 73: after that, \
         the tag has no effect): {begin}, MODE=\"0660\", TAG+=\"uaccess\"; then plug it in again"
    )
}

/// The beginning of a udev rule for the hidraw devices with these numbers. Unknown numbers have placeholders.
pub(crate) fn hidraw_rule(numbers: Option<(u16, u16)>) -> String {
    match numbers {
        Some((vid, pid)) => format!(
            "KERNEL==\"hidraw*\", ATTRS{{idVendor}}==\"{vid:04x}\", ATTRS{{idProduct}}==\"{pid:04x}\""
        ),
        None => {
            "KERNEL==\"hidraw*\", ATTRS{idVendor}==\"VID\", ATTRS{idProduct}==\"PID\" (see `lsusb`)"
                .to_owned()
        }
    }
}

/// The beginning of a udev rule for the USB devices with these numbers.
pub(crate) fn usb_rule((vid, pid): (u16, u16)) -> String {
    format!("SUBSYSTEM==\"usb\", ATTR{{idVendor}}==\"{vid:04x}\", ATTR{{idProduct}}==\"{pid:04x}\"")
}

/// The devices of the machine whose file system has this root (`/`), by connection.
pub fn list(root: &Path) -> Vec<Found> {
    let mut all = hid(root);
    all.extend(falcons(root));
    all.extend(serial(root));
    all.sort_by(|a, b| a.connect.cmp(&b.connect));
    all
}

/// The connected boards of WoodenHaptics.
pub(crate) fn woodenhaptics(root: &Path) -> Alike<'static> {
    let is_board = |one: &Listed| known::board(one.numbers).is_some();
    Alike {
        kind: "woodenhaptics",
        by_path: Some("woodenhaptics"),
        devices: listed::hid(root).into_iter().filter(is_board).collect(),
    }
}

/// The connected USB devices with these numbers, which `kind` connects.
pub(crate) fn usb<'a>(root: &Path, kind: &'a str, numbers: (u16, u16)) -> Alike<'a> {
    let all = listed::usb(root).into_iter();
    Alike {
        kind,
        by_path: None,
        devices: all.filter(|one| one.numbers == numbers).collect(),
    }
}

/// HID devices.
fn hid(root: &Path) -> Vec<Found> {
    let boards = woodenhaptics(root);
    let all = listed::hid(root);
    let each = all.iter().map(|one| {
        let board = known::board(one.numbers);
        let connect = if board.is_some() {
            boards.connection(one)
        } else {
            let (vid, pid) = one.numbers;
            let alike = all.iter().filter(|other| other.numbers == one.numbers);
            let alike = Alike {
                kind: &format!("hid:{vid:04x}:{pid:04x}"),
                by_path: Some("hid"),
                devices: alike.cloned().collect(),
            };
            alike.connection(one)
        };
        Found {
            name: board.map_or_else(|| one.name.clone(), |board| board.name.to_owned()),
            trouble: trouble(&one.file, || hidraw_rule(Some(one.numbers))),
            ..found(connect, one)
        }
    });
    each.collect()
}

/// The device in a list with its connection, whatever its trouble.
fn found(connect: String, one: &Listed) -> Found {
    Found {
        connect,
        name: one.name.clone(),
        numbers: one.on_usb.then_some(one.numbers),
        serial: one.serial.clone(),
        port: one.port.clone(),
        file: one.file.clone(),
        input: one.input,
        trouble: None,
        behind_hub: one.behind_hub,
    }
}

/// Falcons.
fn falcons(root: &Path) -> Vec<Found> {
    // The kernel does not show the Falcon as HID.
    let numbers = known::FALCON.numbers;
    let all = usb(root, "falcon", numbers);
    let each = all.devices.iter().map(|one| Found {
        name: known::FALCON.name.to_owned(),
        // A program that has claimed the device appears as the driver `usbfs`.
        trouble: match one.driver.as_deref() {
            Some("usbfs") => Some(Trouble::Busy),
            Some(driver) => Some(Trouble::Driver(driver.to_owned())),
            None => trouble(&one.file, || usb_rule(numbers)),
        },
        ..found(all.connection(one), one)
    });
    each.collect()
}

/// Serial lines over USB, which a device with the firmware protocol may have.
fn serial(root: &Path) -> Vec<Found> {
    let links = LINKS.map(|folder| entries(&root.join(folder)));
    let all = listed::lines(root);
    let each = all.iter().map(|one| {
        let same = |other: &&Listed| (other.numbers, &other.serial) == (one.numbers, &one.serial);
        // Lines with equal serial numbers share one link by their number. The link leads to any of them.
        let is_told_apart =
            !one.serial.is_empty() && all.iter().filter(same).all(|other| other.port == one.port);
        // In an address, an @ comes before the speed of the line.
        let leads_here = |(name, link): &&(String, PathBuf)| {
            !name.contains('@') && fs::canonicalize(link).ok() == fs::canonicalize(&one.file).ok()
        };
        let [by_id, by_path] = &links;
        let by_id = by_id.iter().filter(|_| is_told_apart).find(leads_here);
        let link = by_id.or_else(|| by_path.iter().find(leads_here));
        let path = link.map_or(&one.file, |(_, link)| link);
        let path = Path::new("/").join(path.strip_prefix(root).unwrap_or(path));
        Found {
            trouble: line_trouble(&one.file, || line_rule(one.numbers)),
            ..found(format!("tty:{}", path.display()), one)
        }
    });
    each.collect()
}

/// The beginning of a udev rule for the serial lines of the USB devices with these numbers.
fn line_rule((vid, pid): (u16, u16)) -> String {
    format!(
        "SUBSYSTEM==\"tty\", ATTRS{{idVendor}}==\"{vid:04x}\", ATTRS{{idProduct}}==\"{pid:04x}\""
    )
}

/// The reason why a serial line cannot be used. The line is not opened, because opening raises its control lines, which
/// restart many boards. The function therefore cannot tell whether another program has the line.
fn line_trouble(file: &Path, rule: impl Fn() -> String) -> Option<Trouble> {
    use rustix::fs::{Access, access};
    let refusal = access(file, Access::READ_OK | Access::WRITE_OK).err()?;
    Some(trouble_of(refusal, rule))
}

/// The reason why this program alone cannot open a file for reading and writing.
fn trouble(file: &Path, rule: impl Fn() -> String) -> Option<Trouble> {
    let refusal = match OpenOptions::new().read(true).write(true).open(file) {
        Ok(file) => rustix::fs::flock(&file, FlockOperation::NonBlockingLockShared).err()?,
        Err(error) => Errno::from_raw_os_error(error.raw_os_error().unwrap_or_default()),
    };
    Some(trouble_of(refusal, rule))
}

/// The trouble with an error of the system.
fn trouble_of(error: Errno, rule: impl Fn() -> String) -> Trouble {
    match error {
        Errno::ACCESS | Errno::PERM => Trouble::Permission(rule()),
        Errno::BUSY | Errno::WOULDBLOCK => Trouble::Busy,
        Errno::NOENT | Errno::NXIO => Trouble::NoFile,
        other => Trouble::Other(other.raw_os_error()),
    }
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

    /// A folder that is the root of a machine, removed at the end.
    struct Machine(PathBuf);

    impl Machine {
        fn new(name: &str) -> Self {
            let name = format!("palpate-found-{name}-{}", std::process::id());
            let path = std::env::temp_dir().join(name);
            let _ = fs::remove_dir_all(&path);
            Self(path)
        }

        /// Plugs in a HID device with these numbers and this serial number, whose interface has the number `interface`.
        fn hid(&self, number: u32, ids: &str, serial: &str, port: &str, interface: u32) {
            let usb = format!("sys/devices/usb1/{port}");
            put(&self.0, &format!("{usb}/idVendor"), "1209\n");
            let device = format!("{usb}/{port}:1.{interface}/0003:{number}");
            let facts = format!("HID_ID=0003:{ids}\nHID_NAME=Arm\nHID_UNIQ={serial}\n");
            put(&self.0, &format!("{device}/uevent"), &facts);
            let hidraw = format!("sys/class/hidraw/hidraw{number}");
            fs::create_dir_all(self.0.join(&hidraw)).expect("ours");
            symlink(self.0.join(device), self.0.join(hidraw).join("device")).expect("ours");
            put(&self.0, &format!("dev/hidraw{number}"), "");
        }

        /// Plugs in a serial line.
        fn line(&self, name: &str, serial: &str, port: &str, interface: u32) {
            let usb = format!("sys/devices/usb1/{port}");
            for (file, text) in [
                ("idVendor", "2341"),
                ("idProduct", "0043"),
                ("serial", serial),
            ] {
                put(&self.0, &format!("{usb}/{file}"), text);
            }
            let folder = format!("{usb}/{port}:1.{interface}");
            put(&self.0, &format!("{folder}/interface"), "");
            put(&self.0, &format!("sys/class/tty/{name}/dev"), "");
            let device = self.0.join(format!("sys/class/tty/{name}/device"));
            symlink(self.0.join(folder), device).expect("ours");
            put(&self.0, &format!("dev/{name}"), "");
        }

        fn link(&self, link: &str, to: &str) {
            let link = self.0.join(link);
            fs::create_dir_all(link.parent().expect("a folder")).expect("ours");
            symlink(to, link).expect("ours");
        }

        fn connections(&self) -> Vec<String> {
            list(&self.0)
                .into_iter()
                .map(|found| found.connect)
                .collect()
        }

        /// The file that a connection selects, from the root of the machine; or why there is none.
        fn select(&self, connect: &str) -> Result<String, String> {
            use crate::hid::HidSelector;
            let found = if let Some(address) = connect.strip_prefix("hid:") {
                let selector = HidSelector::parse(address).expect("an address");
                selector.find(&self.0)
            } else {
                let end = connect
                    .strip_prefix("woodenhaptics")
                    .expect("one of the two");
                let which = Which::parse(end.strip_prefix(':').unwrap_or(end));
                let boards = woodenhaptics(&self.0);
                boards.find(&which, "WoodenHaptics").cloned()
            };
            let file = found.map_err(|error| error.to_string())?.file;
            Ok(self.short(&file.display().to_string()))
        }

        /// A text without the root of the machine.
        fn short(&self, text: &str) -> String {
            text.replace(&self.0.display().to_string(), "")
        }
    }

    impl Drop for Machine {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    /// Every connection that is printed works, and all differ.
    #[test]
    fn devices_with_equal_or_no_serial_numbers_are_told_apart_by_their_port() {
        for (serial, why) in [
            ("0001", "their serial numbers are equal (\"0001\")"),
            ("", "they state no serial number"),
        ] {
            let machine = Machine::new("equal");
            machine.hid(0, "00001209:0000C0DE", serial, "1-1", 0);
            machine.hid(1, "00001209:0000C0DE", serial, "1-2.4", 0);
            let printed = machine.connections();
            assert_eq!(printed, ["hid:1209:c0de:@1-1", "hid:1209:c0de:@1-2.4"]);
            let selected: Vec<_> = printed.iter().map(|one| machine.select(one)).collect();
            assert_eq!(
                selected,
                [Ok("/dev/hidraw0".to_owned()), Ok("/dev/hidraw1".to_owned())]
            );
            let named = match serial {
                "" => "hid:1209:c0de".to_owned(),
                serial => format!("hid:1209:c0de:{serial}"),
            };
            for ambiguous in ["hid:1209:c0de", &named] {
                let text = machine.short(&machine.select(ambiguous).expect_err("there are two"));
                for part in [
                    "the HID device 1209:c0de",
                    "is not the only one: 2 are connected",
                    why,
                    "name one of them: hid:1209:c0de:@1-1, hid:1209:c0de:@1-2.4",
                    "hid:/dev/hidraw0, hid:/dev/hidraw1",
                    "a udev rule makes",
                ] {
                    assert!(text.contains(part), "{part} in {text}");
                }
            }
            // A link of the person leads to one of them.
            machine.link("dev/lab/left", "../hidraw1");
            let link = format!("hid:{}/dev/lab/left", machine.0.display());
            assert_eq!(machine.select(&link), Ok("/dev/hidraw1".to_owned()));
            // One is plugged out.
            fs::remove_dir_all(machine.0.join("sys/class/hidraw/hidraw1")).expect("ours");
            assert_eq!(machine.select(&named), Ok("/dev/hidraw0".to_owned()));
            let gone = machine
                .select("hid:1209:c0de:@1-2.4")
                .expect_err("it is plugged out");
            assert!(
                gone.contains("on the USB port 1-2.4 is connected"),
                "{gone}"
            );
            let gone = machine.select(&link).expect_err("it is plugged out");
            assert!(
                machine.short(&gone).contains("leads to /dev/hidraw1"),
                "{gone}"
            );
        }
    }

    #[test]
    fn serial_numbers_that_differ_are_used_and_those_that_look_like_ports_are_not() {
        let machine = Machine::new("differ");
        machine.hid(0, "00001209:0000C0DE", "left", "1-1", 0);
        machine.hid(1, "00001209:0000C0DE", "", "1-2", 0);
        machine.hid(2, "00001209:0000C0DE", "@1-1", "1-3", 0);
        // Two interfaces of one device.
        machine.hid(3, "00001209:0000BEEF", "x", "1-4", 0);
        machine.hid(4, "00001209:0000BEEF", "x", "1-4", 1);
        let printed = machine.connections();
        assert_eq!(
            printed,
            [
                "hid:1209:beef:@1-4:1.0",
                "hid:1209:beef:@1-4:1.1",
                "hid:1209:c0de:@1-2",
                "hid:1209:c0de:@1-3",
                "hid:1209:c0de:left",
            ]
        );
        let selected: Vec<_> = printed
            .iter()
            .map(|one| machine.select(one).expect("one"))
            .collect();
        let files = [3, 4, 1, 2, 0].map(|number| format!("/dev/hidraw{number}"));
        assert_eq!(selected, files);
        let text = machine
            .select("hid:1209:c0de")
            .expect_err("there are three");
        assert!(!text.contains("serial number"), "{text}");
    }

    /// The two boards are one kind: none of them is taken because it is of the first board.
    #[test]
    fn boards_of_woodenhaptics_are_told_apart() {
        let machine = Machine::new("boards");
        machine.hid(0, "00001234:00000006", "", "1-1", 0);
        assert_eq!(machine.connections(), ["woodenhaptics"]);
        assert_eq!(
            machine.select("woodenhaptics"),
            Ok("/dev/hidraw0".to_owned())
        );
        machine.hid(1, "000016C0:00000486", "", "1-2", 0);
        let printed = machine.connections();
        assert_eq!(printed, ["woodenhaptics:@1-1", "woodenhaptics:@1-2"]);
        assert_eq!(
            machine.select("woodenhaptics:@1-2"),
            Ok("/dev/hidraw1".to_owned())
        );
        let text = machine.select("woodenhaptics").expect_err("there are two");
        assert!(
            text.contains("the WoodenHaptics is not the only one: 2 are connected"),
            "{text}"
        );
    }

    #[test]
    fn a_serial_line_has_the_link_that_stays() {
        let machine = Machine::new("lines");
        let by = |kind: &str, name: &str, to: &str| {
            machine.link(
                &format!("dev/serial/by-{kind}/{name}"),
                &format!("../../{to}"),
            );
        };
        // A line alone, two lines of one device, and two devices that state the same.
        machine.line("ttyACM0", "A1", "1-1", 0);
        by("id", "usb-Arm_A1-if00", "ttyACM0");
        by("path", "pci-usb-0:1:1.0", "ttyACM0");
        machine.line("ttyUSB0", "B", "1-2", 0);
        machine.line("ttyUSB1", "B", "1-2", 1);
        by("id", "usb-Two_B-if00", "ttyUSB0");
        by("id", "usb-Two_B-if01", "ttyUSB1");
        machine.line("ttyUSB2", "0001", "1-3", 0);
        machine.line("ttyUSB3", "0001", "1-4", 0);
        by("id", "usb-Clone_0001-if00", "ttyUSB3");
        by("path", "pci-usb-0:3:1.0", "ttyUSB2");
        by("path", "pci-usb-0:4:1.0", "ttyUSB3");
        // No link, and a link whose name has an @, which an address takes for a speed.
        machine.line("ttyUSB4", "C", "1-5", 0);
        machine.line("ttyUSB5", "D", "1-6", 0);
        by("id", "usb-at@home-if00", "ttyUSB5");
        assert_eq!(
            machine.connections(),
            [
                "tty:/dev/serial/by-id/usb-Arm_A1-if00",
                "tty:/dev/serial/by-id/usb-Two_B-if00",
                "tty:/dev/serial/by-id/usb-Two_B-if01",
                "tty:/dev/serial/by-path/pci-usb-0:3:1.0",
                "tty:/dev/serial/by-path/pci-usb-0:4:1.0",
                "tty:/dev/ttyUSB4",
                "tty:/dev/ttyUSB5",
            ]
        );
    }

    #[test]
    fn a_device_of_another_run_is_busy_and_one_of_another_account_has_its_udev_rule() {
        let machine = Machine::new("trouble");
        machine.hid(0, "00001209:0000C0DE", "left", "1-1", 0);
        let trouble = || list(&machine.0).remove(0).trouble;
        assert_eq!(trouble(), None);
        let run = crate::transport::Hidraw::open(&machine.0.join("dev/hidraw0")).expect("ours");
        assert_eq!(trouble(), Some(Trouble::Busy));
        drop(run);
        assert_eq!(trouble(), None);
        let refused = trouble_of(Errno::ACCESS, || hidraw_rule(Some((0x1209, 0xc0de)))).to_string();
        for part in [
            "KERNEL==\"hidraw*\", ATTRS{idVendor}==\"1209\", ATTRS{idProduct}==\"c0de\", MODE=\"0660\"",
            "TAG+=\"uaccess\"",
        ] {
            assert!(refused.contains(part), "{part} in {refused}");
        }
        // systemd gives the devices with this tag to the person at the seat in its rules with the number 73.
        let number = refused
            .split("rules.d/")
            .nth(1)
            .and_then(|rest| rest.split('-').next());
        let number: u32 = number.and_then(|text| text.parse().ok()).expect("a number");
        assert!(number < 73, "{refused}");
    }

    /// The result of `look` under an account that owns no file.
    fn as_another_account<T: Send>(look: impl FnOnce() -> T + Send) -> T {
        let look = || {
            if rustix::process::geteuid().is_root() {
                // The account "nobody", for this thread alone.
                let nobody = rustix::fs::Uid::from_raw(65534);
                rustix::thread::set_thread_res_uid(nobody, nobody, nobody).expect("root may");
            }
            look()
        };
        std::thread::scope(|scope| scope.spawn(look).join().expect("it looks"))
    }

    #[test]
    fn a_device_that_may_not_be_written_to_comes_with_the_rule_for_its_kind() {
        use std::os::unix::fs::PermissionsExt;
        let machine = Machine::new("rules");
        machine.hid(0, "00001209:0000C0DE", "left", "1-1", 0);
        machine.line("ttyACM0", "A1", "1-2", 0);
        for file in ["hidraw0", "ttyACM0"] {
            let path = machine.0.join("dev").join(file);
            fs::set_permissions(path, fs::Permissions::from_mode(0o444)).expect("ours");
        }
        let mut found = as_another_account(|| list(&machine.0));
        found.sort_by(|a, b| a.connect.cmp(&b.connect));
        let rules: Vec<_> = (found.iter())
            .map(|found| match &found.trouble {
                Some(Trouble::Permission(rule)) => rule.as_str(),
                other => panic!("{other:?} of {}", found.connect),
            })
            .collect();
        assert_eq!(
            rules,
            [
                "KERNEL==\"hidraw*\", ATTRS{idVendor}==\"1209\", ATTRS{idProduct}==\"c0de\"",
                "SUBSYSTEM==\"tty\", ATTRS{idVendor}==\"2341\", ATTRS{idProduct}==\"0043\"",
            ]
        );
        // A line that was plugged out while it was looked for.
        fs::remove_file(machine.0.join("dev/ttyACM0")).expect("ours");
        let trouble = list(&machine.0).pop().expect("the line is last").trouble;
        assert_eq!(trouble, Some(Trouble::NoFile));
    }
}
