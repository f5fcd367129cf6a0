//! Reports over the kernel's hidraw.
//!
//! `hidapi` lists the devices. Reading and writing need none of it: a hidraw device is a file, and one system call
//! passes one report. Its errors are numbers, so that nothing allocates where a device disappears.
//!
//! The kernel queues 64 reports for each open file and drops the newest when the queue is full. A write waits for the
//! device, for up to five seconds, whatever the flags of the file.

use super::{Transport, now, wait_for, write_all};
use rustix::event::PollFlags;
use std::fs::{File, OpenOptions};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::Duration;

/// Longest report that is written (bytes), with the report number.
const LONGEST: usize = 65;
/// Error number of a report that is too long (EMSGSIZE).
const TOO_LONG: i32 = 90;

/// An open hidraw device, whose reports are unnumbered.
#[derive(Debug)]
pub struct Hidraw {
    file: File,
}

impl Hidraw {
    /// Opens the device at `path`, such as `/dev/hidraw3`.
    ///
    /// # Errors
    /// The error of the system.
    pub fn open(path: &Path) -> std::io::Result<Self> {
        let flags = rustix::fs::OFlags::NONBLOCK.bits() as i32;
        let mut options = OpenOptions::new();
        let file = options
            .read(true)
            .write(true)
            .custom_flags(flags)
            .open(path)?;
        Ok(Self { file })
    }

    /// Fills `buffer` with the oldest report that waits, and returns its length; zero where none waits. Never waits, and
    /// never allocates: for the hot path.
    ///
    /// # Errors
    /// The error number of the system.
    pub fn read_now(&self, buffer: &mut [u8]) -> Result<usize, i32> {
        now(rustix::io::read(&self.file, buffer))
    }
}

impl Transport for Hidraw {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        if !wait_for(&self.file, PollFlags::IN, wait)? {
            return Ok(0);
        }
        self.read_now(buffer)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        // The report number 0, of unnumbered reports, comes first.
        let mut report = [0; LONGEST];
        let Some(length) = bytes.len().checked_add(1) else {
            return Err(TOO_LONG);
        };
        let Some(numbered) = report.get_mut(..length) else {
            return Err(TOO_LONG);
        };
        for (to, from) in numbered.iter_mut().skip(1).zip(bytes) {
            *to = *from;
        }
        write_all(&self.file, numbered)
    }
}
