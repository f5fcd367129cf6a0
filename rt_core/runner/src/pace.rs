//! The grid of deadlines, and the treatment of missed deadlines.
//!
//! Deadlines stand at `start + k period`. A tick that runs past one or more deadlines does not make up for them: a
//! burst of ticks would push the hand with stale forces. The missed deadlines are skipped and counted, and the next
//! deadline is the next one in the future on the same grid. The module is pure arithmetic, without clock or thread.

/// The next deadline on the grid through `deadline_ns` with period `period_ns`, and the number of deadlines missed
/// between the two, for a tick that ended at `now_ns`. All times are in ns.
///
/// The next deadline is the first after `deadline_ns` that does not lie before `now_ns`: a deadline at exactly `now_ns`
/// can still be met. A period of zero counts as one nanosecond.
///
/// ```
/// use runner::pace::next_deadline;
///
/// assert_eq!(next_deadline(1_200, 1_000, 500), (1_500, 0)); // in time
/// assert_eq!(next_deadline(1_501, 1_000, 500), (2_000, 1)); // 1500 is gone
/// assert_eq!(next_deadline(3_400, 1_000, 500), (3_500, 4)); // 1500, 2000, 2500 and 3000 are gone
/// ```
pub fn next_deadline(now_ns: u64, deadline_ns: u64, period_ns: u64) -> (u64, u64) {
    let period = period_ns.max(1);
    let elapsed = now_ns.saturating_sub(deadline_ns);
    let steps = elapsed.div_ceil(period).max(1);
    (
        deadline_ns.saturating_add(steps.saturating_mul(period)),
        steps - 1,
    )
}

/// The position of a run on its grid of deadlines.
///
/// ```
/// use runner::pace::Pace;
///
/// // A period of 1 ms. The first tick takes 0.3 ms, the second 2.5 ms.
/// let mut pace = Pace::new(0, 1_000_000);
/// assert_eq!(pace.advance(300_000), 0);
/// assert_eq!(pace.advance(3_500_000), 2);
/// assert_eq!((pace.deadline_ns(), pace.missed()), (4_000_000, 2));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pace {
    start_ns: u64,
    period_ns: u64,
    deadline_ns: u64,
    missed: u64,
    longest_miss: u64,
}

impl Pace {
    /// A run whose first deadline is `start_ns`; the others follow every `period_ns`.
    pub fn new(start_ns: u64, period_ns: u64) -> Self {
        Self {
            start_ns,
            period_ns,
            deadline_ns: start_ns,
            missed: 0,
            longest_miss: 0,
        }
    }

    /// The deadline to sleep to (ns).
    pub fn deadline_ns(&self) -> u64 {
        self.deadline_ns
    }

    /// The nominal time of the next tick (ns): the time of its deadline since the first one. Skipped deadlines advance
    /// it too, so it stays the time of the devices and the host.
    pub(crate) fn nominal_ns(&self) -> u64 {
        self.deadline_ns - self.start_ns
    }

    /// Advances after a tick that ended at `now_ns`. Returns the number of missed deadlines.
    pub fn advance(&mut self, now_ns: u64) -> u64 {
        let (next, missed) = next_deadline(now_ns, self.deadline_ns, self.period_ns);
        self.deadline_ns = next;
        self.missed += missed;
        self.longest_miss = self.longest_miss.max(missed);
        missed
    }

    /// Number of past deadlines, met and missed.
    pub fn slots(&self) -> u64 {
        self.nominal_ns() / self.period_ns.max(1)
    }

    /// Deadlines missed so far.
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// Largest number of deadlines missed by one tick.
    pub fn longest_miss(&self) -> u64 {
        self.longest_miss
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A small generator (Knuth's MMIX constants). The property runs over many cases, and always over the same.
    fn cases(count: usize) -> impl Iterator<Item = (u64, u64, u64)> {
        let mut state = 1_u64;
        let mut next = move |bound: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 20) % bound
        };
        (0..count).map(move |_| {
            let period = 1 + next(5_000);
            let deadline = next(1_000_000);
            // From before the deadline to many periods after it, on and off the grid.
            let late = if next(4) == 0 {
                next(12) * period
            } else {
                next(12 * period)
            };
            (
                (deadline + late).saturating_sub(next(2) * period),
                deadline,
                period,
            )
        })
    }

    #[test]
    fn the_next_deadline_is_the_first_on_the_grid_that_can_still_be_met() {
        for (now, deadline, period) in cases(100_000) {
            let (next, missed) = next_deadline(now, deadline, period);
            let at = format!("now {now}, deadline {deadline}, period {period}");
            assert!(next > deadline && next >= now, "{at}");
            assert_eq!((next - deadline) % period, 0, "{at}");
            assert_eq!((next - deadline) / period, missed + 1, "{at}");
            // The deadline before had passed, or was the one that the tick served.
            assert!(next - period == deadline || next - period < now, "{at}");
        }
    }

    #[test]
    fn met_and_missed_deadlines_add_up_to_the_slots() {
        let mut pace = Pace::new(500, 100);
        let (mut met, mut missed, mut longest) = (0, 0, 0);
        for (k, _, _) in cases(10_000) {
            let end = pace.deadline_ns() + k % 450;
            let skipped = pace.advance(end);
            met += 1;
            missed += skipped;
            longest = longest.max(skipped);
        }
        assert!(missed > 0);
        assert_eq!((pace.missed(), pace.longest_miss()), (missed, longest));
        assert_eq!(met + missed, pace.slots());
    }
}
