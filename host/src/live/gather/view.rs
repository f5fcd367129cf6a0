//! A tick as a gatherer takes it, from a run or from a log.

use crate::record::totals::place;
use crate::record::{LoggedReading, TickRow, Touch};
use rt_core::Reading;
use rt_core::record::{BodyTelemetry, DeviceTelemetry};
use rt_core::{MAX_DEVICES, Telemetry, Vec3};

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
    /// Where each device is (m, device axes); `None` if it gave no state that is believed.
    pub places: [Option<Vec3>; MAX_DEVICES],
    /// The bodies, in the scene's order.
    pub bodies: &'a [BodyTelemetry],
    /// The tools, by device.
    pub tools: [Option<Touch>; MAX_DEVICES],
}

/// The places of `devices` that gave these `readings`.
fn places<'a>(
    devices: &[DeviceTelemetry],
    readings: impl Iterator<Item = Reading> + 'a,
) -> [Option<Vec3>; MAX_DEVICES] {
    let mut places = [None; MAX_DEVICES];
    let each = devices.iter().zip(readings);
    for (at, (device, reading)) in places.iter_mut().zip(each) {
        *at = place(device, &reading);
    }
    places
}

/// The tools of a tick, by device.
fn tools(telemetry: &Telemetry) -> [Option<Touch>; MAX_DEVICES] {
    let mut tools = [None; MAX_DEVICES];
    for tool in telemetry.tools() {
        if let Some(place) = tools.get_mut(usize::from(tool.device)) {
            *place = Some(tool.into());
        }
    }
    tools
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
            places: places(&telemetry.devices[..devices], telemetry.readings().copied()),
            bodies: &telemetry.bodies[..bodies],
            tools: tools(telemetry),
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
            places: places(
                &row.devices,
                row.readings.iter().map(LoggedReading::reading),
            ),
            bodies: &row.bodies,
            tools: row.tools(),
        }
    }
}
