//! The parts that a run and its reference have in common: the scene with the hands of a cell, its devices, and the
//! recording of each tick.

use super::draw::Draw;
use super::measure::{DeviceTrace, Trace};
use host::bodies;
use host::run::setup;
use host::run::timeline::Timeline;
use host::scene::{LoadedScene, SceneError};
use physics::{Body, HandlePose};
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::SafetyState;
use rt_core::{ControllerConfig, MAX_DEVICES, Pose, Probe, Wrench};
use runner::AnyDevice;
use sim::{Fault, Faulty};

/// A cell's scene.
#[derive(Clone, Debug)]
pub(crate) struct World {
    /// The scene with the hands, rates and materials of the cell.
    pub(crate) loaded: LoadedScene,
    /// The softened scene.
    pub(crate) soft: Option<LoadedScene>,
    /// The draw.
    pub(crate) draw: Draw,
}

/// The record of a run, and the facts about the scene that each entry needs.
pub(super) struct Kept {
    /// For each body and handle, the device that holds it.
    held: Vec<Vec<usize>>,
    /// Where each device stands in the scene.
    frames: Vec<DeviceFrame>,
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
            let tools = bodies::tools(scene, body).into_iter();
            tools.map(|tool| tool.device).collect()
        });
        bodies.collect()
    }

    /// Where each device stands in the scene.
    pub(super) fn frames(&self) -> Result<Vec<DeviceFrame>, SceneError> {
        let devices = self.loaded.scene.devices.iter().enumerate();
        let frames = devices.map(|(index, device)| {
            let mount = bodies::mount(&self.loaded, index)?;
            Ok(DeviceFrame {
                rotation: mount.rotation,
                motion_scale: device.motion_scale,
                ..DeviceFrame::at(mount.origin)
            })
        });
        frames.collect()
    }

    /// The controller's configuration, the devices at rest, and the empty recording. `stored` is the energy that the
    /// bodies store (J).
    pub(super) fn devices(
        &self,
        stored: f64,
    ) -> Result<(ControllerConfig, Vec<AnyDevice>, Kept), SceneError> {
        let scene = &self.loaded.scene;
        let (config, devices) = setup::controls(&self.loaded, scene.seed)?;
        let ticks = self.timeline().ticks as usize;
        let devices = devices.into_iter().enumerate().map(|(index, device)| {
            let gone = self.draw.vanishing.filter(|gone| gone.device == index);
            let faults = gone.map(|gone| {
                let span = gone.span.at..gone.span.at + gone.span.duration;
                // The first nanosecond that is not before the time (s).
                let ns = |time: f64| (time * 1e9).ceil() as u64;
                (ns(span.start)..ns(span.end), Fault::Vanished)
            });
            Box::new(Faulty::new(device, faults.into_iter().collect())) as AnyDevice
        });
        let devices: Vec<_> = devices.collect();
        let kept = Kept {
            held: self.held(),
            frames: config.devices.iter().map(|d| d.frame).collect(),
            trace: Trace {
                period: self.period(),
                devices: devices.iter().map(|_| empty_trace(ticks)).collect(),
                ..Trace::default()
            },
            stored,
        };
        Ok((config, devices, kept))
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
        devices: &[AnyDevice],
        states: impl Iterator<Item = SafetyState>,
        bodies: &[Wrench],
        weight: f64,
        account: [f64; 2],
    ) {
        let mut on_hands = 0.0;
        let each = self.trace.devices.iter_mut().zip(devices).zip(&self.frames);
        for ((((trace, device), frame), wrench), state) in each.zip(bodies).zip(states) {
            let probe = probe(device);
            trace.force.push(probe.held.force);
            trace.moment.push(probe.held.moment);
            trace.position.push(probe.pose.position);
            trace.limited.push(state == SafetyState::Limited);
            let force = frame.to_device(wrench).force;
            trace.body.push(device.capabilities().actuated.part(&force));
            on_hands += probe.on_hand;
        }
        self.trace.out.push(on_hands + weight - self.stored);
        self.trace.account.push(account);
    }

    /// Keeps the pose of a device's proxy in a tick.
    pub(super) fn keep_proxy(&mut self, device: usize, pose: Pose) {
        self.trace.devices[device].proxy.push(pose);
    }

    /// The whole record. `capped` is the number of ticks in which the cap acted.
    pub(super) fn finish(self, capped: u64) -> Trace {
        Trace {
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

/// The true state of a simulated device.
pub(crate) fn probe(device: &AnyDevice) -> Probe {
    let probe = device.probe();
    probe.expect("a scene under virtual time has simulated devices only")
}

/// A record without entries, with room for `ticks`.
fn empty_trace(ticks: usize) -> DeviceTrace {
    DeviceTrace {
        force: Vec::with_capacity(ticks),
        moment: Vec::with_capacity(ticks),
        position: Vec::with_capacity(ticks),
        limited: Vec::with_capacity(ticks),
        body: Vec::with_capacity(ticks),
        proxy: Vec::with_capacity(ticks),
        own: Vec::new(),
    }
}

/// A proxy's pose as that of a handle.
pub(super) fn handle(pose: &Pose) -> HandlePose {
    HandlePose {
        position: pose.position,
        rotation: pose.rotation,
    }
}
