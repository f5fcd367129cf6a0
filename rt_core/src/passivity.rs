//! The energy that passes between hands and a body: an account of it, and a cap on what the body may give back.
//!
//! **Account.** A device holds a wrench `w` while it moves by `D`: the hands put `-w . D` in. Summed over the
//! ticks and over all devices on one body that is the hands' net work, exact for any scheme; below zero by more
//! than what was stored at the start, energy has been made. Cumulative sums are kept, so that a lost record loses
//! nothing.
//!
//! **Cap.** The energy-capped linear model: an elastic force whose recoverable energy `V` is more than what the
//! hands have put in (`H`) is scaled down by `sqrt(H / V)`, so the body never gives back more than it was given, be
//! the local models late, wrong or contradictory. It is the passivity controller of B. Hannaford and J.-H. Ryu,
//! "Time-domain passivity control of haptic interfaces" (2002), with the energy bounded above as well (a tank, as of
//! M. Franken et al., "Bilateral telemanipulation with time delays: a two-layer approach", 2011): credit that is not
//! backed by the spring of the moment is forgotten, so it cannot be spent at once later. With `F_s` the elastic and
//! `F_d` the viscous wrench on all handles, each tick:
//!
//! ```text
//! H <- H - w . D + eta (b D^2 / (n T) + f_c |D|)  what the device itself dissipates counts in part
//! H <- min(H, 2 V + E)                            E: the allowance, a millijoule
//! F_s <- F_s sqrt(H+ / V), F_d <- F_d - c v       where V > H; c takes out what is missing
//! F_s <- F_s H+ / p                               where p = |F_s| D > H+: more than a tick may spend
//! F_d <- F_d (H + E - |F_s| D)+ / (|F_d| D)       where that is less: dampers may go into debt by E
//! ```
//!
//! There `D` is how far the hand may get in a tick, whichever way: the longest of its last steps, forgotten by and by.
//! A hand that turns back within a tick has yesterday's damper push it along; only its first quick step is a surprise.
//!
//! **Counts.** What an encoder shows steps by a whole count when the hand has got to its edge, and steps back when it
//! leaves by the same edge: no work is done between, but `w . D` with the force before each step says that a spring
//! gave `K D^2`. A trembling hand on a stiff wall would so empty the account, and the wall would go soft. Where a count
//! comes after a rest, the spring's work is taken with the mean of its force before and after. What a hand can get by
//! that is `K D^2 / 2` a count, covered by friction that is not relied on up to `K = 2 (1 - eta) f_c / D`.
//!
//! `n` counts the ticks since the device last moved: a damper takes least where the motion was even.
//!
//! `V` needs no inverse of the stiffness: the host publishes what is stored at the reference, and from there the
//! model's own force tells (`LocalModel::stored`).
//!
//! **Weight** is a potential and not the cap's business: it gives back exactly what lifting it took. It is left out of
//! `F_s`, `V` and `H` and accounted for apart; only where it comes back from having been taken away (a host that was
//! late, a device that was silent) higher up than it began, the cap pays for the difference.

mod classic;

use crate::geometry::{Pose, Vec3, Vec6, Wrench};
use crate::{MAX_DEVICES, MAX_HANDLES};

/// Most ticks by which a device renders a wrench late.
pub const MAX_DELAY: usize = 4;

/// Slower than this (m/s) a hand is not damped for energy that is missing: one count in tens of ticks says nothing
/// of where it goes.
const CREEP: f64 = 1e-3;

/// More than this (N) no device holds.
const MOST_FORCE: f64 = 1e6;
/// How long (s) it is remembered how far a hand got in a tick.
const MEMORY: f64 = 0.02;

/// Faster than this (m/s, rad/s) no hand moves a device: such a step is a reading gone wrong, and no work was done on
/// the way. Without this one bad reading would leave a debt that no hand could ever repay.
const FASTEST: [f64; 2] = [20.0, 200.0];

/// A device as the account sees it, all of it at the handle and in the scene's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Port {
    /// Viscous damping of the mechanism that may be relied on (N s/m).
    pub damping: f64,
    /// Coulomb friction of the mechanism that may be relied on (N).
    pub friction: f64,
    /// Most damping that is rendered (N s/m): what [`crate::velocity::most_damping`] allows.
    pub most_damping: f64,
    /// The same of rotation (N m s/rad).
    pub most_turning_damping: f64,
    /// Newtons at the hand per newton in the scene beyond what the motion scale asks for.
    pub force_scale: f64,
    /// Position change of one encoder count (m); zero where there is no such thing.
    pub count: f64,
    /// Fastest change of its force (N/s); infinite where there is no such limit. A force that cannot fall at once goes
    /// on doing work, and the cap keeps that much back.
    pub max_slew: f64,
}

impl Port {
    /// A device of which nothing is known: it dissipates nothing, and whatever damping is asked for is rendered.
    pub const UNKNOWN: Self = Self {
        damping: 0.0,
        friction: 0.0,
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

/// How energy is accounted for and capped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassivityConfig {
    /// The tick's period (s).
    pub period: f64,
    /// What may be spent without having been put in (J): the start of the account, its slack above twice what is
    /// stored, and the debt at which damping ends.
    pub allowance: f64,
    /// Share of the devices' own damping and friction that is relied on.
    pub credit: f64,
    /// Ticks between a wrench's command and when the device renders it.
    pub delay: usize,
    /// The devices, by index.
    pub ports: [Port; MAX_DEVICES],
}

impl PassivityConfig {
    /// A millijoule, two fifths of what devices dissipate, no delay, devices of which nothing is known.
    pub fn new(period: f64) -> Self {
        Self {
            period,
            allowance: 1e-3,
            credit: 0.4,
            delay: 0,
            ports: [Port::UNKNOWN; MAX_DEVICES],
        }
    }
}

/// Sums over all ticks (J). They tell the whole story without any record in between.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnergyAccount {
    /// Net work of the hands on the body. Below zero, the body has given more than it got.
    pub supplied: f64,
    /// Part of it that lifted the body's weight; below zero where it was let down.
    pub raised: f64,
    /// The least that `supplied - raised` ever was: minus the net energy that came out.
    pub least: f64,
    /// What was stored when the first model came.
    pub initial: f64,
    /// Recoverable energy of the local model as rendered now; under other schemes than `capped` as it was published.
    pub stored: f64,
    /// What the devices themselves dissipated and the cap relied on.
    pub credited: f64,
    /// What the cap has to spend now.
    pub available: f64,
    /// Ticks in which the cap took something off, or the classic controller damped.
    pub capped: u64,
}

impl EnergyAccount {
    /// What the body, as rendered, has dissipated (J): supplied, and neither stored nor raised. Below zero, energy was
    /// made.
    pub fn dissipated(&self) -> f64 {
        self.supplied + self.initial - self.raised - self.stored
    }
}

/// How one handle moves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    /// Displacement over the last tick.
    pub(crate) step: Vec6,
    /// Velocity, filtered.
    pub(crate) velocity: Vec6,
}

impl Motion {
    pub(crate) fn none() -> Self {
        Self {
            step: Vec6::zeros(),
            velocity: Vec6::zeros(),
        }
    }
}

/// What is remembered of a device.
#[derive(Clone, Copy, Debug)]
struct Hand {
    pose: Option<Pose>,
    /// What it rendered and renders, newest first.
    held: [Wrench; MAX_DELAY + 1],
    /// How much of that is weight.
    weights: [Vec3; MAX_DELAY + 1],
    /// Where it was when it first bore weight.
    lifted_from: Option<Vec3>,
    /// The last translation that was one.
    way: Vec3,
    /// Ticks since then.
    since: u32,
    /// The step of this tick, if it was one count after a rest.
    crept: Vec3,
    /// Force of the springs held last.
    spring: Vec3,
    /// How far it may get in a tick, either way: the longest of its last steps, forgotten by and by.
    reach: [f64; 2],
}

impl Hand {
    fn new() -> Self {
        Self {
            pose: None,
            held: [Wrench::zero(); MAX_DELAY + 1],
            weights: [Vec3::zeros(); MAX_DELAY + 1],
            lifted_from: None,
            way: Vec3::zeros(),
            since: 0,
            crept: Vec3::zeros(),
            spring: Vec3::zeros(),
            reach: [0.0; 2],
        }
    }

    /// A newer wrench is held, `weight` of it weight; the oldest is forgotten. Returns what the change of weight adds
    /// to the potential (J).
    fn push(&mut self, wrench: &Wrench, weight: &Vec3) -> f64 {
        let [before, ..] = self.weights;
        let mut newer = *wrench;
        for held in &mut self.held {
            core::mem::swap(held, &mut newer);
        }
        let mut newer = *weight;
        for held in &mut self.weights {
            core::mem::swap(held, &mut newer);
        }
        let change = weight - before;
        let Some(pose) = self.pose.filter(|_| change != Vec3::zeros()) else {
            return 0.0;
        };
        let from = *self.lifted_from.get_or_insert(pose.position);
        -change.dot(&(pose.position - from))
    }

    /// Work that the wrench held now will do (J) before it can be taken away, moving on at `velocity`: it falls by
    /// `slew` (N/s) at most.
    fn lingering(&self, velocity: &Vec6, slew: f64) -> f64 {
        let [held, ..] = &self.held;
        let power = held
            .force
            .dot(&Vec3::new(velocity.x, velocity.y, velocity.z));
        (0.5 * power * held.force.norm() / slew).max(0.0)
    }
}

/// The energy of one body's hands.
#[derive(Clone, Debug)]
pub struct Passivity {
    config: PassivityConfig,
    hands: [Hand; MAX_DEVICES],
    account: EnergyAccount,
    /// Whether a first local model has come.
    began: bool,
    /// What is left of a reach after a tick.
    fade: f64,
}

impl Passivity {
    /// Nothing has passed yet.
    pub fn new(config: PassivityConfig) -> Self {
        Self {
            config,
            hands: [Hand::new(); MAX_DEVICES],
            account: EnergyAccount {
                available: config.allowance,
                ..EnergyAccount::default()
            },
            began: false,
            fade: libm::exp(-config.period / MEMORY),
        }
    }

    /// The sums so far.
    pub fn account(&self) -> &EnergyAccount {
        &self.account
    }

    /// How the account is kept.
    pub fn config(&self) -> &PassivityConfig {
        &self.config
    }

    /// Takes the devices' poses of this tick; returns how each moved since the last. The wrenches held meanwhile
    /// did their work.
    pub(crate) fn observe(&mut self, poses: impl Iterator<Item = Pose>) -> [Vec6; MAX_DEVICES] {
        let mut steps = [Vec6::zeros(); MAX_DEVICES];
        let each = self.hands.iter_mut().zip(&self.config.ports);
        for (((hand, port), pose), step) in each.zip(poses).zip(&mut steps) {
            let Some(before) = hand.pose.replace(pose) else {
                continue;
            };
            hand.since = hand.since.saturating_add(1);
            hand.crept = Vec3::zeros();
            let moved = pose.displacement_from(&before);
            if !possible(&moved, self.config.period) {
                continue;
            }
            *step = moved;
            for (reach, length) in hand.reach.iter_mut().zip(norms(&moved)) {
                *reach = length.max(*reach * self.fade);
            }
            let way = Vec3::new(step.x, step.y, step.z);
            let held = hand.held.get(self.config.delay);
            let work = held.map_or(0.0, |wrench| wrench.stacked().dot(step)) * port.force_scale;
            let weight = hand.weights.get(self.config.delay);
            let fallen = weight.map_or(0.0, |weight| weight.dot(&way)) * port.force_scale;
            let mut credit = 0.0;
            if way != Vec3::zeros() {
                // A count that flickers to and fro dissipates nothing. One that comes once in many ticks, or after a
                // device was silent, was made slowly: a damper takes `b D^2 / t` at least in the time `t`.
                if way.dot(&hand.way) > 0.0 {
                    let length = way.norm();
                    let speed = length / (self.config.period * f64::from(hand.since));
                    credit = self.config.credit * length * (port.damping * speed + port.friction);
                }
                if hand.since > 1 && way.norm() < 1.5 * port.count {
                    hand.crept = way;
                }
                hand.way = way;
                hand.since = 0;
            }
            self.account.supplied -= work;
            self.account.credited += credit;
            self.account.raised -= fallen;
            self.account.available += credit - (work - fallen);
        }
        let account = &mut self.account;
        account.least = account.least.min(account.supplied - account.raised);
        steps
    }

    /// The body has a first local model, with so much energy in it (J): the hands need not have put it in.
    pub(crate) fn begin(&mut self, stored: f64) {
        if !self.began {
            self.began = true;
            self.account.initial = stored.max(0.0);
            self.account.available += self.account.initial;
        }
    }

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
        let period = self.config.period;
        let mut ports = [Port::UNKNOWN; MAX_HANDLES];
        let mut reaches = [[0.0; 2]; MAX_HANDLES];
        let mut under_way = 0.0;
        let mut holders = [usize::MAX; MAX_HANDLES];
        let each = ports.iter_mut().zip(&mut reaches).zip(devices).zip(motions);
        for ((((port, reach), device), motion), holder) in each.zip(&mut holders) {
            let device = usize::from(device);
            *holder = device;
            let known = self.config.ports.get(device).zip(self.hands.get(device));
            if let Some((known, hand)) = known {
                *port = *known;
                *reach = hand.reach;
                let coming = hand.held.iter().take(self.config.delay);
                under_way += coming
                    .map(|wrench| most_work(&wrench.stacked(), reach))
                    .sum::<f64>()
                    + hand.lingering(&motion.velocity, known.max_slew);
            }
        }
        let available = &mut self.account.available;
        *available = available.min(2.0 * stored + self.config.allowance);
        // Wrenches under way will be rendered whatever is decided now.
        let left = *available - under_way;
        let budget = left.max(0.0);
        let mut kept = 1.0;
        if stored > budget {
            kept = libm::sqrt(budget / stored);
            damp(stored - budget, period, &ports, motions, viscous);
        }
        let most = |wrenches: &[Vec6; MAX_HANDLES]| -> f64 {
            let each = wrenches.iter().zip(&reaches);
            each.map(|(wrench, reach)| most_work(wrench, reach)).sum()
        };
        // Whichever way the hands turn, springs spend no more than there is, and dampers no more than the allowance on
        // top.
        let (springs, dampers) = (most(elastic), most(viscous));
        if springs * kept > budget {
            kept = budget / springs;
        }
        let room = (left + self.config.allowance - springs * kept).max(0.0);
        let solvent = if dampers > room { room / dampers } else { 1.0 };
        if kept < 1.0 {
            for elastic in elastic.iter_mut() {
                *elastic *= kept;
            }
        }
        if solvent < 1.0 {
            for viscous in viscous.iter_mut() {
                *viscous *= solvent;
            }
        }
        if kept < 1.0 || solvent < 1.0 {
            crate::count_one(&mut self.account.capped);
        }
        // A count that came after a rest was reached slowly, and left again where it was reached: the springs' force
        // changes on the way, not after it. What a hand can make of that is less than the friction not relied on.
        for (holder, elastic) in holders.iter().zip(elastic.iter()) {
            if let Some(hand) = self.hands.get_mut(*holder) {
                let spring = Vec3::new(elastic.x, elastic.y, elastic.z);
                // What no device holds was held back on the way.
                hand.spring = if spring.norm() <= MOST_FORCE {
                    self.account.available -= 0.5 * (spring - hand.spring).dot(&hand.crept);
                    spring
                } else {
                    Vec3::zeros()
                };
            }
        }
    }

    /// Notes what could be got back now (J).
    pub(crate) fn note_stored(&mut self, stored: f64) {
        self.account.stored = stored;
    }

    /// What each device, by index, was in the end commanded to hold for this body (scene axes), and how much of that is
    /// weight.
    pub(crate) fn hold(&mut self, wrenches: &[Wrench; MAX_DEVICES], weights: &[Vec3; MAX_DEVICES]) {
        let each = self.hands.iter_mut().zip(&self.config.ports);
        for ((hand, port), (wrench, weight)) in each.zip(wrenches.iter().zip(weights)) {
            // No device holds more than this, so a number that says otherwise was held back on the way.
            let held = |force: &Vec3| force.norm() <= MOST_FORCE;
            let zero = (Wrench::zero(), Vec3::zeros());
            let sound = wrench.is_finite() && held(&wrench.force) && held(weight);
            let (wrench, weight) = if sound { (*wrench, *weight) } else { zero };
            let raised = hand.push(&wrench, &weight) * port.force_scale;
            self.account.raised += raised;
            // What is lost is not credited.
            self.account.available -= raised.max(0.0);
        }
    }
}

/// Whether a device can have moved so far in a tick. What is not a number it cannot.
fn possible(step: &Vec6, period: f64) -> bool {
    let [linear, angular] = FASTEST.map(|speed| speed * period);
    let translation = Vec3::new(step.x, step.y, step.z);
    let rotation = Vec3::new(step.w, step.a, step.b);
    translation.norm() <= linear && rotation.norm() <= angular
}

/// Lengths of the translational and the rotational part.
fn norms(stacked: &Vec6) -> [f64; 2] {
    let linear = Vec3::new(stacked.x, stacked.y, stacked.z);
    let angular = Vec3::new(stacked.w, stacked.a, stacked.b);
    [linear.norm(), angular.norm()]
}

/// Work that a wrench can do on a hand that gets so far in a tick at most.
fn most_work(wrench: &Vec6, [reach, turn]: &[f64; 2]) -> f64 {
    let [linear, angular] = norms(wrench);
    linear * reach + angular * turn
}

/// Adds damping that takes `missing` (J) out within a tick, where hands move clearly, in proportion to what each
/// device can render.
fn damp(
    missing: f64,
    period: f64,
    ports: &[Port; MAX_HANDLES],
    motions: &[Motion; MAX_HANDLES],
    viscous: &mut [Vec6; MAX_HANDLES],
) {
    let agree = |motion: &Motion| {
        let v = &motion.velocity;
        motion.step.dot(v) > 0.0 && v.x * v.x + v.y * v.y + v.z * v.z > CREEP * CREEP
    };
    let mut most = [Vec6::zeros(); MAX_HANDLES];
    let mut power = 0.0;
    for ((most, port), motion) in most.iter_mut().zip(ports).zip(motions) {
        let [linear, angular] = port.most().map(|limit| limit.min(1e3));
        if agree(motion) {
            let scale = Vec6::new(linear, linear, linear, angular, angular, angular);
            *most = motion.velocity.component_mul(&scale);
            power += most.dot(&motion.velocity);
        }
    }
    if power > 0.0 {
        let share = (missing / (period * power)).min(1.0);
        for (viscous, most) in viscous.iter_mut().zip(&most) {
            *viscous -= most * share;
        }
    }
}
