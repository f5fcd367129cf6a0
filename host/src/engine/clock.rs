//! The time that a body's state stands for.
//!
//! A step moves a body on by as much time as it is long. The newest tick record tells until when the hands are known, and
//! that goes on unevenly: a record gets lost or comes late, a step is no whole number of ticks. A handle that stood where
//! the newest record saw it would stand still for a step and then go twice as far in the next, and its body would answer
//! jolts that no hand made. So the body's time goes on evenly, and the hands' paths go on at their velocity for as long as
//! the records are late, up to [`LONGEST`]. Where records come evenly, nothing is made up.

/// For how long (s) a path goes on without a record. Of ten records of a millisecond in a row all get lost once in a
/// thousand times even where every other does.
const LONGEST: f64 = 0.010;

/// Share of its advance over the records that a clock gives back in a step: records that come later from some time on,
/// or a step that is not quite as long as it says, must not leave the clock ahead for good.
const RETURN: f64 = 0.01;

/// A clock that goes on in steps, no further behind than the newest record.
#[derive(Clone, Copy, Debug)]
pub(super) struct BodyClock {
    step_ns: u64,
    now_ns: Option<u64>,
}

impl BodyClock {
    /// A clock that has not begun, for steps of `step` (s).
    pub(super) fn new(step: f64) -> Self {
        Self {
            step_ns: (step * 1e9).round() as u64,
            now_ns: None,
        }
    }

    /// One step on, where the newest record is of `newest_ns`. Returns the time at its end (ns); it never goes back.
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
            // It is ahead by six milliseconds at most. Each step gives back a hundredth, and the next record makes up for
            // all of that: for 0.01 (1 + 2 + ... + 6) = 0.21 ms.
            let by = now - last;
            assert!((940_000..=1_210_000).contains(&by), "{tick}: {by}");
            last = now;
        }
        // Without any record it stands before long.
        for _ in 0..20 {
            last = clock.step(693 * MS);
        }
        assert_eq!(last, 703 * MS);
        assert_eq!(clock.step(693 * MS), last);
        // After a stall of the host it is where the records are.
        assert_eq!(clock.step(2000 * MS), 2000 * MS);
    }

    #[test]
    fn an_advance_is_given_back() {
        let mut clock = BodyClock::new(1e-3);
        clock.step(0);
        // From here on all records are five milliseconds later than before.
        for tick in 1..2000_u64 {
            let now = clock.step(tick.saturating_sub(5) * MS);
            assert!(tick < 1000 || now - tick.saturating_sub(5) * MS < 200);
        }
    }
}
