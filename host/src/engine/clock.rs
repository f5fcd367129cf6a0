//! The time at which a body's state holds.
//!
//! A step advances a body by the length of the step. The newest tick record gives the time up to which the hands are
//! known. This time advances unevenly: a record is lost or comes late, or a step is no whole number of ticks. A
//! handle at the pose of the newest record would stand still for a step and move twice as far in the next, and its
//! body would answer jolts that no hand made. So the body's time advances evenly. While the records are late, the
//! paths of the hands are extrapolated at their velocity, for at most [`LONGEST`]. If records come evenly, nothing
//! is extrapolated.

/// Longest time (s) over which a path is extrapolated without a record. Even if records of a millisecond are lost
/// with a probability of one half, ten records in a row are lost only once in a thousand times.
const LONGEST: f64 = 0.010;

/// Fraction of its advance over the records that a clock gives back in a step. Without this, records that come later
/// from some time on, or a step slightly shorter than its nominal length, would leave the clock ahead for good.
const RETURN: f64 = 0.01;

/// A clock that advances in steps and is never behind the newest record.
#[derive(Clone, Copy, Debug)]
pub(super) struct BodyClock {
    step_ns: u64,
    now_ns: Option<u64>,
}

impl BodyClock {
    /// A clock that has not started, for steps of `step` (s).
    pub(super) fn new(step: f64) -> Self {
        Self {
            step_ns: (step * 1e9).round() as u64,
            now_ns: None,
        }
    }

    /// Advances by one step. The newest record is of `newest_ns`. Returns the time at the end of the step (ns), which
    /// never decreases.
    pub(super) fn step(&mut self, newest_ns: u64) -> u64 {
        let now_ns = self.now_ns.map_or(newest_ns, |now_ns| {
            let due_ns = now_ns.saturating_add(self.step_ns);
            let ahead = due_ns.saturating_sub(newest_ns) as f64;
            let ahead = (ahead * (1.0 - RETURN)).min(LONGEST * 1e9);
            newest_ns.saturating_add(ahead as u64).max(now_ns)
        });
        self.now_ns = Some(now_ns);
        now_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn even_records_are_followed_to_the_nanosecond() {
        let mut clock = BodyClock::new(2e-3);
        for step in 0..1000 {
            assert_eq!(clock.step(2 * step * MS), 2 * step * MS);
        }
    }

    #[test]
    fn time_goes_on_where_records_are_lost_and_jumps_only_after_a_stall() {
        let mut clock = BodyClock::new(1e-3);
        let mut last = clock.step(0);
        // Every other record, then one in seven.
        for tick in 1..700 {
            let seen = if tick < 350 {
                tick / 2 * 2
            } else {
                tick / 7 * 7
            };
            let now = clock.step(seen * MS);
            // The clock is ahead by six milliseconds at most. Each step gives back a hundredth of the advance. The next
            // record makes up for the sum: 0.01 (1 + 2 + ... + 6) = 0.21 ms.
            let by = now - last;
            assert!((940_000..=1_210_000).contains(&by), "{tick}: {by}");
            last = now;
        }
        // Without any record the clock soon stops.
        for _ in 0..20 {
            last = clock.step(693 * MS);
        }
        assert_eq!(last, 703 * MS);
        assert_eq!(clock.step(693 * MS), last);
        // After a stall of the host the clock is at the newest record.
        assert_eq!(clock.step(2000 * MS), 2000 * MS);
    }

    #[test]
    fn an_advance_of_the_clock_is_returned() {
        let mut clock = BodyClock::new(1e-3);
        clock.step(0);
        // From here on all records are five milliseconds later than before.
        for tick in 1..2000_u64 {
            let now = clock.step(tick.saturating_sub(5) * MS);
            assert!(tick < 1000 || now - tick.saturating_sub(5) * MS < 200);
        }
    }
}
