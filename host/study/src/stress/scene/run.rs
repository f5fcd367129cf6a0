//! One run of a cell under one scheme: the set-up and the host of `palpate run`. Models are late or lost, the host stalls,
//! and bodies soften as the cell says.
//!
//! The physics takes the same steps at every publication rate. The run therefore differs from the reference by the
//! multirate scheme alone.

use super::draw::Span;
use super::measure::{HOLD, Trace};
use super::reference::rest;
use super::trial::{Trial, probe};
use super::troubled::{Lossy, Troubled, stalls};
use crate::StudyError;
use crate::chance::Chance;
use host::engine::body::HostBody;
use host::run::prepare::{Options, Prepared};
use host::run::session::Session;
use host::scene::spec::SchemeName;
use host::world::World;
use nalgebra::UnitQuaternion;
use rt_core::device_frame::DeviceFrame;
use rt_core::{Pose, Vec3};

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

/// Runs the cell of `trial` under `scheme`.
pub(in crate::stress) fn run(
    trial: &Trial,
    scheme: SchemeName,
    chance: Chance,
) -> Result<Trace, StudyError> {
    let trial = &trial.under(scheme);
    let (scene, draw) = (&trial.loaded.scene, &trial.draw);
    let built = World::new(&trial.loaded)?;
    let options = Options {
        faults: stalls(&draw.stalls),
        ..Options::of(&built)
    };
    let mut prepared = Prepared::new(&built, &options)?;
    prepared.tick.devices = trial.faulty(prepared.tick.devices);
    let bodies = prepared.engine.bodies().iter();
    let mut kept = trial.kept(bodies.map(|body| body.body().total_energy()).sum())?;
    let lossy = |link| Lossy::new(link, draw, chance, scene.bodies.len());
    let mut session = Session::with(prepared, lossy, |host| Troubled::new(host, trial));
    let period = trial.period();
    let frames = trial.frames()?;
    let mut shifted = vec![ShiftedPose::new(period); trial.loaded.scene.devices.len()];
    let softens = draw.softening.map(|softening| softening.at);
    let mut unaware = Span::default();
    let mut held = Vec::new();
    let hold_ns = ((scene.duration - HOLD) * 1e9) as u64;
    while let Some(telemetry) = session.try_tick()? {
        let (now, tick, host) = (telemetry.time_ns, session.tick_loop(), session.host());
        let time = now as f64 * 1e-9;
        if let Some(at) = softens.filter(|at| time >= *at && host.awaits_model()) {
            unaware = Span {
                at,
                duration: time + period - at,
            };
        }
        let devices = tick.devices.iter().zip(&mut shifted).enumerate();
        for (index, (device, shifted)) in devices {
            let shown = telemetry.devices[index].pose;
            let reading = telemetry.readings[index].as_ref().ok();
            let truly = probe(device).pose;
            let pose = shifted.pose(&shown, reading.map(|r| (&r.pose, &truly)), &frames[index]);
            kept.keep_proxy(index, pose);
        }
        let bodies = host.engine().bodies().iter().map(HostBody::body);
        if now >= hold_ns {
            let bodies = bodies.clone();
            if held.is_empty() {
                held.extend(bodies.clone().cloned());
            }
            kept.keep_apart(bodies, |device| telemetry.devices[device].pose);
        }
        let (wrenches, weight) = kept.exerted_by(bodies);
        let account = tick.controller.energy().fold([0.0; 2], |sum, account| {
            [sum[0] + account.available, sum[1] + account.stored]
        });
        let states = telemetry.devices.iter().map(|device| device.safety);
        kept.keep(&tick.devices, states, &wrenches, weight, account);
    }
    if let Some(panic) = session.panicked() {
        return Err(StudyError::Host(panic.to_owned()));
    }
    let energy = session.tick_loop().controller.energy();
    let capped = energy.map(|account| account.capped).sum();
    let mut trace = Trace {
        unaware,
        ..kept.finish(capped)
    };
    rest(trial, &mut trace, held)?;
    Ok(trace)
}
