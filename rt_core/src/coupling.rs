//! The coupling: from the newest local model of a body to a wrench on each hand that never jumps.
//!
//! **Change of model.** The old model is re-expressed at the new one's reference, with its reference
//! wrench chosen so that at the present poses and velocities it renders exactly what it rendered before;
//! then wrench, stiffness and damping pass linearly to the new ones over half a publication period (the
//! blend of the multirate study), or half the time since the last model if that was longer, two ticks at
//! least. A model that arrives during a blend starts from the blended one.
//!
//! **Energy.** Whatever the scheme, the work of the hands is accounted for ([`crate::passivity`]); under `capped` the
//! wrench is held to it, and under `classic` hands that got more than they gave are damped.
//!
//! **Age.** A model older than the limit is not trusted: the wrench fades along a smooth step to a safe
//! hold, which is plain damping of the hand's motion. A new model brings it back the same way. Before the
//! first model the hold is all there is, so a run starts without a jump as well.

mod capped;

use crate::geometry::{Pose, Twist, Vec3, Vec6, Wrench, smooth_step};
use crate::local_model::{LocalModel, ModelFault};
use crate::passivity::{EnergyAccount, Passivity, PassivityConfig, Withheld};
use crate::scheme::Scheme;
use crate::{MAX_DEVICES, MAX_HANDLES, count_one};

/// How a coupling blends and ages. Times in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CouplingConfig {
    /// Which force is rendered between publications.
    pub scheme: Scheme,
    /// The tick's period (s).
    pub period: f64,
    /// Fraction of a publication period over which a new model takes over.
    pub blend: f64,
    /// Age beyond which a model is no longer trusted (s).
    pub age_limit: f64,
    /// How long the force takes to fade once the model is too old (s).
    pub decay: f64,
    /// How long it takes to come back (s).
    pub recovery: f64,
    /// Damping of the safe hold (N s/m).
    pub hold_damping: f64,
    /// How the energy of its hands is accounted for.
    pub passivity: PassivityConfig,
}

/// What the coupling is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HostState {
    /// No model has come yet.
    Waiting,
    /// The model is young enough; the force is (or is coming back to) the model's.
    Live,
    /// The model is too old and the force is fading.
    Fading,
    /// The model is too old and only the safe hold is left.
    Held,
}

/// Counts of what a coupling met. They only grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CouplingCounters {
    /// Models taken into use.
    pub accepted: u64,
    /// Models refused because a number was not finite.
    pub not_finite: u64,
    /// Models refused because their handles make no sense here.
    pub wrong_handles: u64,
    /// Models refused because they were not newer than the one in use.
    pub outdated: u64,
    /// Models refused because the time that they speak of has not come.
    pub to_come: u64,
    /// Times that the model grew too old.
    pub faded: u64,
}

/// The force side of one connected body.
#[derive(Clone, Debug)]
pub struct Coupling {
    config: CouplingConfig,
    /// What was rendered before the newest model, re-expressed at its reference.
    from: LocalModel,
    /// The newest model, as the scheme reads it.
    to: LocalModel,
    /// A model that the next tick takes into use, where there is one.
    pending: LocalModel,
    is_pending: bool,
    /// Fraction of `to` in the blend, and by how much it grows a tick.
    blend: f64,
    blend_step: f64,
    /// Trust in the model, from zero (safe hold) to one.
    trust: f64,
    state: HostState,
    counters: CouplingCounters,
    passivity: Passivity,
    /// When the last tick was (ns); none before the first.
    ticked_ns: Option<u64>,
    /// How long the drift of the newest model has gone on (s).
    ahead: f64,
    /// Fraction of a step that the stiffness resists as a damper would, by handle: translation and rotation.
    lead: [[f64; 2]; MAX_HANDLES],
}

impl Coupling {
    /// A coupling that has seen no model yet.
    pub fn new(config: CouplingConfig) -> Self {
        Self {
            config,
            from: LocalModel::empty(),
            to: LocalModel::empty(),
            pending: LocalModel::empty(),
            is_pending: false,
            blend: 1.0,
            blend_step: 0.0,
            trust: 0.0,
            state: HostState::Waiting,
            counters: CouplingCounters::default(),
            passivity: Passivity::new(config.passivity),
            ticked_ns: None,
            ahead: 0.0,
            lead: [[0.0; 2]; MAX_HANDLES],
        }
    }

    /// Hands over a model, which the next tick takes into use if it is sound.
    ///
    /// # Errors
    /// The [`ModelFault`] for which it was refused; refusals are counted.
    pub fn accept(&mut self, model: &LocalModel) -> Result<(), ModelFault> {
        let current = if self.is_pending {
            &self.pending
        } else {
            &self.to
        };
        let seen_one = current.handle_count > 0;
        let checked = model.check().and_then(|()| {
            // A clock that was set back must not leave the model that it made first and last.
            let later = model.time_ns > current.time_ns || self.is_to_come(current.time_ns);
            let newer = later && model.epoch >= current.epoch;
            if self.is_to_come(model.time_ns) {
                Err(ModelFault::ToCome)
            } else if seen_one && !newer {
                Err(ModelFault::Outdated)
            } else if seen_one && model.epoch == current.epoch && !same_handles(model, current) {
                // Only a change of topology may give a body other handles.
                Err(ModelFault::Handles)
            } else {
                Ok(())
            }
        });
        match checked {
            Ok(()) => {
                self.pending.copy_used_from(model);
                self.is_pending = true;
            }
            Err(ModelFault::NotFinite) => count_one(&mut self.counters.not_finite),
            Err(ModelFault::Handles) => count_one(&mut self.counters.wrong_handles),
            Err(ModelFault::Outdated) => count_one(&mut self.counters.outdated),
            Err(ModelFault::ToCome) => count_one(&mut self.counters.to_come),
        }
        checked
    }

    /// One tick: the wrench on each of the body's hands, in the model's order of handles.
    /// `devices` are the proxies' poses and twists, by device index.
    pub fn tick(&mut self, now_ns: u64, devices: &[(Pose, Twist)]) -> [Wrench; MAX_HANDLES] {
        self.ticked_ns = Some(now_ns);
        let steps = self
            .passivity
            .observe(devices.iter().map(|(pose, _)| *pose));
        self.ahead = self.to.ahead(now_ns);
        if self.is_pending {
            self.is_pending = false;
            self.switch(now_ns, devices);
        }
        let mut wrenches = match self.config.scheme {
            Scheme::Capped => self.capped(devices, &steps),
            _ => self.rendered(devices),
        };
        if self.config.scheme == Scheme::Classic {
            let hands = self.to.handles().map(|handle| handle.device);
            self.passivity
                .restore(hands, devices, &steps, &mut wrenches);
        }
        self.blend = (self.blend + self.blend_step).min(1.0);
        self.grow_old(now_ns);
        let trust = smooth_step(self.trust);
        for (wrench, handle) in wrenches.iter_mut().zip(self.to.handles()) {
            let velocity = devices
                .get(usize::from(handle.device))
                .map_or(Vec3::zeros(), |(_, t)| t.linear);
            let hold = velocity * (-self.config.hold_damping * (1.0 - trust));
            *wrench = wrench.scaled(trust);
            wrench.force += hold;
        }
        wrenches
    }

    /// What each device, by index, was in the end told to hold for this body (scene axes), and which fraction of the
    /// force that was asked for this is.
    pub fn hold(&mut self, wrenches: &[Wrench; MAX_DEVICES], passed: &[f64; MAX_DEVICES]) {
        let mut weights = [Vec3::zeros(); MAX_DEVICES];
        let trust = smooth_step(self.trust);
        for handle in self.to.handles() {
            let device = usize::from(handle.device);
            if let Some((weight, passed)) = weights.get_mut(device).zip(passed.get(device)) {
                *weight += handle.weight * (trust * passed);
            }
        }
        self.passivity.hold(wrenches, &weights);
    }

    /// The energy of its hands.
    pub fn energy(&self) -> &EnergyAccount {
        self.passivity.account()
    }

    /// What the cap withholds of the force in this tick.
    pub fn withheld(&self) -> Withheld {
        self.passivity.withheld()
    }

    /// The newest model in use, as the scheme reads it; without handles before the first.
    pub fn model(&self) -> &LocalModel {
        &self.to
    }

    /// Age of the model in use (ns).
    pub fn age_ns(&self, now_ns: u64) -> u64 {
        now_ns.saturating_sub(self.to.time_ns)
    }

    /// Trust in the model, from zero (safe hold) to one.
    pub fn trust(&self) -> f64 {
        self.trust
    }

    /// What the coupling is doing.
    pub fn state(&self) -> HostState {
        self.state
    }

    /// What it met so far.
    pub fn counters(&self) -> CouplingCounters {
        self.counters
    }

    /// Whether a time lies further ahead of the last tick than a model may lie behind it.
    fn is_to_come(&self, time_ns: u64) -> bool {
        self.ticked_ns.is_some_and(|ticked| {
            let ahead = time_ns.saturating_sub(ticked) as f64 * 1e-9;
            ahead > self.config.age_limit
        })
    }

    /// Takes the pending model into use: from here on the force passes from the one rendered so far to the new one's.
    fn switch(&mut self, now_ns: u64, devices: &[(Pose, Twist)]) {
        self.config.scheme.shape(&mut self.pending);
        if self.config.scheme == Scheme::Capped {
            self.pending.rest_dampers();
            self.bound();
        }
        let before = self.rendered(devices);
        let ahead = self.pending.ahead(now_ns);
        let ticks = self.blend_ticks();
        // The models as they were tell it, so it comes first.
        let stored = self.stored_before(devices);
        self.re_express(ahead, &before, devices);
        if let Some(stored) = stored {
            self.from.energy = 0.0;
            self.from.energy = stored + self.from.work(&self.from.deviations(devices), ahead);
        }
        self.to.copy_used_from(&self.pending);
        self.passivity.begin(self.to.energy);
        self.passivity.release(self.to.released);
        self.passivity.note_stored(self.to.energy.max(0.0));
        self.ahead = ahead;
        self.blend_step = 1.0 / ticks;
        self.blend = 0.0;
        count_one(&mut self.counters.accepted);
    }

    /// Energy of the model as rendered so far (J), where it is to be the same afterwards: under the cap, and not before
    /// the first model. What the body stores then is its own, though its force is yet to come.
    fn stored_before(&self, devices: &[(Pose, Twist)]) -> Option<f64> {
        let told = self.config.scheme == Scheme::Capped && self.to.handle_count > 0;
        let still = [Vec6::zeros(); MAX_HANDLES];
        told.then(|| self.parts(devices, &still, &still).stored)
    }

    /// Makes `from` what was rendered so far, re-expressed at the references of the pending model, with reference wrenches
    /// that make the present wrenches those `before`. The drift goes on.
    fn re_express(
        &mut self,
        ahead: f64,
        before: &[Wrench; MAX_HANDLES],
        devices: &[(Pose, Twist)],
    ) {
        let Self {
            from, to, pending, ..
        } = self;
        if same_handles(to, pending) {
            from.mix(to, self.blend);
        } else {
            from.copy_used_from(pending);
        }
        from.handle_count = pending.handle_count;
        for (handle, newer) in from.handles.iter_mut().zip(pending.handles()) {
            let drift = handle.drift;
            *handle = *newer;
            handle.drift = drift;
        }
        let response = from.response(&from.deviations(devices));
        let used = usize::from(pending.handle_count);
        for (handle, fall) in from.handles.iter_mut().zip(&response).take(used) {
            let old = to
                .handles()
                .zip(before)
                .find(|(old, _)| old.device == handle.device);
            let force = old.map_or(Wrench::zero(), |(_, wrench)| *wrench);
            let drift = handle.drift.stacked() * ahead;
            let wrench = Wrench::from_stacked(&(force.stacked() + fall - drift));
            // A force that overflowed must not live on from blend to blend, long after its cause.
            handle.wrench = if wrench.is_finite() {
                wrench
            } else {
                Wrench::zero()
            };
        }
    }

    /// Over how many ticks the force passes to the pending model.
    fn blend_ticks(&self) -> f64 {
        let period = self.pending.period;
        // After a gap the two models differ by what happened in it: the blend takes its part of that, up to the time
        // in which a force comes back.
        let gap = self.pending.time_ns.saturating_sub(self.to.time_ns) as f64 * 1e-9;
        let interval = gap.min(self.config.age_limit).max(period);
        let longest = self.config.recovery.max(self.config.blend * period);
        let time = (self.config.blend * interval).min(longest);
        let ticks = libm::ceil(time / self.config.period).max(2.0);
        // A blend that is under way is not cut short by the next model either.
        let left = if self.blend < 1.0 {
            (1.0 - self.blend) / self.blend_step
        } else {
            0.0
        };
        ticks.max(left)
    }

    fn rendered(&self, devices: &[(Pose, Twist)]) -> [Wrench; MAX_HANDLES] {
        let deviations = self.to.deviations(devices);
        let mut wrenches = self.to.wrenches(&deviations, self.ahead);
        if self.blend < 1.0 {
            let old = self.from.wrenches(&deviations, self.ahead);
            for (wrench, old) in wrenches.iter_mut().zip(&old) {
                *wrench = old
                    .scaled(1.0 - self.blend)
                    .plus(&wrench.scaled(self.blend));
            }
        }
        wrenches
    }

    fn grow_old(&mut self, now_ns: u64) {
        if self.to.handle_count == 0 {
            return;
        }
        let fresh = self.age_ns(now_ns) as f64 <= self.config.age_limit * 1e9;
        let was_live = self.state == HostState::Live;
        let step = if fresh {
            self.config.period / self.config.recovery
        } else {
            -self.config.period / self.config.decay
        };
        self.trust = (self.trust + step).clamp(0.0, 1.0);
        self.state = match (fresh, self.trust > 0.0) {
            (true, _) => HostState::Live,
            (false, true) => HostState::Fading,
            (false, false) => HostState::Held,
        };
        if was_live && !fresh {
            count_one(&mut self.counters.faded);
        }
    }
}

/// Whether two models have the same handles, in the same hands.
fn same_handles(a: &LocalModel, b: &LocalModel) -> bool {
    a.handle_count == b.handle_count
        && a.handles()
            .zip(b.handles())
            .all(|(a, b)| a.device == b.device)
}
