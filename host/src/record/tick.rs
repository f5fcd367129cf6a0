//! One tick: the telemetry of devices and bodies, and the readings of the devices, from which a run is replayed.

use rt_core::Reading;
use rt_core::record::{BodyTelemetry, DeviceTelemetry};
use rt_core::{Corruption, DeviceError, DeviceState, EnergyAccount, Telemetry};
use std::fmt;

/// One tick, read back from a log.
#[derive(Clone, Debug, PartialEq)]
pub struct TickRow {
    /// Number of the tick, from zero.
    pub tick: u64,
    /// Nominal time of the tick (ns).
    pub time_ns: u64,
    /// Lateness of the tick (ns).
    pub lateness_ns: u64,
    /// Time from the wake-up to the moment just before the commands left (ns).
    pub took_ns: u64,
    /// The devices.
    pub devices: Vec<DeviceTelemetry>,
    /// The bodies.
    pub bodies: Vec<BodyTelemetry>,
    /// The reading of each device (device axes).
    pub readings: Vec<LoggedReading>,
}

impl From<&Telemetry> for TickRow {
    fn from(telemetry: &Telemetry) -> Self {
        Self {
            tick: telemetry.tick,
            time_ns: telemetry.time_ns,
            lateness_ns: telemetry.lateness_ns,
            took_ns: telemetry.took_ns,
            devices: telemetry.devices().copied().collect(),
            bodies: telemetry.bodies().copied().collect(),
            readings: telemetry.readings().map(LoggedReading::from).collect(),
        }
    }
}

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

/// The sums of energy (J), by the names and in the order of the message definition. They are all fields of the account
/// except the count of ticks.
pub fn energy_sums(energy: &EnergyAccount) -> [(&'static str, f64); 7] {
    let EnergyAccount {
        supplied,
        raised,
        least,
        initial,
        stored,
        credited,
        available,
        capped: _,
    } = *energy;
    [
        ("supplied", supplied),
        ("raised", raised),
        ("least", least),
        ("initial", initial),
        ("stored", stored),
        ("credited", credited),
        ("available", available),
    ]
}
