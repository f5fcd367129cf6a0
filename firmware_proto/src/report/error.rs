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
    /// The squared length of the orientation's four numbers; see
    /// [`StateReport::orientation`](super::StateReport::orientation).
    OrientationLength,
    /// The sum of the reserved bytes.
    Reserved,
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
                write!(f, "report of protocol version {found}, expected {VERSION}")
            }
            Self::Kind { expected, found } => {
                write!(
                    f,
                    "report of kind {found:#04x}, expected {:#04x}",
                    expected as u8
                )
            }
            Self::OutOfRange {
                field,
                least,
                most,
                found,
            } => {
                let field = match field {
                    Field::OrientationLength => "squared length of the orientation",
                    Field::Reserved => "sum of the reserved bytes",
                };
                write!(
                    f,
                    "report whose {field} is {found}, expected {least} to {most}"
                )
            }
        }
    }
}

impl core::error::Error for ReportError {}
