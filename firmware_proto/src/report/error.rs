//! The reasons why bytes are not a valid report.

use super::{Kind, LENGTH, VERSION};
use core::fmt;

/// The reason why bytes are not a valid report. `Copy`, so that a realtime loop can keep and count it without
/// allocating.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReportError {
    /// The number of bytes is not [`LENGTH`].
    Length {
        /// The number of bytes.
        found: usize,
    },
    /// The check sum does not match: bytes were changed in transit.
    Crc {
        /// The check sum of the received bytes.
        expected: u16,
        /// The check sum in the report.
        found: u16,
    },
    /// The sender uses another version of the protocol than [`VERSION`].
    Version {
        /// The sender's version.
        found: u8,
    },
    /// The report is of another kind.
    Kind {
        /// The kind that was asked for.
        expected: Kind,
        /// The number of the received kind.
        found: u8,
    },
    /// This version has no report of that kind, or its receiver takes none.
    UnexpectedKind {
        /// The number of the received kind.
        found: u8,
    },
    /// The report is intact, but a field has a value that no sender should send.
    OutOfRange {
        /// The field.
        field: Field,
        /// The least value allowed.
        least: u64,
        /// The greatest value allowed.
        most: u64,
        /// The value found.
        found: u64,
    },
}

/// A field that can be out of range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// The session number of a report to a device, which is never zero.
    Session,
    /// The squared length of the orientation's four numbers; see
    /// [`StateReport::orientation`](super::StateReport::orientation).
    OrientationLength,
    /// The bits of the status.
    Status,
    /// The mode of the device.
    Mode,
    /// The fault of the device, which is zero in every mode but that of a fault.
    Fault,
    /// The bits of the flags.
    Flags,
    /// The newest version that a host speaks.
    Newest,
    /// The watchdog (µs).
    Watchdog,
    /// The bits of the axes.
    Axes,
    /// The rate of states (Hz).
    Rate,
    /// The kind of the device's states.
    Sends,
    /// The number of encoders.
    Encoders,
    /// The number of counts, or parameters, behind the last one, that are not zero.
    Unused,
    /// The number of bytes in the name of the model that are no printable ASCII.
    Name,
    /// The number of parameters of the geometry.
    Parameters,
    /// The number of the encoder.
    Encoder,
    /// The quantity that an encoder measures.
    Quantity,
    /// The size of the counts per unit of an encoder.
    Scale,
    /// The sum of the reserved bytes.
    Reserved,
}

impl Field {
    /// The field in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Session => "session",
            Self::OrientationLength => "squared length of the orientation",
            Self::Status => "status",
            Self::Mode => "mode",
            Self::Fault => "fault",
            Self::Flags => "flags",
            Self::Newest => "newest version",
            Self::Watchdog => "watchdog",
            Self::Axes => "axes",
            Self::Rate => "rate of states",
            Self::Sends => "kind of states",
            Self::Encoders => "number of encoders",
            Self::Unused => "count of unused numbers that are not zero",
            Self::Name => "count of bytes in the name that are no printable ASCII",
            Self::Parameters => "number of parameters",
            Self::Encoder => "encoder",
            Self::Quantity => "quantity",
            Self::Scale => "size of the counts per unit",
            Self::Reserved => "sum of the reserved bytes",
        }
    }
}

impl fmt::Display for ReportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Length { found } => {
                write!(f, "report of {found} bytes, expected {LENGTH}")
            }
            Self::Crc { expected, found } => {
                write!(
                    f,
                    "report with check sum {found:#06x}, expected {expected:#06x}"
                )
            }
            Self::Version { found } => {
                write!(
                    f,
                    "report of protocol version {found}, expected {VERSION}: "
                )?;
                if found < VERSION {
                    write!(
                        f,
                        "its sender is older; update it, or use a peer of version {found}"
                    )
                } else {
                    write!(
                        f,
                        "its sender is newer; update this side, or use a peer of version {VERSION}"
                    )
                }
            }
            Self::Kind { expected, found } => {
                write!(
                    f,
                    "report of kind {found:#04x}, expected {:#04x}",
                    expected as u8
                )
            }
            Self::UnexpectedKind { found } => {
                write!(
                    f,
                    "report of kind {found:#04x}, which this side does not take"
                )
            }
            Self::OutOfRange {
                field,
                least,
                most,
                found,
            } => {
                let field = field.name();
                write!(
                    f,
                    "report whose {field} is {found}, expected {least} to {most}"
                )
            }
        }
    }
}

impl core::error::Error for ReportError {}
