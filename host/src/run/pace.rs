//! The pace of a run in virtual time that viewers watch: seconds of the run for each second of the wall clock.
//!
//! The run waits between two ticks. Nothing of this enters the state.

use std::time::{Duration, Instant};

/// Longest sleep before the caller is asked again.
const SLICE: Duration = Duration::from_millis(16);
/// Shortest sleep. A run that is less ahead does not sleep.
const SHORTEST: Duration = Duration::from_millis(1);

/// Holds a run back.
#[derive(Debug)]
pub(super) struct Pace {
    factor: f64,
    /// Wall clock and time of the run (ns) from which the pace counts.
    from: Option<(Instant, u64)>,
}

impl Pace {
    /// A pace of `factor`; `None` for zero, with which a run is as fast as possible.
    pub(super) fn new(factor: f64) -> Option<Self> {
        (factor > 0.0).then_some(Self { factor, from: None })
    }

    /// Waits until the tick at `time_ns` is due. Calls `meanwhile` many times a second, and waits no more when
    /// `meanwhile` returns false. A run that is slower than its pace does not catch up.
    pub(super) fn wait(&mut self, time_ns: u64, mut meanwhile: impl FnMut() -> bool) {
        let mut now = Instant::now();
        let due = self.due(time_ns, now);
        if due.saturating_duration_since(now) < SHORTEST {
            return;
        }
        while now < due {
            std::thread::sleep(SLICE.min(due - now));
            if !meanwhile() {
                return;
            }
            now = Instant::now();
        }
    }

    /// When the tick at `time_ns` is due.
    fn due(&mut self, time_ns: u64, now: Instant) -> Instant {
        let (from, start_ns) = *self.from.get_or_insert((now, time_ns));
        let seconds = time_ns.saturating_sub(start_ns) as f64 * 1e-9 / self.factor;
        let after = Duration::try_from_secs_f64(seconds).ok();
        let due = after.and_then(|after| from.checked_add(after));
        let due = due.unwrap_or_else(|| now + Duration::from_secs(86_400));
        if now > due + SLICE {
            self.from = Some((now, time_ns));
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_due_at_the_pace_and_a_slow_run_does_not_catch_up() {
        let start = Instant::now();
        let mut pace = Pace::new(2.0).expect("a pace above zero");
        let at = |ms| start + Duration::from_millis(ms);
        assert_eq!(pace.due(0, start), start);
        assert_eq!(pace.due(20_000_000, at(3)), at(10));
        // A step that takes a second.
        assert_eq!(pace.due(40_000_000, at(1000)), at(20));
        assert_eq!(pace.due(60_000_000, at(1000)), at(1010));
        assert!(Pace::new(0.0).is_none());
    }

    #[test]
    fn a_pace_of_almost_zero_is_no_overflow() {
        let mut pace = Pace::new(f64::MIN_POSITIVE).expect("a pace above zero");
        let now = Instant::now();
        pace.due(0, now);
        assert!(pace.due(u64::MAX, now) > now);
    }
}
