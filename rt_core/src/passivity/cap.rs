//! The cap: what a body may give back.
//!
//! The energy-capped linear model: no tick may spend more than the hands have put in (`H`), so the body never gives back
//! more than it was given, be the local models late, wrong or contradictory. It is the passivity controller of B.
//! Hannaford and J.-H. Ryu, "Time-domain passivity control of haptic interfaces" (2002), with the energy bounded above
//! as well (a tank, as of M. Franken et al., "Bilateral telemanipulation with time delays: a two-layer approach",
//! 2011): credit that is not backed by the spring of the moment is forgotten by and by, so it cannot be spent at once
//! much later. With `F_s` the elastic and `F_d` the viscous wrench on all handles, `V` the energy that hands could get
//! back, and `R` what they were spared by weights that went and came, each tick:
//!
//! ```text
//! H <- H - (w - g) . D + eta (b D^2 / (n T) + f_c |D|)  what the device itself dissipates counts in part
//! H <- H - (H - R+ - (2 V + E))+ T / 0.5 s              E: the allowance, 0.4 mJ
//! G  = (H - R+)+                                        what this tick may spend
//! F_s <- F_s min(1, G / (b V))                          the force bows out; b = 0.3, more for late devices
//! F_d <- F_d - c v                                      where V > G; c takes out what is missing
//! F_s <- F_s G / p                                      where p = |F_s| D > G: the certificate
//! F_d <- F_d (H - R+ + E - |F_s| D)+ / (|F_d| D)        where that is less: dampers may go into debt by E
//! ```
//!
//! There `D` is how far the hand may get in a tick, in any direction: the longest of its last steps, forgotten by and by.
//! When a hand turns back within a tick, the previous tick's damper pushes it along; only the first quick step is a
//! surprise.
//!
//! **The certificate** is the bound on what a tick may spend. It keeps `H >= -E` for all steps within `D`, whatever `V`,
//! `K` and `w0` a model claims: what came out is at most what was stored at the start, twice `E`, and the fraction of the
//! devices' own dissipation that is relied on. `V` decides only how early the force bows out. A model that claims too
//! much energy must not soften a hold that was paid for, so the force stays whole down to three tenths of `V`. From
//! there, on the way out, `d ln H / d ln V = 1 / 0.3`: force and account come to nothing together with `V`, without a
//! jump.
//!
//! **Counts.** What an encoder shows steps by a whole count when the hand has got to its edge, and steps back when it
//! leaves by the same edge: no work is done between, but `w . D` with the force before each step says that a spring
//! gave `K D^2`. A trembling hand on a stiff wall would so empty the account, and the wall would go soft. Where a count
//! comes after a rest, the spring's work is taken with the mean of its force before and after. What a hand can get by
//! that is `K D^2 / 2` a count, covered by friction that is not relied on up to `K = 2 (1 - eta) f_c / D`. What dampers
//! and late models make of the same count is in [`super::edge`].
//!
//! `n` counts the ticks since the device last moved: a damper takes least where the motion was even.
//!
//! `V` needs no inverse of the stiffness: the host publishes what is stored at the reference, and from there the
//! model's own force tells (`LocalModel::stored`).

use super::{MOST_FORCE, Motion, Passivity, Port, Withheld, norms};
use crate::MAX_HANDLES;
use crate::geometry::{Vec3, Vec6};
use crate::velocity::VelocityEstimator;

/// Slower than this (m/s) a hand is not damped for energy that is missing: one count in tens of ticks says nothing
/// of where it goes.
const CREEP: f64 = 1e-3;

/// Fraction of the energy that a model claims below which the force bows out. A device that is late by a tick renders
/// another tick's force on a hand that grows faster meanwhile: twice as much must be backed, and at most all. Where a
/// force falls no faster than a limit of slew, all must.
const BACKED: f64 = 0.3;

/// Time (s) in which credit that no spring backs is forgotten. At once would be wrong: while models disagree `V` passes
/// through zero for some ticks, and what was paid for the spring would be lost.
const FORGET: f64 = 0.5;

/// More damping than this (N s/m, N m s/rad) is not rendered where nothing is known of a device.
const MOST_DAMPING: f64 = 1e3;

/// Time (s) in which the damper that takes out what is missing grows to all that a device can render.
const EASE: f64 = 0.02;

/// The devices on a body's handles, in the handles' order.
struct Holders {
    devices: [usize; MAX_HANDLES],
    ports: [Port; MAX_HANDLES],
    /// How far each handle may get in a tick: translation (m) and rotation (rad).
    reaches: [[f64; 2]; MAX_HANDLES],
    /// Work that wrenches commanded before may still do (J).
    under_way: f64,
}

impl Passivity {
    /// Caps the elastic and viscous wrenches on the handles whose devices are `devices`, of which `stored` (J)
    /// could be got back.
    pub(crate) fn cap(
        &mut self,
        devices: impl Iterator<Item = u8>,
        motions: &[Motion; MAX_HANDLES],
        stored: f64,
        elastic: &mut [Vec6; MAX_HANDLES],
        viscous: &mut [Vec6; MAX_HANDLES],
    ) {
        let holders = self.holders(devices, motions);
        let spared = self.spared.max(0.0);
        self.forget(spared, stored);
        // Wrenches under way will be rendered whatever is decided now.
        let left = self.credit - spared - holders.under_way;
        let budget = left.max(0.0);
        let bowed = self.bowed_out(budget, stored, &holders.ports);
        self.damp_missing(stored - budget, &holders.ports, motions, viscous);
        let [kept, solvent] = self.certified(left, bowed, &holders.reaches, elastic, viscous);
        self.withhold([kept, solvent], elastic, viscous);
        self.settle_counts(&holders, elastic);
    }

    /// What is known of the devices on a body's handles.
    fn holders(
        &self,
        devices: impl Iterator<Item = u8>,
        motions: &[Motion; MAX_HANDLES],
    ) -> Holders {
        let mut holders = Holders {
            devices: [usize::MAX; MAX_HANDLES],
            ports: [Port::UNKNOWN; MAX_HANDLES],
            reaches: [[0.0; 2]; MAX_HANDLES],
            under_way: 0.0,
        };
        let each = holders.ports.iter_mut().zip(&mut holders.reaches);
        let each = each.zip(devices).zip(motions).zip(&mut holders.devices);
        for ((((port, reach), device), motion), holder) in each {
            let device = usize::from(device);
            *holder = device;
            let known = self.config.ports.get(device).zip(self.hands.get(device));
            if let Some((known, hand)) = known {
                *port = *known;
                *reach = hand.reach;
                let coming = hand.held.iter().take(self.config.delay);
                holders.under_way += coming
                    .map(|wrench| most_work(&wrench.stacked(), reach))
                    .sum::<f64>()
                    + hand.lingering(&motion.velocity, known.max_slew);
            }
        }
        holders
    }

    /// Lets credit fade that is not backed by what is `stored` (J); work that hands were `spared` (J) is no credit.
    fn forget(&mut self, spared: f64, stored: f64) {
        let backed = 2.0 * stored + self.config.allowance;
        self.credit -= (self.credit - spared - backed).max(0.0) * (self.config.period / FORGET);
    }

    /// The fraction of the elastic wrenches that is left where the `budget` (J) falls below the part of the `stored`
    /// energy (J) that must be backed.
    fn bowed_out(&self, budget: f64, stored: f64, ports: &[Port; MAX_HANDLES]) -> f64 {
        let slow = ports.iter().any(|port| port.max_slew.is_finite());
        let backed = if slow {
            1.0
        } else {
            (BACKED * (1.0 + self.config.delay as f64)).min(1.0)
        };
        if budget < backed * stored {
            budget / (backed * stored)
        } else {
            1.0
        }
    }

    /// Adds the damper that takes out the energy that is `missing` (J). It comes and goes without a jump.
    fn damp_missing(
        &mut self,
        missing: f64,
        ports: &[Port; MAX_HANDLES],
        motions: &[Motion; MAX_HANDLES],
        viscous: &mut [Vec6; MAX_HANDLES],
    ) {
        let period = self.config.period;
        let (eased, step) = (self.damped, period / EASE);
        let bounds = [(eased - step).max(0.0), (eased + step).min(1.0)];
        self.damped = 0.0;
        if missing > 0.0 || eased > step {
            let mut clear = *motions;
            for (motion, port) in clear.iter_mut().zip(ports) {
                quieten(&mut motion.velocity, port.count);
            }
            self.damped = damp(missing, period, bounds, ports, &clear, viscous);
        }
    }

    /// The certificate: the fractions of the elastic and of the viscous wrenches that are left. Whichever way the hands
    /// turn, springs spend no more than there is `left` (J), and dampers no more than the allowance on top.
    fn certified(
        &self,
        left: f64,
        bowed: f64,
        reaches: &[[f64; 2]; MAX_HANDLES],
        elastic: &[Vec6; MAX_HANDLES],
        viscous: &[Vec6; MAX_HANDLES],
    ) -> [f64; 2] {
        let most = |wrenches: &[Vec6; MAX_HANDLES]| -> f64 {
            let each = wrenches.iter().zip(reaches);
            each.map(|(wrench, reach)| most_work(wrench, reach)).sum()
        };
        let (springs, dampers) = (most(elastic), most(viscous));
        let budget = left.max(0.0);
        let kept = if springs * bowed > budget {
            budget / springs
        } else {
            bowed
        };
        let room = (left + self.config.allowance - springs * kept).max(0.0);
        let solvent = if dampers > room { room / dampers } else { 1.0 };
        [kept, solvent]
    }

    /// Leaves the fractions `kept` of the elastic and `solvent` of the viscous wrenches, and notes what is withheld.
    fn withhold(
        &mut self,
        [kept, solvent]: [f64; 2],
        elastic: &mut [Vec6; MAX_HANDLES],
        viscous: &mut [Vec6; MAX_HANDLES],
    ) {
        self.withheld = Withheld::default();
        if kept < 1.0 {
            for elastic in elastic.iter_mut() {
                let [force, _] = norms(elastic);
                self.withheld.of = self.withheld.of.max(force);
                *elastic *= kept;
            }
            self.withheld.force = self.withheld.of * (1.0 - kept);
        }
        if solvent < 1.0 {
            for viscous in viscous.iter_mut() {
                *viscous *= solvent;
            }
        }
        if kept < 1.0 || solvent < 1.0 {
            crate::count_one(&mut self.account.capped);
        }
    }

    /// Corrects the account for counts that came after a rest. Such a count was reached slowly, and left again where it
    /// was reached: the springs' force changes during the count, not after it. A hand can make less of that than the friction
    /// that is not relied on.
    fn settle_counts(&mut self, holders: &Holders, elastic: &[Vec6; MAX_HANDLES]) {
        let each = holders.devices.iter().zip(elastic).zip(&holders.ports);
        for ((holder, elastic), port) in each {
            let Some(hand) = self.hands.get_mut(*holder) else {
                continue;
            };
            let spring = Vec3::new(elastic.x, elastic.y, elastic.z);
            // A force that no device holds was held back before it left.
            hand.spring = if spring.norm() <= MOST_FORCE {
                let corrections = (hand.spring - spring).component_mul(&hand.crept) * 0.5;
                self.credit += corrections.sum();
                for (edge, correction) in hand.edges.iter_mut().zip(&corrections) {
                    self.credit += edge.settle(*correction, port.friction, self.config.credit);
                }
                spring
            } else {
                Vec3::zeros()
            };
        }
    }
}

/// Takes from a velocity what a count (m) by itself makes of it: that the hand got to an edge does not say how fast it
/// goes, and a trembling hold would buzz under its damper.
fn quieten(velocity: &mut Vec6, count: f64) {
    let quiet = count / VelocityEstimator::SPAN;
    let [speed, _] = norms(velocity);
    let fraction = if speed > quiet {
        1.0 - quiet / speed
    } else {
        0.0
    };
    *velocity = velocity.component_mul(&Vec6::new(fraction, fraction, fraction, 1.0, 1.0, 1.0));
}

/// Work that a wrench can do on a hand that gets so far in a tick at most.
fn most_work(wrench: &Vec6, [reach, turn]: &[f64; 2]) -> f64 {
    let [linear, angular] = norms(wrench);
    linear * reach + angular * turn
}

/// Adds damping that takes `missing` (J) out within a tick, where hands move clearly, in proportion to what each
/// device can render: a fraction of it within `bounds`, which is returned.
pub(super) fn damp(
    missing: f64,
    period: f64,
    [least, most]: [f64; 2],
    ports: &[Port; MAX_HANDLES],
    motions: &[Motion; MAX_HANDLES],
    viscous: &mut [Vec6; MAX_HANDLES],
) -> f64 {
    // Counts come every few ticks: between them the last one says where the hand goes, or damping would come and go.
    let agree = |motion: &Motion| {
        let (v, heading, step) = (&motion.velocity, &motion.heading, &motion.step);
        let along = heading.x * v.x + heading.y * v.y + heading.z * v.z;
        let about = step.w * v.w + step.a * v.a + step.b * v.b;
        along + about > 0.0 && v.x * v.x + v.y * v.y + v.z * v.z > CREEP * CREEP
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
    // Not `clamp`, which may panic: the bounds are in order, but nothing here proves it.
    let fraction = wanted.min(most).max(least);
    for (viscous, whole) in viscous.iter_mut().zip(&whole) {
        *viscous -= whole * fraction;
    }
    fraction
}
