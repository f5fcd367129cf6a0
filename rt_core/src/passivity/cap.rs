//! The cap: a bound on the energy that a body may give back.
//!
//! No tick may spend more than the hands have supplied (`H`). The body therefore never gives back more energy than it
//! got, even if the local models are late, wrong or contradictory. The cap is the passivity controller of B. Hannaford
//! and J.-H. Ryu, "Time-domain passivity control of haptic interfaces" (2002), with an upper bound on the energy as
//! well (a tank, as in M. Franken et al., "Bilateral telemanipulation with time delays: a two-layer approach", 2011).
//! The account gradually forgets credit that the present spring does not back, so this credit cannot be spent at once
//! much later.
//!
//! Let `F_s` and `F_d` be the elastic and the viscous wrench on all handles, and `V` the energy that hands could get
//! back. Let `R` be the work that the hands were spared by weights that their devices did not render. Each tick does:
//!
//! ```text
//! H <- H - (w - g) . D + eta (b D^2 / (n T) + f_c |D|)  eta: the fraction of the dissipation that counts
//! H <- H - (H - R+ - (2 V + E))+ T / 0.5 s              E: the allowance, 0.4 mJ
//! G  = (H - R+)+                                        what this tick may spend
//! F_s <- F_s min(1, G / (beta V))                       the force is reduced; beta = 0.3, more for late devices
//! F_d <- F_d - c v                                      if V > G; c takes out the missing energy
//! F_s <- F_s G / p                                      if p = |F_s| D > G: the certificate
//! F_d <- F_d (H - R+ + E - |F_s| D)+ / (|F_d| D)        if that is less: dampers may go into debt by E
//! ```
//!
//! Here `D` bounds the motion of a hand in a tick, in any direction: the longest of its last steps, with a memory that
//! decays. When a hand turns back within a tick, the damper of the previous tick pushes it along. Only the first quick
//! step is a surprise.
//!
//! **The certificate** bounds the energy that a tick may spend. It keeps `H >= -E` for all steps within `D`, for any
//! `V`, `K` and `w0` that a model claims. The energy that came out is then at most the energy stored at the start, plus
//! `2 E`, plus the part of the devices' own dissipation that is relied on. `V` decides only how early the force is
//! reduced. A model that claims too much energy must not soften a hold that was paid for, so the force stays whole
//! until the credit falls below `0.3 V`. From there on, as the hand retreats, `d ln H / d ln V = 1 / 0.3`: force and
//! credit vanish together with `V`, without a jump.
//!
//! **A force that stays reduced** becomes whole again by a slip of the proxies ([`crate::slip`]): `V` falls to
//! `0.95 H / beta`, and `H` stays.
//!
//! **No jump of a hand at rest.** While no hand moves, `H`, `R` and `V` stay, unless a model changes or a body releases
//! energy. The factor `G / (beta V)` then stays, too. A motion of the hands changes this factor by `(1 / beta - 1) w .
//! D / V`. Once a hand rests after a quick step, `D` decays, and the certificate lets the force return by a factor of
//! at most `exp(T / 20 ms)` in a tick.
//!
//! **Pieces.** Each piece of a torn body is capped by its own `H`, `R` and `V` (`passivity/pieces.rs`).
//!
//! **Counts.** The position that an encoder shows steps by a whole count when the hand reaches the edge of the count,
//! and steps back when the hand leaves by the same edge. The hand does no work between the two steps. But `w . D`, with
//! the force before each step, shows that a spring gave `K D^2`. A hand that trembles on a stiff wall would thus empty
//! the account, and the wall would become soft. If a count comes after a rest, the account therefore takes the mean of
//! the spring's force before and after the count. A hand can gain up to `K D^2 / 2` a count by this correction. The
//! friction that the account does not rely on covers this gain up to `K = 2 (1 - eta) f_c / D`. The module
//! [`super::edge`] treats the energy of dampers and late models at the same count.
//!
//! `n` is the number of ticks since the device last moved: a damper dissipates least when the motion was even.
//!
//! `V` needs no inverse of the stiffness. The host publishes the energy stored at the reference; the work of the
//! model's own force gives the difference since then ([`crate::local_model::Parts::stored`]).

use super::{MOST_FORCE, Motion, Passivity, PieceAccount, Port, Withheld, norms};
use crate::MAX_HANDLES;
use crate::geometry::{Vec3, Vec6};
use crate::velocity::VelocityEstimator;

/// Speed (m/s) below which a hand is not damped for missing energy. One count in tens of ticks does not tell the
/// direction of the hand.
const CREEP: f64 = 1e-3;

/// Angular rate (rad/s) below which a hand that only turns is not damped: the speed [`CREEP`] at 5 cm from the axis.
const TURNING_CREEP: f64 = 0.02;

/// Fraction of the energy claimed by a model below which the force is reduced. A device that is late by a tick renders
/// the force of another tick, while the hand speeds up: the backed fraction doubles, up to one. If a slew limit
/// bounds the fall of a force, the whole energy must be backed.
const BACKED: f64 = 0.3;

/// The part of the energy that hands have paid for which a slip of the proxies leaves stored. The force is whole from one
/// on; the rest keeps a tremor of the hand from asking for the next slip.
const PAID: f64 = 0.95;

/// Time constant (s) with which unbacked credit is forgotten. Credit must not be forgotten at once: while models
/// disagree, `V` passes through zero for some ticks, and the credit that paid for the spring would be lost.
pub(super) const FORGET: f64 = 0.5;

/// Largest damping (N s/m, N m s/rad) rendered on a device of unknown properties.
const MOST_DAMPING: f64 = 1e3;

/// Time (s) in which the damper that takes out missing energy grows to the largest damping of a device.
const EASE: f64 = 0.02;

/// The device on a handle.
struct Holder {
    device: usize,
    port: Port,
    /// Largest motion of the handle in a tick: translation (m) and rotation (rad).
    reach: [f64; 2],
}

/// The devices on a body's handles, in the handles' order.
type Holders = heapless::Vec<Holder, MAX_HANDLES>;

impl Passivity {
    /// Caps the elastic and viscous wrenches on the handles that `devices` hold. `stored` (J) is the energy that hands
    /// could get back.
    pub(crate) fn cap(
        &mut self,
        devices: impl Iterator<Item = u8>,
        motions: &[Motion; MAX_HANDLES],
        stored: f64,
        elastic: &mut [Vec6; MAX_HANDLES],
        viscous: &mut [Vec6; MAX_HANDLES],
    ) {
        let [mut whole, ..] = self.pieces;
        let capped = self.cap_piece(&mut whole, devices, motions, stored, elastic, viscous);
        let [first, ..] = &mut self.pieces;
        *first = whole;
        self.withheld = capped.unwrap_or_default();
        if capped.is_some() {
            crate::count_one(&mut self.account.capped);
        }
    }

    /// Caps the wrenches on the handles of one piece, by the account of that `piece`. Returns the withheld force, or
    /// `None` if the wrenches stay whole.
    pub(super) fn cap_piece(
        &mut self,
        piece: &mut PieceAccount,
        devices: impl Iterator<Item = u8>,
        motions: &[Motion; MAX_HANDLES],
        stored: f64,
        elastic: &mut [Vec6; MAX_HANDLES],
        viscous: &mut [Vec6; MAX_HANDLES],
    ) -> Option<Withheld> {
        let (holders, under_way) = self.holders(devices, motions);
        let spared = piece.spared.max(0.0);
        self.forget(piece, spared, stored);
        // The devices will render the commands that are under way, whatever this tick decides.
        let left = piece.credit - spared - under_way;
        let budget = left.max(0.0);
        let backed = self.backed(&holders);
        let needed = backed * stored;
        piece.balance.needed = needed;
        let bowed = if budget < needed {
            piece.balance.unpaid = stored - PAID * budget / backed;
            budget / needed
        } else {
            piece.balance.unpaid = 0.0;
            1.0
        };
        piece.balance.budget = budget;
        self.damp_missing(piece, stored - budget, &holders, motions, viscous);
        // Handles that do not exist have no force.
        let elastic = elastic.get_mut(..holders.len()).unwrap_or_default();
        let viscous = viscous.get_mut(..holders.len()).unwrap_or_default();
        let [elastic_share, viscous_share] =
            self.certified(left, bowed, &holders, elastic, viscous);
        let withheld = withhold([elastic_share, viscous_share], elastic, viscous);
        self.settle_counts(piece, &holders, elastic);
        withheld
    }

    /// The known properties of the devices on a body's handles, and the work that earlier commands may still do (J).
    fn holders(
        &self,
        devices: impl Iterator<Item = u8>,
        motions: &[Motion; MAX_HANDLES],
    ) -> (Holders, f64) {
        let (mut holders, mut under_way) = (Holders::new(), 0.0);
        for (device, motion) in devices.zip(motions) {
            let device = usize::from(device);
            let mut holder = Holder {
                device,
                port: Port::UNKNOWN,
                reach: [0.0; 2],
            };
            if let Some(hand) = self.hands.get(device) {
                (holder.port, holder.reach) = (hand.port, hand.reach);
                let coming = hand.held.iter().take(self.config.delay);
                under_way += coming
                    .map(|wrench| most_work(&wrench.stacked(), &hand.reach))
                    .sum::<f64>()
                    + hand.lingering(&motion.velocity);
            }
            // There are no more motions than places.
            let _ = holders.push(holder);
        }
        (holders, under_way)
    }

    /// Lets the credit decay that the `stored` energy (J) does not back. The work that the hands were `spared` (J) does
    /// not count as credit.
    fn forget(&self, piece: &mut PieceAccount, spared: f64, stored: f64) {
        let backed = 2.0 * stored + self.config.allowance;
        piece.credit -= (piece.credit - spared - backed).max(0.0) * (self.config.period / FORGET);
    }

    /// The fraction of the stored energy that must be backed, lest the elastic wrenches be reduced.
    fn backed(&self, holders: &Holders) -> f64 {
        let mut ports = holders.iter().map(|holder| &holder.port);
        if ports.any(|port| port.max_slew.is_finite()) {
            1.0
        } else {
            (BACKED * (1.0 + self.config.delay as f64)).min(1.0)
        }
    }

    /// Adds the damper that takes out the `missing` energy (J). The damper comes and goes without a jump.
    fn damp_missing(
        &self,
        piece: &mut PieceAccount,
        missing: f64,
        holders: &Holders,
        motions: &[Motion; MAX_HANDLES],
        viscous: &mut [Vec6; MAX_HANDLES],
    ) {
        let period = self.config.period;
        let (eased, step) = (piece.damped, period / EASE);
        let bounds = [(eased - step).max(0.0), (eased + step).min(1.0)];
        piece.damped = 0.0;
        if missing > 0.0 || eased > step {
            let mut clear = *motions;
            for (motion, holder) in clear.iter_mut().zip(holders) {
                without_count(&mut motion.velocity, holder.port.count);
            }
            let ports = holders.iter().map(|holder| &holder.port);
            piece.damped = damp(missing, period, bounds, ports, &clear, viscous);
        }
    }

    /// The certificate: the fractions of the elastic and of the viscous wrenches that are left. In whatever direction
    /// the hands move, springs spend at most the credit `left` (J), and dampers at most the allowance on top.
    fn certified(
        &self,
        left: f64,
        bowed: f64,
        holders: &Holders,
        elastic: &[Vec6],
        viscous: &[Vec6],
    ) -> [f64; 2] {
        let most = |wrenches: &[Vec6]| -> f64 {
            let each = wrenches.iter().zip(holders);
            each.map(|(wrench, holder)| most_work(wrench, &holder.reach))
                .sum()
        };
        let (springs, dampers) = (most(elastic), most(viscous));
        let budget = left.max(0.0);
        let elastic_share = if springs * bowed > budget {
            budget / springs
        } else {
            bowed
        };
        let room = (left + self.config.allowance - springs * elastic_share).max(0.0);
        let viscous_share = if dampers > room { room / dampers } else { 1.0 };
        [elastic_share, viscous_share]
    }

    /// Corrects the account for counts that came after a rest. The hand reached such a count slowly, and leaves it at
    /// the same place: the force of the springs changes during the count, not after it. The gain of a hand by this
    /// correction is less than the friction that the account does not rely on.
    fn settle_counts(&mut self, piece: &mut PieceAccount, holders: &Holders, elastic: &[Vec6]) {
        for (holder, elastic) in holders.iter().zip(elastic) {
            let Some(hand) = self.hands.get_mut(holder.device) else {
                continue;
            };
            let port = &holder.port;
            let spring = Vec3::new(elastic.x, elastic.y, elastic.z);
            // A force that no device holds was limited before it left.
            hand.spring = if spring.norm() <= MOST_FORCE {
                let corrections = (hand.spring - spring).component_mul(&hand.rest_count) * 0.5;
                piece.credit += corrections.sum();
                for (edge, correction) in hand.edges.iter_mut().zip(&corrections) {
                    piece.credit += edge.settle(*correction, port.friction, self.config.credit);
                }
                spring
            } else {
                Vec3::zeros()
            };
        }
    }
}

/// Scales the elastic wrenches by `elastic_share` and the viscous ones by `viscous_share`. Returns the withheld force; `None` if
/// both stay whole.
fn withhold(
    [elastic_share, viscous_share]: [f64; 2],
    elastic: &mut [Vec6],
    viscous: &mut [Vec6],
) -> Option<Withheld> {
    let mut withheld = Withheld::default();
    if elastic_share < 1.0 {
        for elastic in elastic.iter_mut() {
            let [force, _] = norms(elastic);
            withheld.of = withheld.of.max(force);
            *elastic *= elastic_share;
        }
        withheld.force = withheld.of * (1.0 - elastic_share);
    }
    if viscous_share < 1.0 {
        for viscous in viscous.iter_mut() {
            *viscous *= viscous_share;
        }
    }
    (elastic_share < 1.0 || viscous_share < 1.0).then_some(withheld)
}

/// Takes from a velocity the part that a single count (m) produces. An edge that the hand has reached does not tell its
/// speed, and a trembling hold would buzz under its damper.
fn without_count(velocity: &mut Vec6, count: f64) {
    let quiet = count / VelocityEstimator::SPAN;
    let [speed, _] = norms(velocity);
    let fraction = if speed > quiet {
        1.0 - quiet / speed
    } else {
        0.0
    };
    *velocity = velocity.component_mul(&Vec6::new(fraction, fraction, fraction, 1.0, 1.0, 1.0));
}

/// Largest work of a wrench on a hand that moves at most by these distances in a tick (J).
fn most_work(wrench: &Vec6, [reach, turn]: &[f64; 2]) -> f64 {
    let [linear, angular] = norms(wrench);
    linear * reach + angular * turn
}

/// Adds damping that takes out the energy `missing` (J) within a tick, if the velocity of a hand is clear. The
/// damping is proportional to what each device can render, by a fraction within the bounds. Returns this fraction.
pub(super) fn damp<'a>(
    missing: f64,
    period: f64,
    [least, most]: [f64; 2],
    ports: impl Iterator<Item = &'a Port>,
    motions: &[Motion; MAX_HANDLES],
    viscous: &mut [Vec6; MAX_HANDLES],
) -> f64 {
    // Counts come every few ticks. Between them, the last count tells the heading of the hand; otherwise damping would
    // come and go.
    let agree = |motion: &Motion| {
        let (v, heading, step) = (&motion.velocity, &motion.heading, &motion.step);
        let along = heading.x * v.x + heading.y * v.y + heading.z * v.z;
        let about = step.w * v.w + step.a * v.a + step.b * v.b;
        let moves = v.x * v.x + v.y * v.y + v.z * v.z > CREEP * CREEP;
        let turns = v.w * v.w + v.a * v.a + v.b * v.b > TURNING_CREEP * TURNING_CREEP;
        along + about > 0.0 && (moves || turns)
    };
    let mut whole = [Vec6::zeros(); MAX_HANDLES];
    let mut power = 0.0;
    for ((whole, port), motion) in whole.iter_mut().zip(ports).zip(motions) {
        let [linear, angular] = port.most().map(|limit| limit.min(MOST_DAMPING));
        if agree(motion) {
            let scale = Vec6::new(linear, linear, linear, angular, angular, angular);
            *whole = motion.velocity.component_mul(&scale);
            power += whole.dot(&motion.velocity);
        }
    }
    let wanted = if power > 0.0 {
        missing / (period * power)
    } else {
        0.0
    };
    // Not `clamp`, which may panic: nothing here proves that the bounds are in order, though they are.
    let fraction = wanted.min(most).max(least);
    for (viscous, whole) in viscous.iter_mut().zip(&whole) {
        *viscous -= whole * fraction;
    }
    fraction
}
