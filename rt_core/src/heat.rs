//! The heat of a device's motors: a limit on the mean square of the force.
//!
//! A motor heats with the square of its current, and cools with a time constant. The mean square `q` of the force over
//! that time follows `dq/dt = (F^2 - q) / T`, so `q <= F_c^2` keeps the motor as cool as the continuous force `F_c`. Up
//! to half of that heat, the device renders its largest force. Above half, the largest force falls linearly, and
//! reaches `F_c` at the whole heat. The limit therefore never makes a force jump, and `q` never passes `F_c^2`.

/// The part of the heat from which the largest force falls.
const WARM: f64 = 0.5;

/// The heat that the motors of a device withstand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeatConfig {
    /// The force that the device may render continuously (N); infinite if the heat has no limit.
    pub continuous_force: f64,
    /// Time constant of the motors' cooling (s).
    pub time: f64,
}

impl Default for HeatConfig {
    /// No limit.
    fn default() -> Self {
        Self {
            continuous_force: f64::INFINITY,
            time: 1.0,
        }
    }
}

/// The heat of one device's motors.
///
/// ```
/// use rt_core::heat::{Heat, HeatConfig};
///
/// // 8 N at most, and 2 N continuously.
/// let config = HeatConfig { continuous_force: 2.0, time: 10.0 };
/// let mut heat = Heat::default();
/// assert_eq!(heat.largest_force(&config, 8.0), 8.0);
/// for _ in 0..60_000 {
///     let force = heat.largest_force(&config, 8.0);
///     heat.note(&config, force, 1e-3);
/// }
/// assert!((heat.largest_force(&config, 8.0) - 2.0).abs() < 0.01);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Heat {
    /// Mean square of the force (N^2).
    mean_square: f64,
}

impl Heat {
    /// The largest force that the heat allows (N), at most `most`.
    pub fn largest_force(&self, config: &HeatConfig, most: f64) -> f64 {
        let continuous = config.continuous_force;
        if continuous >= most {
            return most;
        }
        let heat = self.mean_square / (continuous * continuous);
        let warm = ((heat - WARM) / (1.0 - WARM)).clamp(0.0, 1.0);
        most + (continuous - most) * warm
    }

    /// Notes that the device renders `force` (N) for a `period` (s).
    pub fn note(&mut self, config: &HeatConfig, force: f64, period: f64) {
        if config.continuous_force.is_finite() {
            let part = (period / config.time).min(1.0);
            self.mean_square += (force * force - self.mean_square) * part;
        }
    }

    /// The root of the mean square of the force (N).
    pub fn root_mean_square(&self) -> f64 {
        libm::sqrt(self.mean_square)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_mean_square_follows_a_steady_force_with_the_time_constant() {
        let config = HeatConfig {
            continuous_force: 5.0,
            time: 2.0,
        };
        let (period, mut heat) = (1e-3, Heat::default());
        for tick in 1..=6000 {
            heat.note(&config, 3.0, period);
            let passed = f64::from(tick) * period / config.time;
            let expected = 3.0 * libm::sqrt(1.0 - libm::exp(-passed));
            // A step of one tick errs by half of the ratio of the tick to the time constant.
            let found = heat.root_mean_square();
            assert!(
                (found - expected).abs() < 1e-3,
                "{tick}: {found} {expected}"
            );
        }
        // A tick longer than the time constant has the heat of its own force.
        heat.note(&config, 1.0, 10.0);
        assert_eq!(heat.root_mean_square(), 1.0);
    }

    #[test]
    fn the_largest_force_falls_from_half_of_the_heat_to_the_whole() {
        let config = HeatConfig {
            continuous_force: 2.0,
            time: 1.0,
        };
        for (heat, largest) in [(0.0, 8.0), (0.5, 8.0), (0.75, 5.0), (1.0, 2.0), (2.0, 2.0)] {
            let mean_square = 4.0 * heat;
            let found = Heat { mean_square }.largest_force(&config, 8.0);
            assert!((found - largest).abs() < 1e-12, "{heat}: {found}");
        }
        // A device that may render its largest force continuously never gets hot.
        let hot = Heat { mean_square: 100.0 };
        for most in [1.0, 2.0] {
            assert_eq!(hot.largest_force(&config, most), most);
        }
    }

    proptest! {
        /// For any force of the scene, the mean square of the force stays below that of the continuous force, and the
        /// largest force changes by less than a hand can feel from one tick to the next.
        #[test]
        fn the_mean_square_stays_below_that_of_the_continuous_force(
            asked in prop::collection::vec((0.0..20.0, 1..3000_u32), 1..20),
            continuous in 0.5..4.0, time in 1.0..60.0,
        ) {
            let (most, period) = (10.0, 1e-3);
            let config = HeatConfig { continuous_force: continuous, time };
            let mut heat = Heat::default();
            let mut before = most;
            for (force, ticks) in asked {
                for _ in 0..ticks {
                    let largest = heat.largest_force(&config, most);
                    prop_assert!(largest >= continuous && largest <= most);
                    // The slope of the largest force in the heat, times the fastest change of the heat.
                    let slope = (most - continuous) / (1.0 - WARM) / (continuous * continuous);
                    prop_assert!((largest - before).abs() <= slope * most * most * period / time);
                    before = largest;
                    heat.note(&config, f64::min(force, largest), period);
                    prop_assert!(heat.root_mean_square() <= continuous * (1.0 + 1e-12));
                }
            }
        }
    }
}
