//! The velocity of the handle from its positions, by the difference across a window of time.
//!
//! A device that answers only when it is asked has no fixed period, so each position comes with its time. (The
//! estimators of [`rt_core::velocity`] expect one position per period.) The window is as long as theirs, and never
//! shorter: after a late answer, it reaches back across the gap. A count more or less at one of its ends is thus an
//! error of at most a count over the window: 15 mm/s for 0.06 mm. The estimate lags by half the window.

use rt_core::Vec3;
use rt_core::velocity::VelocityEstimator;

/// Number of intervals into which a window is divided. The time of a position is kept if it is at least one interval
/// after the last kept time. At 4 kHz, the time of each position is kept.
const PARTS: usize = 16;
/// Rounding of a time in whole nanoseconds (s).
const ROUNDING: f64 = 0.5e-9;

/// An estimator of velocity from positions at known times.
///
/// ```
/// use devices::woodenhaptics::velocity::Slope;
/// use rt_core::Vec3;
///
/// let mut slope = Slope::default();
/// assert_eq!(slope.update(0, &Vec3::zeros()), Vec3::zeros());
/// let velocity = slope.update(4_000_000, &Vec3::new(0.002, 0.0, 0.0));
/// assert!((velocity.x - 0.5).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Slope {
    /// Positions (m) with their times (ns), the newest first. They span a window once enough positions have come.
    samples: [Option<(u64, Vec3)>; PARTS + 1],
    /// Time of the last position (ns).
    last_ns: Option<u64>,
    velocity: Vec3,
}

impl Slope {
    /// Takes the position (m) at `time_ns`; returns the velocity (m/s): the slope from the newest position that is a
    /// window old. If no position is that old, the slope is from the oldest position, and its distance counts as that
    /// of a whole window. A time that is not later than the last one changes nothing.
    pub fn update(&mut self, time_ns: u64, position: &Vec3) -> Vec3 {
        if self.last_ns.is_some_and(|last_ns| time_ns <= last_ns) {
            return self.velocity;
        }
        self.last_ns = Some(time_ns);
        let age = |at_ns: u64| time_ns.saturating_sub(at_ns) as f64 * 1e-9 + ROUNDING;
        let samples = || self.samples.iter().flatten();
        let from = samples()
            .find(|(at_ns, _)| age(*at_ns) >= VelocityEstimator::SPAN)
            .or(samples().last());
        self.velocity = from.map_or_else(Vec3::zeros, |(at_ns, earlier)| {
            let span = time_ns.saturating_sub(*at_ns) as f64 * 1e-9;
            (position - earlier) / span.max(VelocityEstimator::SPAN)
        });
        let [newest, ..] = self.samples;
        let part = VelocityEstimator::SPAN / PARTS as f64;
        if newest.is_none_or(|(at_ns, _)| age(at_ns) >= part) {
            self.samples.rotate_right(1);
            if let Some(newest) = self.samples.first_mut() {
                *newest = Some((time_ns, *position));
            }
        }
        self.velocity
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MS: u64 = 1_000_000;
    /// A count at the tip (m).
    const COUNT: f64 = 60e-6;

    #[test]
    fn a_steady_motion_has_its_velocity_at_uneven_times() {
        let velocity = Vec3::new(0.3, -0.2, 0.1);
        let mut slope = Slope::default();
        let mut time_ns = 0;
        for k in 0..200 {
            time_ns += 300_000 + 700_000 * (k * k % 5);
            let found = slope.update(time_ns, &(velocity * (time_ns as f64 * 1e-9)));
            // Rounding of positions of 0.1 m over a window of a millisecond.
            if time_ns > 5 * MS {
                assert!((found - velocity).norm() < 1e-12, "{k}: {found}");
            }
            assert!(found.norm() <= velocity.norm() + 1e-12, "{k}: {found}");
        }
    }

    #[test]
    fn the_window_is_four_milliseconds() {
        // From a loop of 250 Hz to an exchange without end.
        for period_ns in [4 * MS, 2 * MS, MS, 500_000, 250_000, 125_000, 20_000] {
            let at = |k: u64| k * period_ns;
            let before = 20 * MS / period_ns;
            let mut slope = Slope::default();
            for k in 0..before {
                slope.update(at(k), &Vec3::zeros());
            }
            // A step of 1 mm stays in the window for four milliseconds, or as much longer as the times of positions are
            // apart.
            for k in before..2 * before {
                let found = slope.update(at(k), &Vec3::new(0.001, 0.0, 0.0)).x;
                let since_ns = at(k) - at(before);
                if since_ns < 4 * MS {
                    // The window is longer by the time between two kept positions.
                    assert!((0.22..0.25 + 1e-12).contains(&found), "{k}: {found}");
                } else if since_ns > 4 * MS + 250_000 {
                    assert_eq!(found, 0.0, "{k}");
                }
            }
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

    /// The case of a loaded machine: positions every millisecond, an answer 4.2 ms late, and a count 0.11 ms after it.
    #[test]
    fn one_count_after_a_gap_is_no_fast_motion() {
        for gap_ns in [3_800_000, 4_200_000, 30 * MS] {
            let mut slope = Slope::default();
            for k in 0..20 {
                slope.update(k * MS, &Vec3::zeros());
            }
            let late_ns = 19 * MS + gap_ns;
            assert_eq!(slope.update(late_ns, &Vec3::zeros()), Vec3::zeros());
            let count = Vec3::new(COUNT, 0.0, 0.0);
            let found = slope.update(late_ns + 110_000, &count).x;
            assert!((0.0..=COUNT / 0.004).contains(&found), "{gap_ns}: {found}");
        }
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

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        /// At any times of the answers (early, late, lost), the estimate for a hand with a bounded speed is at most the
        /// sum of this speed and two errors in a window: a count at each end, and an answer that is late by `late`.
        #[test]
        fn no_time_of_an_answer_makes_a_fast_hand(
            fastest in 0.0..2.0_f64,
            steps in prop::collection::vec((1..3_000_000_u64, 0..10_000_000_u64, -1.0..1.0_f64, 0..10_u8), 1..300),
        ) {
            let mut slope = Slope::default();
            let (mut sampled_ns, mut position, mut came_ns) = (0, 0.0, 0);
            let late = 10e-3;
            let most = fastest * (1.0 + late / VelocityEstimator::SPAN) + COUNT / VelocityEstimator::SPAN;
            for (step_ns, late_ns, speed, lost) in steps {
                sampled_ns += step_ns;
                position += fastest * speed * step_ns as f64 * 1e-9;
                if lost == 0 {
                    continue;
                }
                // Answers come in their order.
                came_ns = (sampled_ns + if lost == 1 { late_ns } else { 0 }).max(came_ns + 1);
                let counted = (position / COUNT).round() * COUNT;
                let found = slope.update(came_ns, &Vec3::new(counted, 0.0, 0.0)).x;
                prop_assert!(found.abs() <= most + 1e-9, "{} m/s of {}", found, fastest);
            }
        }
    }
}
