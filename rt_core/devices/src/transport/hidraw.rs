//! Reports over the kernel's hidraw.
//!
//! A hidraw device is a file, and one system call passes one report. Errors are numbers, so nothing allocates when a
//! device disappears. The file is locked, so no second run commands the device.
//!
//! The kernel queues 64 reports for each open file and drops the newest when the queue is full. A write waits for the
//! device, for up to five seconds, whatever the flags of the file.

use super::{Transport, lock, now, wait_for, write_all};
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
    /// The error of the system: `EBUSY` if another run has the device.
    pub fn open(path: &Path) -> std::io::Result<Self> {
        let flags = rustix::fs::OFlags::NONBLOCK.bits() as i32;
        let mut options = OpenOptions::new();
        let file = options
            .read(true)
            .write(true)
            .custom_flags(flags)
            .open(path)?;
        lock(&file)?;
        Ok(Self { file })
    }

    /// A second handle of the open device, for another thread. The kernel lets one thread read while another writes.
    ///
    /// # Errors
    /// The error of the system.
    pub fn try_clone(&self) -> std::io::Result<Self> {
        let file = self.file.try_clone()?;
        Ok(Self { file })
    }

    /// Fills `buffer` with the oldest report that waits, and returns its length; zero if no report waits. The function
    /// never waits and never allocates, so it suits the hot path.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_is_open_once_and_its_handles_are_one() {
        let path = std::env::temp_dir().join(format!("palpate-hidraw-{}", std::process::id()));
        std::fs::write(&path, "").expect("a temporary folder");
        let first = Hidraw::open(&path).expect("nobody has it");
        let second = first.try_clone().expect("a handle");
        // A read without a report must not hold up the tick.
        let flags = rustix::fs::fcntl_getfl(&first.file).expect("an open file");
        assert!(flags.contains(rustix::fs::OFlags::NONBLOCK));
        for _ in 0..2 {
            let refused = Hidraw::open(&path).expect_err("it is open");
            assert_eq!(refused.raw_os_error(), Some(16), "{refused}");
        }
        drop(first);
        assert!(Hidraw::open(&path).is_err());
        drop(second);
        assert!(Hidraw::open(&path).is_ok());
        std::fs::remove_file(&path).expect("ours");
    }
}
