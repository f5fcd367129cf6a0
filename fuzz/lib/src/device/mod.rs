//! Devices under hostile bytes: their drivers, protocols, connections and profiles.
//!
//! The bytes of an input are both what a hostile device sends and when the device sends them. The rules are the same
//! everywhere:
//!
//! 1. No bytes make a parser or a driver panic.
//! 2. The work is bounded: a driver reads a bounded number of times before it returns.
//! 3. A state that is passed on is finite and within the reach of the device, and its clock never goes back.
//! 4. No bytes make a force: a device applies only an intact wrench of its session. A driver commands no more than it was
//!    asked for, and nothing while it does not know the position.
//!
//! Each function returns how often the input reached the part that the rules are about: a state that was passed on, or a
//! force that was applied.

mod boot;
mod falcon;
mod firmware_device;
mod firmware_host;
mod plugin_state;
mod text;
mod woodenhaptics;

pub use boot::falcon_boot;
pub use falcon::falcon;
pub use firmware_device::firmware_device;
pub use firmware_host::firmware_host;
pub use plugin_state::plugin_state;
pub use text::{connection, profile, sysfs};
pub use woodenhaptics::woodenhaptics;

/// The bytes of an input, read from the front. Behind the last byte there are zeros.
#[derive(Clone, Debug, Default)]
struct Input {
    bytes: Vec<u8>,
    at: usize,
}

impl Input {
    fn new(bytes: &[u8]) -> Self {
        Self {
            bytes: bytes.to_vec(),
            at: 0,
        }
    }

    /// Whether all bytes have been read.
    fn is_over(&self) -> bool {
        self.at >= self.bytes.len()
    }

    fn byte(&mut self) -> u8 {
        let byte = self.bytes.get(self.at).copied().unwrap_or_default();
        self.at += 1;
        byte
    }

    /// The next `N` bytes.
    fn array<const N: usize>(&mut self) -> [u8; N] {
        std::array::from_fn(|_| self.byte())
    }

    /// As many of the next `count` bytes as there are.
    fn some(&mut self, count: usize) -> Vec<u8> {
        let count = count.min(self.bytes.len().saturating_sub(self.at));
        (0..count).map(|_| self.byte()).collect()
    }

    fn u16(&mut self) -> u16 {
        u16::from_le_bytes(self.array())
    }

    fn i16(&mut self) -> i16 {
        i16::from_le_bytes(self.array())
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.array())
    }

    fn i32(&mut self) -> i32 {
        i32::from_le_bytes(self.array())
    }

    fn f64(&mut self) -> f64 {
        f64::from_le_bytes(self.array())
    }
}
