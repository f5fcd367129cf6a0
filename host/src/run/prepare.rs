//! Prepares a session of a world, before its first tick.

use super::devices;
use super::slow_host::{SlowWatch, StepTime};
use super::subscribers::Subscribers;
use super::view::HostView;
use crate::engine::build::BuildOptions;
use crate::engine::contact::Contact;
use crate::engine::faults::{Faults, HostFault};
use crate::engine::pacer::Pacer;
use crate::engine::rehearsal::Rehearsal;
use crate::engine::tool::{stiffest, stiffest_turning};
use crate::engine::{Engine, build};
use crate::preparation::Preparation;
use crate::scene::spec::{self, Scene, button_mask};
use crate::scene::{LoadedScene, SceneError};
use crate::world::{World, bodies_held, port, scheme};
use physics::FactorCode;
use rt_core::controller::DeviceConfig;
use rt_core::coupling::CouplingConfig;
use rt_core::device_frame::DeviceFrame;
use rt_core::engage::EngageConfig;
use rt_core::heat::HeatConfig;
use rt_core::passivity::MAX_DELAY;
use rt_core::safety::SafetyConfig;
use rt_core::square_wave::SquareWave;
use rt_core::tool::{ToolConfig, ToolCouplingConfig};
use rt_core::{
    Capabilities, Controller, ControllerConfig, MAX_DEVICES, PassivityConfig, Port, Vec3,
};
use runner::link::{HostEnd, LinkConfig, LogEnd, link};
use runner::{AnyDevice, ThreadPlace, TickLoop};
use sim::DeviceModel;

/// Number of its own periods for which a device may stay silent before its force is removed.
const PATIENCE: f64 = 5.0;
/// Least number of ticks for which a device may stay silent. A device that sends faster than the tick reads may be
/// delayed by other traffic on its bus.
const LEAST_PATIENCE: f64 = 2.0;

/// The speed (m/s) at which a tool and a surface that overlap part.
const PARTING: f64 = 0.02;

/// Times of a run, in integer nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timing {
    /// The tick's period (ns).
    pub period_ns: u64,
    /// Ticks in the run.
    pub ticks: u64,
    /// Latency under virtual time (ns): from reading the hands to the arrival of the model.
    pub latency_ns: u64,
}

/// The options of a session.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Length (s).
    pub duration: f64,
    /// Seed of the hands and devices.
    pub seed: u64,
    /// The code that makes factors.
    pub code: FactorCode,
    /// Whether the session is under the real clock.
    pub real: bool,
    /// Faults that the host makes on purpose.
    pub faults: Vec<HostFault>,
    /// Where the threads of the devices run.
    pub threads: ThreadPlace,
}

impl Options {
    /// A session of `duration` (s) with `seed`, in virtual time and without faults.
    pub fn new(duration: f64, seed: u64) -> Self {
        Self {
            duration,
            seed,
            code: FactorCode::default(),
            real: false,
            faults: Vec::new(),
            threads: ThreadPlace::default(),
        }
    }

    /// A session as the world's scene describes it, in virtual time.
    pub fn of(world: &World<'_>) -> Self {
        let scene = &world.loaded.scene;
        Self::new(scene.duration, scene.seed)
    }
}

/// Everything that a session needs.
pub struct Prepared {
    /// The tick with its devices.
    pub tick: TickLoop,
    /// The host's end of the link.
    pub host: HostEnd,
    /// The log's end of the link.
    pub log: LogEnd,
    /// The physics.
    pub engine: Engine,
    /// Faults that the host makes on purpose; by default there are none.
    pub faults: Faults,
    /// The subscribers to the host steps.
    pub subscribers: Subscribers,
    /// The viewers' access to the run, if there is one.
    pub view: Option<HostView>,
    /// The due times of the host's steps.
    pub pacer: Pacer,
    /// Judges whether a step takes longer than the scene allows.
    pub slow: SlowWatch,
    /// The times of the run.
    pub timing: Timing,
    /// The notes of the drivers, one sentence each.
    pub told: Vec<String>,
}

impl Prepared {
    /// Prepares a session of a world.
    ///
    /// # Errors
    /// [`SceneError`], naming the file, line and field that cannot be built.
    pub fn new(world: &World<'_>, options: &Options) -> Result<Self, SceneError> {
        Self::told(world, options, &mut |_| ())
    }

    /// Prepares a session as `new` does. `preparing` receives each part of the preparation when it begins.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn told(
        world: &World<'_>,
        options: &Options,
        preparing: &mut dyn FnMut(Preparation),
    ) -> Result<Self, SceneError> {
        let scene = &world.loaded.scene;
        build::check(world.loaded)?;
        preparing(Preparation::Settling);
        world.settle();
        // Under the real clock, a warning must come before hands hold the devices.
        let slow = if options.real {
            preparing(Preparation::Factorizing);
            let rehearsal = Rehearsal::new(world)?;
            preparing(Preparation::Timing);
            SlowWatch::rehearsed(scene, StepTime::new(scene, rehearsal.step_time()))
        } else {
            SlowWatch::new(scene)
        };
        preparing(Preparation::Factorizing);
        let how = BuildOptions {
            code: options.code,
            real: options.real,
        };
        let bodies = build::bodies(world, how)?;
        let contact = Contact::new(world, &bodies)?;
        let engine = Engine::new(bodies).touching(contact).on(scene.host.threads);
        let (devices, told) = devices::open(world, options.seed, options.real, &options.threads)?;
        let (tick, host, log) = connect(world, devices, scene.devices.len(), LinkConfig::STALL)?;
        let period = 1.0 / scene.realtime.rate;
        Ok(Self {
            tick,
            host,
            log,
            engine,
            faults: Faults::new(options.faults.clone()),
            subscribers: Subscribers::default(),
            view: None,
            pacer: Pacer::new(scene.host.step_rate, build::steps_per_publication(scene)),
            slow,
            timing: Timing {
                period_ns: (1e9 * period).round() as u64,
                ticks: (options.duration * scene.realtime.rate).round().max(1.0) as u64,
                latency_ns: (scene.host.latency * 1e9).round() as u64,
            },
            told,
        })
    }
}

/// The tick of a world with its open `devices`, and the other ends of its link, which has room for models of `handles`
/// handles and for a `stall` (s).
///
/// # Errors
/// As [`Prepared::new`].
pub(super) fn connect(
    world: &World<'_>,
    devices: Vec<AnyDevice>,
    handles: usize,
    stall: f64,
) -> Result<(TickLoop, HostEnd, LogEnd), SceneError> {
    let scene = &world.loaded.scene;
    let config = controller(world, &devices)?;
    let (end, host, log) = link(&LinkConfig {
        bodies: scene.bodies.len(),
        handles,
        tools: config.tools.map(|tool| tool.is_some()),
        stall,
        ..LinkConfig::new(scene.realtime.rate, scene.host.publish_rate)
    });
    let tick = TickLoop::new(Controller::new(&config), devices, end);
    Ok((tick, host, log))
}

/// Makes the checks of a run before its first tick, except those of the bodies, without opening a real device.
///
/// # Errors
/// As [`Prepared::new`].
pub fn check(world: &World<'_>) -> Result<(), SceneError> {
    build::check(world.loaded)?;
    devices::check(world)?;
    // The limits of a real device are those of its profile until it is opened.
    let (_, devices) = devices::replayed(world.loaded, &[]);
    controller(world, &devices).map(|_| ())
}

/// The tick's side of a world alone: the configuration of its controller, and its simulated devices.
///
/// # Errors
/// As [`Prepared::new`].
pub fn controls(
    world: &World<'_>,
    seed: u64,
) -> Result<(ControllerConfig, Vec<AnyDevice>), SceneError> {
    let (devices, _) = devices::open(world, seed, false, &ThreadPlace::default())?;
    Ok((controller(world, &devices)?, devices))
}

/// The configuration of a world's controller, for its open `devices`.
///
/// # Errors
/// As [`Prepared::new`].
fn controller(world: &World<'_>, devices: &[AnyDevice]) -> Result<ControllerConfig, SceneError> {
    let loaded = world.loaded;
    let scene = &loaded.scene;
    let period = 1.0 / scene.realtime.rate;
    let mut config = ControllerConfig::default();
    let mut passivity = PassivityConfig::new(period);
    passivity.delay = delay(loaded, period)?;
    let held = bodies_held(scene);
    for (index, device) in devices.iter().enumerate() {
        let mount = world.mounts[index];
        let frame = DeviceFrame {
            rotation: mount.rotation,
            motion_scale: scene.devices[index].motion_scale,
            ..DeviceFrame::at(mount.origin)
        };
        let capabilities = device.capabilities();
        let model = credited(loaded, index);
        let spec = &scene.devices[index];
        check_grip(loaded, index, &capabilities)?;
        let limits = safety(spec, &model, &capabilities, scene, period);
        let safety = SafetyConfig {
            engage: engage(spec, mount.start),
            ..limits
        };
        let whole = port(&model, safety.max_slew, &frame, period);
        passivity.ports[index] = share(&whole, held[index]);
        // The consistency of the scene was checked before: there are no more devices than the loop serves.
        let _ = config.devices.push(DeviceConfig { frame, safety });
        config.square_waves[index] = spec.square_wave.map(|wave| SquareWave {
            force: wave.force.into(),
            half_period_ns: (wave.half_period * 1e9).round() as u64,
        });
    }
    // The couplings of the bodies that a device holds damp it together as the scene says.
    let mut hold_damping = [0.0; MAX_DEVICES];
    for (damping, held) in hold_damping.iter_mut().zip(held) {
        *damping = scene.realtime.hold_damping / held.max(1) as f64;
    }
    for _ in &scene.bodies {
        let coupling = coupling(scene, period, &passivity, hold_damping);
        let _ = config.bodies.push(coupling);
    }
    for ((tool, device, _), shape) in scene.numbered_tools().zip(world.tool_shapes()) {
        config.tools[device] = Some(ToolCouplingConfig {
            tool: ToolConfig {
                hull: *shape.hull(),
                turns: stiffest_turning(loaded, device).is_some(),
                radius: shape.radius(),
                period,
                stiffest: stiffest(loaded, device),
                most_damping: passivity.ports[device].most_damping,
                parting: PARTING,
            },
            age_limit: scene.realtime.age_limit(),
            decay: scene.realtime.decay,
            recovery: scene.realtime.recovery,
            hold_damping: scene.realtime.hold_damping,
            take_buttons: tool.take_buttons(),
            passivity,
        });
    }
    Ok(config)
}

/// The model of a device for the account of energy. The account of a real device relies on no estimate.
fn credited(loaded: &LoadedScene, index: usize) -> DeviceModel {
    let profile = &loaded.profiles[index];
    if loaded.scene.devices[index].is_simulated() {
        profile.model
    } else {
        profile.model.without_estimates(&profile.estimated)
    }
}

/// Number of consecutive ticks of `period` (s) for which a device may stay silent before its force is removed.
pub fn patience(model: &DeviceModel, period: f64) -> u32 {
    let ticks = PATIENCE / (f64::from(model.rate_hz) * period);
    // Rounding must not add a tick if the device has the rate of the tick.
    (ticks - 1e-6).ceil().max(LEAST_PATIENCE) as u32
}

/// Ticks from the command of a wrench to its rendering, for the slowest device.
fn delay(loaded: &LoadedScene, period: f64) -> Result<usize, SceneError> {
    let mut most = 0;
    for (index, model) in loaded.models.iter().enumerate() {
        let ticks = (model.output_delay / period - 1e-6).ceil().max(0.0) as usize;
        // The wrench of an emulated device is on its way for a part of a tick.
        let emulated = loaded.scene.devices[index].is_emulated();
        let ticks = ticks.max(usize::from(emulated));
        if ticks > MAX_DELAY {
            let field = format!("device[{index}].model");
            let found = format!("an output delay of {:?} s", model.output_delay);
            let allowed = format!(
                "at most {MAX_DELAY} ticks, {:?} s",
                MAX_DELAY as f64 * period
            );
            return Err(loaded.source.error(&field, found, allowed));
        }
        most = most.max(ticks);
    }
    Ok(most)
}

fn coupling(
    scene: &Scene,
    period: f64,
    passivity: &PassivityConfig,
    hold_damping: [f64; MAX_DEVICES],
) -> CouplingConfig {
    CouplingConfig {
        scheme: scheme(scene),
        period,
        blend: scene.realtime.blend,
        age_limit: scene.realtime.age_limit(),
        decay: scene.realtime.decay,
        recovery: scene.realtime.recovery,
        hold_damping,
        passivity: *passivity,
    }
}

/// The share of one of `bodies` bodies in the port of a device that holds them all. Every body has an account of its own.
/// Together, the accounts must not rely on more dissipation than the device has, nor render more damping than it can.
fn share(port: &Port, bodies: usize) -> Port {
    let part = 1.0 / bodies.max(1) as f64;
    Port {
        damping: port.damping * part,
        friction: port.friction * part,
        turning_damping: port.turning_damping * part,
        turning_friction: port.turning_friction * part,
        most_damping: port.most_damping * part,
        most_turning_damping: port.most_turning_damping * part,
        max_slew: port.max_slew * part,
        ..*port
    }
}

fn safety(
    spec: &spec::Device,
    model: &DeviceModel,
    capabilities: &Capabilities,
    scene: &Scene,
    period: f64,
) -> SafetyConfig {
    SafetyConfig {
        actuated: capabilities.actuated,
        max_force: spec
            .max_force
            .unwrap_or(f64::INFINITY)
            .min(capabilities.max_force - grip_force(spec).norm()),
        max_moment: capabilities.max_moment,
        max_speed: spec.max_speed.unwrap_or(f64::INFINITY),
        max_reach: spec.max_reach.unwrap_or(f64::INFINITY),
        max_slew: spec.max_slew.unwrap_or(f64::INFINITY),
        patience: patience(model, period),
        decay: scene.realtime.decay,
        recovery: scene.realtime.recovery,
        engage: EngageConfig::default(),
        heat: HeatConfig {
            continuous_force: spec.continuous_force.unwrap_or(f64::INFINITY),
            time: spec.heat_time,
        },
        period,
    }
}

/// How a device is engaged; its handle rests at `start` (m, device axes).
fn engage(spec: &spec::Device, start: Vec3) -> EngageConfig {
    EngageConfig {
        armed: spec.is_armed_at_start(),
        arm: button_mask(spec.engage.arm_button),
        dead_man: button_mask(spec.engage.dead_man_button),
        stop: button_mask(spec.engage.stop_button),
        ramp: spec.ramp(),
        grip_force: grip_force(spec),
        waits_at: start,
    }
}

/// Checks that the weight of its grip takes at most half of the largest force of a device.
fn check_grip(
    loaded: &LoadedScene,
    index: usize,
    capabilities: &Capabilities,
) -> Result<(), SceneError> {
    let weight = grip_force(&loaded.scene.devices[index]).norm();
    let most = 0.5 * capabilities.max_force;
    if weight <= most {
        return Ok(());
    }
    let allowed = format!("at most half of the largest force of the device, {most:?} N");
    let field = format!("device[{index}].grip_weight");
    let found = format!("a weight of {weight:?} N");
    Err(loaded.source.error(&field, found, allowed))
}

/// The force of the motors that carries the weight of the grip (N, device axes).
fn grip_force(spec: &spec::Device) -> Vec3 {
    -Vec3::from(spec.grip_weight.unwrap_or_default())
}
