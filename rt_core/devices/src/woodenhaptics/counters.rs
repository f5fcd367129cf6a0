//! Counters of 16 bits, extended beyond their range, and the jumps that no hand can cause.
//!
//! A counter that turns by less than half its range between two reports is extended exactly. A joint that turns faster
//! than [`FASTEST`] is impossible, so a report that would need such a turn is refused. The device may have started
//! anew. Its counters then began anew, too. After [`RESTART`] refused reports in a row that agree with each other, the
//! device counts as restarted: the position of the handle is lost until counters are set again.
//!
//! The time between the samples of two reports is not known exactly, because the protocol has no time. The device
//! samples a report after the previous report was taken. The time between the samples of two consecutive reports is
//! therefore at most the time between the arrivals of the newer of the two and of the report before both. A refused
//! report shows a sample of the device, too, so the allowance does not grow while reports are refused.

/// Fastest turn of a joint (rad/s). At the end of a link of 0.2 m, this rate is 20 m/s. A fast throw of an arm is about
/// 10 m/s.
pub const FASTEST: f64 = 100.0;
/// Number of refused reports in a row, each in reach of the one before, that make a restart.
pub const RESTART: u8 = 8;
/// Longest time between two reports that counts (s). In this time a joint turns by 2 rad at most, which is more than
/// its turn across the workspace. The driver therefore believes any position of a device that was silent for long.
const LONGEST: f64 = 0.02;

use super::geometry::each;

/// The effect of a report on the counters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken {
    /// The report advanced the counters.
    Counted,
    /// The report was refused: no hand moves that fast.
    Jumped,
    /// The report was refused, and the device has started anew. The counters are no longer valid.
    Restarted,
}

/// Three counters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counters {
    counts: [i64; 3],
    /// Angle of each joint per count (rad), above zero.
    angle_per_count: [f64; 3],
    /// Arrivals of the last report and of the one before it (ns).
    arrivals: [u64; 2],
    /// The last report, if it was refused.
    refused: Option<Refused>,
}

/// The last of some refused reports.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Refused {
    raw: [i16; 3],
    /// Number of refused reports in a row, each in reach of the one before.
    alike: u8,
}

impl Counters {
    /// Counters that were set to `counts`, at the report that arrived at `now_ns` (ns). One count turns a joint by
    /// `angle_per_count` (rad, above zero). `None` if a joint is further than `most` (rad) from `counts`, so that the
    /// report does not confirm them.
    pub fn set_to(
        counts: [i64; 3],
        raw: [i16; 3],
        most: f64,
        angle_per_count: [f64; 3],
        now_ns: u64,
    ) -> Option<Self> {
        let mut counters = Self {
            counts,
            angle_per_count,
            arrivals: [now_ns; 2],
            refused: None,
        };
        let moved = counters.turns_to(raw);
        counters.is_within(moved, most).then(|| {
            counters.turn_by(moved);
            counters
        })
    }

    /// The extended counters.
    pub fn counts(&self) -> [i64; 3] {
        self.counts
    }

    /// Whether the last report was refused, so that the counters may no longer be valid.
    pub fn in_doubt(&self) -> bool {
        self.refused.is_some()
    }

    /// Takes the counters of a report that arrived at `now_ns`.
    pub fn take(&mut self, raw: [i16; 3], now_ns: u64) -> Taken {
        let [last_ns, before_ns] = self.arrivals;
        let elapsed = (now_ns.saturating_sub(before_ns) as f64 * 1e-9).min(LONGEST);
        self.arrivals = [now_ns.max(last_ns), last_ns];
        let most = FASTEST * elapsed;
        let moved = self.turns_to(raw);
        if self.is_within(moved, most) {
            self.turn_by(moved);
            self.refused = None;
            return Taken::Counted;
        }
        let alike = match self.refused {
            Some(last) if self.is_within(turns(last.raw, raw), most) => last.alike,
            _ => 0,
        };
        let alike = alike.saturating_add(1);
        self.refused = Some(Refused { raw, alike });
        if alike < RESTART {
            Taken::Jumped
        } else {
            Taken::Restarted
        }
    }

    /// The shortest turns to a report (counts).
    fn turns_to(&self, raw: [i16; 3]) -> [i16; 3] {
        turns(self.counts.map(|count| count as i16), raw)
    }

    fn turn_by(&mut self, moved: [i16; 3]) {
        self.counts = each(self.counts, moved, |count, by| {
            count.saturating_add(i64::from(by))
        });
    }

    /// Whether each joint turns by `most` (rad) at most.
    fn is_within(&self, moved: [i16; 3], most: f64) -> bool {
        let turned = each(moved, self.angle_per_count, |counts, angle| {
            f64::from(counts).abs() * angle
        });
        turned.iter().all(|angle| *angle <= most)
    }
}

/// The shortest turns from one report to another (counts).
fn turns(from: [i16; 3], to: [i16; 3]) -> [i16; 3] {
    each(from, to, |from, to| to.wrapping_sub(from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MS: u64 = 1_000_000;
    /// A hundred counts per turn of 0.01 rad each: 100 counts are 1 rad.
    const ANGLES: [f64; 3] = [0.01; 3];

    fn started(counts: [i64; 3], angles: [f64; 3]) -> Counters {
        let raw = counts.map(|count| count as i16);
        Counters::set_to(counts, raw, 0.0, angles, 0).expect("it confirms them")
    }

    fn counters(counts: [i64; 3]) -> Counters {
        started(counts, ANGLES)
    }

    #[test]
    fn a_turn_at_the_bound_is_counted_and_a_count_more_is_not() {
        // The second report arrives at 2 ms, and the one before both at 0: 0.2 rad at most, 20 counts.
        for (by, taken) in [
            (20, Taken::Counted),
            (-20, Taken::Counted),
            (21, Taken::Jumped),
            (-21, Taken::Jumped),
        ] {
            let mut counters = counters([5, 6, 7]);
            assert_eq!(counters.take([5, 6, 7], MS), Taken::Counted);
            assert_eq!(counters.take([5, 6 + by, 7], 2 * MS), taken, "{by} counts");
            assert_eq!(counters.in_doubt(), taken == Taken::Jumped);
        }
    }

    #[test]
    fn a_report_confirms_counters_that_it_is_near() {
        let set = |raw| Counters::set_to([70_000, 0, 0], raw, 0.05, ANGLES, 0);
        // 70,000 is 4464 in 16 bits.
        let counters = set([4467, -5, 0]).expect("it confirms them");
        assert_eq!(counters.counts(), [70_003, -5, 0]);
        assert_eq!(set([4470, 0, 0]), None);
    }

    #[test]
    fn a_single_wild_report_leaves_no_trace() {
        let mut counters = counters([100, 200, 300]);
        assert_eq!(counters.take([100, 200, 301], MS), Taken::Counted);
        assert_eq!(counters.take([-9999, 200, 301], 2 * MS), Taken::Jumped);
        assert_eq!(counters.counts(), [100, 200, 301]);
        assert_eq!(counters.take([101, 200, 302], 3 * MS), Taken::Counted);
        assert!(!counters.in_doubt());
        assert_eq!(counters.counts(), [101, 200, 302]);
    }

    #[test]
    fn agreeing_jumps_are_a_restart_and_others_never_are() {
        // A jump of 25 counts, less than a joint turns in the time of the eight reports.
        let mut restarted = counters([100, 100, 100]);
        restarted.take([100, 100, 100], MS);
        for k in 2..=8 {
            assert_eq!(restarted.take([75, 100, 100], k * MS), Taken::Jumped);
        }
        assert_eq!(restarted.take([75, 100, 100], 9 * MS), Taken::Restarted);
        assert_eq!(restarted.counts(), [100, 100, 100]);

        let mut wild = counters([100, 100, 100]);
        for k in 1..1000 {
            let raw = if k % 2 == 0 { 5000 } else { -5000 };
            assert_eq!(wild.take([raw, 100, 100], k * MS), Taken::Jumped);
        }
    }

    #[test]
    fn a_silence_allows_the_whole_workspace_and_no_more() {
        let mut silent = counters([0; 3]);
        let second = 1000 * MS;
        assert_eq!(silent.take([200, 0, 0], second), Taken::Counted);
        let mut silent = counters([0; 3]);
        assert_eq!(silent.take([201, 0, 0], second), Taken::Jumped);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn counters_continue_over_any_number_of_wraps(
            start in prop::array::uniform3(-1_000_000..1_000_000_i64),
            steps in prop::collection::vec(prop::array::uniform3(-10_000..=10_000_i64), 1..100),
        ) {
            // Fine counts: 10,000 of them are 0.1 rad, the most in a millisecond.
            let mut counters = started(start, [1e-5; 3]);
            let mut exact = start;
            for (k, step) in (1..).zip(steps) {
                exact = [0, 1, 2].map(|i| exact[i] + step[i]);
                let raw = exact.map(|count| count as i16);
                prop_assert_eq!(counters.take(raw, k * MS), Taken::Counted);
                prop_assert_eq!(counters.counts(), exact);
            }
        }

        #[test]
        fn any_reports_at_any_times_are_taken(
            reports in prop::collection::vec((prop::array::uniform3(any::<i16>()), any::<u64>()), 1..100),
            start in prop::array::uniform3(any::<i64>()),
        ) {
            let mut counters = counters(start);
            for (raw, at) in reports {
                let before = counters.counts();
                let taken = counters.take(raw, at);
                prop_assert_eq!(taken == Taken::Counted, !counters.in_doubt());
                if taken != Taken::Counted {
                    prop_assert_eq!(counters.counts(), before);
                }
            }
        }
    }
}
