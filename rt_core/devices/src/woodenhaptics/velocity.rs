//! The velocity of the handle from its positions, by the difference across a window of time.
//!
//! A device that answers when it is asked has no fixed period, so each position comes with its time. (The estimators of
//! [`rt_core::velocity`] expect one position per period.) The window is as long as theirs. A count more or less at one
//! of its ends is an error of a count over the window: 15 mm/s for 0.06 mm. The estimate lags by half the window.

use rt_core::Vec3;
use rt_core::velocity::VelocityEstimator;

/// Largest number of positions in a window. At 4 kHz it spans the longest window.
const MOST: usize = 17;

/// An estimator of velocity from positions at known times.
///
/// ```
/// use devices::woodenhaptics::velocity::Slope;
/// use rt_core::Vec3;
///
/// let mut slope = Slope::default();
/// assert_eq!(slope.update(0, &Vec3::zeros()), Vec3::zeros());
/// let velocity = slope.update(2_000_000, &Vec3::new(0.001, 0.0, 0.0));
/// assert!((velocity.x - 0.5).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Slope {
    /// The positions (m) with their times (ns), the newest first.
    samples: [Option<(u64, Vec3)>; MOST],
    velocity: Vec3,
}

impl Slope {
    /// Takes the position (m) at `time_ns`; returns the velocity (m/s): the slope from the oldest position in the
    /// window, or from the last position where it is older than the window. A time that is not later than the last one
    /// changes nothing.
    pub fn update(&mut self, time_ns: u64, position: &Vec3) -> Vec3 {
        if let [Some((last_ns, _)), ..] = self.samples
            && time_ns <= last_ns
        {
            return self.velocity;
        }
        let mut from = None;
        for (at_ns, earlier) in self.samples.iter().flatten() {
            let span = time_ns.saturating_sub(*at_ns) as f64 * 1e-9;
            // Half a nanosecond of rounding.
            if from.is_some() && span > VelocityEstimator::SPAN + 0.5e-9 {
                break;
            }
            from = Some((span, *earlier));
        }
        self.velocity =
            from.map_or_else(Vec3::zeros, |(span, earlier)| (position - earlier) / span);
        self.samples.rotate_right(1);
        if let Some(newest) = self.samples.first_mut() {
            *newest = Some((time_ns, *position));
        }
        self.velocity
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn a_steady_motion_has_its_velocity_at_uneven_times() {
        let velocity = Vec3::new(0.3, -0.2, 0.1);
        let mut slope = Slope::default();
        let mut time_ns = 0;
        for k in 0..200 {
            time_ns += 300_000 + 700_000 * (k * k % 5);
            let found = slope.update(time_ns, &(velocity * (time_ns as f64 * 1e-9)));
            let expected = if k == 0 { Vec3::zeros() } else { velocity };
            // Rounding of positions of 0.1 m over a window of a millisecond.
            assert!((found - expected).norm() < 1e-12, "{k}: {found}");
        }
    }

    #[test]
    fn the_window_is_four_milliseconds() {
        let mut slope = Slope::default();
        for k in 0..20 {
            slope.update(k * MS, &Vec3::zeros());
        }
        // A step of 1 mm stays in the window for four milliseconds.
        for k in 20..30 {
            let found = slope.update(k * MS, &Vec3::new(0.001, 0.0, 0.0));
            let expected = if k < 24 { 0.25 } else { 0.0 };
            assert!((found.x - expected).abs() < 1e-12, "{k}: {found}");
        }
    }

    #[test]
    fn a_silence_gives_the_mean_velocity_across_it() {
        let mut slope = Slope::default();
        slope.update(0, &Vec3::zeros());
        slope.update(MS, &Vec3::zeros());
        let found = slope.update(101 * MS, &Vec3::new(0.0, 0.01, 0.0));
        assert!((found.y - 0.1).abs() < 1e-12, "{found}");
    }

    #[test]
    fn a_repeated_or_earlier_time_changes_nothing() {
        let mut slope = Slope::default();
        slope.update(5 * MS, &Vec3::zeros());
        let velocity = slope.update(6 * MS, &Vec3::new(0.001, 0.0, 0.0));
        for time_ns in [6 * MS, 3 * MS, 0] {
            assert_eq!(slope.update(time_ns, &Vec3::new(1.0, 0.0, 0.0)), velocity);
        }
    }
}
