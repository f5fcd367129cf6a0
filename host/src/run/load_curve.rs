//! The force-displacement curve of each device as an observer, which draws the curves at the end of the run.

use super::observer::{Observed, Observer};
use crate::plot::{LoadCurve, force_displacement, write_picture};
use crate::scene::Scene;
use rt_core::safety::SafetyState;
use runner::link::LogRecord;
use std::path::{Path, PathBuf};

/// Most samples of a device that are kept. A longer run keeps every second tick, then every fourth, and so on.
const MOST: usize = 1 << 18;

/// Collects position and force of each device, from when it first renders the whole force of the models: while the first
/// force fades in, it belongs to no displacement.
pub(super) struct LoadCurveObserver {
    path: PathBuf,
    title: String,
    devices: Vec<Samples>,
    /// Ticks from one kept sample to the next.
    every: u64,
    taken: u64,
}

/// One device: the positions of its proxy, and the forces of the hand on the body.
struct Samples {
    name: String,
    /// Metres of the scene per metre of the device.
    scale: f64,
    /// Whether the first force has faded in.
    begun: bool,
    position: Vec<[f64; 3]>,
    force: Vec<[f64; 3]>,
}

impl LoadCurveObserver {
    /// An observer that draws to the file at `path`.
    pub(super) fn new(path: &Path, scene: &Scene) -> Self {
        let devices = scene.devices.iter().map(|device| Samples {
            name: device.name.clone(),
            scale: device.motion_scale,
            begun: false,
            position: Vec::new(),
            force: Vec::new(),
        });
        Self {
            path: path.to_owned(),
            title: scene.name.clone(),
            devices: devices.collect(),
            every: 1,
            taken: 0,
        }
    }

    /// Drops every second sample.
    fn thin(&mut self) {
        for device in &mut self.devices {
            for samples in [&mut device.position, &mut device.force] {
                let mut index = 0;
                samples.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
            }
        }
        self.every *= 2;
    }
}

/// Whether a device in this state renders the force, up to its limits.
fn renders(safety: SafetyState) -> bool {
    use SafetyState::{Hot, Limited, Normal, Slewed};
    matches!(safety, Normal | Limited | Hot | Slewed)
}

impl Observer for LoadCurveObserver {
    fn take(&mut self, record: LogRecord<'_>) {
        let LogRecord::Tick(telemetry) = record else {
            return;
        };
        if self.taken.is_multiple_of(self.every) {
            let trusted = telemetry.bodies().all(|body| body.trust >= 1.0);
            for (device, samples) in telemetry.devices().zip(&mut self.devices) {
                samples.begun |= trusted && renders(device.safety);
                if !samples.begun {
                    continue;
                }
                samples.position.push(device.pose.position.into());
                // The wrench of the telemetry acts on the hand, which feels `scale` times the force of the body.
                let force = -device.wrench.force / samples.scale;
                samples.force.push(force.into());
            }
        }
        self.taken += 1;
        let longest = self.devices.iter().map(|device| device.position.len());
        if longest.max() >= Some(MOST) {
            self.thin();
        }
    }

    fn finish(self: Box<Self>, observed: &mut Observed) {
        let devices = self.devices.iter();
        let curves = devices
            .map(|device| LoadCurve::of_motion(&device.name, &device.position, &device.force));
        let picture = force_displacement(&self.title, &curves.collect::<Vec<_>>());
        if let Err(error) = write_picture(&self.path, &picture) {
            observed.failures.push(error.to_string());
            observed.unwritten.push(self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::Telemetry;

    /// A hand whose motions are doubled in the scene feels twice the force of the body.
    #[test]
    fn the_force_is_that_on_the_body_whatever_the_scale_of_motions() {
        let mut loaded = Scene::embedded_default().expect("the built-in scene");
        loaded.scene.devices[1].motion_scale = 2.0;
        let mut observer = LoadCurveObserver::new(Path::new("x.svg"), &loaded.scene);
        let mut telemetry = Telemetry::empty();
        telemetry.device_count = 2;
        for device in &mut telemetry.devices {
            device.wrench.force.x = -6.0;
        }
        observer.take(LogRecord::Tick(&telemetry));
        let forces = observer.devices.iter().map(|device| device.force[0][0]);
        assert_eq!(forces.collect::<Vec<_>>(), [6.0, 3.0]);
    }

    /// The force of the first model fades in while the hand rests: that is no part of the curve.
    #[test]
    fn the_curve_begins_when_the_first_force_has_faded_in() {
        let loaded = Scene::embedded_default().expect("the built-in scene");
        let mut observer = LoadCurveObserver::new(Path::new("x.svg"), &loaded.scene);
        let mut telemetry = Telemetry::empty();
        telemetry.device_count = 2;
        telemetry.body_count = 1;
        telemetry.devices[1].safety = SafetyState::Engaging;
        // Fading in, and later fading after a stall.
        for trust in [0.0, 0.5, 1.0, 0.3] {
            telemetry.bodies[0].trust = trust;
            observer.take(LogRecord::Tick(&telemetry));
        }
        let kept = observer.devices.iter().map(|device| device.force.len());
        assert_eq!(kept.collect::<Vec<_>>(), [2, 0]);
    }

    /// However long a run is, the samples stay bounded and evenly spaced from its start to its end.
    #[test]
    fn a_long_run_keeps_samples_at_even_distances() {
        let loaded = Scene::embedded_default().expect("the built-in scene");
        let mut observer = LoadCurveObserver::new(Path::new("x.svg"), &loaded.scene);
        let mut telemetry = Telemetry::empty();
        telemetry.device_count = 2;
        let ticks = 3 * MOST;
        for tick in 0..ticks {
            telemetry.devices[1].pose.position.x = tick as f64;
            observer.take(LogRecord::Tick(&telemetry));
        }
        assert_eq!(observer.every, 4);
        for device in &observer.devices {
            assert_eq!(device.position.len(), ticks / 4);
            assert_eq!(device.force.len(), ticks / 4);
        }
        let kept = observer.devices[1].position.iter().enumerate();
        assert!({ kept }.all(|(index, at)| at[0] == 4.0 * index as f64));
    }
}
