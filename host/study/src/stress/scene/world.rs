//! What a run and its reference share: the scene with the hands of a cell, its devices, and what is kept of a tick.

use super::draw::Draw;
use super::measure::{DeviceTrace, Trace};
use host::run::AnyDevice;
use host::run::setup;
use host::scene::{LoadedScene, SceneError};
use physics::{Body, HandlePose};
use rt_core::{ControllerConfig, Device, DeviceState, MAX_DEVICES, Pose, Wrench};

/// A cell's scene.
#[derive(Clone, Debug)]
pub(in crate::stress) struct World {
    /// With the cell's hands, rates and materials.
    pub(in crate::stress) loaded: LoadedScene,
    /// The same, softened.
    pub(in crate::stress) soft: Option<LoadedScene>,
    /// What was drawn.
    pub(in crate::stress) draw: Draw,
}

/// The devices of a run under virtual time.
pub(super) struct Devices {
    all: Vec<AnyDevice>,
    /// For each body and handle, the device that holds it.
    held: Vec<Vec<usize>>,
    /// Scene metres per device metre.
    scales: Vec<f64>,
    /// The device that is gone for a while.
    gone: Option<super::draw::Vanishing>,
    trace: Trace,
    /// What was stored before the first tick, gravity's part with it (J).
    stored: f64,
}

impl World {
    /// The tick's period (ns).
    pub(super) fn period_ns(&self) -> u64 {
        (1e9 / self.loaded.scene.realtime.rate).round() as u64
    }

    /// The same in seconds.
    pub(in crate::stress) fn period(&self) -> f64 {
        self.period_ns() as f64 * 1e-9
    }

    /// Ticks of a run.
    pub(super) fn ticks(&self) -> u64 {
        (self.loaded.scene.duration * self.loaded.scene.realtime.rate).round() as u64
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

    /// The devices at rest, and the controller's configuration. `stored` is what the bodies store (J).
    pub(super) fn devices(&self, stored: f64) -> Result<(ControllerConfig, Devices), SceneError> {
        let scene = &self.loaded.scene;
        let (config, devices) = setup::controls(&self.loaded, scene.seed)?;
        let ticks = self.ticks() as usize;
        let empty = || DeviceTrace {
            force: Vec::with_capacity(ticks),
            moment: Vec::with_capacity(ticks),
            position: Vec::with_capacity(ticks),
            limited: Vec::with_capacity(ticks),
            body: Vec::with_capacity(ticks),
            proxy: Vec::with_capacity(ticks),
            own: Vec::new(),
        };
        let trace = Trace {
            period: self.period(),
            devices: devices.iter().map(|_| empty()).collect(),
            ..Trace::default()
        };
        Ok((
            config,
            Devices {
                held: self.held(),
                scales: scene.devices.iter().map(|d| d.motion_scale).collect(),
                gone: self.draw.vanishing,
                all: devices,
                trace,
                stored,
            },
        ))
    }
}

impl Devices {
    /// Whether a device is gone at `now_ns`.
    fn is_gone(&self, device: usize, now_ns: u64) -> bool {
        let time = now_ns as f64 * 1e-9;
        self.gone
            .is_some_and(|gone| gone.device == device && gone.span.holds(time))
    }

    /// Moves all devices on to `now_ns`; gives what each says, or nothing where it is gone, and where it truly is.
    pub(super) fn read(
        &mut self,
        now_ns: u64,
        mut take: impl FnMut(usize, Option<DeviceState>, Pose),
    ) {
        for index in 0..self.all.len() {
            let gone = self.is_gone(index, now_ns);
            let device = &mut self.all[index];
            // A simulated device never fails by itself. One that is gone moves on all the same.
            let state = device.read(now_ns).ok().filter(|_| !gone);
            let simulated = device.simulated();
            let truly = Pose {
                position: simulated.position(),
                rotation: simulated.orientation(),
            };
            take(index, state, truly);
        }
    }

    /// Writes the commands; a device that is gone holds nothing.
    pub(super) fn write(
        &mut self,
        now_ns: u64,
        commands: &[Wrench],
        limited: impl Fn(usize) -> bool,
    ) {
        for (index, command) in commands.iter().enumerate().take(self.all.len()) {
            let gone = self.is_gone(index, now_ns);
            let device = &mut self.all[index];
            let command = if gone { &Wrench::zero() } else { command };
            // A simulated device takes every wrench.
            let _ = device.write(now_ns, command);
            let simulated = device.simulated();
            let trace = &mut self.trace.devices[index];
            trace.force.push(simulated.force());
            trace.moment.push(simulated.moment());
            trace.position.push(simulated.position());
            trace.limited.push(limited(index));
        }
    }

    /// What `bodies`, in the scene's order, exert on the devices (scene axes), and the potential of their weight (J).
    pub(super) fn exerted_by<'a>(
        &self,
        bodies: impl Iterator<Item = &'a Body>,
    ) -> ([Wrench; MAX_DEVICES], f64) {
        exerted(bodies, &self.held)
    }

    /// Keeps what the bodies exert on the devices (scene axes, N), the potential of their weight (J) and the tick's
    /// account.
    pub(super) fn keep(&mut self, bodies: &[Wrench], weight: f64, account: [f64; 2]) {
        let traces = self.trace.devices.iter_mut().zip(&self.scales);
        for ((trace, scale), wrench) in traces.zip(bodies) {
            trace.body.push(wrench.force * *scale);
        }
        let on_hands: f64 = self.all.iter().map(|d| d.energy().on_hand()).sum();
        self.trace.out.push(on_hands + weight - self.stored);
        self.trace.account.push(account);
    }

    /// Keeps where in the scene a device's proxy is.
    pub(super) fn keep_proxy(&mut self, device: usize, pose: Pose) {
        self.trace.devices[device].proxy.push(pose);
    }

    /// What was kept.
    pub(super) fn finish(self, capped: u64) -> Trace {
        Trace {
            capped,
            ..self.trace
        }
    }
}

/// What `bodies`, whose handles `held` gives to devices, exert on these (scene axes), and the potential of their weight
/// (J).
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

/// A proxy's pose as that of a handle.
pub(super) fn handle(pose: &Pose) -> HandlePose {
    HandlePose {
        position: pose.position,
        rotation: pose.rotation,
    }
}
