//! Real devices that speak the firmware protocol over a stream of bytes: a serial line, a pty, TCP.
//!
//! - [`Serial`]: the exchange with a device, over any transport, with [`firmware_proto::host::Host`] and
//!   [`firmware_proto::stream`].
//! - [`Tty`], [`Tcp`]: the drivers `tty` and `tcp`, which open the device that a scene names.
//!
//! The device sends its states by itself. An exchange sends the wrench, and takes the newest state that has come. The
//! rules for reports are those of HID ([`crate::hid`]): the same bytes are a state, missing or corrupt.
//!
//! The device states its own limits when it is greeted. These limits must agree with the profile that the scene names.
//! With another device's profile, a controller would rely on a mass and on a damping that the device does not have.

pub mod connect;
mod exchange;

pub use connect::{Tcp, Tty};
pub use exchange::{GREETING_NS, SILENT_PERIODS, Serial};
