//! The hands and the bodies of a frame, from the telemetry of a tick.
//!
//! A number that is not finite, which only a damaged log holds, becomes zero, because a message has finite numbers only.

use crate::live::{BodyState, HandState, ToolState};
use crate::record::totals::DeviceTotals;
use crate::record::{Touch, energy_sums};
use rt_core::record::{BodyTelemetry, DeviceTelemetry};
use rt_core::{Pose, Vec3};

/// The hand that holds a device.
pub(super) fn hand(device: &DeviceTelemetry, totals: &DeviceTotals) -> HandState {
    let rotation = device.pose.rotation.coords;
    HandState {
        position: vector(&device.pose.position),
        rotation: [rotation.x, rotation.y, rotation.z, rotation.w].map(finite),
        force: vector(&device.wrench.force),
        moment: vector(&device.wrench.moment),
        velocity: vector(&device.twist.linear),
        buttons: device.buttons,
        fresh: device.fresh,
        safety: device.safety.name().to_owned(),
        peak_force: finite(totals.peak_force),
        work: finite(totals.work),
        reach: finite(totals.reach),
    }
}

/// The state of a body, without its vertices.
pub(super) fn body(body: &BodyTelemetry) -> BodyState {
    let sums = energy_sums(&body.energy).into_iter();
    BodyState {
        state: body.state.name().to_owned(),
        sequence: body.sequence,
        epoch: body.epoch,
        age: body.age_ns as f64 * 1e-9,
        trust: finite(body.trust),
        withheld: finite(body.withheld.force),
        energy: sums
            .map(|(name, sum)| (name.to_owned(), finite(sum)))
            .collect(),
        capped_ticks: body.energy.capped,
        vertices: None,
    }
}

/// The tool of a device that leads it to a pose, without its sites.
pub(super) fn tool(device: usize, touch: &Touch, led: &Pose) -> ToolState {
    ToolState {
        device: device as u32,
        led: pose(led),
        contacts: u32::from(touch.contacts),
        force: vector(&touch.force),
        patch: touch.patch,
        sites: Vec::new(),
    }
}

/// A pose as a frame has it: position, and the quaternion x, y, z, w.
pub(super) fn pose(pose: &Pose) -> [f64; 7] {
    let (at, turn) = (pose.position, pose.rotation.coords);
    [at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w].map(finite)
}

fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}

fn vector(value: &Vec3) -> [f64; 3] {
    [value.x, value.y, value.z].map(finite)
}
