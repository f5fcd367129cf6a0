//! The forces that did not reach the hand whole, in plain words: whose force, for how long, by how much,
//! when, and why. The numbers are those of the tick (`rt_core::held_back`).

use super::summary::HeldBackSummary;
use crate::scene::Scene;
use rt_core::{Capabilities, HeldBack, HeldBackByBody, HeldBackByDevice};

/// What was held back from the hands of each body, then of each tool in the order of the devices, then of each device, in the
/// scene's order. `capabilities` are those of the devices.
pub(super) fn summaries(
    scene: &Scene,
    capabilities: &[Capabilities],
    by_bodies: impl Iterator<Item = HeldBackByBody>,
    by_tools: impl Iterator<Item = (usize, HeldBackByBody)>,
    by_devices: impl Iterator<Item = HeldBackByDevice>,
) -> Vec<HeldBackSummary> {
    let period = 1.0 / scene.realtime.rate;
    let mut all = Vec::new();
    let mut push = |of: &str, cause, found: &HeldBack, why: String| {
        if found.ticks > 0 {
            all.push(summary(of, cause, found, why, period));
        }
    };
    for (body, found) in scene.bodies.iter().zip(by_bodies) {
        let why = "the cap lets a body give back no more energy than the hands have supplied";
        push(&body.name, "cap", &found.capped, why.to_owned());
        let why = format!(
            "its model was older than {} s (`age_limit`), or its force was returning after that",
            scene.realtime.age_limit()
        );
        push(&body.name, "old model", &found.aged, why);
    }
    for (device, found) in by_tools {
        let Some((tool, ..)) = scene.numbered_tools().find(|(_, of, _)| *of == device) else {
            continue;
        };
        let why = "the cap lets a surface give back no more energy than the hand has supplied";
        push(&tool.name, "cap", &found.capped, why.to_owned());
        let why = format!(
            "its patch was older than {} s (`age_limit`), or its force was returning after that",
            scene.realtime.age_limit()
        );
        push(&tool.name, "old patch", &found.aged, why);
    }
    for ((device, able), found) in scene.devices.iter().zip(capabilities).zip(by_devices) {
        let infinite = |limit: Option<f64>| limit.unwrap_or(f64::INFINITY);
        let force = infinite(device.max_force).min(able.max_force);
        let why = format!("the device renders at most {force} N");
        push(&device.name, "force limit", &found.limited, why);
        let heat = infinite(device.continuous_force);
        let why = format!("the motors bear {heat} N for ever (`continuous_force`)");
        push(&device.name, "heat limit", &found.hot, why);
        let slew = infinite(device.max_slew);
        let why = format!("its force may change by at most {slew} N/s (`max_slew`)");
        push(&device.name, "slew limit", &found.slewed, why);
        let speed = infinite(device.max_speed);
        let why = format!("the hand moved faster than {speed} m/s (`max_speed`)");
        push(&device.name, "speed limit", &found.too_fast, why);
        let reach = infinite(device.max_reach);
        let why = format!("the hand was beyond {reach} m (`max_reach`)");
        push(&device.name, "reach limit", &found.out_of_reach, why);
        let why = "the device gave no reading, or the loop stood still".to_owned();
        push(&device.name, "no reading", &found.silent, why);
        let why = "the device said that it renders no force".to_owned();
        push(&device.name, "device let go", &found.let_go, why);
        let why = "the force returns slowly after a fault".to_owned();
        push(&device.name, "return", &found.recovering, why);
        let why = match device.ramp() {
            0.0 => format!(
                "the force comes in over {} s (`recovery`, where there is no `engage.ramp`)",
                scene.realtime.recovery
            ),
            ramp => format!("the force comes in over {ramp} s (`engage.ramp`)"),
        };
        push(&device.name, "engagement", &found.engaging, why);
        let why = "the hand did not hold the dead-man button".to_owned();
        push(&device.name, "dead-man button", &found.hands_off, why);
        let why = "the device was not armed".to_owned();
        push(&device.name, "disarmed", &found.disarmed, why);
        let why = "the emergency stop acted".to_owned();
        push(&device.name, "emergency stop", &found.stopped, why);
    }
    all
}

fn summary(
    of: &str,
    cause: &'static str,
    found: &HeldBack,
    why: String,
    period: f64,
) -> HeldBackSummary {
    let seconds = |ns: u64| ns as f64 * 1e-9;
    HeldBackSummary {
        of: of.to_owned(),
        cause,
        why,
        ticks: found.ticks,
        duration: found.ticks as f64 * period,
        from: seconds(found.first_ns),
        to: seconds(found.last_ns) + period,
        mean: found.mean(),
        most: found.most,
        most_of: found.of,
        most_time: seconds(found.most_ns),
    }
}
