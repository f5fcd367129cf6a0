//! The record of a run, tick by tick.

use crate::stress::scene::measure::{Trace, main_direction};
use crate::stress::scene::trial::probe;
use host::engine::Engine;
use host::engine::body::HostBody;
use host::run::prepare::Prepared;
use host::run::tear_force::{TearForce, TearForces};
use host::scene::Scene;
use physics::{Body, Vec3};
use rt_core::coupling::HostState;
use rt_core::safety::SafetyState;
use rt_core::{HeldBack, Telemetry, Withheld};
use runner::{TickLoop, TickReport};

/// A run, tick by tick.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Record {
    /// The tick's period (s).
    pub period: f64,
    /// The devices, in the scene's order.
    pub devices: Vec<DeviceRecord>,
    /// The bodies, in the scene's order; none in a reference, which has no local models.
    pub bodies: Vec<BodyRecord>,
    /// Work done on the hands of all devices, less the energy stored at the start (J).
    pub out: Vec<f64>,
}

/// One device, one value for each tick.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DeviceRecord {
    /// The force of the motors (N, axes of the device).
    pub force: Vec<Vec3>,
    /// The true position of the handle (m, axes of the device).
    pub position: Vec<Vec3>,
    /// Ticks in which the force was reduced to the limit of the device.
    pub limited: u64,
    /// What the largest force of the device held back; nothing in a reference, which has no controller.
    pub held_back: HeldBack,
}

/// One body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyRecord {
    /// The force that a cap withheld, in each tick.
    pub withheld: Vec<Withheld>,
    /// Ticks in which a cap reduced a wrench, or the classic controller damped.
    pub capped: u64,
    /// Ticks in which the force faded, or was the safe hold, because the model was too old.
    pub faded: u64,
    /// Age of the local model in use (s): median and largest; none without a model.
    pub model_age: Option<[f64; 2]>,
}

impl DeviceRecord {
    /// The direction of the largest force; the x axis if there is no force.
    pub fn main_direction(&self) -> Vec3 {
        main_direction(&self.force)
    }
}

impl Record {
    /// The record of a reference run.
    pub(super) fn of_reference(trace: &Trace) -> Self {
        let devices = trace.devices.iter().map(|device| DeviceRecord {
            force: device.force.clone(),
            position: device.position.clone(),
            limited: device.limited.iter().filter(|limited| **limited).count() as u64,
            held_back: HeldBack::default(),
        });
        Self {
            period: trace.period,
            devices: devices.collect(),
            bodies: Vec::new(),
            out: trace.out.clone(),
        }
    }
}

/// The physics of the bodies.
fn all(bodies: &[HostBody]) -> impl Iterator<Item = &Body> {
    bodies.iter().map(HostBody::body)
}

/// Records a run.
pub(super) struct Recorder {
    /// Energy stored before the first tick, with the potential of gravity (J).
    stored: f64,
    /// The potential of the weight of the bodies (J); that of the last tick before a panic of the host.
    weight: f64,
    tears: TearForces,
    record: Record,
}

impl Recorder {
    /// Records the run of `scene` that is set up.
    pub(super) fn new(scene: &Scene, prepared: &mut Prepared) -> Self {
        let tears = TearForces::listening(scene, prepared);
        let bodies = prepared.engine.bodies();
        Self {
            stored: all(bodies).map(Body::total_energy).sum(),
            weight: 0.0,
            tears,
            record: Record {
                period: prepared.timing.period_ns as f64 * 1e-9,
                devices: vec![DeviceRecord::default(); prepared.tick.devices.len()],
                bodies: vec![BodyRecord::default(); bodies.len()],
                out: Vec::new(),
            },
        }
    }

    /// Takes a tick.
    pub(super) fn take(&mut self, tick: &TickLoop, telemetry: &Telemetry, engine: Option<&Engine>) {
        if let Some(engine) = engine {
            self.weight = all(engine.bodies()).map(Body::load_potential).sum();
        }
        self.tears.take(telemetry);
        let mut on_hands = 0.0;
        let devices = self.record.devices.iter_mut().zip(&tick.devices);
        for ((record, device), now) in devices.zip(telemetry.devices()) {
            let probe = probe(device);
            record.force.push(probe.held.force);
            record.position.push(probe.pose.position);
            record.limited += u64::from(now.safety == SafetyState::Limited);
            on_hands += probe.on_hand;
        }
        self.record.out.push(on_hands + self.weight - self.stored);
        for (record, now) in self.record.bodies.iter_mut().zip(telemetry.bodies()) {
            record.withheld.push(now.withheld);
            let faded = matches!(now.state, HostState::Fading | HostState::Held);
            record.faded += u64::from(faded);
        }
    }

    /// The whole record, with the counts of the tick at the end, and the force at the tears of each body.
    pub(super) fn finish(mut self, tick: &TickReport) -> (Record, Vec<Option<TearForce>>) {
        let devices = self.record.devices.iter_mut();
        for (device, found) in devices.zip(tick.controller.held_back_by_devices()) {
            device.held_back = found.limited;
        }
        let each = self.record.bodies.iter_mut();
        let each = each
            .zip(tick.controller.energy())
            .zip(&tick.latencies.model_age);
        for ((body, account), age) in each {
            body.capped = account.capped;
            let age = age.summary();
            let seconds = |ns: u64| ns as f64 * 1e-9;
            body.model_age = (age.count > 0).then(|| [seconds(age.p50), seconds(age.max)]);
        }
        (self.record, self.tears.finish())
    }
}
