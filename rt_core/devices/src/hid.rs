//! A real device over USB HID, through the kernel's hidraw.
//!
//! - **Reading** drains the kernel's queue to its newest report in each tick. The queue holds 64 reports and drops the
//!   newest when it is full, so a report left in the queue would make the force lag.
//! - **Writing** is the task of a separate thread for each device (`writer`), because the kernel makes a writer wait
//!   for the device, for up to five seconds.
//! - Reader and writer each open a file of their own, because two threads cannot use the same handle. The kernel also
//!   queues up to 64 reports for the writer's file; they are never read.
//!
//! The driver greets the device with a hello when it opens it, and, in place of wrenches, until the device has answered;
//! so also where the device was restarted. Each wrench names the newest state that the driver has read ([`firmware_proto::host`]).
//!
//! A device that disappears is opened again by the writing thread as soon as it is back, without a restart of the run.
//! Its selector finds it again, so a device that was opened by its numbers may come back under another path.
//!
//! The bytes pass through two functions ([`HidDevice::over`]), so that a test can take the place of hidraw.
//!
//! The hot path consists of `read` until the queue is empty, one copy into a ring, and one wake-up. It never allocates,
//! not even in the tick in which the device disappears.

mod driver;
mod reading;
mod selector;
mod writer;

use crate::transport::{Hidraw, Transport};
use firmware_proto::host::release;
use hidapi::HidApi;
use reading::numbered;
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Wrench};
use std::ffi::OsStr;
use std::hash::{BuildHasher, RandomState};
use std::num::NonZeroU32;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use writer::{Open, Write, Writer};

pub use driver::Hid;
pub(crate) use driver::watchdog_us;
pub use reading::{Command, QUEUE, Reports};
pub use selector::HidSelector;

/// Error number of a device that is not connected (ENODEV).
const NO_DEVICE: i32 = 19;

/// Why a device could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum HidError {
    /// The system does not list HID devices.
    #[error("the HID devices of this system cannot be listed: {0}")]
    System(#[source] hidapi::HidError),
    /// No such device is connected.
    #[error(
        "no HID device {selector} is connected ({found}). Check its cable and power, and `lsusb` for its \
         numbers; in a container or virtual machine, check that hidraw devices are passed on"
    )]
    NotFound {
        /// The device that was asked for.
        selector: HidSelector,
        /// The devices of the same kind that were found.
        found: String,
    },
    /// More than one such device is connected.
    #[error(
        "{count} HID devices {selector} are connected; name one by its serial number ({serials})"
    )]
    Several {
        /// The device that was asked for.
        selector: HidSelector,
        /// Number of such devices.
        count: usize,
        /// The serial numbers of these devices.
        serials: String,
    },
    /// The device is connected but cannot be opened.
    #[error(
        "the HID device {selector} is connected as {path} but cannot be opened: {source}. Let your account use \
         it with a udev rule: KERNEL==\"hidraw*\", {}, MODE=\"0660\", TAG+=\"uaccess\"; then plug it in again",
        selector.udev()
    )]
    Open {
        /// The device that was asked for.
        selector: HidSelector,
        /// The path of the device in the file system.
        path: String,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The system gave no thread for writing.
    #[error("the system gave no thread for writing to the HID device {selector}: {source}")]
    Thread {
        /// The device that was asked for.
        selector: HidSelector,
        /// The error of the system.
        source: std::io::Error,
    },
}

/// Fills a buffer with the next report that waits. Returns the length of the report, zero where no report waits, or the
/// error number of the system. Never waits.
pub type ReadReport = dyn FnMut(&mut [u8]) -> Result<usize, i32> + Send;
/// Writes a command, or returns the error number of the system. May block.
pub type WriteReport = dyn FnMut(&Command) -> Result<(), i32> + Send;

/// An open device. Dropping it sends a last command of zero force, and waits until that command is written, at most
/// five seconds.
pub struct HidDevice {
    read: Box<ReadReport>,
    writer: Writer<Command, Box<ReadReport>>,
    reports: Reports,
    capabilities: Capabilities,
    /// The system's error number, while the device is lost.
    gone: Option<i32>,
}

/// The two ends of an open device.
type Ends = (Box<ReadReport>, Write<Command>);

/// Opens the reading end and the writing end of the device that is selected.
fn ends(selector: &HidSelector) -> Result<Ends, HidError> {
    let api = HidApi::new().map_err(HidError::System)?;
    let path = selector.find(&api)?;
    let path = Path::new(OsStr::from_bytes(path.to_bytes()));
    let open = || {
        Hidraw::open(path).map_err(|source| HidError::Open {
            selector: selector.clone(),
            path: path.to_string_lossy().into_owned(),
            source,
        })
    };
    let (input, mut output) = (open()?, open()?);
    let read = move |buffer: &mut [u8]| input.read_now(buffer);
    // The transport puts the report number 0 before the report itself.
    let write = move |report: &Command| output.write(report.get(1..).unwrap_or_default());
    Ok((Box::new(read), Box::new(write)))
}

impl HidDevice {
    /// Opens the one device that `selector` names. `capabilities` are the capabilities of the device, and `watchdog_us` is
    /// the watchdog that it is asked for (see [`firmware_proto::report::HelloReport::watchdog_us`]).
    ///
    /// # Errors
    /// [`HidError`], which names the device and the checks that the user can make.
    pub fn open(
        selector: &HidSelector,
        capabilities: Capabilities,
        watchdog_us: u32,
    ) -> Result<Self, HidError> {
        let first = ends(selector)?;
        let again = selector.clone();
        // The thread needs a number only.
        let open = move || ends(&again).map_err(|_| NO_DEVICE);
        Self::start(first, Box::new(open), capabilities, watchdog_us).map_err(|source| {
            HidError::Thread {
                selector: selector.clone(),
                source,
            }
        })
    }

    /// A device whose reports come from `read`, and whose commands go to `write` in a separate thread. `write` may
    /// block, and is called once, with the first hello, before this function returns. Either function returns the error
    /// number of the system where the device is disconnected. The device is asked for its own watchdog.
    ///
    /// # Errors
    /// The error of the system, where it gave no thread for writing.
    pub fn over(
        read: impl FnMut(&mut [u8]) -> Result<usize, i32> + Send + 'static,
        write: impl FnMut(&Command) -> Result<(), i32> + Send + 'static,
        capabilities: Capabilities,
    ) -> std::io::Result<Self> {
        let open = || Err(NO_DEVICE);
        Self::start(
            (Box::new(read), Box::new(write)),
            Box::new(open),
            capabilities,
            0,
        )
    }

    /// As [`over`](Self::over), with a function that opens a lost device again.
    ///
    /// # Errors
    /// As [`over`](Self::over).
    pub fn reopened(
        mut open: impl FnMut() -> Result<(Box<ReadReport>, Box<WriteReport>), i32> + Send + 'static,
        capabilities: Capabilities,
    ) -> std::io::Result<Self> {
        let first = open().map_err(std::io::Error::from_raw_os_error)?;
        Self::start(first, Box::new(open), capabilities, 0)
    }

    fn start(
        (read, mut write): Ends,
        open: Open<Command, Box<ReadReport>>,
        capabilities: Capabilities,
        watchdog_us: u32,
    ) -> std::io::Result<Self> {
        let session = session();
        let mut reports = Reports::new(session, watchdog_us);
        // Where this write fails, the tick greets the device again, and reports the failure.
        let _ = write(&numbered(&reports.greet()));
        let let_go = numbered(&release(session.get(), 0));
        Ok(Self {
            read,
            writer: Writer::start(write, let_go, open)?,
            reports,
            capabilities,
            gone: None,
        })
    }

    /// Counts of the reports so far, and the device's status.
    pub fn reports(&self) -> &Reports {
        &self.reports
    }
}

impl Device for HidDevice {
    fn capabilities(&self) -> Capabilities {
        self.capabilities
    }

    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        if let Some(number) = self.gone {
            if !self.writer.found(&mut self.read) {
                return Err(DeviceError::Disconnected(number));
            }
            self.gone = None;
        }
        let read = &mut self.read;
        let result = self
            .reports
            .newest(self.capabilities.sensed, now_ns, |buffer| {
                read(buffer).map_err(DeviceError::Disconnected)
            });
        if let Err(DeviceError::Disconnected(number)) = result {
            self.gone = Some(number);
            self.writer.lose();
        }
        result
    }

    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        if let Some(number) = self.gone {
            return Err(DeviceError::Disconnected(number));
        }
        match self.reports.command(wrench, now_ns) {
            Some(command) => self.writer.hand_on(numbered(&command)),
            None => Ok(()),
        }
    }

    fn motion_to_force_ns(&self) -> Option<u64> {
        self.reports.shown_ns()
    }

    fn refused_wrenches(&self) -> Option<u64> {
        Some(self.reports.refused_by_device)
    }
}

/// A session that no other host has, but by chance: the standard library draws the keys of its hashes at random.
pub(crate) fn session() -> NonZeroU32 {
    let number = RandomState::new().hash_one(0_u8);
    NonZeroU32::new(number as u32).unwrap_or(NonZeroU32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::Freedom;

    #[test]
    fn a_missing_device_is_named_with_a_remedy() {
        // Vendor 0 is not assigned.
        let selector = HidSelector::parse("0000:0bad:left").expect("an address");
        let capabilities = Capabilities {
            sensed: Freedom::Three,
            actuated: Freedom::Three,
            max_force: 1.0,
            max_moment: 0.0,
            workspace_radius: 0.1,
            position_step: 1e-5,
        };
        match HidDevice::open(&selector, capabilities, 0) {
            Ok(_) => panic!("no such device exists"),
            Err(error @ HidError::NotFound { .. }) => {
                let text = error.to_string();
                assert!(
                    text.contains("0000:0bad") && text.contains("\"left\""),
                    "{text}"
                );
                assert!(text.contains("lsusb"), "{text}");
            }
            // A system without sysfs lists no devices at all.
            Err(error) => assert!(matches!(error, HidError::System(_)), "{error}"),
        }
    }

    #[test]
    fn a_device_that_may_not_be_opened_comes_with_its_udev_rule() {
        let error = HidError::Open {
            selector: HidSelector::parse("1209:c0de").expect("an address"),
            path: "/dev/hidraw3".into(),
            source: std::io::ErrorKind::PermissionDenied.into(),
        };
        let text = error.to_string();
        for part in [
            "1209:c0de",
            "/dev/hidraw3",
            "ATTRS{idVendor}==\"1209\"",
            "permission denied",
        ] {
            assert!(text.contains(part), "{part} in {text}");
        }
    }
}
