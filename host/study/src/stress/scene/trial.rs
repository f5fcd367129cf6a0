//! The parts that a run and its reference have in common: the scene with the hands of a cell, its devices, and the
//! recording of each tick.

use super::draw::Draw;
use super::measure::{Apart, DeviceTrace, HOLD, Trace};
use host::scene::spec::SchemeName;
use host::scene::{LoadedScene, SceneError};
use host::world::grasps;
use physics::{Body, HandlePose, Vec3};
use rt_core::device_frame::DeviceFrame;
use rt_core::safety::SafetyState;
use rt_core::{MAX_DEVICES, Pose, Probe, Wrench};
use runner::AnyDevice;
use sim::{Fault, Faulty};

/// A cell's scene.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
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

impl Trial {
    /// The tick's period (ns).
    pub(super) fn period_ns(&self) -> u64 {
        (1e9 / self.loaded.scene.realtime.rate).round() as u64
    }

    /// The tick's period (s).
    pub(in crate::stress) fn period(&self) -> f64 {
        self.period_ns() as f64 * 1e-9
    }

    /// Number of ticks of a run.
    pub(super) fn ticks(&self) -> u64 {
        (self.loaded.scene.duration * self.loaded.scene.realtime.rate).round() as u64
    }

    /// For each body and handle, the device that holds it.
    pub(super) fn held(&self) -> Vec<Vec<usize>> {
        let scene = &self.loaded.scene;
        let bodies = scene.bodies.iter().map(|body| {
            let grasps = grasps(scene, body).into_iter();
            grasps.map(|grasp| grasp.device).collect()
        });
        bodies.collect()
    }

    /// Where each device stands in the scene.
    pub(super) fn frames(&self) -> Result<Vec<DeviceFrame>, SceneError> {
        frames(&self.loaded)
    }

    /// `devices` with the fault of the draw.
    pub(super) fn faulty(&self, devices: Vec<AnyDevice>) -> Vec<AnyDevice> {
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
        devices.collect()
    }

    /// The empty recording of a run. `stored` is the energy that the bodies store (J).
    pub(super) fn kept(&self, stored: f64) -> Result<Kept, SceneError> {
        let ticks = self.ticks() as usize;
        let models = self.loaded.models.iter();
        Ok(Kept {
            held: self.held(),
            frames: self.frames()?,
            trace: Trace {
                period: self.period(),
                devices: models
                    .map(|model| empty_trace(ticks, model.friction))
                    .collect(),
                apart: self
                    .held()
                    .iter()
                    .map(|held| vec![Apart::default(); held.len()])
                    .collect(),
                ..Trace::default()
            },
            stored,
        })
    }

    /// The trial of a run under `scheme`.
    pub(in crate::stress) fn under(&self, scheme: SchemeName) -> Self {
        let mut trial = self.clone();
        let draw = &self.draw;
        let soft = trial.soft.as_mut();
        for loaded in [Some(&mut trial.loaded), soft].into_iter().flatten() {
            let realtime = &mut loaded.scene.realtime;
            realtime.scheme = scheme;
            // A scene for a late host sets an age limit that accepts the usual latency.
            let usual = 2.0 * (1.0 + draw.jitter) * (draw.latency + 1.0 / draw.rate);
            realtime.age_limit = Some(realtime.age_limit().max(usual));
        }
        trial
    }
}

/// Where each device of a scene stands.
pub(in crate::stress) fn frames(loaded: &LoadedScene) -> Result<Vec<DeviceFrame>, SceneError> {
    let mounts = host::world::World::new(loaded)?.mounts.into_iter();
    let frames = mounts
        .zip(&loaded.scene.devices)
        .map(|(mount, device)| DeviceFrame {
            rotation: mount.rotation,
            motion_scale: device.motion_scale,
            ..DeviceFrame::at(mount.origin)
        });
    Ok(frames.collect())
}

impl Kept {
    /// The wrenches that `bodies`, in the order of the scene, exert on the devices (axes of the scene), and the
    /// potential of their weight (J).
    pub(super) fn exerted_by<'a>(
        &self,
        bodies: impl Iterator<Item = &'a Body>,
    ) -> ([Wrench; MAX_DEVICES], f64) {
        exerted(bodies.zip(self.held.iter().map(Vec::as_slice)))
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

    /// Adds where the handles of `bodies` are in a tick of the hold, at the poses `shown` of the devices, to their mean.
    pub(super) fn keep_apart<'a>(
        &mut self,
        bodies: impl Iterator<Item = &'a Body>,
        shown: impl Fn(usize) -> Pose,
    ) {
        let share = self.trace.period / HOLD;
        let each = bodies.zip(&self.held).zip(&mut self.trace.apart);
        for ((body, held), apart) in each {
            for (handle, (device, apart)) in held.iter().zip(apart).enumerate() {
                if let Some(report) = body.handle_report(handle) {
                    let pose = Pose {
                        position: report.pose.position,
                        rotation: report.pose.rotation,
                    };
                    let begin = *apart.begin.get_or_insert(pose);
                    apart.moved += pose.displacement_from(&begin) * share;
                    apart.mean += pose.displacement_from(&shown(*device)) * share;
                }
            }
        }
    }

    /// The whole record. `capped` is the number of ticks in which the cap acted.
    pub(super) fn finish(self, capped: u64) -> Trace {
        Trace {
            capped,
            ..self.trace
        }
    }
}

/// The wrenches that bodies exert on the devices that hold their handles (axes of the scene), and the potential of their
/// weight (J). Each body comes with the devices of its handles.
pub(super) fn exerted<'a, 'b>(
    bodies: impl Iterator<Item = (&'a Body, &'b [usize])>,
) -> ([Wrench; MAX_DEVICES], f64) {
    let mut wrenches = [Wrench::zero(); MAX_DEVICES];
    let mut weight = 0.0;
    for (body, held) in bodies {
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

/// A record without entries, with room for `ticks`, of a device with the friction `friction` (N).
fn empty_trace(ticks: usize, friction: f64) -> DeviceTrace {
    DeviceTrace {
        force: Vec::with_capacity(ticks),
        moment: Vec::with_capacity(ticks),
        position: Vec::with_capacity(ticks),
        limited: Vec::with_capacity(ticks),
        body: Vec::with_capacity(ticks),
        proxy: Vec::with_capacity(ticks),
        own: Vec::new(),
        leaves: Vec3::zeros(),
        rest: Vec3::zeros(),
        friction,
    }
}

/// A proxy's pose as that of a handle.
pub(super) fn handle(pose: &Pose) -> HandlePose {
    HandlePose {
        position: pose.position,
        rotation: pose.rotation,
    }
}
