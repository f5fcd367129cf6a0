//! The lateness of every deadline.
//!
//! A tick that is late or long skips deadlines. If only the ticks counted, a stall of 50 ms would be one late tick among
//! thousands ("coordinated omission": G. Tene, "How not to measure latency", 2013). Each skipped deadline is therefore as
//! late as the next tick that woke: until then no state was read and no force left.

use rt_core::Telemetry;

/// Gives each deadline of a run its lateness, from the telemetry of the ticks in their order.
#[derive(Clone, Copy, Debug)]
pub struct Deadlines {
    period_ns: u64,
    /// Number and nominal time of the last tick.
    last: Option<(u64, u64)>,
    /// Deadlines that a tick served.
    pub met: u64,
    /// Deadlines that the loop skipped.
    pub skipped: u64,
    /// Deadlines whose tick is unknown, because its telemetry was lost.
    pub unknown: u64,
}

impl Deadlines {
    /// A run with the period `period_ns`, before its first tick.
    pub fn new(period_ns: u64) -> Self {
        Self {
            period_ns: period_ns.max(1),
            last: None,
            met: 0,
            skipped: 0,
            unknown: 0,
        }
    }

    /// Takes a tick. Calls `each` with the time (ns) and the lateness (ns) of every deadline since the previous tick, and of
    /// the tick's own. Returns the number of deadlines that were skipped just before the tick.
    pub fn take(&mut self, telemetry: &Telemetry, mut each: impl FnMut(u64, u64)) -> u64 {
        let woke_ns = telemetry.time_ns.saturating_add(telemetry.lateness_ns);
        let mut skipped = 0;
        if let Some((tick, time_ns)) = self.last {
            let slots = telemetry.time_ns.saturating_sub(time_ns) / self.period_ns;
            let between = slots.saturating_sub(1);
            if telemetry.tick == tick + 1 {
                skipped = between;
                for slot in 1..slots {
                    let deadline_ns = time_ns + slot * self.period_ns;
                    each(deadline_ns, woke_ns.saturating_sub(deadline_ns));
                }
            } else {
                self.unknown += between;
            }
        }
        each(telemetry.time_ns, telemetry.lateness_ns);
        self.last = Some((telemetry.tick, telemetry.time_ns));
        self.met += 1;
        self.skipped += skipped;
        skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tick: its number, its nominal time and its lateness (ms).
    fn taken(ticks: &[(u64, u64, u64)]) -> (Vec<(u64, u64)>, Deadlines) {
        let mut deadlines = Deadlines::new(1_000_000);
        let mut found = Vec::new();
        for &(tick, time, lateness) in ticks {
            let mut telemetry = Telemetry::empty();
            telemetry.tick = tick;
            telemetry.time_ns = time * 1_000_000;
            telemetry.lateness_ns = lateness * 1_000_000;
            deadlines.take(&telemetry, |at, late| {
                found.push((at / 1_000_000, late / 1_000_000));
            });
        }
        (found, deadlines)
    }

    #[test]
    fn a_stall_counts_once_for_each_deadline_that_passed_in_it() {
        // The second tick wakes 3 ms late. The loop skips the deadlines 2, 3 and 4.
        let (found, deadlines) = taken(&[(0, 0, 0), (1, 1, 3), (2, 5, 0)]);
        assert_eq!(found, [(0, 0), (1, 3), (2, 3), (3, 2), (4, 1), (5, 0)]);
        assert_eq!(
            (deadlines.met, deadlines.skipped, deadlines.unknown),
            (3, 3, 0)
        );
    }

    #[test]
    fn deadlines_of_lost_telemetry_are_unknown_and_not_late() {
        let (found, deadlines) = taken(&[(0, 0, 0), (3, 5, 1), (4, 6, 0)]);
        assert_eq!(found, [(0, 0), (5, 1), (6, 0)]);
        assert_eq!(
            (deadlines.met, deadlines.skipped, deadlines.unknown),
            (3, 0, 4)
        );
    }
}
