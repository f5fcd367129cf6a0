//! The 64-byte reports that are exchanged every tick: the device's state, and the wrench to apply.
//!
//! Each report fits one USB HID interrupt transfer at full speed. Reports are unnumbered: the 64 bytes are the whole
//! payload. The report number 0, which operating systems put before an outgoing report, is not among them. All numbers
//! are little-endian; signed numbers are in two's complement.
//!
//! Every report, in every version of this protocol:
//!
//! | offset | bytes | field                                                     |
//! |-------:|------:|-----------------------------------------------------------|
//! |      0 |     1 | version of the protocol, now [`VERSION`]                  |
//! |      1 |     1 | kind of report, see [`Kind`]                              |
//! |      2 |     2 | sequence number, `u16`, plus one each report, wraps       |
//! |     62 |     2 | CRC-16/IBM-3740 of bytes 0 to 61, `u16`                   |
//!
//! [`StateReport`], device to host:
//!
//! | offset | bytes | field                                                     |
//! |-------:|------:|-----------------------------------------------------------|
//! |      4 |     4 | device time, `u32`, µs, wraps after 71.6 minutes          |
//! |      8 |    12 | position x, y, z, `i32`, 0.1 µm                           |
//! |     20 |     8 | orientation w, x, y, z, `i16`, unit quaternion of 32767   |
//! |     28 |    12 | linear velocity x, y, z, `i32`, µm/s                      |
//! |     40 |     6 | angular velocity x, y, z, `i16`, mrad/s                   |
//! |     46 |     2 | buttons, `u16`, bit 0 is the first button                 |
//! |     48 |     1 | status, see [`status`]                                    |
//! |     49 |    13 | reserved, zero                                            |
//!
//! [`WrenchReport`], host to device:
//!
//! | offset | bytes | field                                                     |
//! |-------:|------:|-----------------------------------------------------------|
//! |      4 |    12 | force x, y, z, `i32`, µN                                  |
//! |     16 |    12 | moment x, y, z, `i32`, µN·m                               |
//! |     28 |     1 | flags, see [`flags`]                                      |
//! |     29 |    33 | reserved, zero                                            |
//!
//! The check sum has the polynomial x^16 + x^12 + x^5 + 1 (0x1021), starts at 0xFFFF, and is not reflected. It finds
//! every error of up to three bits in reports of this length (Koopman, "Best CRC Polynomials": up to 32751 bits).
//! Because of the start at 0xFFFF, a report of zeros, which a stalled device may send, has a wrong check sum.
//!
//! The structure follows smoltcp's `wire`: offsets of fields, a checked view over bytes, and a plain struct.

mod error;
mod state;
mod units;
mod wire;
mod wrench;

pub use error::{Field, ReportError};
pub use state::{StateReport, StateSi, StateView, status};
pub use wrench::{WrenchReport, WrenchSi, WrenchView, flags};

/// The length of every report in bytes.
pub const LENGTH: usize = 64;
/// The version of the protocol that this crate implements.
pub const VERSION: u8 = 1;

/// The kinds of report, each with its number in a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// [`StateReport`], device to host.
    State = 0x01,
    /// [`WrenchReport`], host to device.
    Wrench = 0x81,
}
