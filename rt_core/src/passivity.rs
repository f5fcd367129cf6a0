//! The energy that passes between hands and a body: an account of it, and a cap on what the body may give back.
//!
//! **Account.** A device holds a wrench `w` while it moves by `D`: the hands put `-w . D` in. Summed over the
//! ticks and over all devices on one body that is the hands' net work, exact for any scheme; below zero by more
//! than what was stored at the start, energy has been made. Cumulative sums are kept, so that a lost record loses
//! nothing.
//!
//! **Cap.** What a body gives back is held to it: `passivity/cap.rs`; or taken back after the fact:
//! `passivity/classic.rs`.
//!
//! **Weight** is a potential and not the cap's business: it gives back exactly what lifting it took. It is left out of
//! `F_s`, `V` and `H` and accounted for apart. Where the held fraction `s` of a weight `g` changes (a host that was late, a
//! device that was silent) at a place `p`, its potential changes by `R = -ds g . (p - p_0)`. The sum of these changes
//! has its sign: a weight that is taken away up there and comes back up there costs nothing. As long as the sum is
//! above zero, hands have been spared so much work, and the cap has so much less to spend.

mod cap;
mod classic;
mod edge;
mod hand;

use edge::Edge;
use hand::Hand;
pub(crate) use hand::Motion;

use crate::MAX_DEVICES;
use crate::geometry::{Pose, Vec3, Vec6, Wrench};
use crate::limits::{LARGEST_ANGULAR_RATE, LARGEST_SPEED};

/// Most ticks by which a device renders a wrench late.
pub const MAX_DELAY: usize = 4;

/// More than this (N) no device holds.
const MOST_FORCE: f64 = 1e6;
/// How long (s) it is remembered how far a hand got in a tick.
const MEMORY: f64 = 0.02;

/// A device as the account sees it, all of it at the handle and in the scene's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Port {
    /// Viscous damping of the mechanism that may be relied on (N s/m).
    pub damping: f64,
    /// Coulomb friction of the mechanism that may be relied on (N).
    pub friction: f64,
    /// Viscous damping of its rotation (N m s/rad).
    pub turning_damping: f64,
    /// Coulomb friction of its rotation (N m).
    pub turning_friction: f64,
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

/// How energy is accounted for and capped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassivityConfig {
    /// The tick's period (s).
    pub period: f64,
    /// What may be spent without having been put in (J): the start of the account, its slack above twice what is
    /// stored, and the debt at which damping ends.
    pub allowance: f64,
    /// Fraction of the devices' own damping and friction that is relied on.
    pub credit: f64,
    /// Ticks between a wrench's command and when the device renders it.
    pub delay: usize,
    /// The devices, by index.
    pub ports: [Port; MAX_DEVICES],
}

impl PassivityConfig {
    /// 0.4 mJ (with as much of debt again, less than a millijoule comes out), two fifths of what devices dissipate, no
    /// delay, devices of which nothing is known. With half as much, walls stand a little more of hands that leave at
    /// once, but a hand at rest on a light force feels the cap at work.
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

/// Sums over all ticks (J). They tell the whole story without any record in between.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnergyAccount {
    /// Net work of the hands on the body. Below zero, the body has given more than it got.
    pub supplied: f64,
    /// Part of it that lifted the body's weight; below zero where it was let down.
    pub raised: f64,
    /// The least that `supplied - raised + credited` ever was: minus the net energy that came out at the hands, whose port
    /// lies behind what their devices dissipate.
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

/// What the cap withholds of a body's force now, at the handle where the springs hold most.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Withheld {
    /// Force that is withheld (N).
    pub force: f64,
    /// Force of the local model's springs there, weight left out (N).
    pub of: f64,
}

impl EnergyAccount {
    /// What the body, as rendered, has dissipated (J): supplied, and neither stored nor raised. Below zero, energy was
    /// made.
    pub fn dissipated(&self) -> f64 {
        self.supplied + self.initial - self.raised - self.stored
    }
}

/// The energy of one body's hands.
#[derive(Clone, Debug)]
pub struct Passivity {
    config: PassivityConfig,
    hands: [Hand; MAX_DEVICES],
    account: EnergyAccount,
    /// What springs may give back (J): what hands have put in, less what has been forgotten of it.
    credit: f64,
    /// What bodies said to have released so far (J), and what hands have got by it since they said so last.
    released: f64,
    got: f64,
    /// Work that hands were spared by weights that went and came (J), with its sign.
    spared: f64,
    withheld: Withheld,
    /// Fraction of the devices' damping that takes out what is missing.
    damped: f64,
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
            credit: config.allowance,
            released: 0.0,
            got: 0.0,
            spared: 0.0,
            withheld: Withheld::default(),
            damped: 0.0,
            began: false,
            fade: libm::exp(-config.period / MEMORY),
        }
    }

    /// The sums so far.
    pub fn account(&self) -> &EnergyAccount {
        &self.account
    }

    /// What the cap withholds in this tick.
    pub fn withheld(&self) -> Withheld {
        self.withheld
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
            hand.crept = Vec3::zeros();
            hand.pace = 1.0;
            for last in &mut hand.last_steps {
                last.since = last.since.saturating_add(1);
            }
            let moved = pose.displacement_from(&before);
            if !possible(&moved, self.config.period) {
                continue;
            }
            *step = moved;
            for (reach, length) in hand.reach.iter_mut().zip(norms(&moved)) {
                *reach = length.max(*reach * self.fade);
            }
            let translation = Vec3::new(step.x, step.y, step.z);
            let held = hand.held.get(self.config.delay);
            let work = held.map_or(0.0, |wrench| wrench.stacked().dot(step)) * port.force_scale;
            let weight = hand.weights.get(self.config.delay);
            let fallen = weight.map_or(0.0, |weight| weight.dot(&translation)) * port.force_scale;
            let turn = Vec3::new(step.w, step.a, step.b);
            let [last, last_turn] = &mut hand.last_steps;
            if translation != Vec3::zeros() {
                if last.since > 1 && translation.norm() < 1.5 * port.count {
                    hand.crept = translation;
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
            let fraction = self.config.credit;
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
            self.account.raised -= fallen;
            self.credit += credit - (work - fallen);
            self.got += work - fallen;
        }
        let account = &mut self.account;
        let got = account.supplied - account.raised + account.credited;
        account.least = account.least.min(got);
        account.available = self.credit - self.spared.max(0.0);
        steps
    }

    /// The body has a first local model, with so much energy in it (J): the hands need not have put it in.
    pub(crate) fn begin(&mut self, stored: f64) {
        if !self.began {
            self.began = true;
            self.account.initial = stored.max(0.0);
            self.credit += self.account.initial;
        }
    }

    /// Where a device goes: its last translation along each axis.
    pub(crate) fn heading(&self, device: usize) -> Vec3 {
        self.hands
            .get(device)
            .map_or(Vec3::zeros(), |hand| hand.heading)
    }

    /// The body says to have released so much of its own energy so far (J). As much of it as hands have got since it was
    /// last asked is credited: a body may give what it has, and no word of a model makes more than that of it.
    pub(crate) fn release(&mut self, released: f64) {
        let more = (released - self.released).max(0.0);
        self.credit += more.min(self.got.max(0.0));
        self.released = self.released.max(released);
        self.got = 0.0;
    }

    /// One along each axis of a device; zero where its last step was a single count back, as a tremor on the edge of a
    /// count makes it.
    pub(crate) fn onward(&self, device: usize) -> Vec3 {
        self.hands
            .get(device)
            .map_or(Vec3::repeat(1.0), |hand| hand.onward)
    }

    /// In how many ticks a device has made the translation of this tick: one, or more where it is a count after a rest.
    pub(crate) fn pace(&self, device: usize) -> f64 {
        self.hands.get(device).map_or(1.0, |hand| hand.pace)
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
            // No device holds more than this, so a number that says otherwise was held back before it left.
            let held = |force: &Vec3| force.norm() <= MOST_FORCE;
            let zero = (Wrench::zero(), Vec3::zeros());
            let sound = wrench.is_finite() && held(&wrench.force) && held(weight);
            let (wrench, weight) = if sound { (*wrench, *weight) } else { zero };
            let raised = hand.push(&wrench, &weight) * port.force_scale;
            self.account.raised += raised;
            let before = self.spared.max(0.0);
            self.spared += raised;
            self.account.available -= self.spared.max(0.0) - before;
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

/// Tells the edges of each axis of a step by `translation` (m) under `force` (N).
fn note_edges(edges: &mut [Edge; 3], translation: &Vec3, force: &Vec3, credited: bool, count: f64) {
    let [x, y, z] = [translation.x, translation.y, translation.z].map(|by| by != 0.0);
    let others = [y || z, x || z, x || y];
    let axes = translation.iter().zip(force).zip(edges).zip(others);
    for (((&by, force), edge), others) in axes {
        if by != 0.0 {
            edge.step(by, -force * by, credited, count);
        }
        if others {
            edge.slant();
        }
    }
}

/// Whether a device can have moved so far in a tick; not where the step is not a number. A step that is not possible is a
/// reading gone wrong, and no work was done on it: one bad reading would leave a debt that no hand could ever repay.
fn possible(step: &Vec6, period: f64) -> bool {
    let [linear, angular] = [LARGEST_SPEED, LARGEST_ANGULAR_RATE].map(|speed| speed * period);
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
