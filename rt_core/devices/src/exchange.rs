//! Devices that answer only when they are asked, or that may block: a thread of its own for each.

use rt_core::{DeviceError, DeviceState, Wrench};

/// A device that takes a wrench and answers with its state. The calls may block, for a bounded time.
pub trait Exchange: Send {
    /// Sends `wrench` (N, N m on the hand, device axes), and returns the newest state of the device.
    ///
    /// # Errors
    /// [`DeviceError::Disconnected`] where the device is gone: the thread then calls [`reopen`](Self::reopen) until the
    /// device is back. Any other error is one missing state.
    fn exchange(&mut self, wrench: &Wrench) -> Result<DeviceState, DeviceError>;

    /// Lets the device go: zero wrench, amplifiers off. Called at the end, whatever happened before.
    fn release(&mut self);

    /// Tries once to connect a lost device again, and brings it to the state in which it answers. Counters and clocks of
    /// the driver begin anew.
    ///
    /// # Errors
    /// As [`exchange`](Self::exchange).
    fn reopen(&mut self) -> Result<(), DeviceError>;
}
