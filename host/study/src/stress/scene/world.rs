//! The parts that a run and its reference have in common: the scene with the hands of a cell, its devices, and the
//! recording of each tick.

use super::draw::Draw;
use super::measure::Trace;
use super::traced::Traced;
use host::run::setup;
use host::run::timeline::Timeline;
use host::scene::{LoadedScene, SceneError};
use physics::{Body, HandlePose};
use rt_core::safety::SafetyState;
use rt_core::{ControllerConfig, MAX_DEVICES, Pose, Wrench};
use sim::Vanishing;

/// A cell's scene.
#[derive(Clone, Debug)]
pub(in crate::stress) struct World {
    /// The scene with the hands, rates and materials of the cell.
    pub(in crate::stress) loaded: LoadedScene,
    /// The softened scene.
    pub(in crate::stress) soft: Option<LoadedScene>,
    /// The draw.
    pub(in crate::stress) draw: Draw,
}

/// The recording of a run, except for the traces of its devices.
pub(super) struct Kept {
    /// For each body and handle, the device that holds it.
    held: Vec<Vec<usize>>,
    /// Metres of the scene per metre of the device.
    scales: Vec<f64>,
    trace: Trace,
    /// Energy stored before the first tick, with the potential of gravity (J).
    stored: f64,
}

impl World {
    /// The tick's period (ns).
    pub(super) fn period_ns(&self) -> u64 {
        (1e9 / self.loaded.scene.realtime.rate).round() as u64
    }

    /// The tick's period (s).
    pub(in crate::stress) fn period(&self) -> f64 {
        self.period_ns() as f64 * 1e-9
    }

    /// The times of the ticks of a run.
    pub(super) fn timeline(&self) -> Timeline {
        Timeline {
            period_ns: self.period_ns(),
            ticks: (self.loaded.scene.duration * self.loaded.scene.realtime.rate).round() as u64,
        }
    }

    /// For each body and handle, the device that holds it.
    pub(super) fn held(&self) -> Vec<Vec<usize>> {
        let scene = &self.loaded.scene;
        let bodies = scene.bodies.iter().map(|body| {
            let handles = body.handles.iter();
            handles.map(|handle| scene.device_of(handle)).collect()
        });
        bodies.collect()
    }

    /// The controller's configuration, the devices at rest, and the empty recording. `stored` is the energy that the
    /// bodies store (J).
    pub(super) fn devices(
        &self,
        stored: f64,
    ) -> Result<(ControllerConfig, Vec<Traced>, Kept), SceneError> {
        let scene = &self.loaded.scene;
        let (config, devices) = setup::controls(&self.loaded, scene.seed)?;
        let ticks = self.timeline().ticks as usize;
        let devices = devices.into_iter().enumerate().map(|(index, device)| {
            let gone = self.draw.vanishing.filter(|gone| gone.device == index);
            let gone = gone.map(|gone| gone.span.at..gone.span.at + gone.span.duration);
            Traced::new(Vanishing::new(device, gone), ticks)
        });
        let kept = Kept {
            held: self.held(),
            scales: scene.devices.iter().map(|d| d.motion_scale).collect(),
            trace: Trace {
                period: self.period(),
                ..Trace::default()
            },
            stored,
        };
        Ok((config, devices.collect(), kept))
    }
}

impl Kept {
    /// The wrenches that `bodies`, in the order of the scene, exert on the devices (axes of the scene), and the
    /// potential of their weight (J).
    pub(super) fn exerted_by<'a>(
        &self,
        bodies: impl Iterator<Item = &'a Body>,
    ) -> ([Wrench; MAX_DEVICES], f64) {
        exerted(bodies, &self.held)
    }

    /// Records a tick: the state of each device's last stage, the wrenches of the bodies on the devices (axes of the
    /// scene, N), the potential of their weight (J) and the tick's account.
    pub(super) fn keep(
        &mut self,
        devices: &mut [Traced],
        states: impl Iterator<Item = SafetyState>,
        bodies: &[Wrench],
        weight: f64,
        account: [f64; 2],
    ) {
        let each = devices.iter_mut().zip(&self.scales);
        for (((device, scale), wrench), state) in each.zip(bodies).zip(states) {
            device.trace.limited.push(state == SafetyState::Limited);
            device.trace.body.push(wrench.force * *scale);
        }
        let on_hands: f64 = devices.iter().map(Traced::on_hand).sum();
        self.trace.out.push(on_hands + weight - self.stored);
        self.trace.account.push(account);
    }

    /// The complete recording.
    pub(super) fn finish(self, devices: Vec<Traced>, capped: u64) -> Trace {
        Trace {
            devices: devices.into_iter().map(|device| device.trace).collect(),
            capped,
            ..self.trace
        }
    }
}

/// The wrenches that `bodies` exert on the devices that `held` names for their handles (axes of the scene), and the
/// potential of their weight (J).
pub(super) fn exerted<'a>(
    bodies: impl Iterator<Item = &'a Body>,
    held: &[Vec<usize>],
) -> ([Wrench; MAX_DEVICES], f64) {
    let mut wrenches = [Wrench::zero(); MAX_DEVICES];
    let mut weight = 0.0;
    for (body, held) in bodies.zip(held) {
        weight += body.load_potential();
        for (handle, device) in held.iter().enumerate() {
            if let Some(report) = body.handle_report(handle) {
                let found = report.wrench_on_hand;
                wrenches[*device].force += found.force;
                wrenches[*device].moment += found.moment;
            }
        }
    }
    (wrenches, weight)
}

/// The pose of a proxy as the pose of a handle.
pub(super) fn handle(pose: &Pose) -> HandlePose {
    HandlePose {
        position: pose.position,
        rotation: pose.rotation,
    }
}
