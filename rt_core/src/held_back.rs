//! The part of a force that did not reach the hand, by cause, over a run.
//!
//! The cap and the age of a model hold back the force of a body; the last stage holds back the force of a device. Each
//! cause has one [`HeldBack`]. It tells when the force was smaller than without that cause, for how long, and by how
//! much. The sums only grow and use constant memory, so a summary needs no record of the ticks.

use crate::geometry::{Vec3, Wrench};
use crate::passivity::Withheld;
use crate::safety::SafetyState;

/// Smallest fraction of a force that counts as held back. Smaller ones lie within the accuracy of the hold.
pub const LEAST_FRACTION: f64 = 0.01;
/// Smallest force that counts as held back (N). A hand cannot notice a smaller one.
pub const LEAST_FORCE: f64 = 0.02;

/// Whether a hand can notice that the part `held` of a `whole` force (N) is missing.
pub fn is_noticeable(held: f64, whole: f64) -> bool {
    held > LEAST_FORCE.max(LEAST_FRACTION * whole)
}

/// The force that one cause held back.
///
/// ```
/// use rt_core::held_back::HeldBack;
///
/// let mut held_back = HeldBack::default();
/// held_back.note(3_000_000, 2.0, 1.5); // half a newton of two, at 3 ms
/// held_back.note(4_000_000, 2.0, 1.0);
/// held_back.note(5_000_000, 2.0, 1.99); // too little to notice
/// assert_eq!((held_back.ticks, held_back.mean()), (2, 0.75));
/// assert_eq!((held_back.most, held_back.of, held_back.most_ns), (1.0, 2.0, 4_000_000));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeldBack {
    /// Ticks in which a noticeable force was held back.
    pub ticks: u64,
    /// Time of the first such tick (ns).
    pub first_ns: u64,
    /// Time of the last such tick (ns).
    pub last_ns: u64,
    /// Sum of the held-back forces over these ticks (N).
    pub sum: f64,
    /// The largest force that was held back (N).
    pub most: f64,
    /// The whole force at that time (N).
    pub of: f64,
    /// That time (ns).
    pub most_ns: u64,
}

impl HeldBack {
    /// Notes that at `now_ns` (ns) only `passed` of a `whole` force passed (N).
    pub fn note(&mut self, now_ns: u64, whole: f64, passed: f64) {
        let held = whole - passed;
        // False for a number that is not finite: such a wrench is a fault with a count of its own.
        let counts = whole.is_finite() && is_noticeable(held, whole);
        if !counts {
            return;
        }
        if self.ticks == 0 {
            self.first_ns = now_ns;
        }
        self.last_ns = now_ns;
        self.ticks = self.ticks.saturating_add(1);
        self.sum += held;
        if held > self.most {
            self.most = held;
            self.of = whole;
            self.most_ns = now_ns;
        }
    }

    /// Mean of the held-back force over the ticks in which it was held back (N); zero if there were none.
    pub fn mean(&self) -> f64 {
        if self.ticks == 0 {
            0.0
        } else {
            self.sum / self.ticks as f64
        }
    }
}

/// The causes in the last stage that held back the force of one device. Forces are those on the hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeldBackByDevice {
    /// The largest force or moment of the device.
    pub limited: HeldBack,
    /// The heat of the motors.
    pub hot: HeldBack,
    /// The slew limit.
    pub slewed: HeldBack,
    /// The device moved too fast.
    pub too_fast: HeldBack,
    /// The device was out of reach.
    pub out_of_reach: HeldBack,
    /// The force was coming back after a fault.
    pub recovering: HeldBack,
    /// The force was coming in after the device was engaged.
    pub engaging: HeldBack,
    /// The hand did not hold the dead-man button.
    pub hands_off: HeldBack,
    /// The device was not armed.
    pub disarmed: HeldBack,
    /// The emergency stop acted.
    pub stopped: HeldBack,
    /// The device gave no state, or the loop stood still.
    pub silent: HeldBack,
    /// The device said that it renders no force, or that it has a fault.
    pub let_go: HeldBack,
}

impl HeldBackByDevice {
    /// Notes the force `asked` for at `now_ns` (ns), the force that the last stage `passed`, and the `state` of that
    /// stage.
    pub(crate) fn note(&mut self, state: SafetyState, now_ns: u64, asked: &Vec3, passed: &Vec3) {
        // Nearly every tick passes the whole force, and then there is nothing to compute.
        if asked == passed {
            return;
        }
        let cause = match state {
            SafetyState::Limited => &mut self.limited,
            SafetyState::Hot => &mut self.hot,
            SafetyState::Slewed => &mut self.slewed,
            SafetyState::TooFast => &mut self.too_fast,
            SafetyState::OutOfReach => &mut self.out_of_reach,
            SafetyState::Recovering => &mut self.recovering,
            SafetyState::Engaging => &mut self.engaging,
            SafetyState::HandsOff => &mut self.hands_off,
            SafetyState::Disarmed => &mut self.disarmed,
            SafetyState::Stopped => &mut self.stopped,
            SafetyState::Silent => &mut self.silent,
            SafetyState::LetGo | SafetyState::DeviceFault => &mut self.let_go,
            SafetyState::Normal | SafetyState::NotANumber => return,
        };
        cause.note(now_ns, asked.norm(), passed.norm());
    }
}

/// The causes that held back the force of one body. Forces are those at the handle with the largest force (scene).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeldBackByBody {
    /// The cap: the part of the local model's spring force.
    pub capped: HeldBack,
    /// The age of the model: after a model has grown too old, the force fades, and returns later.
    pub aged: HeldBack,
}

impl HeldBackByBody {
    /// Notes the force that the cap and the fade of an old message hold back at `now_ns` (ns). `trust` is the fraction of the
    /// `wrenches` that is rendered. The force that grows before the first fade belongs to the start of a run, and does not count.
    pub(crate) fn note<'a>(
        &mut self,
        now_ns: u64,
        withheld: &Withheld,
        trust: f64,
        is_aged: bool,
        wrenches: impl Iterator<Item = &'a Wrench>,
    ) {
        if withheld.force > 0.0 {
            let whole = withheld.of * trust;
            (self.capped).note(now_ns, whole, whole - withheld.force * trust);
        }
        if trust < 1.0 && is_aged {
            let largest = wrenches.map(|wrench| wrench.force.norm());
            let largest = largest.fold(0.0, f64::max);
            self.aged.note(now_ns, largest, largest * trust);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hand_notices_more_than_a_hundredth_of_the_force_and_more_than_20_mn() {
        for (held, whole, noticed) in [
            (0.0, 0.0, false),
            (LEAST_FORCE, 1.0, false),
            (0.021, 1.0, true),
            (0.05, 10.0, false),
            (0.1, 10.0, false),
            (0.11, 10.0, true),
            (-1.0, 1.0, false),
        ] {
            assert_eq!(is_noticeable(held, whole), noticed, "{held} of {whole}");
        }
    }

    #[test]
    fn the_record_keeps_the_first_of_the_largest_forces_and_ignores_numbers_that_are_not_finite() {
        let mut held_back = HeldBack::default();
        assert_eq!(held_back.mean(), 0.0);
        for (now_ns, whole, passed) in [
            (1, f64::INFINITY, 1.0),
            (2, f64::NAN, 0.0),
            (3, 1.0, f64::NAN),
            (4, 2.0, 1.5),
            (5, 3.0, 2.0),
            (6, 2.0, 1.0),
            (7, 5.0, 4.99),
        ] {
            held_back.note(now_ns, whole, passed);
        }
        let expected = HeldBack {
            ticks: 3,
            first_ns: 4,
            last_ns: 6,
            sum: 2.5,
            most: 1.0,
            of: 3.0,
            most_ns: 5,
        };
        assert_eq!(held_back, expected);
        assert_eq!(held_back.mean(), 2.5 / 3.0);
    }

    /// The record of a device for each cause.
    type Cause = (SafetyState, fn(&HeldBackByDevice) -> HeldBack);

    #[test]
    fn a_force_is_held_back_by_the_cause_that_the_last_stage_names() {
        let causes: [Cause; 11] = [
            (SafetyState::Limited, |held| held.limited),
            (SafetyState::Hot, |held| held.hot),
            (SafetyState::Slewed, |held| held.slewed),
            (SafetyState::TooFast, |held| held.too_fast),
            (SafetyState::OutOfReach, |held| held.out_of_reach),
            (SafetyState::Recovering, |held| held.recovering),
            (SafetyState::Engaging, |held| held.engaging),
            (SafetyState::HandsOff, |held| held.hands_off),
            (SafetyState::Disarmed, |held| held.disarmed),
            (SafetyState::Stopped, |held| held.stopped),
            (SafetyState::Silent, |held| held.silent),
        ];
        let (asked, passed) = (Vec3::new(0.0, 3.0, 4.0), Vec3::new(1.0, 0.0, 0.0));
        for (state, of) in causes {
            let mut held = HeldBackByDevice::default();
            held.note(state, 9, &asked, &passed);
            for (other, of_other) in causes {
                let ticks = u64::from(other == state);
                assert_eq!(of_other(&held).ticks, ticks, "{state:?} {other:?}");
            }
            assert_eq!((of(&held).most, of(&held).of), (4.0, 5.0));
        }
        let mut held = HeldBackByDevice::default();
        for state in [SafetyState::Normal, SafetyState::NotANumber] {
            held.note(state, 9, &asked, &passed);
        }
        held.note(SafetyState::Limited, 9, &asked, &asked);
        assert_eq!(held, HeldBackByDevice::default());
    }
}
