//! From a scene to everything that a run needs, before anything runs.

use super::{AnyDevice, hand};
use crate::bodies;
use crate::engine::build::How;
use crate::engine::faults::Faults;
use crate::engine::pacer::Pacer;
use crate::engine::{Engine, build};
use crate::scene::spec::{self, Scene, SchemeName};
use crate::scene::{LoadedScene, SceneError};
use rt_core::controller::DeviceConfig;
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::SafetyConfig;
use rt_core::velocity::{VelocityEstimator, most_damping};
use rt_core::{Controller, ControllerConfig, Device, PassivityConfig, Port, Scheme, Vec3};
use runner::link::{HostEnd, LinkConfig, LogEnd, link};
use runner::tick_loop::TickLoop;
use sim::{DeviceModel, SimDevice, Wired};

/// Ticks in a row that a device may stay silent before its force is taken away.
const PATIENCE: u32 = 10;

/// Times of a run, in integer nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// The tick's period.
    pub period_ns: u64,
    /// Ticks in the run.
    pub ticks: u64,
    /// From reading the hands to the model's arrival, under virtual time.
    pub latency_ns: u64,
}

/// Everything that a run needs.
pub struct Setup {
    /// The tick with its devices.
    pub tick: TickLoop<AnyDevice>,
    /// The host's end of the link.
    pub host: HostEnd,
    /// The log's end.
    pub log: LogEnd,
    /// The physics.
    pub engine: Engine,
    /// What the physics does wrong on purpose: nothing, unless it is told to.
    pub faults: Faults,
    /// When it steps.
    pub pacer: Pacer,
    /// Times.
    pub timing: Timing,
}

/// The host's side of a run.
pub struct HostSide {
    /// The physics.
    pub engine: Engine,
    /// When it steps.
    pub pacer: Pacer,
    /// The host's end of the link.
    pub end: HostEnd,
}

/// What is left of a [`Setup`] after its run.
pub struct Running {
    /// The tick with its devices.
    pub tick: TickLoop<AnyDevice>,
    /// The log's end.
    pub log: LogEnd,
    /// The host's side; `None` where it panicked.
    pub host: Option<HostSide>,
    /// What the panic said.
    pub panicked: Option<String>,
}

/// Builds everything for a run of `duration` (s) with `seed`.
///
/// # Errors
/// [`SceneError`], naming the file, line and field that cannot be built.
pub fn setup(loaded: &LoadedScene, duration: f64, seed: u64) -> Result<Setup, SceneError> {
    setup_with(loaded, duration, seed, How::default())
}

/// The same, with a choice of how bodies are run.
///
/// # Errors
/// As [`setup`].
pub(crate) fn setup_with(
    loaded: &LoadedScene,
    duration: f64,
    seed: u64,
    how: How,
) -> Result<Setup, SceneError> {
    let scene = &loaded.scene;
    let held = build::bodies(loaded, how)?;
    let (config, devices) = controls(loaded, seed)?;
    let (end, host, log) = link(&LinkConfig {
        bodies: scene.bodies.len(),
        ..LinkConfig::new(scene.realtime.rate, scene.host.publish_rate)
    });
    let period = 1.0 / scene.realtime.rate;
    Ok(Setup {
        tick: TickLoop::new(Controller::new(&config), devices, end),
        host,
        log,
        engine: Engine::new(held),
        faults: Faults::default(),
        pacer: Pacer::new(scene.host.step_rate, build::steps_per_publication(scene)),
        timing: Timing {
            period_ns: (1e9 * period).round() as u64,
            ticks: (duration * scene.realtime.rate).round().max(1.0) as u64,
            latency_ns: (scene.host.latency * 1e9).round() as u64,
        },
    })
}

/// The tick's side of a scene alone: what its controller is made of, and its devices.
///
/// # Errors
/// As [`setup`].
pub fn controls(
    loaded: &LoadedScene,
    seed: u64,
) -> Result<(ControllerConfig, Vec<AnyDevice>), SceneError> {
    let scene = &loaded.scene;
    let period = 1.0 / scene.realtime.rate;
    let mut config = ControllerConfig::default();
    let mut devices = Vec::new();
    let mut passivity = PassivityConfig::new(period);
    for index in 0..scene.devices.len() {
        let origin = handle_origin(loaded, index)?;
        let device = device(loaded, index, period, seed)?;
        let frame = DeviceFrame {
            motion_scale: scene.devices[index].motion_scale,
            ..DeviceFrame::at(origin)
        };
        let safety = safety(&scene.devices[index], &device, scene, period);
        passivity.ports[index] = port(&loaded.models[index], &safety, &frame, period);
        // The scene's consistency was checked: there are no more devices than the loop serves.
        let _ = config.devices.push(DeviceConfig { frame, safety });
        devices.push(device);
    }
    for _ in &scene.bodies {
        let _ = config.bodies.push(coupling(scene, period, &passivity));
    }

    Ok((config, devices))
}

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

fn coupling(scene: &Scene, period: f64, passivity: &PassivityConfig) -> CouplingConfig {
    CouplingConfig {
        scheme: scheme(scene),
        period,
        blend: scene.realtime.blend,
        age_limit: scene.realtime.age_limit(),
        decay: scene.realtime.decay,
        recovery: scene.realtime.recovery,
        hold_damping: scene.realtime.hold_damping,
        passivity: *passivity,
    }
}

/// A device as the account of energy sees it: what it dissipates, in the scene's metres and newtons.
fn port(model: &DeviceModel, safety: &SafetyConfig, frame: &DeviceFrame, period: f64) -> Port {
    let scale = frame.motion_scale;
    // The estimate that its driver makes.
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
        max_slew: safety.max_slew / (scale * frame.force_scale),
    }
}

fn safety(spec: &spec::Device, device: &AnyDevice, scene: &Scene, period: f64) -> SafetyConfig {
    let capabilities = device.capabilities();
    SafetyConfig {
        actuated: capabilities.actuated,
        max_force: spec
            .max_force
            .unwrap_or(f64::INFINITY)
            .min(capabilities.max_force),
        max_moment: capabilities.max_moment,
        max_speed: spec.max_speed.unwrap_or(f64::INFINITY),
        max_reach: spec.max_reach.unwrap_or(f64::INFINITY),
        max_slew: spec.max_slew.unwrap_or(f64::INFINITY),
        patience: PATIENCE,
        decay: scene.realtime.decay,
        recovery: scene.realtime.recovery,
        period,
    }
}

/// The device's origin lies where its handle is at rest; a device that holds none stays at the world's.
fn handle_origin(loaded: &LoadedScene, device: usize) -> Result<Vec3, SceneError> {
    let name = &loaded.scene.devices[device].name;
    for (body, spec) in loaded.scene.bodies.iter().enumerate() {
        if let Some(handle) = spec
            .handles
            .iter()
            .position(|handle| handle.device == *name)
        {
            return Ok(bodies::handle_origins(loaded, body)?[handle]);
        }
    }
    Ok(Vec3::zeros())
}

fn device(
    loaded: &LoadedScene,
    index: usize,
    period: f64,
    seed: u64,
) -> Result<AnyDevice, SceneError> {
    let spec = &loaded.scene.devices[index];
    let field = format!("device[{index}]");
    let refuse =
        |e: &dyn std::fmt::Display| loaded.source.error(&field, e.to_string(), "a sound device");
    let hand = hand::build(loaded, index, seed)?;
    let device =
        SimDevice::new(loaded.models[index], Some(hand), period).map_err(|e| refuse(&e))?;
    Ok(if spec.wire {
        AnyDevice::Wired(Box::new(Wired::new(device)))
    } else {
        AnyDevice::Bare(Box::new(device))
    })
}
