//! The 64-byte reports that host and device exchange.
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
//! Each side counts all its reports, of every kind, in one sequence. Every report of version 2:
//!
//! | offset | bytes | field                                                     |
//! |-------:|------:|-----------------------------------------------------------|
//! |      4 |     4 | session, `u32`: chosen by the host, zero is no session    |
//!
//! [`HelloReport`], host to device:
//!
//! | offset | bytes | field                                                     |
//! |-------:|------:|-----------------------------------------------------------|
//! |      0 |     1 | oldest version that the host speaks                       |
//! |      8 |     1 | newest version that the host speaks                       |
//! |      9 |     3 | reserved, zero                                            |
//! |     12 |     4 | wanted watchdog, `u32`, µs, zero for the device's own     |
//! |     16 |    46 | reserved, zero                                            |
//!
//! [`WrenchReport`], host to device:
//!
//! | offset | bytes | field                                                     |
//! |-------:|------:|-----------------------------------------------------------|
//! |      8 |     2 | sequence number of the state that it answers, `u16`       |
//! |     10 |     1 | flags, see [`flags`]                                      |
//! |     11 |     1 | reserved, zero                                            |
//! |     12 |    12 | force x, y, z, `i32`, µN                                  |
//! |     24 |    12 | moment x, y, z, `i32`, µN·m                               |
//! |     36 |    26 | reserved, zero                                            |
//!
//! [`StateReport`] and [`EncodersReport`], device to host, both begin with the device's [`Condition`]:
//!
//! | offset | bytes | field                                                     |
//! |-------:|------:|-----------------------------------------------------------|
//! |      8 |     4 | device time, `u32`, µs, wraps after 71.6 minutes          |
//! |     12 |     4 | device time of the last change of the force, `u32`, µs    |
//! |     16 |     2 | sequence number of the wrench in force, `u16`             |
//! |     18 |     2 | buttons, `u16`, bit 0 is the first button                 |
//! |     20 |     1 | status, see [`status`]                                    |
//! |     21 |     1 | mode of the device, see [`Mode`]                          |
//! |     22 |     1 | count of refused reports, `u8`, wraps                     |
//! |     23 |     1 | fault, zero for none, see [`fault`]                       |
//!
//! [`StateReport`]:
//!
//! | offset | bytes | field                                                     |
//! |-------:|------:|-----------------------------------------------------------|
//! |     24 |    12 | position x, y, z, `i32`, 0.1 µm                           |
//! |     36 |     8 | orientation w, x, y, z, `i16`, unit quaternion of 32767   |
//! |     44 |    12 | linear velocity x, y, z, `i32`, µm/s                      |
//! |     56 |     6 | angular velocity x, y, z, `i16`, mrad/s                   |
//!
//! [`EncodersReport`]:
//!
//! | offset | bytes | field                                                     |
//! |-------:|------:|-----------------------------------------------------------|
//! |     24 |    32 | counts of encoders 0 to 7, `i32`; zero if there is none   |
//! |     56 |     1 | number of encoders, 1 to 8                                |
//! |     57 |     5 | reserved, zero                                            |
//!
//! [`CapabilitiesReport`], device to host, the answer to a hello:
//!
//! | offset | bytes | field                                                     |
//! |-------:|------:|-----------------------------------------------------------|
//! |      8 |     2 | sequence number of the hello that it answers, `u16`       |
//! |     10 |     1 | axes that the device senses, see [`axes`]                 |
//! |     11 |     1 | axes that the device actuates, see [`axes`]               |
//! |     12 |     4 | version of the firmware: major `u8`, minor `u8`, patch `u16` |
//! |     16 |     4 | largest force, `u32`, µN                                  |
//! |     20 |     4 | largest moment, `u32`, µN·m                               |
//! |     24 |     4 | radius of the workspace, `u32`, 0.1 µm                    |
//! |     28 |     4 | position step, `u32`, nm                                  |
//! |     32 |     2 | least rate of states, `u16`, Hz                           |
//! |     34 |     2 | greatest rate of states, `u16`, Hz                        |
//! |     36 |     4 | watchdog in force, `u32`, µs                              |
//! |     40 |     4 | device time at which the hello came, `u32`, µs            |
//! |     44 |     1 | kind of its states: that of [`StateReport`] or [`EncodersReport`] |
//! |     45 |     1 | number of encoders, zero for a device that sends poses    |
//! |     46 |    16 | name of the model, printable ASCII, zeros at its end      |
//!
//! [`GeometryReport`], device to host, follows the capabilities of a device that sends counts:
//!
//! | offset | bytes | field                                                     |
//! |-------:|------:|-----------------------------------------------------------|
//! |      8 |     2 | kinematics, `u16`, see [`kinematics`]                     |
//! |     10 |     1 | number of parameters, 0 to 12                             |
//! |     11 |     1 | reserved, zero                                            |
//! |     12 |    48 | parameters 0 to 11, `i32`, 0.1 µm or 0.1 µrad; zero if there is none |
//! |     60 |     2 | reserved, zero                                            |
//!
//! [`JointReport`], device to host, one for each encoder, follows the geometry:
//!
//! | offset | bytes | field                                                     |
//! |-------:|------:|-----------------------------------------------------------|
//! |      8 |     1 | encoder, 0 to 7                                           |
//! |      9 |     1 | quantity: 0 an angle (rad), 1 a length (m)                |
//! |     10 |     2 | reserved, zero                                            |
//! |     12 |     8 | counts per rad or m, `i64`, 0.000001; negative if the count falls as the quantity grows |
//! |     20 |     4 | angle or length at count zero, `i32`, 0.1 µrad or 0.1 µm  |
//! |     24 |    38 | reserved, zero                                            |
//!
//! Reserved bytes, and bits of status and flags that this version does not define, are zero. A receiver refuses a
//! report in which they are not zero. A new field therefore needs a new version.
//!
//! The check sum has the polynomial x^16 + x^12 + x^5 + 1 (0x1021), starts at 0xFFFF, and is not reflected. It finds
//! every error of up to three bits in reports of this length (Koopman, "Best CRC Polynomials": up to 32751 bits).
//! A stalled device may send a report of zeros. Because of the start at 0xFFFF, such a report has a wrong check sum.

mod capabilities;
mod condition;
mod encoders;
mod error;
mod geometry;
mod hello;
mod state;
mod units;
mod wire;
mod wrench;

#[cfg(test)]
mod tests;

pub use capabilities::{CapabilitiesReport, FirmwareVersion, Model, Sends, axes};
pub use condition::{Condition, Mode, fault, status};
pub use encoders::{ENCODERS, EncodersReport};
pub use error::{Field, ReportError};
pub use geometry::{GeometryReport, JointReport, PARAMETERS, Quantity, kinematics};
pub use hello::{HelloReport, WATCHDOG_LEAST_US, WATCHDOG_MOST_US, WATCHDOG_US};
pub use state::{StateReport, StateSi};
pub use wrench::{WrenchReport, WrenchSi, flags};

/// The length of every report in bytes.
pub const LENGTH: usize = 64;
/// The version of the protocol that this crate implements.
pub const VERSION: u8 = 2;

/// The kinds of report, each with its number in a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// [`StateReport`], device to host.
    State = 0x01,
    /// [`EncodersReport`], device to host.
    Encoders = 0x02,
    /// [`CapabilitiesReport`], device to host.
    Capabilities = 0x03,
    /// [`GeometryReport`], device to host.
    Geometry = 0x04,
    /// [`JointReport`], device to host.
    Joint = 0x05,
    /// [`WrenchReport`], host to device.
    Wrench = 0x81,
    /// [`HelloReport`], host to device.
    Hello = 0x82,
}

impl Kind {
    /// The kind of a number; `None` if this version has no such kind.
    pub fn of(number: u8) -> Option<Self> {
        const ALL: [Kind; 7] = [
            Kind::State,
            Kind::Encoders,
            Kind::Capabilities,
            Kind::Geometry,
            Kind::Joint,
            Kind::Wrench,
            Kind::Hello,
        ];
        ALL.into_iter().find(|&kind| kind as u8 == number)
    }
}

/// A report of any kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Report {
    /// The pose of a device.
    State(StateReport),
    /// The counts of a device's encoders.
    Encoders(EncodersReport),
    /// The capabilities of a device.
    Capabilities(CapabilitiesReport),
    /// The kinematics of a device that sends counts.
    Geometry(GeometryReport),
    /// One encoder of a device that sends counts.
    Joint(JointReport),
    /// The wrench to apply.
    Wrench(WrenchReport),
    /// The host's greeting.
    Hello(HelloReport),
}

impl Report {
    /// The report in `bytes`, whatever its kind.
    ///
    /// # Errors
    /// The first [`ReportError`] found, in the order of the enum's variants.
    pub fn decode(bytes: &[u8]) -> Result<Self, ReportError> {
        let (_, kind) = wire::check_any(bytes)?;
        match kind {
            Kind::State => StateReport::decode(bytes).map(Self::State),
            Kind::Encoders => EncodersReport::decode(bytes).map(Self::Encoders),
            Kind::Capabilities => CapabilitiesReport::decode(bytes).map(Self::Capabilities),
            Kind::Geometry => GeometryReport::decode(bytes).map(Self::Geometry),
            Kind::Joint => JointReport::decode(bytes).map(Self::Joint),
            Kind::Wrench => WrenchReport::decode(bytes).map(Self::Wrench),
            Kind::Hello => HelloReport::decode(bytes).map(Self::Hello),
        }
    }

    /// The bytes of the report.
    pub fn encode(&self) -> [u8; LENGTH] {
        match self {
            Self::State(report) => report.encode(),
            Self::Encoders(report) => report.encode(),
            Self::Capabilities(report) => report.encode(),
            Self::Geometry(report) => report.encode(),
            Self::Joint(report) => report.encode(),
            Self::Wrench(report) => report.encode(),
            Self::Hello(report) => report.encode(),
        }
    }
}
