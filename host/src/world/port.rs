//! The demands of a scene on its devices: the scheme of the forces, and the port through which the account of energy sees a
//! device.

use crate::scene::spec::{Scene, SchemeName};
use rt_core::device_frame::DeviceFrame;
use rt_core::velocity::{VelocityEstimator, most_damping};
use rt_core::{Port, Scheme};
use sim::DeviceModel;

/// The force scheme that a scene names.
pub fn scheme(scene: &Scene) -> Scheme {
    match scene.realtime.scheme {
        SchemeName::Hold => Scheme::Hold,
        SchemeName::Thesis => Scheme::Thesis {
            stiffness: scene.realtime.thesis_stiffness,
            damping: scene.realtime.thesis_damping,
        },
        SchemeName::Linear => Scheme::Linear,
        SchemeName::Proxy => Scheme::Proxy,
        SchemeName::Classic => Scheme::Classic,
        SchemeName::Capped => Scheme::Capped,
    }
}

/// The port of a device, in the units of the scene. The account of energy takes the device's dissipation from it. The
/// force of the device changes by `max_slew` (N/s) at most.
pub fn port(model: &DeviceModel, max_slew: f64, frame: &DeviceFrame, period: f64) -> Port {
    let scale = frame.motion_scale;
    // The delay of the velocity estimate that the device's driver makes.
    let delay = VelocityEstimator::for_encoder(period, model.position_step).delay();
    let turning = model.rotation;
    Port {
        damping: model.damping / (scale * scale),
        friction: model.friction / scale,
        turning_damping: turning.map_or(0.0, |rotation| rotation.damping),
        turning_friction: turning.map_or(0.0, |rotation| rotation.friction),
        most_damping: most_damping(model.mass, period, delay) / (scale * scale * frame.force_scale),
        most_turning_damping: turning.map_or(f64::INFINITY, |rotation| {
            most_damping(rotation.inertia, period, delay) / frame.force_scale
        }),
        force_scale: frame.force_scale,
        count: model.position_step * scale,
        max_slew: max_slew / (scale * frame.force_scale),
    }
}
