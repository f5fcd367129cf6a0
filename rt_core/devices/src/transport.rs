//! How bytes reach a device: one interface for the reports of HID and for streams of bytes (pty, TCP, tty, USB serial).
//!
//! A transport may block, so only a thread of its own calls it ([`crate::exchange`]), never the tick. A transport knows
//! no protocol. A protocol takes any transport, so a test can take the place of the kernel.

use std::time::Duration;

/// A connection to a device. Errors are error numbers of the system (`ENODEV` where the device is gone), because the
/// hot path formats and allocates nothing.
pub trait Transport: Send {
    /// Waits for bytes from the device, at most for `wait`, and fills `buffer` from its start. Returns the number of
    /// bytes; zero where none came in time. HID gives one report a call and cuts a longer report off. A stream gives
    /// the bytes that are there, which may be a part of a packet, or several packets.
    ///
    /// # Errors
    /// The error number of the system.
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32>;

    /// Sends all of `bytes`. On HID they are one report, without a report number.
    ///
    /// # Errors
    /// The error number of the system.
    fn write(&mut self, bytes: &[u8]) -> Result<(), i32>;
}

impl<T: Transport + ?Sized> Transport for Box<T> {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        (**self).read(buffer, wait)
    }
    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        (**self).write(bytes)
    }
}
