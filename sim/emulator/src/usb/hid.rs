//! A HID device as a USB gadget: the kernel's function `hid`.
//!
//! The kernel has a file `/dev/hidgN` for the device. One read gives one report of the host, and one write sends one. The
//! kernel holds one report for the host at a time. The kernel refuses a write before the host has taken that report, so
//! a device that sends faster than its host reads loses reports, as real devices do.
//!
//! At high speed the host asks for a report every millisecond.

use super::gadget::{Function, Gadget, GadgetError, Numbers};
use crate::uhid::{self, Identity};
use devices::Transport;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use std::fs::{File, OpenOptions};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Time within which the file of the device must appear: a service of the system makes it.
const PATIENCE: Duration = Duration::from_secs(2);
/// Time between two looks for the file.
const LOOK: Duration = Duration::from_millis(20);
/// Release of the device: 1.0.
const RELEASE: u16 = 0x0100;

/// A HID gadget, which lives as long as this value.
#[derive(Debug)]
pub struct HidGadget {
    // The file is closed before the gadget is removed.
    file: File,
    _gadget: Gadget,
}

impl HidGadget {
    /// Makes a gadget with unnumbered reports of a vendor's own usage, and binds it to the first device controller that
    /// is free.
    ///
    /// # Errors
    /// [`GadgetError`], which names what is missing and the remedy.
    pub fn create(identity: &Identity) -> Result<Self, GadgetError> {
        let numbers = Numbers {
            vid: identity.vid,
            pid: identity.pid,
            release: RELEASE,
            manufacturer: "palpate".into(),
            product: identity.name.clone(),
            serial: identity.serial.clone(),
            full_speed: false,
        };
        let text = |number: u8| format!("{number}\n").into_bytes();
        let attributes = [
            ("protocol", text(0)),
            ("subclass", text(0)),
            ("report_length", text(identity.report)),
            ("report_desc", uhid::descriptor(identity.report)),
        ];
        let gadget = Gadget::new(&numbers, Function::Hid, &attributes)?;
        gadget.bind()?;
        let path = file_of(&gadget.attribute("dev")?);
        let file = open(&path).map_err(|source| GadgetError::NoFile { path, source })?;
        Ok(Self {
            file,
            _gadget: gadget,
        })
    }
}

/// The file of a device with the number `major:minor`.
fn file_of(number: &str) -> PathBuf {
    let minor = number.split_once(':').map_or(number, |(_, minor)| minor);
    Path::new("/dev").join(format!("hidg{minor}"))
}

/// Opens the file as soon as it is there and may be opened.
fn open(path: &Path) -> std::io::Result<File> {
    let flags = rustix::fs::OFlags::NONBLOCK.bits() as i32;
    let start = Instant::now();
    loop {
        let mut options = OpenOptions::new();
        let file = options
            .read(true)
            .write(true)
            .custom_flags(flags)
            .open(path);
        if file.is_ok() || start.elapsed() >= PATIENCE {
            return file;
        }
        std::thread::sleep(LOOK);
    }
}

impl Transport for HidGadget {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        let timeout = Timespec::try_from(wait).ok();
        match poll(
            &mut [PollFd::new(&self.file, PollFlags::IN)],
            timeout.as_ref(),
        ) {
            Ok(0) | Err(Errno::INTR) => return Ok(0),
            Ok(_) => {}
            Err(error) => return Err(error.raw_os_error()),
        }
        match rustix::io::read(&self.file, buffer) {
            Ok(count) => Ok(count),
            Err(Errno::AGAIN | Errno::INTR) => Ok(0),
            Err(error) => Err(error.raw_os_error()),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        match rustix::io::write(&self.file, bytes) {
            Ok(_) => Ok(()),
            Err(error) => Err(error.raw_os_error()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_is_that_of_the_minor_number() {
        assert_eq!(file_of("240:3"), Path::new("/dev/hidg3"));
    }
}
