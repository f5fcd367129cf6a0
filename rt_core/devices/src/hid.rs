//! A real device over USB HID, through the kernel's hidraw.
//!
//! - **Reading** drains the kernel's queue to its newest report in each tick. The queue holds 64 reports and drops the
//!   newest when it is full, so a report left in the queue would make the force lag.
//! - **Writing** is the task of a separate thread for each device (`writer`), because the kernel makes a writer wait
//!   for the device, for up to five seconds.
//!
//! The driver greets the device with a hello when it opens the device. Until the device has answered, hellos replace
//! wrenches. The driver greets a restarted device in the same way. Each wrench names the newest state that the driver
//! has read ([`firmware_proto::host`]).
//!
//! The answer states the capabilities of the device. If these disagree with the profile, the driver refuses to open the
//! device ([`stated`](crate::stated)). A device whose answer comes later, or that comes back as another device, is
//! lost: it gets no wrench before its answer agrees.
//!
//! A device that disappears is opened again by the writing thread as soon as it is back, without a restart of the run.
//! Its selector finds it again, so a device that was opened by its numbers may come back under another path, and a device
//! that was opened by its path under the same path.
//!
//! The bytes pass through two functions ([`HidDevice::over`]), so that a test can take the place of hidraw.
//!
//! The hot path consists of `read` until the queue is empty, one copy into a ring, and one wake-up. It never allocates,
//! not even in the tick in which the device disappears.

mod driver;
mod reading;
mod selector;
mod tick_end;
mod writer;
mod writing;

use crate::firmware::{GreetingError, check, session};
use crate::found::{FindError, udev_rule};
use crate::stated::Name;
use crate::transport::{Hidraw, Transport};
use firmware_proto::host::release;
use firmware_proto::report::{FirmwareVersion, Model};
use reading::numbered;
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Wrench};
use runner::schedule::DEVICE_PRIORITY;
use std::path::Path;
use std::time::{Duration, Instant};
use writer::{Open, Write, Writer};

pub use driver::Hid;
pub use reading::{Command, QUEUE, Reports};
pub use selector::HidSelector;
pub use tick_end::TickEnd;
pub use writing::{Step, Writing};

/// Error number of a device that is not connected (ENODEV).
const NO_DEVICE: i32 = 19;

/// Time within which a device should answer the greeting. A device that is silent for longer may still be starting.
const GREETING: Duration = Duration::from_secs(1);
/// Time between two looks for the answer.
const LOOK: Duration = Duration::from_millis(1);

/// The reason why a device could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum HidError {
    /// There is not exactly one such device.
    #[error(transparent)]
    Find(#[from] FindError),
    /// The device is not that of its profile.
    #[error(transparent)]
    Profile(#[from] GreetingError),
    /// The device is connected but cannot be opened.
    #[error(
        "the HID device {selector} is connected as {path} but cannot be opened: {source}. {}",
        advice(source, &selector.udev())
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

/// Fills a buffer with the next report that waits. Returns the length of the report, zero if no report waits, or the
/// error number of the system. Never waits.
pub type ReadReport = dyn FnMut(&mut [u8]) -> Result<usize, i32> + Send;
/// Writes a command, or returns the error number of the system. May block.
pub type WriteReport = dyn FnMut(&Command) -> Result<(), i32> + Send;

/// The remedy if a device cannot be opened. `rule` is the beginning of its udev rule.
pub(crate) fn advice(error: &std::io::Error, rule: &str) -> String {
    match error.kind() {
        std::io::ErrorKind::ResourceBusy => "Another run has it open; end that run".to_owned(),
        _ => udev_rule(rule),
    }
}

/// An open device. Dropping it sends a last command of zero force, and waits until that command is written, at most
/// five seconds.
pub struct HidDevice {
    /// `None` while the device is lost.
    read: Option<Box<ReadReport>>,
    writer: Writer<Command, Box<ReadReport>>,
    end: TickEnd,
    /// The version of its firmware, as it stated it when it was opened.
    firmware: Option<FirmwareVersion>,
}

/// The two ends of an open device.
type Ends = (Box<ReadReport>, Write<Command>);

/// Opens the reading end and the writing end of the device that is selected.
fn ends(selector: &HidSelector) -> Result<Ends, HidError> {
    let path = selector.find(Path::new("/"))?.file;
    let open = || {
        let input = Hidraw::open(&path)?;
        let output = input.try_clone()?;
        Ok((input, output))
    };
    let (input, mut output) = open().map_err(|source| HidError::Open {
        selector: selector.clone(),
        path: path.display().to_string(),
        source,
    })?;
    let read = move |buffer: &mut [u8]| input.read_now(buffer);
    // The transport puts the report number 0 before the report itself.
    let write = move |report: &Command| output.write(report.get(1..).unwrap_or_default());
    Ok((Box::new(read), Box::new(write)))
}

/// Greets a device, and waits for its answer, for a second at most. Returns its statements; `None` if the device did
/// not answer.
fn answer(
    (read, write): &mut Ends,
    profile: &Capabilities,
    watchdog_us: u32,
) -> Result<Option<Model>, GreetingError> {
    let mut reports = Reports::new(session(), watchdog_us);
    let start = Instant::now();
    while start.elapsed() < GREETING {
        let now_ns = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        // A failure here occurs again in the ticks, which report it.
        if let Some(hello) = reports.command(&Wrench::zero(), now_ns) {
            let _ = write(&numbered(&hello));
        }
        let _ = reports.newest(profile.sensed, now_ns, |buffer| {
            read(buffer).map_err(DeviceError::Disconnected)
        });
        if let Some(report) = reports.host().capabilities() {
            check(&report.model, profile)?;
            return Ok(Some(report.model));
        }
        std::thread::sleep(LOOK);
    }
    Ok(None)
}

impl HidDevice {
    /// Opens the one device that `selector` names. `capabilities` are those of its profile, and `watchdog_us` is
    /// the watchdog that it is asked for (see [`firmware_proto::report::HelloReport::watchdog_us`]). The thread that writes
    /// takes `priority` under SCHED_FIFO. Waits for the answer of the device, for a second at most.
    ///
    /// # Errors
    /// [`HidError`], which names the device and the checks that the user can make.
    pub fn open(
        selector: &HidSelector,
        capabilities: Capabilities,
        watchdog_us: u32,
        priority: u8,
    ) -> Result<Self, HidError> {
        let mut first = ends(selector)?;
        let model = answer(&mut first, &capabilities, watchdog_us)?;
        let again = selector.clone();
        // The thread needs a number only.
        let open = move || ends(&again).map_err(|_| NO_DEVICE);
        let device = Self::start(
            first,
            Box::new(open),
            capabilities,
            watchdog_us,
            model,
            priority,
        );
        device.map_err(|source| HidError::Thread {
            selector: selector.clone(),
            source,
        })
    }

    /// The name of the device's model; `None` before its first answer.
    pub fn name(&self) -> Option<Name> {
        self.end.name
    }

    /// The version of the device's firmware, as it stated it when it was opened.
    pub fn firmware(&self) -> Option<FirmwareVersion> {
        self.firmware
    }

    /// A device whose reports come from `read`, and whose commands go to `write` in a separate thread. `write` may
    /// block, and is called once, with the first hello, before this function returns. Either function returns the error
    /// number of the system if the device is disconnected. The device is asked for its own watchdog.
    ///
    /// # Errors
    /// The error of the system, if it gave no thread for writing.
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
            None,
            DEVICE_PRIORITY,
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
        Self::start(
            first,
            Box::new(open),
            capabilities,
            0,
            None,
            DEVICE_PRIORITY,
        )
    }

    /// Starts the thread of a device that is open, and which has stated this model if it has been greeted before.
    fn start(
        (read, mut write): Ends,
        open: Open<Command, Box<ReadReport>>,
        capabilities: Capabilities,
        watchdog_us: u32,
        model: Option<Model>,
        priority: u8,
    ) -> std::io::Result<Self> {
        let session = session();
        let name = model.map(|model| Name(model.name));
        let mut end = TickEnd::new(session, watchdog_us, capabilities, name);
        // If this write fails, the tick greets the device again, and reports the failure.
        let _ = write(&numbered(&end.greet()));
        let let_go = numbered(&release(session.get(), 0));
        Ok(Self {
            read: Some(read),
            writer: Writer::start(write, let_go, open, priority)?,
            end,
            firmware: model.map(|model| model.firmware),
        })
    }

    /// Counts of the reports so far, and the device's status.
    pub fn reports(&self) -> &Reports {
        &self.end.reports
    }
}

impl Device for HidDevice {
    fn capabilities(&self) -> Capabilities {
        self.end.capabilities
    }

    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        if let Some(error) = self.end.lost() {
            let Some(read) = self.writer.found() else {
                return Err(error);
            };
            self.read = Some(read);
            self.end.reopened();
        }
        let read = &mut self.read;
        let result = self.end.read(now_ns, |buffer| match read {
            Some(read) => read(buffer),
            None => Err(NO_DEVICE),
        });
        if self.end.lost().is_some() {
            self.writer.lose(&mut self.read);
        }
        result
    }

    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        match self.end.command(now_ns, wrench)? {
            Some(command) => self.writer.hand_on(numbered(&command)),
            None => Ok(()),
        }
    }

    fn motion_to_force_ns(&self) -> Option<u64> {
        self.end.reports.shown_ns()
    }

    fn refused_wrenches(&self) -> Option<u64> {
        Some(self.end.refused_wrenches())
    }
}

#[cfg(test)]
mod tests;
