//! The impedance of an arm at the handle that it holds, and the grips from relaxed to rigid.
//!
//! The arm is a mass that moves with the handle, and a spring and a damper from the handle to the aim of the hand. The
//! named grips span the use of a stylus or a knob, from two fingers that barely hold the handle ([`Arm::RELAXED`]) to a
//! braced fist ([`Arm::RIGID`]). [`Arm::TYPICAL`] is a published fit. The other three are round numbers at the ends and
//! in the upper part of the published ranges.

/// The impedance of an arm at the handle that it holds.
///
/// ```
/// use sim::Arm;
///
/// assert_eq!(Arm::named("rigid"), Some(Arm::RIGID));
/// assert_eq!(Arm::between(0.0), Arm::RELAXED);
/// // Halfway, each number is the geometric mean of the two ends.
/// let middle = Arm::between(0.5);
/// assert!((middle.stiffness - (30.0_f64 * 2000.0).sqrt()).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm {
    /// Mass that moves with the handle (kg).
    pub mass: f64,
    /// Damping between the handle and the aim of the hand (N s/m).
    pub damping: f64,
    /// Stiffness between the handle and the aim of the hand (N/m).
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

    /// A hand that holds on firmly: three quarters of the range from relaxed to rigid.
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

    /// The grip of that name among [`Arm::GRIPS`]; `None` for an unknown name.
    pub fn named(name: &str) -> Option<Self> {
        let grip = Self::GRIPS.iter().find(|(known, _)| *known == name)?;
        Some(grip.1)
    }

    /// A device that no hand holds.
    pub(crate) const NONE: Self = Self {
        mass: 0.0,
        damping: 0.0,
        stiffness: 0.0,
    };

    /// The grip between relaxed (`fraction` 0) and rigid (1). Each number is interpolated in its logarithm, so that
    /// equal steps are equal ratios. Fractions beyond the ends give the ends.
    pub fn between(fraction: f64) -> Self {
        // The ends are exact, without the rounding of their logarithms. NaN counts as relaxed.
        if fraction.is_nan() || fraction <= 0.0 {
            return Self::RELAXED;
        }
        if fraction >= 1.0 {
            return Self::RIGID;
        }
        let grade = |from: f64, to: f64| from * libm::exp(fraction * libm::log(to / from));
        Self {
            mass: grade(Self::RELAXED.mass, Self::RIGID.mass),
            damping: grade(Self::RELAXED.damping, Self::RIGID.damping),
            stiffness: grade(Self::RELAXED.stiffness, Self::RIGID.stiffness),
        }
    }

    pub(crate) fn is_sound(&self) -> bool {
        [self.mass, self.damping, self.stiffness]
            .iter()
            .all(|x| x.is_finite() && *x >= 0.0)
    }
}

/// The impedance of a wrist at the handle that it turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrist {
    /// Moment of inertia that turns with the handle (kg m^2).
    pub inertia: f64,
    /// Damping between the handle and the orientation that the hand aims at (N m s/rad).
    pub damping: f64,
    /// Stiffness between the handle and the orientation that the hand aims at (N m/rad).
    pub stiffness: f64,
}

impl Wrist {
    /// The wrists of the grips in [`Arm::GRIPS`], under the same names. These are estimates: the arm's numbers at a
    /// lever of 7 to 10 cm, reduced for the compliance of the fingers.
    pub const GRIPS: [(&str, Self); 4] = [
        ("relaxed", Self::new(5e-4, 0.01, 0.2)),
        ("typical", Self::new(2e-3, 0.03, 1.0)),
        ("firm", Self::new(4e-3, 0.1, 4.0)),
        ("rigid", Self::new(8e-3, 0.3, 12.0)),
    ];

    /// The grip of that name; `None` for an unknown name.
    pub fn named(name: &str) -> Option<Self> {
        let grip = Self::GRIPS.iter().find(|(known, _)| *known == name)?;
        Some(grip.1)
    }

    const fn new(inertia: f64, damping: f64, stiffness: f64) -> Self {
        Self {
            inertia,
            damping,
            stiffness,
        }
    }

    /// A device that no hand holds.
    pub(crate) const NONE: Self = Self::new(0.0, 0.0, 0.0);

    pub(crate) fn is_sound(&self) -> bool {
        [self.inertia, self.damping, self.stiffness]
            .iter()
            .all(|x| x.is_finite() && *x >= 0.0)
    }
}

impl Default for Wrist {
    /// The wrist of the typical grip.
    fn default() -> Self {
        let [_, (_, typical), _, _] = Self::GRIPS;
        typical
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
        let fractions: Vec<_> = (0..=20)
            .map(|k| Arm::between(f64::from(k) / 20.0))
            .collect();
        for pair in fractions.windows(2) {
            assert!(tighter(&pair[0], &pair[1]), "{pair:?}");
        }
    }

    #[test]
    fn a_wrist_has_the_same_grips() {
        for ((arm, _), (wrist, _)) in Arm::GRIPS.iter().zip(&Wrist::GRIPS) {
            assert_eq!(arm, wrist);
        }
        for pair in Wrist::GRIPS.windows(2) {
            let (a, b) = (pair[0].1, pair[1].1);
            assert!(a.inertia < b.inertia && a.damping < b.damping && a.stiffness < b.stiffness);
        }
        assert_eq!(Arm::named("typical"), Some(Arm::default()));
        assert_eq!(Wrist::named("typical"), Some(Wrist::default()));
        assert_eq!((Arm::named("limp"), Wrist::named("limp")), (None, None));
    }

    #[test]
    fn grips_in_between_have_the_ends_and_the_geometric_mean_in_the_middle() {
        for (fraction, end) in [
            (0.0, Arm::RELAXED),
            (-1.0, Arm::RELAXED),
            (f64::NAN, Arm::RELAXED),
            (1.0, Arm::RIGID),
            (7.0, Arm::RIGID),
        ] {
            assert_eq!(Arm::between(fraction), end);
        }
        let middle = Arm::between(0.5);
        // Tolerances of a few roundings.
        assert!((middle.mass - (0.1_f64 * 2.0).sqrt()).abs() < 1e-15);
        assert!((middle.damping - (2.0_f64 * 60.0).sqrt()).abs() < 1e-13);
        assert!((middle.stiffness - (30.0_f64 * 2000.0).sqrt()).abs() < 1e-11);
    }
}
