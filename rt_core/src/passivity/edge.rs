//! A hand that trembles on the edge of an encoder count, along one axis.
//!
//! The encoder shows a whole count `D` out and, a little later, the same count back. The hand itself has moved by some
//! `a`, at most `D`, and nobody knows how far. Where the device held `w_1` on the way out and `w_2` on the way back, its
//! motor has done `(w_1 - w_2) a`, and the account has been charged `(w_1 - w_2) D`: a tremor would empty the account of
//! a hold that was paid for.
//!
//! The mechanism's Coulomb friction `f_c` took `2 f_c a` on the same path; `f` stands for the part of it that has not been
//! credited already. So what is truly lost is at most `(w_1 - w_2 - 2 f)+ a`, and it is safe to charge the same with `D`
//! for `a`. The rest is given back when the pair is closed. A closed pair never gains. Where counts came along another
//! axis meanwhile, a slanting path may have to serve both, and each has one over the square root of three of it.

/// Fraction of the friction on a slanting path that each of three axes may rely on.
const SLANTING: f64 = 0.577_350_269_189_625_8;

/// The last count along an axis, and what the account was told of it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Edge {
    /// The count (m), with its sign; zero where there is none to be closed.
    by: f64,
    /// What the account gained by it (J), by the force that was held.
    gained: f64,
    /// What was added for a spring that changes during a count (J).
    corrected: f64,
    /// How many of its counts friction was credited for.
    credited: f64,
    /// Whether counts came along another axis since it was opened.
    slanting: bool,
    /// Whether this tick's count has closed the pair.
    closed: bool,
}

impl Edge {
    /// A step (m) along the axis, not zero, by which the account gains `gain` (J), its friction `credited` or not;
    /// `count` (m) is the encoder's.
    pub(super) fn step(&mut self, by: f64, gain: f64, credited: bool, count: f64) {
        let single = by.abs() < 1.5 * count;
        let credited = f64::from(u8::from(credited));
        if single && self.by != 0.0 && (by + self.by).abs() < 0.5 * count {
            self.by = by;
            self.gained += gain;
            self.credited += credited;
            self.closed = true;
        } else {
            *self = Self {
                by: if single { by } else { 0.0 },
                gained: gain,
                credited,
                ..Self::default()
            };
        }
    }

    /// A step came along another axis.
    pub(super) fn slant(&mut self) {
        self.slanting = true;
    }

    /// The account has got `correction` (J) more for this tick's step. Returns what else it is to get (J) as the pair is
    /// closed, where the mechanism's friction is `friction` (N) and a `fraction` of it is credited.
    pub(super) fn settle(&mut self, correction: f64, friction: f64, fraction: f64) -> f64 {
        self.corrected += correction;
        if !self.closed {
            return 0.0;
        }
        let slant = if self.slanting { SLANTING } else { 1.0 };
        let covered = (2.0 - fraction * self.credited) * slant * friction * self.by.abs();
        let lost = (-self.gained - covered).max(0.0);
        let told = self.gained + self.corrected;
        *self = Self::default();
        (-lost - told).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const COUNT: f64 = 4e-5;
    const FRICTION: f64 = 0.4;

    /// What the account gets in all for a count out under `out` and back under `back` (N), springs corrected by
    /// `corrections` (J).
    fn pair(out: f64, back: f64, corrections: [f64; 2], slanting: bool) -> f64 {
        let mut edge = Edge::default();
        edge.step(COUNT, -out * COUNT, false, COUNT);
        let mut got = -out * COUNT + corrections[0] + edge.settle(corrections[0], FRICTION, 0.4);
        if slanting {
            edge.slant();
        }
        edge.step(-COUNT, back * COUNT, false, COUNT);
        got += back * COUNT + corrections[1];
        got + edge.settle(corrections[1], FRICTION, 0.4)
    }

    proptest! {
        /// However far the hand went, the account says no more than motor and friction together did.
        #[test]
        fn a_closed_pair_never_gains_and_charges_what_friction_does_not_cover(
            out in -5.0..5.0, back in -5.0..5.0, fraction in 0.0..1.0, slanting: bool,
        ) {
            let got = pair(out, back, [0.0; 2], slanting);
            let friction: f64 = FRICTION * if slanting { SLANTING } else { 1.0 };
            // Of motor and friction, for a hand that went this fraction of the count.
            let truly: f64 = ((back - out) + 2.0 * friction) * fraction * COUNT;
            // Rounding of sums of order 1e-4 J.
            if back <= out {
                prop_assert!(got <= 1e-18, "{got:e}");
                prop_assert!(got <= truly + 1e-18, "{got:e} {truly:e}");
            } else {
                prop_assert!((got - (back - out) * COUNT).abs() < 1e-18);
            }
        }
    }

    #[test]
    fn a_spring_that_was_corrected_is_not_paid_twice() {
        // 2,000 N/m: half of K D^2 each way, all that it lost.
        let half = 0.5 * 2000.0 * COUNT * COUNT;
        let got = pair(1.0, 1.0 - 2000.0 * COUNT, [half; 2], false);
        assert!(got.abs() < 1e-18, "{got:e}");
    }

    #[test]
    fn a_pair_is_closed_once_and_steps_of_several_counts_are_none() {
        let mut edge = Edge::default();
        for (by, pays) in [
            (1.0, false),
            (-1.0, true),
            (1.0, false),
            (2.0, false),
            (-2.0, false),
            (-1.0, false),
        ] {
            edge.step(by * COUNT, -1e-6, false, COUNT);
            assert_eq!(edge.settle(0.0, FRICTION, 0.4) > 0.0, pays, "{by}");
        }
    }
}
