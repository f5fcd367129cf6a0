//! The last stage before a device: what may leave.
//!
//! - A wrench that is **not a number** becomes zero.
//! - A device that has given **no good state** for a while gets zero.
//! - A moment for a device that actuates none is left out: that is no fault and is not counted.
//! - A wrench beyond the device's limits is scaled to them, its direction kept.
//!
//! After a fault the force comes back along a smooth step, never at once. Each case has a named state, a
//! counter and this way back. The slew limit that some devices need belongs inside the energy account
//! (alone it injects energy), so it is not here.

use crate::count_one;
use crate::device::Freedom;
use crate::geometry::{Vec3, Wrench};

/// Limits of what may leave for a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyConfig {
    /// Degrees of freedom that the device actuates.
    pub actuated: Freedom,
    /// Largest force (N).
    pub max_force: f64,
    /// Largest moment (N m).
    pub max_moment: f64,
    /// How many ticks in a row may pass without a good device state.
    pub patience: u32,
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
    /// Is bringing it back after a fault.
    Recovering,
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
    /// Ticks with a wrench that was not a number.
    pub not_a_number: u64,
    /// Ticks without a good device state.
    pub missed_reads: u64,
    /// Times that the device went stale.
    pub stale: u64,
}

/// The last stage of one device.
#[derive(Clone, Debug)]
pub struct Limiter {
    config: SafetyConfig,
    /// How much of the wrench passes, from zero to one.
    authority: f64,
    misses: u32,
    state: SafetyState,
    counters: SafetyCounters,
}

impl Limiter {
    /// With full authority: the coupling's own start is smooth.
    pub fn new(config: SafetyConfig) -> Self {
        Self {
            config,
            authority: 1.0,
            misses: 0,
            state: SafetyState::Normal,
            counters: SafetyCounters::default(),
        }
    }

    /// The wrench that may leave. `fresh` says whether the device gave a good state this tick.
    pub fn pass(&mut self, wrench: &Wrench, fresh: bool) -> Wrench {
        if fresh {
            self.misses = 0;
        } else {
            self.misses = self.misses.saturating_add(1);
            count_one(&mut self.counters.missed_reads);
            if self.misses == self.config.patience.saturating_add(1) {
                count_one(&mut self.counters.stale);
            }
        }
        if !wrench.is_finite() {
            count_one(&mut self.counters.not_a_number);
            return self.fault(SafetyState::NotANumber);
        }
        if self.misses > self.config.patience {
            return self.fault(SafetyState::DeviceStale);
        }
        self.state = SafetyState::Normal;
        let mut passed = *wrench;
        if self.config.actuated == Freedom::Three {
            passed.moment = Vec3::zeros();
        }
        if self.authority < 1.0 {
            self.authority = (self.authority + self.config.period / self.config.recovery).min(1.0);
            self.state = SafetyState::Recovering;
            let s = self.authority;
            passed = passed.scaled(s * s * (3.0 - 2.0 * s));
        }
        let force = shorten(&mut passed.force, self.config.max_force);
        let moment = shorten(&mut passed.moment, self.config.max_moment);
        if force || moment {
            self.state = SafetyState::Limited;
            count_one(&mut self.counters.limited);
        }
        passed
    }

    /// What was done to the last wrench.
    pub fn state(&self) -> SafetyState {
        self.state
    }

    /// What was met so far.
    pub fn counters(&self) -> SafetyCounters {
        self.counters
    }

    fn fault(&mut self, state: SafetyState) -> Wrench {
        self.authority = 0.0;
        self.state = state;
        Wrench::zero()
    }
}

/// Scales `v` to length `limit` if it is longer; says whether it did.
fn shorten(v: &mut Vec3, limit: f64) -> bool {
    let length = v.norm();
    if length <= limit {
        return false;
    }
    // The squares of very large components overflow to infinity: those have no usable direction left.
    *v = if length.is_finite() {
        *v * (limit / length)
    } else {
        Vec3::zeros()
    };
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn config() -> SafetyConfig {
        SafetyConfig {
            actuated: Freedom::Six,
            max_force: 8.0,
            max_moment: 0.2,
            patience: 3,
            recovery: 0.01,
            period: 1e-3,
        }
    }

    fn push(x: f64) -> Wrench {
        Wrench {
            force: Vec3::new(x, 0.0, 0.0),
            moment: Vec3::zeros(),
        }
    }

    #[test]
    fn a_wrench_that_is_not_a_number_becomes_zero_and_the_force_comes_back_smoothly() {
        let mut limiter = Limiter::new(config());
        assert_eq!(limiter.pass(&push(2.0), true), push(2.0));
        assert_eq!(limiter.pass(&push(f64::NAN), true), Wrench::zero());
        assert_eq!(limiter.state(), SafetyState::NotANumber);
        let mut last = 0.0;
        // Ten tenths round to just below one: the eleventh tick completes the way back.
        for _ in 0..11 {
            let now = limiter.pass(&push(2.0), true).force.x;
            // Ten steps of a smooth step: none larger than 1.5 times the even share.
            assert!(now >= last && now - last <= 2.0 * 0.15 + 1e-12);
            last = now;
        }
        assert_eq!(limiter.pass(&push(2.0), true), push(2.0));
        assert_eq!(limiter.state(), SafetyState::Normal);
        assert_eq!(limiter.counters().not_a_number, 1);
    }

    #[test]
    fn a_device_without_moments_is_not_limited_for_want_of_them() {
        let mut limiter = Limiter::new(SafetyConfig {
            actuated: Freedom::Three,
            ..config()
        });
        let wrench = Wrench {
            moment: Vec3::new(0.0, 5.0, 0.0),
            ..push(2.0)
        };
        assert_eq!(limiter.pass(&wrench, true), push(2.0));
        assert_eq!(
            (limiter.state(), limiter.counters().limited),
            (SafetyState::Normal, 0)
        );
    }

    #[test]
    fn a_silent_device_gets_zero_after_its_patience() {
        let mut limiter = Limiter::new(config());
        for _ in 0..3 {
            assert_eq!(limiter.pass(&push(1.0), false), push(1.0));
        }
        assert_eq!(limiter.pass(&push(1.0), false), Wrench::zero());
        assert_eq!(limiter.state(), SafetyState::DeviceStale);
        let counters = limiter.counters();
        assert_eq!((counters.missed_reads, counters.stale), (4, 1));
    }

    proptest! {
        #[test]
        fn nothing_beyond_the_limits_ever_leaves(
            fx in proptest::num::f64::ANY, fy in proptest::num::f64::ANY,
            mz in proptest::num::f64::ANY, fresh in any::<bool>(),
        ) {
            let mut limiter = Limiter::new(config());
            let wrench = Wrench {
                force: Vec3::new(fx, fy, 1.0),
                moment: Vec3::new(0.0, 0.0, mz),
            };
            let out = limiter.pass(&wrench, fresh);
            // One rounding of a product and a norm.
            prop_assert!(out.force.norm() <= 8.0 * (1.0 + 1e-14));
            prop_assert!(out.moment.norm() <= 0.2 * (1.0 + 1e-14));
        }
    }
}
