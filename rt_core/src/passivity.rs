//! The energy that passes between hands and a body: its account, and a cap on the energy that the body may give back.
//!
//! **Account.** A device holds a wrench `w` while it moves by `D`: the hands supply `-w . D`. The sum over the ticks
//! and over all devices on one body is the net work of the hands, exact for any scheme. If the sum falls below zero by
//! more than the energy stored at the start, energy has been generated. The sums are cumulative, so no information is
//! lost with a record.
//!
//! **Cap.** `passivity/cap.rs` limits the energy that a body gives back to that account. `passivity/classic.rs` takes
//! energy back after the fact instead.
//!
//! **Weight** is a potential, so the cap need not limit it: it gives back exactly the work that lifting took. `F_s`,
//! `V` and `H` leave the weight out, and the account keeps it apart. A device may render only a fraction `s` of a
//! weight `g`, because the host is late, or because the force of the device fades or comes in. A hand that moves at
//! such a time is spared the work `R = -(1 - s) g . D`. If the weight itself changes by `dg` at the place `p`, its
//! potential changes by `R = -dg . (p - p_0)`. The sum of these works is signed: a hand that goes up and comes back
//! down to the same height without the weight owes nothing. While the sum is positive, the hands have been spared that
//! work, and the credit of the cap is smaller by that work. A hand that rests while a weight goes and returns is spared
//! no work, so the springs keep their credit, and their force does not jump.
//!
//! **Contacts.** Bodies that touch each other pass credit on (`passivity/exchange.rs`).
//!
//! **Pieces.** Each piece of a torn body has its own credit, because hands on different pieces cannot pass energy to
//! each other (`passivity/pieces.rs`). The account of the body is the sum. `classic` knows only the sum.

mod cap;
mod classic;
mod edge;
mod exchange;
mod hand;
mod pieces;

use cap::FORGET;
use edge::Edge;
use exchange::Exchange;
pub(crate) use hand::{HandMemory, Motion};
pub(crate) use pieces::Division;
use pieces::PieceAccount;

use crate::geometry::{Pose, Vec3, Vec6, Wrench};
use crate::held_back::is_noticeable;
use crate::limits::{LARGEST_ANGULAR_RATE, LARGEST_SPEED};
use crate::{MAX_DEVICES, MAX_HANDLES};

/// Largest number of ticks by which a device renders a wrench late.
pub const MAX_DELAY: usize = 4;

/// No device holds a larger force (N).
const MOST_FORCE: f64 = 1e6;
/// Time constant (s) with which the reach of a hand in a tick decays.
const MEMORY: f64 = 0.02;

/// A device as the account sees it. All quantities are at the handle and in the scene's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Port {
    /// Viscous damping of the mechanism that the account may rely on (N s/m).
    pub damping: f64,
    /// Coulomb friction of the mechanism that the account may rely on (N).
    pub friction: f64,
    /// Viscous damping of the mechanism's rotation (N m s/rad).
    pub turning_damping: f64,
    /// Coulomb friction of the mechanism's rotation (N m).
    pub turning_friction: f64,
    /// Largest damping that is rendered (N s/m), as [`crate::velocity::most_damping`] allows.
    pub most_damping: f64,
    /// Largest rotational damping that is rendered (N m s/rad).
    pub most_turning_damping: f64,
    /// Newtons at the hand per newton in the scene, beside the factor that the motion scale implies.
    pub force_scale: f64,
    /// Position change of one encoder count (m); zero if the device has no counts.
    pub count: f64,
    /// Fastest change of the device's force (N/s); infinite if there is no slew limit. A force that cannot fall at
    /// once continues to do work. The cap keeps credit back for that work.
    pub max_slew: f64,
}

impl Port {
    /// A device of unknown properties: the account relies on no dissipation, and any damping is rendered.
    pub const UNKNOWN: Self = Self {
        damping: 0.0,
        friction: 0.0,
        turning_damping: 0.0,
        turning_friction: 0.0,
        most_damping: f64::INFINITY,
        most_turning_damping: f64::INFINITY,
        force_scale: 1.0,
        count: 0.0,
        max_slew: f64::INFINITY,
    };

    pub(crate) fn most(&self) -> [f64; 2] {
        [self.most_damping, self.most_turning_damping]
    }
}

/// Configuration of the energy account and of the cap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassivityConfig {
    /// The tick's period (s).
    pub period: f64,
    /// Energy that may be spent without being supplied (J). It is the credit at the start, the slack of the credit
    /// above twice the stored energy, and the debt at which damping ends.
    pub allowance: f64,
    /// Fraction of the devices' own damping and friction that the account relies on.
    pub credit: f64,
    /// Ticks from the command of a wrench to its rendering by the device.
    pub delay: usize,
    /// The devices, by index.
    pub ports: [Port; MAX_DEVICES],
}

impl PassivityConfig {
    /// An allowance of 0.4 mJ, a credit of two fifths of the devices' own dissipation, no delay, and devices of unknown
    /// properties. With this allowance as credit, and a debt of the same size, less than a millijoule comes out. With
    /// half the allowance, walls withstand hands that leave at once somewhat better, but a hand at rest on a light
    /// force feels the cap.
    pub fn new(period: f64) -> Self {
        Self {
            period,
            allowance: 0.4e-3,
            credit: 0.4,
            delay: 0,
            ports: [Port::UNKNOWN; MAX_DEVICES],
        }
    }
}

/// Sums over all ticks (J). The latest sums suffice: no earlier record is needed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnergyAccount {
    /// Net work of the hands on the body. A value below zero means that the body has given more energy than it got.
    pub supplied: f64,
    /// The part of `supplied` that lifted the body's weight; below zero if the weight was lowered.
    pub raised: f64,
    /// The minimum over time of `supplied + received - raised + credited`: minus the net energy that came out at the hands. The
    /// port of the hands lies behind the dissipation of their devices.
    pub least: f64,
    /// Energy in the first model that the body had before hands moved it.
    pub initial: f64,
    /// Credit that other bodies gave to this body, less the credit that it gave to them ([`LocalModel`](crate::LocalModel)
    /// states the work of contacts between bodies).
    pub received: f64,
    /// Recoverable energy of the local model. Under `capped`, the model as rendered now counts; under other schemes,
    /// the model as published.
    pub stored: f64,
    /// The part of the devices' own dissipation that the cap relied on.
    pub credited: f64,
    /// Credit that the cap can spend now.
    pub available: f64,
    /// Ticks in which the cap reduced a wrench, or the classic controller damped.
    pub capped: u64,
}

/// The force that the cap withholds now, at the handle with the largest spring force.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Withheld {
    /// Withheld force (N).
    pub force: f64,
    /// Spring force of the local model at that handle, without the weight (N).
    pub of: f64,
}

/// The energy that a piece stores, against the energy that its hands have paid for.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Balance {
    /// Energy that the springs could spend in the last tick (J).
    pub(crate) budget: f64,
    /// Energy with which their force stays whole (J).
    pub(crate) needed: f64,
    /// Energy that the piece stores beyond the energy whose force the cap leaves whole (J); zero if the force is whole.
    pub(crate) unpaid: f64,
}

impl Withheld {
    /// No force.
    pub(crate) const NONE: Self = Self {
        force: 0.0,
        of: 0.0,
    };

    /// Whether a hand can notice the withheld force.
    pub fn is_noticeable(&self) -> bool {
        is_noticeable(self.force, self.of)
    }
}

impl EnergyAccount {
    /// No energy.
    pub(crate) const NONE: Self = Self {
        supplied: 0.0,
        raised: 0.0,
        least: 0.0,
        initial: 0.0,
        received: 0.0,
        stored: 0.0,
        credited: 0.0,
        available: 0.0,
        capped: 0,
    };

    /// Energy that the rendered body has dissipated (J): supplied or received, but neither stored nor raised. A value below zero
    /// means that energy was generated.
    ///
    /// ```
    /// use rt_core::EnergyAccount;
    ///
    /// let account = EnergyAccount {
    ///     supplied: 5e-3,
    ///     raised: 1e-3,
    ///     stored: 3e-3,
    ///     ..EnergyAccount::default()
    /// };
    /// assert!((account.dissipated() - 1e-3).abs() < 1e-12);
    /// ```
    pub fn dissipated(&self) -> f64 {
        self.supplied + self.initial + self.received - self.raised - self.stored
    }
}

/// The energy account of one body's hands, and the cap on the energy that the body may give back.
///
/// A [`crate::coupling::Coupling`] owns the account and passes motions and wrenches to it. The example there shows an
/// account.
///
/// ```
/// use rt_core::PassivityConfig;
/// use rt_core::passivity::Passivity;
///
/// let passivity = Passivity::new(PassivityConfig::new(1e-3));
/// assert_eq!(passivity.account().supplied, 0.0);
/// // Before any motion, the springs may spend the allowance.
/// assert_eq!(passivity.account().available, 0.4e-3);
/// assert_eq!(passivity.withheld().force, 0.0);
/// ```
#[derive(Clone, Debug)]
pub struct Passivity {
    config: PassivityConfig,
    hands: [HandMemory; MAX_DEVICES],
    /// Number of devices that move these hands.
    devices: usize,
    account: EnergyAccount,
    /// The accounts of the pieces, and their number: one for a whole body.
    pieces: [PieceAccount; MAX_HANDLES],
    piece_count: usize,
    exchange: Exchange,
    withheld: Withheld,
    /// Whether a first local model has come.
    began: bool,
    /// Factor by which a reach decays in a tick.
    fade: f64,
}

impl Passivity {
    /// An account through which no energy has passed yet.
    pub fn new(config: PassivityConfig) -> Self {
        Self {
            config,
            hands: config.ports.map(HandMemory::new),
            devices: 0,
            account: EnergyAccount {
                available: config.allowance,
                ..EnergyAccount::default()
            },
            pieces: [PieceAccount::new(config.allowance); MAX_HANDLES],
            piece_count: 1,
            exchange: Exchange::default(),
            withheld: Withheld::default(),
            began: false,
            fade: libm::exp(-config.period / MEMORY),
        }
    }

    /// The sums so far.
    pub fn account(&self) -> &EnergyAccount {
        &self.account
    }

    /// The force that the cap withholds in this tick.
    pub fn withheld(&self) -> Withheld {
        self.withheld
    }

    /// The configuration of the account.
    pub fn config(&self) -> &PassivityConfig {
        &self.config
    }

    /// Takes the devices' poses of this tick, and accounts for the work of the wrenches held since the last tick.
    /// `holders` are the devices that hold the body: only their dissipation is credited.
    pub(crate) fn observe(
        &mut self,
        poses: impl Iterator<Item = Pose>,
        holders: impl Iterator<Item = u8>,
    ) {
        for hand in &mut self.hands {
            hand.holds = false;
        }
        for holder in holders {
            if let Some(hand) = self.hands.get_mut(usize::from(holder)) {
                hand.holds = true;
            }
        }
        self.devices = 0;
        for (hand, pose) in self.hands.iter_mut().zip(poses) {
            self.devices = self.devices.saturating_add(1);
            let port = hand.port;
            hand.step = Vec6::zeros();
            let Some(before) = hand.pose.replace(pose) else {
                continue;
            };
            hand.rest_count = Vec3::zeros();
            hand.pace = 1.0;
            for last in &mut hand.last_steps {
                last.since = last.since.saturating_add(1);
            }
            let moved = pose.displacement_from(&before);
            if !possible(&moved, self.config.period) {
                continue;
            }
            hand.step = moved;
            for (reach, length) in hand.reach.iter_mut().zip(norms(&moved)) {
                *reach = length.max(*reach * self.fade);
            }
            let translation = Vec3::new(moved.x, moved.y, moved.z);
            let held = hand.held.get(self.config.delay);
            let work = held.map_or(0.0, |wrench| wrench.stacked().dot(&moved)) * port.force_scale;
            let weight = hand.weights.get(self.config.delay);
            let fallen = weight.map_or(0.0, |weight| weight.dot(&translation)) * port.force_scale;
            // The work of the part of the weight that the device did not render.
            let spared = fallen - hand.weight.dot(&translation) * port.force_scale;
            let turn = Vec3::new(moved.w, moved.a, moved.b);
            let [last, last_turn] = &mut hand.last_steps;
            if translation != Vec3::zeros() {
                if last.since > 1 && translation.norm() < 1.5 * port.count {
                    hand.rest_count = translation;
                    hand.pace = f64::from(last.since);
                }
                note_turns(&mut hand.onward, &translation, &hand.heading, port.count);
                hand.heading =
                    hand.heading.zip_map(
                        &translation,
                        |last, now| if now == 0.0 { last } else { now },
                    );
            }
            let period = self.config.period;
            let fraction = if hand.holds { self.config.credit } else { 0.0 };
            let onwards = last.dissipated(
                &translation,
                period,
                [port.damping, port.friction],
                fraction,
            );
            if translation != Vec3::zeros() {
                let held = held.map_or(Vec3::zeros(), |wrench| wrench.force);
                let spring = (held - weight.copied().unwrap_or_default()) * port.force_scale;
                note_edges(
                    &mut hand.edges,
                    &translation,
                    &spring,
                    onwards > 0.0,
                    port.count,
                );
            }
            let credit = onwards
                + last_turn.dissipated(
                    &turn,
                    period,
                    [port.turning_damping, port.turning_friction],
                    fraction,
                );
            self.account.supplied -= work;
            self.account.credited += credit;
            self.account.raised -= fallen - spared;
            hand.spared += spared;
            if let Some(piece) = self.pieces.get_mut(hand.piece) {
                piece.credit += credit - (work - fallen);
                piece.got += work - fallen;
                piece.spared += spared;
            }
        }
        let account = &mut self.account;
        let got = account.supplied + account.received - account.raised + account.credited;
        account.least = account.least.min(got);
        self.total();
    }

    /// Takes the energy stored in the first local model, and the part of it that the body has released by itself (J). The hands
    /// need not have supplied that part. The rest is the work of hands that moved before the first model: they felt no
    /// force, so they have not paid for it yet.
    pub(crate) fn begin(&mut self, stored: f64, released: f64) {
        if !self.began {
            self.began = true;
            self.account.initial = stored.min(released).max(0.0);
            let [whole, ..] = &mut self.pieces;
            whole.begin(self.account.initial, released);
        }
    }

    /// Whether the hands had not paid for the energy of a piece in the last tick.
    #[inline]
    pub(crate) fn is_unpaid(&self) -> bool {
        let pieces = self.pieces.iter().take(self.piece_count);
        pieces.fold(0.0, |sum, piece| sum + piece.balance.unpaid) > 0.0
    }

    /// The result of the cap for a piece in the last tick.
    pub(crate) fn balance(&self, piece: usize) -> Balance {
        self.pieces
            .get(piece)
            .map_or(Balance::default(), |piece| piece.balance)
    }

    /// The memory of the account for a device.
    pub(crate) fn hand(&self, device: usize) -> Option<&HandMemory> {
        self.hands.get(device)
    }

    /// Takes the energy that the body itself has released so far, as its model claims (J). The increase is credited up
    /// to the energy that hands have got since the last such claim. A body may give energy that it has, but the claim
    /// of a model alone never raises the credit beyond that energy.
    pub(crate) fn release(&mut self, released: f64) {
        let [whole, ..] = &mut self.pieces;
        whole.release(released);
    }

    /// Notes the energy that hands could get back now (J).
    pub(crate) fn note_stored(&mut self, stored: f64) {
        self.account.stored = stored;
    }

    /// Takes the wrenches that the devices, by index, were finally commanded to hold for this body (scene axes), and for
    /// each the weight in this wrench and the weight on the handle.
    pub(crate) fn hold(
        &mut self,
        wrenches: &[Wrench; MAX_DEVICES],
        weights: &[[Vec3; 2]; MAX_DEVICES],
    ) {
        let each = self.hands.iter_mut().zip(wrenches).zip(weights);
        for ((hand, wrench), [rendered, weight]) in each.take(self.devices) {
            // No device holds a larger force, so a larger number was limited before it left.
            let held = |force: &Vec3| force.norm() <= MOST_FORCE;
            let zero = (Wrench::zero(), Vec3::zeros());
            let sound = wrench.is_finite() && held(&wrench.force) && held(rendered);
            let (wrench, rendered) = if sound { (*wrench, *rendered) } else { zero };
            let weight = if held(weight) { *weight } else { rendered };
            let raised = hand.push(&wrench, &rendered, &weight) * hand.port.force_scale;
            self.account.raised += raised;
            hand.spared += raised;
            if let Some(piece) = self.pieces.get_mut(hand.piece) {
                let before = piece.spared.max(0.0);
                piece.spared += raised;
                self.account.available -= piece.spared.max(0.0) - before;
            }
        }
    }
}

/// Notes along which axes a step by `translation` (m) is a single count back.
fn note_turns(onward: &mut Vec3, translation: &Vec3, heading: &Vec3, count: f64) {
    for ((onward, by), last) in onward.iter_mut().zip(translation).zip(heading) {
        if *by != 0.0 {
            let turns = by * last < 0.0 && by.abs() < 1.5 * count;
            *onward = if turns { 0.0 } else { 1.0 };
        }
    }
}

/// Passes a step by `translation` (m) under `force` (N) to the edge of each axis.
fn note_edges(edges: &mut [Edge; 3], translation: &Vec3, force: &Vec3, credited: bool, count: f64) {
    let moved = translation.map(|by| u8::from(by != 0.0));
    for ((&by, force), edge) in translation.iter().zip(force).zip(edges) {
        let others = moved.sum() > u8::from(by != 0.0);
        if by != 0.0 {
            edge.step(by, -force * by, credited, count);
        }
        if others {
            edge.slant();
        }
    }
}

/// Whether a device can have moved so far in a tick; false if the step is not a number. An impossible step is a
/// faulty reading, and no work was done on it. One faulty reading would leave a debt that no hand could ever repay.
fn possible(step: &Vec6, period: f64) -> bool {
    let [linear, angular] = [LARGEST_SPEED, LARGEST_ANGULAR_RATE].map(|speed| speed * period);
    let translation = Vec3::new(step.x, step.y, step.z);
    let rotation = Vec3::new(step.w, step.a, step.b);
    translation.norm() <= linear && rotation.norm() <= angular
}

/// Lengths of the translational and of the rotational part.
fn norms(stacked: &Vec6) -> [f64; 2] {
    let linear = Vec3::new(stacked.x, stacked.y, stacked.z);
    let angular = Vec3::new(stacked.w, stacked.a, stacked.b);
    [linear.norm(), angular.norm()]
}
