//! What an arm feels like from the handle that it holds, and the grips from relaxed to rigid.
//!
//! A mass that moves with the handle, and a spring and a damper from it to where the hand wants to be. The
//! named grips span what people do with a stylus or a knob: from two fingers that barely hold it
//! ([`Arm::RELAXED`]) to a braced fist ([`Arm::RIGID`]). [`Arm::TYPICAL`] is a published fit; the other
//! three are round numbers at the ends and in the upper part of the published ranges.

/// What an arm looks like from the handle that it holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm {
    /// Mass that moves with the handle (kg).
    pub mass: f64,
    /// Damping between the handle and where the hand wants to be (N s/m).
    pub damping: f64,
    /// Stiffness between the handle and where the hand wants to be (N/m).
    pub stiffness: f64,
}

impl Arm {
    /// Two fingers that barely hold the handle.
    pub const RELAXED: Self = Self {
        mass: 0.1,
        damping: 2.0,
        stiffness: 30.0,
    };

    /// A typical published fit of a relaxed arm: 0.554 kg, 6.45 N s/m, 135 N/m.
    pub const TYPICAL: Self = Self {
        mass: 0.554,
        damping: 6.45,
        stiffness: 135.0,
    };

    /// A hand that means to hold on: three quarters of the way from relaxed to rigid.
    pub const FIRM: Self = Self {
        mass: 0.95,
        damping: 25.0,
        stiffness: 700.0,
    };

    /// A braced fist, every muscle tense.
    pub const RIGID: Self = Self {
        mass: 2.0,
        damping: 60.0,
        stiffness: 2000.0,
    };

    /// The named grips, from relaxed to rigid.
    pub const GRIPS: [(&str, Self); 4] = [
        ("relaxed", Self::RELAXED),
        ("typical", Self::TYPICAL),
        ("firm", Self::FIRM),
        ("rigid", Self::RIGID),
    ];

    /// Nobody holds the device.
    pub(crate) const NONE: Self = Self {
        mass: 0.0,
        damping: 0.0,
        stiffness: 0.0,
    };

    /// The grip at `share` of the way from relaxed (0) to rigid (1). Each number goes evenly in its
    /// logarithm, so that equal steps are equal ratios; beyond the ends it stays at them.
    pub fn between(share: f64) -> Self {
        // The ends themselves, not their logarithms' rounding. What is not a number counts as relaxed.
        if share.is_nan() || share <= 0.0 {
            return Self::RELAXED;
        }
        if share >= 1.0 {
            return Self::RIGID;
        }
        let way = |from: f64, to: f64| from * libm::exp(share * libm::log(to / from));
        Self {
            mass: way(Self::RELAXED.mass, Self::RIGID.mass),
            damping: way(Self::RELAXED.damping, Self::RIGID.damping),
            stiffness: way(Self::RELAXED.stiffness, Self::RIGID.stiffness),
        }
    }

    pub(crate) fn is_sound(&self) -> bool {
        [self.mass, self.damping, self.stiffness]
            .iter()
            .all(|x| x.is_finite() && *x >= 0.0)
    }
}

impl Default for Arm {
    fn default() -> Self {
        Self::TYPICAL
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grips_tighten_from_name_to_name_and_in_between() {
        let tighter = |a: &Arm, b: &Arm| {
            b.mass > a.mass && b.damping > a.damping && b.stiffness > a.stiffness
        };
        for pair in Arm::GRIPS.windows(2) {
            assert!(tighter(&pair[0].1, &pair[1].1), "{pair:?}");
        }
        let shares: Vec<_> = (0..=20)
            .map(|k| Arm::between(f64::from(k) / 20.0))
            .collect();
        for pair in shares.windows(2) {
            assert!(tighter(&pair[0], &pair[1]), "{pair:?}");
        }
    }

    #[test]
    fn the_way_between_has_the_ends_and_the_geometric_mean_in_the_middle() {
        for (share, end) in [
            (0.0, Arm::RELAXED),
            (-1.0, Arm::RELAXED),
            (f64::NAN, Arm::RELAXED),
            (1.0, Arm::RIGID),
            (7.0, Arm::RIGID),
        ] {
            assert_eq!(Arm::between(share), end);
        }
        let middle = Arm::between(0.5);
        // A few roundings.
        assert!((middle.mass - (0.1_f64 * 2.0).sqrt()).abs() < 1e-15);
        assert!((middle.damping - (2.0_f64 * 60.0).sqrt()).abs() < 1e-13);
        assert!((middle.stiffness - (30.0_f64 * 2000.0).sqrt()).abs() < 1e-11);
    }
}
