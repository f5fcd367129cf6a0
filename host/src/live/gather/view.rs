//! A tick as a gatherer takes it, from a run or from a log.

use crate::log::TickRow;
use rt_core::Telemetry;
use rt_core::record::{BodyTelemetry, DeviceTelemetry};

/// A tick, borrowed from a run's [`Telemetry`] or from a row of a log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TickView<'a> {
    /// Number of the tick, from zero.
    pub tick: u64,
    /// Nominal time of the tick (ns).
    pub time_ns: u64,
    /// Lateness of the tick (ns).
    pub lateness_ns: u64,
    /// The devices, in the scene's order.
    pub devices: &'a [DeviceTelemetry],
    /// The bodies, in the scene's order.
    pub bodies: &'a [BodyTelemetry],
}

impl<'a> From<&'a Telemetry> for TickView<'a> {
    fn from(telemetry: &'a Telemetry) -> Self {
        let devices = usize::from(telemetry.device_count).min(telemetry.devices.len());
        let bodies = usize::from(telemetry.body_count).min(telemetry.bodies.len());
        Self {
            tick: telemetry.tick,
            time_ns: telemetry.time_ns,
            lateness_ns: telemetry.lateness_ns,
            devices: &telemetry.devices[..devices],
            bodies: &telemetry.bodies[..bodies],
        }
    }
}

impl<'a> From<&'a TickRow> for TickView<'a> {
    fn from(row: &'a TickRow) -> Self {
        Self {
            tick: row.tick,
            time_ns: row.time_ns,
            lateness_ns: row.lateness_ns,
            devices: &row.devices,
            bodies: &row.bodies,
        }
    }
}
