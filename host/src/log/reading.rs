//! A device's reading in a tick, as the log keeps it. A run is replayed from these readings.
//!
//! The message ([`super::tick`]) has the reason why there was no state (`status`), and what the device said of its wrenches
//! (`rendering`, `fault`).

use std::fmt;

use rt_core::controller::Reading;
use rt_core::{Corruption, DeviceError, DeviceState, Rendering};

use super::cdr::{CdrReader, CdrWriter};

/// A device's state (device axes), or the reason why there was none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoggedReading(pub Result<DeviceState, ReadFault>);

/// The reason why a device gave no state: [`DeviceError`] without its details.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadFault {
    /// No new report since the last read.
    NoReport,
    /// The device was disconnected. Holds the system's error number.
    Disconnected(i32),
    /// The device was busy.
    Busy,
    /// A report of a wrong length.
    BadLength,
    /// A report with a wrong check sum: its bytes changed in transit.
    BadCheckSum,
    /// A report of another version of the protocol.
    BadVersion,
    /// A report of another kind.
    BadKind,
    /// A report with a field out of its range.
    OutOfRange,
}

/// The faults in the order of the constants in the message definition, from one.
const FAULTS: [ReadFault; 8] = [
    ReadFault::NoReport,
    ReadFault::Disconnected(0),
    ReadFault::Busy,
    ReadFault::BadLength,
    ReadFault::BadCheckSum,
    ReadFault::BadVersion,
    ReadFault::BadKind,
    ReadFault::OutOfRange,
];

impl From<DeviceError> for ReadFault {
    fn from(error: DeviceError) -> Self {
        match error {
            DeviceError::NoReport => Self::NoReport,
            DeviceError::Disconnected(number) => Self::Disconnected(number),
            DeviceError::Busy => Self::Busy,
            DeviceError::Corrupt(report) => match report {
                Corruption::Length => Self::BadLength,
                Corruption::CheckSum => Self::BadCheckSum,
                Corruption::Version => Self::BadVersion,
                Corruption::Kind => Self::BadKind,
                Corruption::Range => Self::OutOfRange,
            },
        }
    }
}

impl From<&Reading> for LoggedReading {
    fn from(reading: &Reading) -> Self {
        Self(reading.map_err(ReadFault::from))
    }
}

impl LoggedReading {
    /// The reading as the device gave it. The control law depends on whether there is a state, not on the reason
    /// why there is none. Every report that could not be used is therefore returned as [`DeviceError::NoReport`].
    ///
    /// # Errors
    /// The fault, if the device gave no state.
    pub fn reading(&self) -> Reading {
        self.0.map_err(|fault| match fault {
            ReadFault::Disconnected(number) => DeviceError::Disconnected(number),
            ReadFault::Busy => DeviceError::Busy,
            _ => DeviceError::NoReport,
        })
    }

    pub(super) fn encode(&self, out: &mut CdrWriter) {
        let (state, status, system_error) = match &self.0 {
            Ok(state) => (*state, 0, 0),
            Err(fault) => {
                let (kind, number) = match fault {
                    ReadFault::Disconnected(number) => (ReadFault::Disconnected(0), *number),
                    other => (*other, 0),
                };
                let place = FAULTS.iter().position(|f| *f == kind);
                // The state is all zero: a rotation of zero length cannot be mistaken for a rotation that was read.
                let mut nothing = DeviceState::resting();
                nothing.pose.rotation.as_mut_unchecked().coords.fill(0.0);
                (nothing, place.map_or(u8::MAX, |i| i as u8 + 1), number)
            }
        };
        out.pose(&state.pose);
        out.twist(&state.twist);
        out.u64(state.device_time_ns);
        out.u32(state.buttons);
        out.u32(system_error as u32);
        out.u8(status);
        let (rendering, fault) = match state.rendering {
            Rendering::Commanded => (0, 0),
            Rendering::LetGo => (1, 0),
            Rendering::Fault(fault) => (2, fault),
        };
        out.u8(rendering);
        out.u8(fault);
    }

    pub(super) fn decode(from: &mut CdrReader) -> Option<Self> {
        let (pose, twist) = (from.pose()?, from.twist()?);
        let (device_time_ns, buttons) = (from.u64()?, from.u32()?);
        let system_error = from.u32()? as i32;
        let status = from.u8()?;
        let rendering = match (from.u8()?, from.u8()?) {
            (0, 0) => Rendering::Commanded,
            (1, 0) => Rendering::LetGo,
            (2, fault) => Rendering::Fault(fault),
            _ => return None,
        };
        let Some(place) = usize::from(status).checked_sub(1) else {
            return Some(Self(Ok(DeviceState {
                pose,
                twist,
                buttons,
                device_time_ns,
                rendering,
            })));
        };
        let fault = match *FAULTS.get(place)? {
            ReadFault::Disconnected(_) => ReadFault::Disconnected(system_error),
            other => other,
        };
        Some(Self(Err(fault)))
    }
}

impl fmt::Display for ReadFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoReport => f.write_str("no report"),
            Self::Disconnected(number) => write!(f, "disconnected (system error {number})"),
            Self::Busy => f.write_str("busy"),
            Self::BadLength => f.write_str("a report of a wrong length"),
            Self::BadCheckSum => f.write_str("a report with a wrong check sum"),
            Self::BadVersion => f.write_str("a report of another version"),
            Self::BadKind => f.write_str("a report of another kind"),
            Self::OutOfRange => f.write_str("a report with a field out of range"),
        }
    }
}
