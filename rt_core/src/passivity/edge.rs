//! The account of a hand that trembles on the edge of an encoder count, along one axis.
//!
//! The encoder shows a whole count `D` out and, a little later, the same count back. The hand itself has moved by an
//! unknown distance `a`, at most `D`. Let the device hold `w_1` on the path out and `w_2` on the path back. Its motor
//! has then done the work `(w_1 - w_2) a`, but the account has been charged `(w_1 - w_2) D`. A tremor would empty the
//! account of a hold that was paid for.
//!
//! The mechanism's Coulomb friction `f_c` dissipated `2 f_c a` on the same path; let `f` be the part of `f_c` that has
//! not been credited already. The true loss is then at most `(w_1 - w_2 - 2 f)+ a`, and it is safe to charge this loss
//! with `D` for `a`. When the pair of counts is closed, the account gets the rest back. A closed pair never gains.
//! If counts came along another axis meanwhile, one slanting path may serve both axes. Each axis then relies on the
//! friction divided by the square root of three.

/// Fraction of the friction on a slanting path that each of three axes may rely on: the inverse square root of three.
const SLANTING: f64 = 0.577_350_269_189_625_8;

/// The last count along an axis, and its entries in the account.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Edge {
    /// The count (m), signed; zero if no count waits to be closed.
    by: f64,
    /// Gain of the account by the work of the held force (J).
    gained: f64,
    /// Gain of the account by the correction for a spring that changes during a count (J).
    corrected: f64,
    /// Number of counts of the pair for which friction was credited.
    credited: f64,
    /// Whether counts came along another axis since the pair was opened.
    slanting: bool,
    /// Whether this tick's count has closed the pair.
    closed: bool,
}

impl Edge {
    /// Takes a step (m) along the axis, not zero. The account gains `gain` (J) by this step; `credited` tells whether
    /// friction was credited for the step. `count` (m) is the count of the encoder.
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

    /// Notes a step along another axis.
    pub(super) fn slant(&mut self) {
        self.slanting = true;
    }

    /// Takes the `correction` (J) that the account has got for this tick's step. Returns the further gain (J) if the
    /// step closes the pair. `friction` (N) is that of the mechanism. The account credits a `fraction` of this
    /// friction.
    pub(super) fn settle(&mut self, correction: f64, friction: f64, fraction: f64) -> f64 {
        self.corrected += correction;
        if !self.closed {
            return 0.0;
        }
        let slant = if self.slanting { SLANTING } else { 1.0 };
        let covered = (2.0 - fraction * self.credited) * slant * friction * self.by.abs();
        let lost = (-self.gained - covered).max(0.0);
        let counted = self.gained + self.corrected;
        *self = Self::default();
        (-lost - counted).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const COUNT: f64 = 4e-5;
    const FRICTION: f64 = 0.4;

    const FRACTION: f64 = 0.4;

    /// The whole gain of the account for a count out under `out` (N) and back under `back` (N), with springs corrected
    /// by `corrections` (J). The friction of the counts that are `credited` comes on top.
    fn pair(
        out: f64,
        back: f64,
        corrections: [f64; 2],
        credited: [bool; 2],
        slanting: bool,
    ) -> f64 {
        let mut edge = Edge::default();
        edge.step(COUNT, -out * COUNT, credited[0], COUNT);
        let mut got = -out * COUNT + corrections[0];
        got += edge.settle(corrections[0], FRICTION, FRACTION);
        if slanting {
            edge.slant();
        }
        edge.step(-COUNT, back * COUNT, credited[1], COUNT);
        got += back * COUNT + corrections[1];
        got + edge.settle(corrections[1], FRICTION, FRACTION)
    }

    proptest! {
        /// For any path of the hand, the account gains no more than motor and friction together did.
        #[test]
        fn a_closed_pair_never_gains_and_charges_the_loss_beyond_friction(
            out in -5.0..5.0, back in -5.0..5.0, fraction in 0.0..1.0, credited: [bool; 2], slanting: bool,
        ) {
            let got = pair(out, back, [0.0; 2], credited, slanting);
            let counts = credited.map(|credited| 1.0 - FRACTION * f64::from(u8::from(credited)));
            let friction = FRICTION * if slanting { SLANTING } else { 1.0 } * (counts[0] + counts[1]);
            // True work of motor and friction, for a hand that went this fraction of the count.
            let truly = ((back - out) + friction) * fraction * COUNT;
            // Rounding of sums of order 1e-4 J.
            if back <= out {
                prop_assert!(got <= 1e-18, "{got:e}");
                prop_assert!(got <= truly + 1e-18, "{got:e} {truly:e}");
                // And no less than it must.
                let lost = f64::max(out - back - friction, 0.0) * COUNT;
                prop_assert!((got + lost).abs() < 1e-18, "{got:e} {lost:e}");
            } else {
                prop_assert!((got - (back - out) * COUNT).abs() < 1e-18);
            }
        }
    }

    #[test]
    fn a_spring_that_was_corrected_is_not_paid_twice() {
        // 2,000 N/m: half of `K D^2` for each count, the whole loss.
        let half = 0.5 * 2000.0 * COUNT * COUNT;
        let got = pair(1.0, 1.0 - 2000.0 * COUNT, [half; 2], [false; 2], false);
        assert!(got.abs() < 1e-18, "{got:e}");
    }

    #[test]
    fn only_the_same_count_back_closes_a_pair() {
        for (out, back, closes) in [
            (1.0, -1.0, true),
            (-1.0, 1.0, true),
            // Counts that a driver's geometry makes a little unequal.
            (1.0, -0.9, true),
            (0.9, -1.3, true),
            (1.0, -0.4, false),
            (1.0, 1.0, false),
            (1.0, -2.0, false),
            (2.0, -1.0, false),
            (2.0, -2.0, false),
            // Steps that are no single counts, and a step of less than a count after one.
            (1.4, -1.6, false),
            (2.0, 0.3, false),
        ] {
            let mut edge = Edge::default();
            edge.step(out * COUNT, -1e-6, false, COUNT);
            edge.step(back * COUNT, -1e-6, false, COUNT);
            let pays = edge.settle(0.0, FRICTION, FRACTION) > 0.0;
            assert_eq!(pays, closes, "{out} {back}");
        }
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
            assert_eq!(edge.settle(0.0, FRICTION, FRACTION) > 0.0, pays, "{by}");
        }
    }
}
