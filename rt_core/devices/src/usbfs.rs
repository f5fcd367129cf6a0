//! USB devices through the files of Linux (usbfs), without a library.
//!
//! The driver finds a device in the kernel's list by its numbers ([`found`]) and opens `/dev/bus/usb/BBB/DDD`. Four
//! requests of the kernel drive the device: claim of an interface, control transfer, bulk transfer, and release.
//! Closing the file makes the release. Bulk transfers complete in the interrupt thread of the host controller. The
//! bytes of a tty, in contrast, pass through a worker of ordinary priority.
//!
//! Each read takes one packet. A longer read that times out would lose the packets that it already has.
//!
//! Source: the kernel's documentation, *USB host-side API*, and the layout of `linux/usbdevice_fs.h`.

use crate::found::{self, FindError, Which, udev_rule, usb_rule};
use crate::ftdi::{PACKET, SetupPacket, Usb};
use std::ffi::{c_uint, c_void};
use std::fmt;
use std::fs::File;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The one interface of FTDI's chips of one port.
const INTERFACE: c_uint = 0;
/// Bulk pipe from an FTDI chip.
const IN: c_uint = 0x81;
/// Bulk pipe to an FTDI chip.
const OUT: c_uint = 0x02;
/// Longest wait for a request on the control pipe, and for a write (ms).
const SEND_MS: c_uint = 500;
/// Error number of a transfer that was not complete (EIO).
const INCOMPLETE: i32 = 5;

/// Selects the USB device to open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selector {
    /// The connection of any device of the kind, such as `falcon`.
    pub kind: &'static str,
    /// Vendor and product of the device.
    pub numbers: (u16, u16),
    /// Which one of the devices with these numbers.
    pub which: Which,
}

impl Selector {
    /// The file of the one connected device that is selected, on the machine whose file system has this root.
    ///
    /// # Errors
    /// [`FindError`].
    pub(crate) fn find(&self, root: &Path) -> Result<PathBuf, FindError> {
        let (vendor, product) = self.numbers;
        let called = format!("USB device {vendor:04x}:{product:04x}");
        let alike = found::usb(root, self.kind, self.numbers);
        Ok(alike.find(&self.which, &called)?.file.clone())
    }
}

impl fmt::Display for Selector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (vendor, product) = self.numbers;
        write!(f, "{vendor:04x}:{product:04x}{}", self.which)
    }
}

/// The reason why a USB device could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum UsbError {
    /// There is not exactly one such device.
    #[error(transparent)]
    Find(#[from] FindError),
    /// The device is connected but cannot be opened.
    #[error(
        "the USB device {selector} is connected as {path} but cannot be opened: {source}. {}",
        udev_rule(&usb_rule(selector.numbers)), path = path.display()
    )]
    Open {
        /// The device that was asked for.
        selector: Selector,
        /// The file of the device.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The device is open, but another program uses its interface.
    #[error(
        "the USB device {selector} ({path}) is in use: {source}. End the other program that uses it; where a driver of \
         the kernel has it (`lsusb -t`, such as ftdi_sio), unbind it: echo -n INTERFACE | sudo tee \
         /sys/bus/usb/drivers/ftdi_sio/unbind",
        path = path.display()
    )]
    Claim {
        /// The device that was asked for.
        selector: Selector,
        /// The file of the device.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
}

impl UsbError {
    /// The error number of the system; that of a missing device (ENODEV) if there is none.
    pub fn number(&self) -> i32 {
        match self {
            Self::Open { source, .. } | Self::Claim { source, .. } => {
                source.raw_os_error().unwrap_or(libc::ENODEV)
            }
            Self::Find(_) => libc::ENODEV,
        }
    }
}

/// An open USB device with the pipes of FTDI's chips. Closing it gives the interface back.
#[derive(Debug)]
pub struct UsbDevice {
    file: File,
}

impl UsbDevice {
    /// Opens the one device that `selector` names, and takes its interface, even from a driver of the kernel.
    ///
    /// # Errors
    /// [`UsbError`], which names the device and the remedy.
    pub fn open(selector: &Selector) -> Result<Self, UsbError> {
        let path = selector.find(Path::new("/"))?;
        let file = File::options()
            .read(true)
            .write(true)
            .open(&path)
            .map_err(|source| UsbError::Open {
                selector: selector.clone(),
                path: path.clone(),
                source,
            })?;
        kernel::claim(&file, INTERFACE).map_err(|number| UsbError::Claim {
            selector: selector.clone(),
            path,
            source: std::io::Error::from_raw_os_error(number),
        })?;
        Ok(Self { file })
    }
}

impl Usb for UsbDevice {
    fn request(&mut self, setup: SetupPacket) -> Result<(), i32> {
        kernel::control(&self.file, setup, SEND_MS)
    }

    fn bulk_in(&mut self, packet: &mut [u8; PACKET], wait: Duration) -> Result<usize, i32> {
        // Zero would be no limit. A wait is rounded up, so that it is never shorter than it was asked for.
        let ms = wait.as_nanos().div_ceil(1_000_000).clamp(1, 10_000) as c_uint;
        match kernel::bulk_in(&self.file, IN, packet, ms) {
            Err(libc::ETIMEDOUT | libc::EINTR) => Ok(0),
            result => result,
        }
    }

    fn bulk_out(&mut self, bytes: &[u8]) -> Result<(), i32> {
        match kernel::bulk_out(&self.file, bytes, SEND_MS)? {
            sent if sent == bytes.len() => Ok(()),
            _ => Err(INCOMPLETE),
        }
    }
}

/// The requests of the kernel.
#[allow(unsafe_code)]
mod kernel {
    use super::{AsRawFd, File, PACKET, SetupPacket, c_uint, c_void};
    use std::ptr::null_mut;

    /// `struct usbdevfs_ctrltransfer`.
    #[repr(C)]
    pub(super) struct ControlTransfer {
        kind: u8,
        request: u8,
        value: u16,
        index: u16,
        length: u16,
        timeout_ms: u32,
        data: *mut c_void,
    }

    /// `struct usbdevfs_bulktransfer`.
    #[repr(C)]
    pub(super) struct BulkTransfer {
        endpoint: c_uint,
        length: c_uint,
        timeout_ms: c_uint,
        data: *mut c_void,
    }

    /// `struct usbdevfs_disconnect_claim`.
    #[repr(C)]
    pub(super) struct DisconnectClaim {
        interface: c_uint,
        flags: c_uint,
        driver: [u8; 256],
    }

    /// Takes the interface from every driver but the named one.
    const EXCEPT_DRIVER: c_uint = 2;

    pub(super) const CONTROL: libc::Ioctl = libc::_IOWR::<ControlTransfer>(b'U' as u32, 0);
    pub(super) const BULK: libc::Ioctl = libc::_IOWR::<BulkTransfer>(b'U' as u32, 2);
    pub(super) const CLAIM: libc::Ioctl = libc::_IOR::<DisconnectClaim>(b'U' as u32, 27);

    /// The number that the kernel returned, or its error number.
    fn checked(result: libc::c_int) -> Result<usize, i32> {
        usize::try_from(result).map_err(|_| {
            let error = std::io::Error::last_os_error();
            error.raw_os_error().unwrap_or(libc::EIO)
        })
    }

    /// Takes an interface, even from a driver of the kernel, but not from another program.
    pub(super) fn claim(file: &File, interface: c_uint) -> Result<(), i32> {
        let mut claim = DisconnectClaim {
            interface,
            flags: EXCEPT_DRIVER,
            driver: [0; 256],
        };
        for (place, letter) in claim.driver.iter_mut().zip(b"usbfs") {
            *place = *letter;
        }
        // SAFETY: the kernel reads one `struct usbdevfs_disconnect_claim`, which lives until the call returns.
        checked(unsafe { libc::ioctl(file.as_raw_fd(), CLAIM, &raw mut claim) }).map(drop)
    }

    /// A control transfer without data.
    pub(super) fn control(file: &File, setup: SetupPacket, timeout_ms: c_uint) -> Result<(), i32> {
        let mut transfer = ControlTransfer {
            kind: setup.kind,
            request: setup.request,
            value: setup.value,
            index: setup.index,
            length: 0,
            timeout_ms,
            data: null_mut(),
        };
        // SAFETY: the kernel reads one `struct usbdevfs_ctrltransfer`, which lives until the call returns. Its length
        // is zero, so the kernel reads and writes no data.
        checked(unsafe { libc::ioctl(file.as_raw_fd(), CONTROL, &raw mut transfer) }).map(drop)
    }

    /// A bulk transfer from the device.
    pub(super) fn bulk_in(
        file: &File,
        endpoint: c_uint,
        packet: &mut [u8; PACKET],
        timeout_ms: c_uint,
    ) -> Result<usize, i32> {
        let mut transfer = BulkTransfer {
            endpoint,
            length: PACKET as c_uint,
            timeout_ms,
            data: packet.as_mut_ptr().cast(),
        };
        // SAFETY: the kernel reads one `struct usbdevfs_bulktransfer`, and writes at most `length` bytes to `data`.
        // `packet` is borrowed for longer than the call, and has that length.
        checked(unsafe { libc::ioctl(file.as_raw_fd(), BULK, &raw mut transfer) })
    }

    /// A bulk transfer to the device.
    pub(super) fn bulk_out(file: &File, bytes: &[u8], timeout_ms: c_uint) -> Result<usize, i32> {
        let mut transfer = BulkTransfer {
            endpoint: super::OUT,
            length: c_uint::try_from(bytes.len()).map_err(|_| libc::EINVAL)?,
            timeout_ms,
            data: bytes.as_ptr().cast_mut().cast(),
        };
        // SAFETY: the kernel reads one `struct usbdevfs_bulktransfer`, and `length` bytes from `data`, which `bytes`
        // has. It writes nothing to `data`, because the direction bit of this endpoint is zero.
        checked(unsafe { libc::ioctl(file.as_raw_fd(), BULK, &raw mut transfer) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ftdi::Control;
    use std::fs;

    /// A machine with USB devices, removed at the end.
    struct Machine(PathBuf);

    impl Machine {
        fn new(name: &str) -> Self {
            let path =
                std::env::temp_dir().join(format!("palpate-usb-{name}-{}", std::process::id()));
            fs::create_dir_all(&path).unwrap();
            Self(path)
        }

        fn add(&self, name: &str, files: &[(&str, &str)]) {
            let folder = self.0.join("sys/bus/usb/devices").join(name);
            fs::create_dir_all(&folder).unwrap();
            for (file, text) in files {
                fs::write(folder.join(file), format!("{text}\n")).unwrap();
            }
        }

        fn falcon(&self, name: &str, devnum: &str, serial: &str) {
            self.add(
                name,
                &[
                    ("idVendor", "0403"),
                    ("idProduct", "cb48"),
                    ("busnum", "1"),
                    ("devnum", devnum),
                    ("serial", serial),
                ],
            );
        }

        /// The file of the device that the end of an address names, from the folder of these files; or why there is none.
        fn find(&self, address: &str) -> Result<PathBuf, String> {
            let file = selector(address).find(&self.0).map_err(|e| e.to_string())?;
            let files = self.0.join("dev/bus/usb");
            Ok(file.strip_prefix(files).unwrap().to_owned())
        }
    }

    impl Drop for Machine {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    fn selector(address: &str) -> Selector {
        Selector {
            kind: "falcon",
            numbers: (0x0403, 0xcb48),
            which: Which::parse(address),
        }
    }

    #[test]
    #[cfg(target_arch = "x86_64")]
    fn the_requests_are_the_kernels() {
        let numbers = [kernel::CONTROL, kernel::BULK, kernel::CLAIM];
        assert_eq!(numbers, [0xc018_5500, 0xc018_5502, 0x8108_551b]);
    }

    #[test]
    fn a_device_is_found_by_its_numbers_its_serial_number_and_its_port() {
        let machine = Machine::new("found");
        // An interface, a hub, and a device whose files are no numbers.
        machine.add("1-1:1.0", &[("bInterfaceNumber", "00")]);
        machine.add("usb1", &[("idVendor", "1d6b"), ("idProduct", "0002")]);
        machine.add("1-9", &[("idVendor", "?"), ("idProduct", "cb48")]);
        let text = machine.find("").unwrap_err();
        for part in ["0403:cb48", "no other device", "lsusb"] {
            assert!(text.contains(part), "{part} in {text}");
        }
        machine.falcon("1-1", "7", "left");
        assert_eq!(machine.find("").unwrap(), Path::new("001/007"));
        let text = machine.find("right").unwrap_err();
        assert!(
            text.contains("\"right\"") && text.contains("others of its kind: falcon:left"),
            "{text}"
        );
        machine.falcon("1-2", "12", "right");
        assert_eq!(machine.find("right").unwrap(), Path::new("001/012"));
        let text = machine.find("").unwrap_err();
        assert!(
            text.contains(
                "the USB device 0403:cb48 is not the only one: 2 are connected; name one of them: falcon:left, falcon:right"
            ),
            "{text}"
        );
        // Two more with one serial number.
        machine.falcon("1-3", "13", "left");
        let text = machine.find("left").unwrap_err();
        assert!(
            text.contains(
                "serial numbers are equal (\"left\"); name one of them: falcon:@1-1, falcon:@1-3"
            ),
            "{text}"
        );
        assert_eq!(machine.find("@1-1").unwrap(), Path::new("001/007"));
        assert_eq!(machine.find("@1-3").unwrap(), Path::new("001/013"));
        let text = machine.find("@1-4").unwrap_err();
        assert!(text.contains("on the USB port 1-4"), "{text}");
    }

    #[test]
    fn errors_of_opening_say_what_to_do() {
        let source = |number| std::io::Error::from_raw_os_error(number);
        let open = UsbError::Open {
            selector: selector(""),
            path: "/dev/bus/usb/001/007".into(),
            source: source(libc::EACCES),
        };
        let claim = UsbError::Claim {
            selector: selector(""),
            path: "/dev/bus/usb/001/007".into(),
            source: source(libc::EBUSY),
        };
        for (error, number, parts) in [
            (open, libc::EACCES, ["ATTR{idProduct}==\"cb48\"", "uaccess"]),
            (claim, libc::EBUSY, ["other program", "ftdi_sio"]),
        ] {
            let text = error.to_string();
            assert_eq!(error.number(), number);
            for part in parts.iter().chain(&["001/007"]) {
                assert!(text.contains(part), "{part} in {text}");
            }
        }
    }

    #[test]
    fn a_file_that_is_no_usb_device_refuses_every_request() {
        let file = File::options()
            .read(true)
            .write(true)
            .open("/dev/null")
            .unwrap();
        assert_eq!(kernel::claim(&file, 0), Err(libc::ENOTTY));
        let mut device = UsbDevice { file };
        let setup = Control::Latency(1).setup();
        assert_eq!(device.request(setup), Err(libc::ENOTTY));
        assert_eq!(
            device.bulk_in(&mut [0; PACKET], Duration::ZERO),
            Err(libc::ENOTTY)
        );
        assert_eq!(device.bulk_out(&[1, 2]), Err(libc::ENOTTY));
    }

    #[test]
    fn a_selector_is_shown_by_numbers_and_end() {
        let one = Selector {
            kind: "falcon",
            numbers: (0x0403, 0xcb48),
            which: Which::Serial("A1".to_owned()),
        };
        assert_eq!(one.to_string(), "0403:cb48 with serial number \"A1\"");
    }
}
