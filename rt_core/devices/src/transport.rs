//! Transports carry bytes to and from a device: one interface for the reports of HID and for streams of bytes (pty,
//! TCP, tty, USB serial).
//!
//! A transport may block, so only the device's own thread calls it ([`crate::exchange`]), never the tick. A transport
//! knows no protocol. A protocol takes any transport, so a test can replace the kernel.

mod hidraw;
mod packets;
mod stream;

pub use hidraw::Hidraw;
pub use packets::Packets;
pub use stream::Stream;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::FlockOperation;
use rustix::io::Errno;
use std::os::fd::AsFd;
use std::time::Duration;

/// Longest time that a write waits for room. A device that takes no bytes for this time is stuck.
const WRITE: Duration = Duration::from_millis(100);

/// A connection to a device. Errors are error numbers of the system (`ENODEV` if the device is gone), because the
/// hot path formats and allocates nothing.
pub trait Transport: Send {
    /// Waits for bytes from the device, at most for `wait`, and fills `buffer` from its start. Returns the number of
    /// bytes; zero if none came in time. HID gives one report a call, and truncates a report that is longer than the
    /// buffer. A stream gives the bytes that have come, which may be a part of a packet, or several packets.
    ///
    /// # Errors
    /// The error number of the system.
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32>;

    /// Sends all of `bytes`. On HID, the bytes are one report, without a report number.
    ///
    /// # Errors
    /// The error number of the system.
    fn write(&mut self, bytes: &[u8]) -> Result<(), i32>;
}

impl<T: Transport + ?Sized> Transport for &mut T {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        (**self).read(buffer, wait)
    }
    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        (**self).write(bytes)
    }
}

impl<T: Transport + ?Sized> Transport for Box<T> {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        (**self).read(buffer, wait)
    }
    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        (**self).write(bytes)
    }
}

/// Locks the file of a device for this opening alone. Unlike the kernel's exclusive mode of terminals, the lock also keeps
/// a second run of root away.
fn lock(file: &impl AsFd) -> std::io::Result<()> {
    match rustix::fs::flock(file, FlockOperation::NonBlockingLockExclusive) {
        Err(Errno::WOULDBLOCK) => Err(Errno::BUSY.into()),
        result => Ok(result?),
    }
}

/// The number of bytes of a read that does not wait; zero if nothing waits.
fn now(result: Result<usize, Errno>) -> Result<usize, i32> {
    match result {
        Ok(count) => Ok(count),
        Err(Errno::AGAIN | Errno::INTR) => Ok(0),
        Err(error) => Err(error.raw_os_error()),
    }
}

/// Waits until a file is ready for `events`, at most for `wait`. Returns whether the file is ready. A file whose other
/// end is gone counts as ready: the next call returns its error.
pub(crate) fn wait_for(file: &impl AsFd, events: PollFlags, wait: Duration) -> Result<bool, i32> {
    let wait = Timespec::try_from(wait).unwrap_or(Timespec {
        tv_sec: i64::MAX,
        tv_nsec: 0,
    });
    match poll(&mut [PollFd::new(file, events)], Some(&wait)) {
        Ok(ready) => Ok(ready > 0),
        Err(Errno::INTR) => Ok(false),
        Err(error) => Err(error.raw_os_error()),
    }
}

/// Writes all bytes, and waits up to [`WRITE`] for room.
fn write_all(file: &impl AsFd, mut bytes: &[u8]) -> Result<(), i32> {
    while !bytes.is_empty() {
        match rustix::io::write(file, bytes) {
            Ok(count) => bytes = bytes.get(count..).unwrap_or_default(),
            Err(Errno::INTR) => {}
            Err(Errno::AGAIN) => {
                if !wait_for(file, PollFlags::OUT, WRITE)? {
                    return Err(Errno::TIMEDOUT.raw_os_error());
                }
            }
            Err(error) => return Err(error.raw_os_error()),
        }
    }
    Ok(())
}
