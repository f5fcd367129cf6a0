//! The tick records that the host has received, and which of them a step sees.
//!
//! A publication keeps the host busy. The steps that become due meanwhile are taken late, one right after the other. If
//! each of them saw the newest record, the handles would make the whole motion in the first step and stand still in the
//! others, and the body would answer jolts that no hand made. So a late step sees the records up to its lateness, in whole
//! ticks, before the newest record: those that it would have seen on time. The others wait for the next steps. A step that is
//! late by less than a tick sees the newest record, which is the one that it would have waited for.

use rt_core::TickRecord;
use std::collections::VecDeque;

/// Room for the records of a tenth of a second at 4 kHz, the longest time that a step makes up for.
const ROOM: usize = 400;

/// The records that wait for a step.
pub(crate) struct Records {
    waiting: VecDeque<TickRecord>,
    newest_ns: u64,
    /// The tick's period (ns).
    period_ns: u64,
}

impl Records {
    /// Without records, for ticks of `period_ns` (ns), above zero.
    pub(crate) fn new(period_ns: u64) -> Self {
        Self {
            waiting: VecDeque::with_capacity(ROOM),
            newest_ns: 0,
            period_ns,
        }
    }

    /// Takes a record. Records come in order.
    pub(crate) fn take(&mut self, record: &TickRecord) {
        self.newest_ns = record.time_ns;
        self.waiting.push_back(*record);
    }

    /// Gives `see` the records for a step that is `late_ns` late, oldest first.
    pub(crate) fn see(&mut self, late_ns: u64, mut see: impl FnMut(&TickRecord)) {
        let seen_ns = self
            .newest_ns
            .saturating_sub(late_ns - late_ns % self.period_ns);
        let is_seen = |record: &&TickRecord| record.time_ns <= seen_ns;
        while let Some(record) = self.waiting.front().filter(is_seen) {
            see(record);
            self.waiting.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn seen(records: &mut Records, late_ns: u64) -> Vec<u64> {
        let mut seen = Vec::new();
        records.see(late_ns, |record| seen.push(record.time_ns / MS));
        seen
    }

    #[test]
    fn late_steps_see_the_records_that_they_would_have_seen_on_time() {
        let mut records = Records::new(MS);
        let take = |records: &mut Records, ticks: core::ops::Range<u64>| {
            for tick in ticks {
                let mut record = TickRecord::empty();
                record.time_ns = tick * MS;
                records.take(&record);
            }
        };
        take(&mut records, 0..4);
        assert_eq!(seen(&mut records, 0), [0, 1, 2, 3]);
        assert!(seen(&mut records, 0).is_empty());
        // A publication of four ticks.
        take(&mut records, 4..8);
        assert_eq!(seen(&mut records, 3 * MS), [4]);
        // Late by a part of a tick more.
        assert_eq!(seen(&mut records, 2 * MS + 999_999), [5]);
        // A lost step.
        assert_eq!(seen(&mut records, 0), [6, 7]);
        // A step that is later than the records.
        take(&mut records, 8..9);
        assert!(seen(&mut records, 20 * MS).is_empty());
        assert_eq!(seen(&mut records, 0), [8]);
    }
}
