//! Physiological tremor: the small 8 to 12 Hz motion of every outstretched hand (Elble & Koller 1990).
//!
//! The tremor is a sum of sinusoids with seeded frequencies, amplitudes and phases. It is a function of time alone: no
//! random number is drawn during a run. All three axes share the frequencies and differ in amplitude and phase, as the
//! parts of one limb's motion do.

use crate::curve::{Knot, minimum_jerk};
use core::f64::consts::TAU;
use rand_core::Rng;
use rand_pcg::Pcg64;
use rt_core::Vec3;

/// Number of sinusoids. Their beats repeat after a second and a half or later.
pub const COUNT: usize = 6;
/// Lowest frequency (Hz).
pub(crate) const LOWEST_HZ: f64 = 8.0;
/// Highest frequency (Hz).
pub(crate) const HIGHEST_HZ: f64 = 12.0;
/// Time of the fade-in from rest (s).
pub(crate) const FADE: f64 = 0.5;

/// The stream of the random generator: no other part of the program draws from it.
const STREAM: u128 = 0x7472_656d_6f72;

/// The reason why a tremor cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TremorError {
    /// The amplitude is not a finite number of at least zero.
    #[error("a tremor's RMS amplitude must be finite and at least 0 m, not {found}")]
    Amplitude {
        /// The amplitude that was given (m).
        found: f64,
    },
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Wave {
    /// Angular frequency (rad/s).
    speed: f64,
    sine: Vec3,
    cosine: Vec3,
}

/// A tremor as a function of time.
#[derive(Clone, Debug, PartialEq)]
pub struct Tremor {
    waves: [Wave; COUNT],
}

impl Tremor {
    /// The tremor of `seed`. `rms` (m) is the root mean square of the displacement vector over a long time, after the
    /// fade-in. The `rms` of a relaxed hand is about 0.05 to 0.2 mm.
    ///
    /// # Errors
    /// [`TremorError`] if the amplitude is negative or not finite.
    pub fn new(rms: f64, seed: u64) -> Result<Self, TremorError> {
        if !(rms.is_finite() && rms >= 0.0) {
            return Err(TremorError::Amplitude { found: rms });
        }
        let mut random = Pcg64::new(u128::from(seed), STREAM);
        let vector = |random: &mut Pcg64| Vec3::from_fn(|_, _| 2.0 * unit(random) - 1.0);
        let band = (HIGHEST_HZ - LOWEST_HZ) / COUNT as f64;
        // One frequency in each of COUNT equal parts of the band.
        let mut waves = core::array::from_fn(|k| {
            let frequency = LOWEST_HZ + band * (k as f64 + unit(&mut random));
            Wave {
                speed: TAU * frequency,
                sine: vector(&mut random),
                cosine: vector(&mut random),
            }
        });
        let power: f64 = waves
            .iter()
            .map(|w: &Wave| w.sine.norm_squared() + w.cosine.norm_squared())
            .sum();
        let scale = if power > 0.0 {
            rms / (0.5 * power).sqrt()
        } else {
            0.0
        };
        for wave in &mut waves {
            wave.sine *= scale;
            wave.cosine *= scale;
        }
        Ok(Self { waves })
    }

    /// Displacement (m) and velocity (m/s) at `time` (s). At time zero, the tremor is at rest.
    pub fn at(&self, time: f64) -> (Vec3, Vec3) {
        let mut sum: Knot = (Vec3::zeros(), Vec3::zeros());
        for wave in &self.waves {
            let (sin, cos) = libm::sincos(wave.speed * time);
            sum.0 += wave.sine * sin + wave.cosine * cos;
            sum.1 += (wave.sine * cos - wave.cosine * sin) * wave.speed;
        }
        let (weight, slope) = minimum_jerk(time / FADE);
        (sum.0 * weight, sum.1 * weight + sum.0 * (slope / FADE))
    }
}

/// Uniform in [0, 1), from the upper 53 bits.
pub(crate) fn unit(random: &mut impl Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn it_starts_at_rest_and_refuses_senseless_amplitudes() {
        let tremor = Tremor::new(1e-4, 7).unwrap();
        assert_eq!(tremor.at(0.0), (Vec3::zeros(), Vec3::zeros()));
        assert!(Tremor::new(-1e-4, 7).is_err());
        assert!(Tremor::new(f64::NAN, 7).is_err());
        assert_eq!(Tremor::new(0.0, 7).unwrap().at(3.3).0, Vec3::zeros());
    }

    #[test]
    fn equal_seeds_give_equal_bits_and_others_differ() {
        let (a, b) = (Tremor::new(1e-4, 1).unwrap(), Tremor::new(1e-4, 2).unwrap());
        assert_eq!(a, Tremor::new(1e-4, 1).unwrap());
        assert!(a.at(1.0) != b.at(1.0));
    }

    proptest! {
        #[test]
        fn the_root_mean_square_is_as_asked(seed in any::<u64>()) {
            let rms = 1e-4;
            let tremor = Tremor::new(rms, seed).unwrap();
            let count = 50_000_u32;
            let square = (0..count).map(|k| tremor.at(1.0 + 2e-3 * f64::from(k)).0.norm_squared());
            let found = (square.sum::<f64>() / f64::from(count)).sqrt();
            // The average is over 100 s. Two waves that beat at f leave up to 1 / (2 pi f 100 s) of their power. Only
            // neighbours can be close, and the cross term of each pair holds at most half of the power. Below 0.02 Hz
            // (once in several hundred seeds), nothing averages out. The bound is for f >= 0.02 Hz: 8 % of the power,
            // half of that in the root. Closer pairs are left out.
            let closest = tremor.waves.windows(2).map(|w| w[1].speed - w[0].speed).fold(f64::MAX, f64::min);
            prop_assume!(closest > TAU * 0.02);
            prop_assert!((found / rms - 1.0).abs() < 0.05, "{}", found / rms);
        }

        #[test]
        fn velocity_is_the_slope(seed in any::<u64>(), t in 0.0..20.0_f64) {
            let tremor = Tremor::new(1e-4, seed).unwrap();
            let h = 1e-5;
            let slope = (tremor.at(t + h).0 - tremor.at(t - h).0) / (2.0 * h);
            // h^2 / 6 times a jerk of at most (2 pi 12)^3 * 1e-4 * sqrt(2 COUNT) = 150 m/s^3: 2.5e-9. During the
            // fade-in, the slope of the fade adds less than the same again.
            prop_assert!((slope - tremor.at(t).1).norm() < 6e-9);
        }
    }
}
