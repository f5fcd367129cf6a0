//! The coupling: from the newest local model of a body to a wrench on each hand that never jumps.
//!
//! **Change of model.** The old model is re-expressed at the reference of the new one. The reference wrench of the old
//! model is chosen such that the model's wrench at the present poses and velocities equals the wrench rendered before.
//! Wrench, stiffness and damping then pass linearly to those of the new model. The blend takes half a publication
//! period (as in the multirate study), or half the time since the last model if that is longer, and at least two ticks.
//! A model that arrives during a blend starts from the blended model. The force of a hand that the new model no longer
//! names fades to zero (`coupling/leaving.rs`). If a body parts into pieces, its energies part (`coupling/parting.rs`).
//!
//! **Energy.** Under every scheme, the work of the hands is accounted for ([`crate::passivity`]). Under `capped`, the
//! wrench is limited by that account. Under `classic`, hands that got more energy than they supplied are damped.
//!
//! **Age.** A model older than the limit is not trusted. Its wrench fades along a smooth step to a safe hold, which is
//! plain damping of the hand's motion. A new model brings the wrench back in the same manner. Before the first model
//! there is only the safe hold, so a run also starts without a jump.

mod capped;
mod leaving;
mod parting;
mod slips;

use crate::geometry::{Pose, Twist, Vec3, Vec6, Wrench};
use crate::held_back::HeldBackByBody;
use crate::local_model::{Lead, LocalModel, ModelFault, PublishedModel};
use crate::passivity::{EnergyAccount, Passivity, PassivityConfig, Withheld};
use crate::scheme::Scheme;
use crate::trust::{Aging, Trust};
use crate::{MAX_DEVICES, MAX_HANDLES, count_one};
use leaving::Fade;
use slips::Slips;

/// Configuration of a coupling: how it blends and ages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CouplingConfig {
    /// The scheme that reads a model between publications.
    pub scheme: Scheme,
    /// The tick's period (s).
    pub period: f64,
    /// Fraction of a publication period over which the force passes to a new model.
    pub blend: f64,
    /// Age beyond which a model is no longer trusted (s).
    pub age_limit: f64,
    /// Time in which the force fades once the model is too old, or once no model names the hand any more (s).
    pub decay: f64,
    /// Time in which the force comes back (s).
    pub recovery: f64,
    /// Damping of the safe hold, by device (N s/m). A device feels the sum over the bodies that it holds.
    pub hold_damping: [f64; MAX_DEVICES],
    /// Configuration of the energy account.
    pub passivity: PassivityConfig,
}

/// The part of the force asked for that a device passes in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passed {
    /// The fraction of the force that it renders.
    pub rendered: f64,
    /// The fraction that its limits would let pass if no force faded, came in or was away.
    pub allowed: f64,
}

impl Passed {
    /// Nothing passes.
    pub(crate) const NONE: Self = Self {
        rendered: 0.0,
        allowed: 0.0,
    };
    /// The whole force passes.
    pub const WHOLE: Self = Self {
        rendered: 1.0,
        allowed: 1.0,
    };
}

/// The state of the coupling. The numbers are the codes of the states in logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum HostState {
    /// No model has come yet.
    Waiting,
    /// The model is young enough; the force is the model's, or is coming back to it.
    Live,
    /// The model is too old and the force is fading.
    Fading,
    /// The model is too old and only the safe hold is left.
    Held,
}

impl HostState {
    /// All states, by their codes.
    pub const ALL: [Self; 4] = [Self::Waiting, Self::Live, Self::Fading, Self::Held];

    /// Its code in logs.
    pub fn code(self) -> u8 {
        self as u8
    }

    /// Its name in tables and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Live => "live",
            Self::Fading => "fading",
            Self::Held => "held",
        }
    }

    /// The effect of a model that is too old, for people; `None` while no model is too old.
    pub fn words(self) -> Option<&'static str> {
        match self {
            Self::Waiting | Self::Live => None,
            Self::Fading => Some("model too old, force fading"),
            Self::Held => Some("model too old, safe hold"),
        }
    }
}

/// Counts of the events in a coupling. The counts only grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CouplingCounters {
    /// Models taken into use.
    pub accepted: u64,
    /// Models refused because a number was not finite.
    pub not_finite: u64,
    /// Models refused because their handles do not fit.
    pub wrong_handles: u64,
    /// Models refused because they were not newer than the one in use.
    pub outdated: u64,
    /// Models refused because their time lies in the future.
    pub to_come: u64,
    /// Times that the model grew too old.
    pub faded: u64,
}

/// The coupling of one connected body to its devices.
///
/// ```
/// use rt_core::coupling::{Coupling, CouplingConfig, HostState, Passed};
/// use rt_core::geometry::Twist;
/// use rt_core::{LocalModel, MAX_DEVICES, PassivityConfig, Pose, Scheme, Vec3, Wrench};
///
/// let period = 1e-3;
/// let mut coupling = Coupling::new(CouplingConfig {
///     scheme: Scheme::Capped,
///     period,
///     blend: 0.5,
///     age_limit: 1.0,
///     decay: 0.1,
///     recovery: 0.01,
///     hold_damping: [1.0; MAX_DEVICES],
///     passivity: PassivityConfig::new(period),
/// });
///
/// // A spring of 200 N/m along x, on the handle that device 0 holds.
/// let mut model = LocalModel::empty();
/// model.head.sequence = 1;
/// model.head.handle_count = 1;
/// model.stiffness[0][0][(0, 0)] = 200.0;
/// coupling.accept(&model).unwrap();
///
/// // The hand rests for 0.1 s, then presses the spring by 5 mm in another 0.1 s.
/// let mut force = 0.0;
/// for tick in 0..200 {
///     let x = 5e-3 * f64::from(tick - 99).max(0.0) / 100.0;
///     let device = (Pose::at(Vec3::new(x, 0.0, 0.0)), Twist::zero());
///     let wrenches = coupling.tick(tick as u64 * 1_000_000, &[device]);
///     force = wrenches[0].force.x;
///     // The device renders the whole wrench.
///     let mut held = [Wrench::zero(); MAX_DEVICES];
///     held[0] = wrenches[0];
///     coupling.hold(&held, &[Passed::WHOLE; MAX_DEVICES]);
/// }
/// assert_eq!(coupling.state(), HostState::Live);
/// assert!((force + 1.0).abs() < 0.02);
/// // The hand has supplied about `K d^2 / 2`.
/// assert!((coupling.energy().supplied - 2.5e-3).abs() < 1e-4);
/// ```
#[derive(Clone, Debug)]
pub struct Coupling {
    config: CouplingConfig,
    /// The model rendered before the newest one, re-expressed at the reference of the newest.
    from: LocalModel,
    /// The newest model, as the scheme reads it. Handles of hands whose force fades follow the handles that the model
    /// names.
    to: LocalModel,
    /// Number of handles that the newest model names, and that the model before it named.
    named: u8,
    named_before: u8,
    /// The forces of hands that leave, by device.
    fades: [Fade; MAX_DEVICES],
    /// The weight on each handle, as rendered now.
    weights: [Vec3; MAX_HANDLES],
    /// The model that the next tick takes into use, if `is_pending`.
    pending: LocalModel,
    is_pending: bool,
    /// Fraction of `to` in the blend, and its growth per tick.
    blend: f64,
    blend_step: f64,
    trust: Trust,
    counters: CouplingCounters,
    held_back: HeldBackByBody,
    passivity: Passivity,
    /// Time for which the drift of the newest model has acted (s).
    ahead: f64,
    /// Fraction of each handle's step that the stiffness resists as a damper would: translation and rotation.
    lead: [[f64; 2]; MAX_HANDLES],
    slips: Slips,
}

impl Coupling {
    /// A coupling that has seen no model yet.
    pub fn new(config: CouplingConfig) -> Self {
        Self {
            config,
            from: LocalModel::empty(),
            to: LocalModel::empty(),
            named: 0,
            named_before: 0,
            fades: [Fade::none(); MAX_DEVICES],
            weights: [Vec3::zeros(); MAX_HANDLES],
            pending: LocalModel::empty(),
            is_pending: false,
            blend: 1.0,
            blend_step: 0.0,
            trust: Trust::new(Aging {
                period: config.period,
                age_limit: config.age_limit,
                decay: config.decay,
                recovery: config.recovery,
            }),
            counters: CouplingCounters::default(),
            held_back: HeldBackByBody::default(),
            passivity: Passivity::new(config.passivity),
            ahead: 0.0,
            lead: [[0.0; 2]; MAX_HANDLES],
            slips: Slips::none(),
        }
    }

    /// Hands over a model. The next tick takes the model into use if it is sound.
    ///
    /// # Errors
    /// The [`ModelFault`] for which the model was refused. Refusals are counted.
    pub fn accept(&mut self, model: &impl PublishedModel) -> Result<(), ModelFault> {
        let (current, named) = if self.is_pending {
            (&self.pending, self.pending.head.handle_count)
        } else {
            (&self.to, self.named)
        };
        let seen_one = named > 0;
        let checked = model.check().and_then(|()| {
            // After a clock was set back, the current model lies in the future. It must not block the models that
            // follow.
            let head = model.head();
            let later =
                head.time_ns > current.head.time_ns || self.trust.is_to_come(current.head.time_ns);
            let newer = later && head.epoch >= current.head.epoch;
            if self.trust.is_to_come(head.time_ns) {
                Err(ModelFault::ToCome)
            } else if seen_one && !newer {
                Err(ModelFault::Outdated)
            } else if seen_one
                && head.epoch == current.head.epoch
                && !(head.handle_count == named && same_hands_and_pieces(model, current))
            {
                // Only a change of topology may give a body other handles or other pieces.
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

    /// One tick: returns the wrench on each of the body's hands, in the model's order of handles. `devices` are the
    /// poses and twists of the proxies, by device index.
    pub fn tick(&mut self, now_ns: u64, devices: &[(Pose, Twist)]) -> [Wrench; MAX_HANDLES] {
        self.tick_slipped(now_ns, devices, devices)
    }

    /// As [`Self::tick`], if the `hands` would lead their proxies to other poses than those of `devices`: proxies have
    /// slipped.
    pub(crate) fn tick_slipped(
        &mut self,
        now_ns: u64,
        hands: &[(Pose, Twist)],
        devices: &[(Pose, Twist)],
    ) -> [Wrench; MAX_HANDLES] {
        self.trust.begin(now_ns);
        self.fade_leaving();
        self.passivity.observe(
            hands.iter().map(|(pose, _)| *pose),
            self.to.handles().map(|handle| handle.device),
        );
        self.ahead = self.to.ahead(now_ns);
        if self.is_pending {
            self.is_pending = false;
            self.switch(now_ns, devices);
        }
        self.weigh();
        let mut wrenches = match self.config.scheme {
            Scheme::Capped => self.capped(devices),
            _ => self.rendered(devices),
        };
        if self.config.scheme == Scheme::Classic {
            let hands = self.to.handles().map(|handle| handle.device);
            self.passivity.restore(hands, devices, &mut wrenches);
        }
        self.blend = (self.blend + self.blend_step).min(1.0);
        if self.to.head.handle_count > 0 {
            self.trust.grow_old(self.age_ns(now_ns));
        }
        let trust = self.trust.part();
        let used = wrenches.iter().take(usize::from(self.to.head.handle_count));
        let is_aged = self.trust.faded() > 0;
        (self.held_back).note(now_ns, &self.passivity.withheld(), trust, is_aged, used);
        for (wrench, handle) in wrenches.iter_mut().zip(self.to.handles()) {
            let device = usize::from(handle.device);
            let moving = devices
                .get(device)
                .zip(self.config.hold_damping.get(device));
            let hold = moving.map_or(Vec3::zeros(), |((_, twist), damping)| {
                twist.linear * (-damping * (1.0 - trust))
            });
            *wrench = wrench.scaled(trust);
            wrench.force += hold;
        }
        wrenches
    }

    /// Takes the wrenches that the devices, by index, were finally commanded to hold for this body (scene axes), and
    /// the part that passed of the force asked for.
    pub fn hold(&mut self, wrenches: &[Wrench; MAX_DEVICES], passed: &[Passed; MAX_DEVICES]) {
        let mut weights = [[Vec3::zeros(); 2]; MAX_DEVICES];
        let trust = self.trust.part();
        for (handle, borne) in self.to.handles().zip(&self.weights) {
            let device = usize::from(handle.device);
            let known = weights.get_mut(device).zip(passed.get(device));
            if let Some(([rendered, weight], passed)) = known {
                *rendered += borne * (trust * passed.rendered);
                *weight += borne * passed.allowed;
            }
        }
        self.passivity.hold(wrenches, &weights);
    }

    /// The energy account with its cap.
    pub(crate) fn passivity(&self) -> &Passivity {
        &self.passivity
    }

    /// The same, to pass credit on.
    pub(crate) fn passivity_mut(&mut self) -> &mut Passivity {
        &mut self.passivity
    }

    /// The energy account of the body's hands.
    pub fn energy(&self) -> &EnergyAccount {
        self.passivity.account()
    }

    /// The force that the cap withholds in this tick.
    pub fn withheld(&self) -> Withheld {
        self.passivity.withheld()
    }

    /// The force that the cap and the age of the model held back so far.
    pub fn held_back(&self) -> HeldBackByBody {
        self.held_back
    }

    /// The newest model in use, as the scheme reads it. Before the first model it has no handles. Hands that it no
    /// longer names keep a handle at its end until their force has faded.
    pub fn model(&self) -> &LocalModel {
        &self.to
    }

    /// Age of the model in use (ns).
    pub fn age_ns(&self, now_ns: u64) -> u64 {
        now_ns.saturating_sub(self.to.head.time_ns)
    }

    /// Trust in the model, from zero (safe hold) to one.
    pub fn trust(&self) -> f64 {
        self.trust.value()
    }

    /// The state of the coupling.
    pub fn state(&self) -> HostState {
        self.trust.state()
    }

    /// The counts so far.
    pub fn counters(&self) -> CouplingCounters {
        CouplingCounters {
            faded: self.trust.faded(),
            ..self.counters
        }
    }

    /// Takes the pending model into use. From here on the force passes from the force rendered so far to that of the
    /// new model.
    fn switch(&mut self, now_ns: u64, devices: &[(Pose, Twist)]) {
        self.config.scheme.shape(&mut self.pending);
        if self.config.scheme == Scheme::Capped {
            self.pending.rest_dampers();
            self.bound();
        }
        let before = self.rendered(devices);
        let ahead = self.pending.ahead(now_ns);
        let ticks = self.blend_ticks();
        (self.named_before, self.named) = (self.named, self.pending.head.handle_count);
        self.weigh();
        self.prepare_pieces();
        self.keep_leaving(&before, devices);
        let division = self.division();
        // The stored energy follows from the models as they were, so it is computed first.
        let stored = self.stored_before(devices);
        let pieces = division.is_some() || self.is_torn();
        let by_piece = pieces.then(|| self.stored_by_piece(devices));
        self.re_express(ahead, &before, devices);
        if let Some(stored) = stored {
            self.from.head.energy = 0.0;
            self.from.head.energy = stored + self.from.work(&self.from.deviations(devices), ahead);
        }
        let by_piece = by_piece.filter(|_| stored.is_some());
        let by_piece =
            by_piece.map(|former| division.map_or(former, |division| division.of(&former)));
        if let Some(stored) = &by_piece {
            self.keep_stored(stored, ahead, devices);
        }
        self.to.copy_used_from(&self.pending);
        self.passivity
            .begin(self.to.head.energy, self.to.head.released);
        self.passivity.claim(self.to.head.received);
        self.part_account(division.as_ref(), by_piece.as_ref());
        self.passivity.note_stored(self.to.head.energy.max(0.0));
        self.ahead = ahead;
        self.blend_step = 1.0 / ticks;
        self.blend = 0.0;
        count_one(&mut self.counters.accepted);
    }

    /// Energy of the model as rendered so far (J). The change of model must preserve this energy. `None` for other
    /// schemes than `capped`. `None` before the first model, too: the energy that the body stores then is its own,
    /// although its force is yet to come.
    fn stored_before(&self, devices: &[(Pose, Twist)]) -> Option<f64> {
        let has_energy = self.config.scheme == Scheme::Capped && self.to.head.handle_count > 0;
        let (still, at_rest) = ([Lead::none(); MAX_HANDLES], [Vec6::zeros(); MAX_HANDLES]);
        has_energy.then(|| self.parts(devices, &still, &at_rest).stored)
    }

    /// Makes `from` the model rendered so far, re-expressed at the references of the pending model. The reference
    /// wrenches are chosen such that the present wrenches equal `before`. The drift continues.
    fn re_express(
        &mut self,
        ahead: f64,
        before: &[Wrench; MAX_HANDLES],
        devices: &[(Pose, Twist)],
    ) {
        let Self {
            from,
            to,
            pending,
            weights,
            ..
        } = self;
        if same_handles(to, pending) {
            from.mix(to, self.blend);
            from.hand_on(to, self.blend, devices);
        } else {
            from.copy_used_from(pending);
        }
        from.head.handle_count = pending.head.handle_count;
        from.head.pieces = pending.head.pieces;
        from.head.tear_limit = pending.head.tear_limit;
        for (handle, newer) in from.handles.iter_mut().zip(pending.handles()) {
            let drift = handle.drift;
            *handle = *newer;
            handle.drift = drift;
        }
        let response = from.response(&from.deviations(devices));
        let used = usize::from(pending.head.handle_count);
        for (handle, fall) in from.handles.iter_mut().zip(&response).take(used) {
            let old = to
                .handles()
                .zip(before.iter().zip(weights.iter()))
                .find(|(old, _)| old.device == handle.device);
            let force = old.map_or(Wrench::zero(), |(_, (wrench, _))| *wrench);
            // The former weight; that of the new model if a hand joins.
            handle.weight = old.map_or(handle.weight, |(_, (_, weight))| *weight);
            let drift = handle.drift.stacked() * ahead;
            let wrench = Wrench::from_stacked(&(force.stacked() + fall - drift));
            // A force that overflowed must not persist from blend to blend, long after its cause.
            handle.wrench = if wrench.is_finite() {
                wrench
            } else {
                Wrench::zero()
            };
        }
    }

    /// The number of ticks in which the force passes to the pending model.
    fn blend_ticks(&self) -> f64 {
        let period = self.pending.head.period;
        // After a gap, the two models differ by what happened in the gap. The blend takes its fraction of the gap, up
        // to the time in which a force comes back.
        let gap = self
            .pending
            .head
            .time_ns
            .saturating_sub(self.to.head.time_ns) as f64
            * 1e-9;
        let interval = gap.min(self.config.age_limit).max(period);
        let longest = self.config.recovery.max(self.config.blend * period);
        let time = (self.config.blend * interval).min(longest);
        let ticks = libm::ceil(time / self.config.period).max(2.0);
        // The next model does not shorten a blend that is under way.
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
            let used = usize::from(self.to.head.handle_count);
            for (wrench, old) in wrenches.iter_mut().zip(&old).take(used) {
                *wrench = old
                    .scaled(1.0 - self.blend)
                    .plus(&wrench.scaled(self.blend));
            }
        }
        wrenches
    }
}

/// Whether two models have the same handles, in the same hands.
fn same_handles(a: &LocalModel, b: &LocalModel) -> bool {
    let mut pairs = a.handles().zip(b.handles());
    a.head.handle_count == b.head.handle_count && pairs.all(|(a, b)| a.device == b.device)
}

/// Whether the handles that both models have are in the same hands and on the same pieces.
fn same_hands_and_pieces(a: &impl PublishedModel, b: &LocalModel) -> bool {
    let mut pairs = a.rows().iter().zip(b.handles());
    pairs.all(|(a, b)| a.device == b.device && a.piece == b.piece)
}
