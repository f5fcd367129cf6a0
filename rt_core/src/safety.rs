//! The last stage before a device: what may leave.
//!
//! - A wrench that is **not a number** becomes zero.
//! - A device that has given **no good state** for a while gets zero.
//! - A device that moves **too fast**, or is **out of reach**, has its force fade; below nine tenths of the limit it
//!   comes back.
//! - A moment for a device that actuates none is left out: that is no fault and is not counted.
//! - A wrench beyond the device's limits is scaled to them, its direction kept.
//! - A force that would change faster than the device can stand follows at its **slew limit**.
//!
//! After a fault the force comes back along a smooth step, never at once. Each case has a named state, a
//! counter, the number that tripped it first, and this way back. Whatever is done here the account of energy sees: it
//! is told what was passed on (a slew limit that it does not know of injects energy).

use crate::count_one;
use crate::device::{DeviceState, Freedom};
use crate::geometry::{Vec3, Wrench, smooth_step};

/// Fraction of a limit below which what it took away comes back.
const BACK: f64 = 0.9;

/// Limits of what may leave for a device. Infinite limits never act.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyConfig {
    /// Degrees of freedom that the device actuates.
    pub actuated: Freedom,
    /// Largest force (N).
    pub max_force: f64,
    /// Largest moment (N m).
    pub max_moment: f64,
    /// Speed beyond which the force fades (m/s).
    pub max_speed: f64,
    /// Distance from the device's origin beyond which the force fades (m).
    pub max_reach: f64,
    /// Fastest change of the force (N/s).
    pub max_slew: f64,
    /// How many ticks in a row may pass without a good device state.
    pub patience: u32,
    /// How long the force takes to fade (s).
    pub decay: f64,
    /// How long the force takes to come back after a fault (s).
    pub recovery: f64,
    /// The tick's period (s).
    pub period: f64,
}

/// What the last stage did to the wrench.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SafetyState {
    /// Passed it on.
    Normal,
    /// Scaled it to the device's limits.
    Limited,
    /// Let it change no faster than the device can stand.
    Slewed,
    /// Is bringing it back after a fault.
    Recovering,
    /// Lets it fade: the device moves too fast.
    TooFast,
    /// Lets it fade: the device is out of reach.
    OutOfReach,
    /// Replaced it by zero: the device gives no good state.
    DeviceStale,
    /// Replaced it by zero: it was not a number.
    NotANumber,
}

/// Counts of what the last stage did. They only grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SafetyCounters {
    /// Ticks with the wrench scaled down.
    pub limited: u64,
    /// Ticks with the force held back by the slew limit.
    pub slewed: u64,
    /// Ticks with a wrench that was not a number.
    pub not_a_number: u64,
    /// Ticks without a good device state.
    pub missed_reads: u64,
    /// Times that the device went stale.
    pub stale: u64,
    /// Times that it moved too fast.
    pub too_fast: u64,
    /// Times that it was out of reach.
    pub out_of_reach: u64,
}

/// The first time that something tripped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trip {
    /// What.
    pub state: SafetyState,
    /// In which tick, from zero.
    pub tick: u64,
    /// What was found: newtons, newton metres, metres per second, metres, newtons per second, or ticks without a state.
    pub found: f64,
    /// What it may be at most, in the same unit.
    pub limit: f64,
}

/// The last stage of one device.
#[derive(Clone, Debug)]
pub struct Limiter {
    config: SafetyConfig,
    /// How much of the wrench passes, from zero to one.
    authority: f64,
    misses: u32,
    too_fast: bool,
    out_of_reach: bool,
    /// The force that left last.
    last: Vec3,
    tick: u64,
    state: SafetyState,
    counters: SafetyCounters,
    trip: Option<Trip>,
}

impl Limiter {
    /// With full authority: the coupling's own start is smooth.
    pub fn new(config: SafetyConfig) -> Self {
        Self {
            config,
            authority: 1.0,
            misses: 0,
            too_fast: false,
            out_of_reach: false,
            last: Vec3::zeros(),
            tick: 0,
            state: SafetyState::Normal,
            counters: SafetyCounters::default(),
            trip: None,
        }
    }

    /// The wrench that may leave. `state` is what the device gave this tick (its own axes), if anything good.
    pub fn pass(&mut self, wrench: &Wrench, state: Option<&DeviceState>) -> Wrench {
        let passed = self.decide(wrench, state);
        self.last = passed.force;
        self.tick = self.tick.saturating_add(1);
        passed
    }

    /// Whether the device has given no good state for longer than it may, whatever else was found.
    pub fn is_stale(&self) -> bool {
        self.misses > self.config.patience
    }

    /// Fraction of the force that passes as faults go: one where nothing has tripped for a while.
    pub fn fraction(&self) -> f64 {
        smooth_step(self.authority)
    }

    /// The tick's period (s).
    pub(crate) fn period(&self) -> f64 {
        self.config.period
    }

    /// What was done to the last wrench.
    pub fn state(&self) -> SafetyState {
        self.state
    }

    /// What was met so far.
    pub fn counters(&self) -> SafetyCounters {
        self.counters
    }

    /// What tripped first, if anything did.
    pub fn first_trip(&self) -> Option<Trip> {
        self.trip
    }

    fn decide(&mut self, wrench: &Wrench, state: Option<&DeviceState>) -> Wrench {
        let config = self.config;
        if let Some(state) = state {
            self.misses = 0;
            self.watch(state);
        } else {
            self.misses = self.misses.saturating_add(1);
            count_one(&mut self.counters.missed_reads);
            if self.misses == config.patience.saturating_add(1) {
                count_one(&mut self.counters.stale);
            }
        }
        if !wrench.is_finite() {
            count_one(&mut self.counters.not_a_number);
            return self.fault(SafetyState::NotANumber, f64::NAN, config.max_force);
        }
        if self.is_stale() {
            let (found, limit) = (f64::from(self.misses), f64::from(config.patience));
            return self.fault(SafetyState::DeviceStale, found, limit);
        }
        self.state = SafetyState::Normal;
        let mut passed = *wrench;
        if config.actuated == Freedom::Three {
            passed.moment = Vec3::zeros();
        }
        let fading = self.too_fast || self.out_of_reach;
        if fading || self.authority < 1.0 {
            let step = if fading {
                -config.period / config.decay
            } else {
                config.period / config.recovery
            };
            self.authority = (self.authority + step).clamp(0.0, 1.0);
            self.state = if self.too_fast {
                SafetyState::TooFast
            } else if self.out_of_reach {
                SafetyState::OutOfReach
            } else {
                SafetyState::Recovering
            };
            passed = passed.scaled(self.fraction());
        }
        let force = shorten(&mut passed.force, config.max_force);
        let moment = shorten(&mut passed.moment, config.max_moment);
        for (found, limit) in [(force, config.max_force), (moment, config.max_moment)] {
            if let Some(found) = found {
                self.note(SafetyState::Limited, found, limit);
            }
        }
        if force.or(moment).is_some() {
            self.act(SafetyState::Limited);
            count_one(&mut self.counters.limited);
        }
        let mut change = passed.force - self.last;
        if let Some(found) = shorten(&mut change, config.max_slew * config.period) {
            passed.force = self.last + change;
            self.act(SafetyState::Slewed);
            count_one(&mut self.counters.slewed);
            let slew = found / config.period;
            self.note(SafetyState::Slewed, slew, config.max_slew);
        }
        passed
    }

    /// Whether the device keeps inside its limits of motion.
    fn watch(&mut self, state: &DeviceState) {
        let speed = state.twist.linear.norm();
        let reach = state.pose.position.norm();
        let (max_speed, max_reach) = (self.config.max_speed, self.config.max_reach);
        if trips(&mut self.too_fast, speed, max_speed) {
            count_one(&mut self.counters.too_fast);
            self.note(SafetyState::TooFast, speed, max_speed);
        }
        if trips(&mut self.out_of_reach, reach, max_reach) {
            count_one(&mut self.counters.out_of_reach);
            self.note(SafetyState::OutOfReach, reach, max_reach);
        }
    }

    /// Says what was done, unless something graver is being done.
    fn act(&mut self, state: SafetyState) {
        if matches!(self.state, SafetyState::Normal | SafetyState::Recovering) {
            self.state = state;
        }
    }

    fn note(&mut self, state: SafetyState, found: f64, limit: f64) {
        let tick = self.tick;
        self.trip.get_or_insert(Trip {
            state,
            tick,
            found,
            limit,
        });
    }

    fn fault(&mut self, state: SafetyState, found: f64, limit: f64) -> Wrench {
        self.note(state, found, limit);
        self.authority = 0.0;
        self.state = state;
        Wrench::zero()
    }
}

/// Keeps `tripped` true from above `limit` to below nine tenths of it; says whether it has just become so.
fn trips(tripped: &mut bool, found: f64, limit: f64) -> bool {
    let before = *tripped;
    // A speed or a place that overflowed is beyond any limit but none.
    *tripped = found > limit || (before && found >= BACK * limit);
    *tripped && !before
}

/// Scales `v` to length `limit` if it is longer; the length that it had, if so.
fn shorten(v: &mut Vec3, limit: f64) -> Option<f64> {
    let length = v.norm();
    if length <= limit {
        return None;
    }
    // The squares of very large components overflow to infinity: those have no usable direction left.
    *v = if length.is_finite() {
        *v * (limit / length)
    } else {
        Vec3::zeros()
    };
    Some(length)
}

#[cfg(test)]
mod tests;
