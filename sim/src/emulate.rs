//! Emulated devices: the device's side of a protocol, published or our own, over a simulated device and its hand.
//!
//! An emulator takes the bytes that a driver sends and gives the bytes that a driver reads. A test can therefore put an
//! emulator behind any transport: in memory under virtual time, or behind the kernel.
#![cfg_attr(
    not(test),
    deny(
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used,
    )
)]

pub mod falcon;
pub mod firmware;
pub mod operated;
pub mod woodenhaptics;

pub use firmware::{Firmware, Framing};
pub use operated::Operated;
pub use woodenhaptics::WoodenHaptics;

/// The device's end of a connection. Times are of one clock and do not go back. An earlier time counts as the latest
/// time so far.
pub trait Emulator {
    /// Takes bytes from the host, one report if the connection has reports. Any bytes may come.
    fn receive(&mut self, bytes: &[u8], now_ns: u64);

    /// Fills the start of `report` with the next bytes for the host, and returns their number; `None` if there are no
    /// bytes to send at that time. Call this until it returns `None`.
    fn send(&mut self, now_ns: u64, report: &mut [u8; 64]) -> Option<usize>;
}
