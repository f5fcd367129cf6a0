//! One run of a cell under one scheme. The physics steps at a fixed rate, and publishes at the drawn rate; its models
//! are late or lost, and the host stalls. The controller runs at its tick, devices and hands between ticks.
//!
//! The physics takes the same steps at every publication rate. The run therefore differs from the reference by the
//! multirate scheme alone.

use super::draw::Span;
use super::measure::Trace;
use super::troubled::{Lossy, Steady, Troubled};
use super::world::{World, probe};
use crate::StudyError;
use crate::stress::chance::Chance;
use host::engine::Engine;
use host::engine::body::HostBody;
use host::engine::build::{self, How};
use host::run::late::LateLink;
use host::scene::spec::SchemeName;
use nalgebra::UnitQuaternion;
use rt_core::device_frame::DeviceFrame;
use rt_core::{Controller, Pose, Vec3};
use runner::link::{LinkConfig, link};
use runner::tick_loop::TickLoop;

/// Models a second (Hz) for which the rings have room. The tick empties the rings in every tick.
const ROOM: f64 = 20.0;

/// Time constant (s) of the filter for the error of the encoder.
const SETTLE: f64 = 0.05;

/// The pose at which a body is moved along a run: the true pose of the handle, plus the mean error of the encoder over
/// the last [`SETTLE`]. No tick knows the place of a resting hand better than its encoder, and on a stiff body a
/// fraction of a count changes the force noticeably. A body that followed the counts themselves would shake.
#[derive(Clone)]
struct ShiftedPose {
    gain: f64,
    off: Vec3,
    turned: Vec3,
}

impl ShiftedPose {
    fn new(period: f64) -> Self {
        Self {
            gain: period / SETTLE,
            off: Vec3::zeros(),
            turned: Vec3::zeros(),
        }
    }

    /// The filtered pose, for a proxy of the controller at `shown`. `reading` holds the pose of the encoder and the
    /// true pose (axes of the device, which stands at `frame`). A device that is absent stays at its last pose.
    fn pose(&mut self, shown: &Pose, reading: Option<(&Pose, &Pose)>, frame: &DeviceFrame) -> Pose {
        let Some((counted, truly)) = reading else {
            return *shown;
        };
        let off = frame.rotation * (counted.position - truly.position);
        let turn = truly.rotation * counted.rotation.inverse();
        let turn = frame.rotation * turn * frame.rotation.inverse();
        self.off += (off - self.off) * self.gain;
        self.turned += (-turn.scaled_axis() - self.turned) * self.gain;
        Pose {
            position: shown.position + (self.off - off) * frame.motion_scale,
            rotation: UnitQuaternion::from_scaled_axis(self.turned) * turn * shown.rotation,
        }
    }
}

/// Runs the cell of `world` under `scheme`.
pub(in crate::stress) fn run(
    world: &World,
    scheme: SchemeName,
    chance: Chance,
) -> Result<Trace, StudyError> {
    let mut world = world.clone();
    let draw = world.draw.clone();
    for loaded in [Some(&mut world.loaded), world.soft.as_mut()]
        .into_iter()
        .flatten()
    {
        let realtime = &mut loaded.scene.realtime;
        realtime.scheme = scheme;
        // A scene for a late host sets an age limit that accepts the usual latency.
        let usual = 2.0 * (1.0 + draw.jitter) * (draw.latency + 1.0 / draw.rate);
        realtime.age_limit = Some(realtime.age_limit().max(usual));
    }
    let world = &world;
    let engine = Engine::new(build::bodies(&world.loaded, How::default())?);
    let stored: f64 = engine
        .bodies()
        .iter()
        .map(|body| body.body().total_energy())
        .sum();
    let (config, devices, mut kept) = world.devices(stored)?;
    let (end, host_end, _) = link(&LinkConfig {
        bodies: world.loaded.scene.bodies.len(),
        handles: world.loaded.scene.devices.len(),
        ..LinkConfig::new(world.loaded.scene.realtime.rate, ROOM)
    });
    let mut tick = TickLoop::new(Controller::new(&config), devices, end);
    let late = LateLink::new(host_end, world.loaded.scene.bodies.len());
    let host = Steady::new(engine, Lossy::new(late, world, chance));
    let mut host = Troubled::new(host, world);
    let period = world.period();
    let frames = world.frames()?;
    let mut shifted = vec![ShiftedPose::new(period); world.loaded.scene.devices.len()];
    let softens = draw.softening.map(|softening| softening.at);
    let mut unaware = Span::default();
    world.timeline().drive(&mut host, |host, now| {
        let time = now as f64 * 1e-9;
        if let Some(at) = softens.filter(|at| time >= *at && host.awaits_model()) {
            unaware = Span {
                at,
                duration: time + period - at,
            };
        }
        let telemetry = tick.tick(now);
        let devices = tick.devices.iter().zip(&mut shifted).enumerate();
        for (index, (device, shifted)) in devices {
            let shown = telemetry.devices[index].pose;
            let reading = telemetry.readings[index].as_ref().ok();
            let truly = probe(device).pose;
            let pose = shifted.pose(&shown, reading.map(|r| (&r.pose, &truly)), &frames[index]);
            kept.keep_proxy(index, pose);
        }
        let bodies = host.engine().bodies().iter().map(HostBody::body);
        let (wrenches, weight) = kept.exerted_by(bodies);
        let account = tick.controller.energy().fold([0.0; 2], |sum, account| {
            [sum[0] + account.available, sum[1] + account.stored]
        });
        let states = telemetry.devices.iter().map(|device| device.safety);
        kept.keep(&tick.devices, states, &wrenches, weight, account);
        Ok(())
    })?;
    let capped = tick.controller.energy().map(|account| account.capped).sum();
    Ok(Trace {
        unaware,
        ..kept.finish(capped)
    })
}
