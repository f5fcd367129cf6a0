//! Emulators: devices whose protocols are published, as far as their bytes and their timing, over a [`SimDevice`]
//! and the hand that holds it.
//!
//! A driver talks to an emulator as it talks to the device. An emulator has no thread and no clock: each call has the
//! time, and times never decrease.
//!
//! [`SimDevice`]: crate::SimDevice

pub mod falcon;

/// A device that takes bytes and gives bytes.
pub trait Emulator {
    /// Takes bytes that the host has sent (one report, or a part of a stream) at `now_ns`.
    fn receive(&mut self, bytes: &[u8], now_ns: u64);

    /// Fills `report` with the bytes that the device sends at `now_ns`, and returns their number; `None` where it sends
    /// nothing yet.
    fn send(&mut self, now_ns: u64, report: &mut [u8; 64]) -> Option<usize>;
}
