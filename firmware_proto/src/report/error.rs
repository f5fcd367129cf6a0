//! Why bytes are no report.

use super::{Kind, LENGTH, VERSION};
use core::fmt;

/// Why bytes are no report. `Copy`, so that a realtime loop can keep and count it without allocating.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReportError {
    /// There are not exactly [`LENGTH`] bytes.
    Length {
        /// How many there are.
        found: usize,
    },
    /// The check sum does not match: bytes were changed on the way.
    Crc {
        /// The sum of the bytes that came.
        expected: u16,
        /// The sum that came with them.
        found: u16,
    },
    /// The sender speaks another version of the protocol than [`VERSION`].
    Version {
        /// The sender's version.
        found: u8,
    },
    /// It is another kind of report.
    Kind {
        /// The kind that was asked for.
        expected: Kind,
        /// The number of the kind that came.
        found: u8,
    },
    /// A field came whole but holds what no sender should send.
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
