//! A host that steps and publishes at its own rate, and what hands feel of it in every tick.
//!
//! The hands follow the waypoints of the scene, so that every host of a comparison meets the same motion. Couplings with the
//! scheme `capped` render the models. There is no device, no latency and no encoder.

use crate::StudyError;
use crate::hands::Hands;
use host::engine::Engine;
use host::engine::build::{self, BuildOptions};
use host::engine::contact::Contact;
use host::engine::pacer::Pacer;
use host::engine::stats::WallStopwatch;
use host::scene::LoadedScene;
use host::world::World;
use rt_core::coupling::{Coupling, CouplingConfig, Passed};
use rt_core::{LocalModel, MAX_DEVICES, PassivityConfig, Scheme, TearLimit, Vec3, Vec6, Wrench};

/// Period of the tick (s).
pub(crate) const TICK: f64 = 1e-3;

/// What is done with a model before it is rendered.
pub(crate) type Change = fn(&LocalModel) -> LocalModel;

/// The model as it is.
pub(crate) fn whole(model: &LocalModel) -> LocalModel {
    *model
}

/// The model without the limit to its extrapolation.
pub(crate) fn unlimited(model: &LocalModel) -> LocalModel {
    limited(model, |_| false)
}

/// The model with its limit if it `is_kept`.
pub(crate) fn limited(model: &LocalModel, is_kept: fn(&TearLimit) -> bool) -> LocalModel {
    let mut model = *model;
    if !is_kept(&model.head.tear_limit) {
        model.head.tear_limit = TearLimit::none();
        for handle in &mut model.handles {
            handle.tear_slope = Vec6::zeros();
        }
    }
    model
}

/// The forces on the hands (N), by device.
pub(crate) type Forces = [Vec3; MAX_DEVICES];

/// A way in which the models of the host are rendered.
struct Rendering {
    change: Change,
    /// By body.
    couplings: Vec<Coupling>,
    /// By tick.
    forces: Vec<Forces>,
}

/// One host with its couplings.
pub(crate) struct SlowHost {
    pub(crate) engine: Engine,
    pacer: Pacer,
    renderings: Vec<Rendering>,
    /// Whether a model arrived, by tick.
    arrivals: Vec<bool>,
}

impl SlowHost {
    /// A host of `rate` steps a second (Hz) that publishes once in `steps` steps. Its models are rendered in each of the ways of
    /// `changes`.
    ///
    /// # Errors
    /// [`StudyError`] if the scene cannot be built.
    pub(crate) fn new(
        loaded: &LoadedScene,
        (rate, steps): (f64, u64),
        changes: &[Change],
    ) -> Result<Self, StudyError> {
        let mut loaded = loaded.clone();
        let host = &mut loaded.scene.host;
        (host.step_rate, host.publish_rate, host.latency) = (rate, rate / steps as f64, 0.0);
        let coupling = || {
            Coupling::new(CouplingConfig {
                scheme: Scheme::Capped,
                period: TICK,
                blend: 0.5,
                // Models are never late here.
                age_limit: 1.0,
                decay: 0.1,
                recovery: 0.1,
                hold_damping: [0.0; MAX_DEVICES],
                passivity: PassivityConfig::new(TICK),
            })
        };
        let world = World::new(&loaded)?;
        let bodies = build::bodies(&world, BuildOptions::default())?;
        let contact = Contact::new(&world, &bodies)?;
        let renderings = changes.iter().map(|change| Rendering {
            change: *change,
            couplings: bodies.iter().map(|_| coupling()).collect(),
            forces: Vec::new(),
        });
        Ok(Self {
            renderings: renderings.collect(),
            engine: Engine::new(bodies).touching(contact),
            pacer: Pacer::new(rate, steps),
            arrivals: Vec::new(),
        })
    }

    /// Makes the steps that are due by the time of the tick, and renders.
    pub(crate) fn tick(&mut self, hands: &Hands, number: u64, time_ns: u64, watch: &WallStopwatch) {
        self.engine.follow(&hands.record(number, time_ns));
        let renderings = &mut self.renderings;
        let mut has_arrived = false;
        while self.pacer.next_ns() <= time_ns {
            let due = self.pacer.begin(self.pacer.next_ns());
            self.engine.step(due, watch, &mut |body, model| {
                has_arrived = true;
                for rendering in renderings.iter_mut() {
                    // A refusal would appear as an error of the force.
                    let _ = rendering.couplings[body].accept(&(rendering.change)(model));
                }
            });
        }
        self.arrivals.push(has_arrived);
        let poses = hands.by_device(time_ns as f64 * 1e-9);
        for rendering in renderings {
            let mut forces = [Vec3::zeros(); MAX_DEVICES];
            for (coupling, body) in rendering.couplings.iter_mut().zip(self.engine.bodies()) {
                let wrenches = coupling.tick(time_ns, &poses);
                let mut held = [Wrench::zero(); MAX_DEVICES];
                for (device, wrench) in body.publisher().devices().zip(&wrenches) {
                    held[usize::from(device)] = *wrench;
                    forces[usize::from(device)] += wrench.force;
                }
                coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
            }
            rendering.forces.push(forces);
        }
    }

    /// The forces of a way of rendering, by tick.
    pub(crate) fn forces(&self, rendering: usize) -> &[Forces] {
        &self.renderings[rendering].forces
    }

    /// Whether a model arrived, by tick.
    pub(crate) fn arrivals(&self) -> &[bool] {
        &self.arrivals
    }
}
