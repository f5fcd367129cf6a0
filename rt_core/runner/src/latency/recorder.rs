//! A histogram that one thread writes while other threads read it.
//!
//! The intervals are those of [`LatencyHistogram`], which are those of `hdrhistogram` with three digits. Every interval
//! has an atomic count. There is only one writer, so a relaxed load and a store change a count, without a locked
//! instruction. A reader copies the counts at any time, and disturbs only the cache.
//!
//! The writer stores the least and the greatest value and the sum before the count, and the store of the count releases
//! them. A copy that has a count therefore has a least and a greatest value that enclose the value. A copy made while a
//! value is recorded may lack this value.

use super::LatencyHistogram;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Values below this one have intervals of 1 ns; from there on, each octave has half as many intervals. Three digits need
/// 2000, and `hdrhistogram` takes the next power of two.
const FINE: u64 = 2048;
const HALF_BITS: u32 = FINE.trailing_zeros() - 1;

/// The memory that writer and readers have in common.
#[derive(Debug)]
struct Shared {
    bound: u64,
    counts: Box<[AtomicU64]>,
    overflow: AtomicU64,
    min: AtomicU64,
    max: AtomicU64,
    sum: AtomicU64,
}

/// The writer of a histogram. There is one, so it cannot be cloned.
///
/// ```
/// let (mut recorder, reader) = runner::latency::recorder(1_000_000);
/// recorder.record(700);
/// assert_eq!(reader.read().summary().max, 700);
/// ```
#[derive(Debug)]
pub struct LatencyRecorder(Arc<Shared>);

/// A reader of the histogram of a [`LatencyRecorder`], for any thread.
#[derive(Clone, Debug)]
pub struct LatencyReader(Arc<Shared>);

/// A histogram for values up to `bound_ns`, ten at least, as a writer and a reader. This allocates as much as a
/// [`LatencyHistogram`] of this bound, and writes all memory once.
pub fn recorder(bound_ns: u64) -> (LatencyRecorder, LatencyReader) {
    let bound = bound_ns.max(10);
    let counts: Box<[AtomicU64]> = (0..=index(bound)).map(|_| AtomicU64::new(0)).collect();
    // Fresh memory is mapped on first use. These stores keep the mapping out of the tick.
    counts
        .iter()
        .for_each(|count| count.store(0, Ordering::Relaxed));
    let shared = Arc::new(Shared {
        bound,
        counts,
        overflow: AtomicU64::new(0),
        min: AtomicU64::new(u64::MAX),
        max: AtomicU64::new(0),
        sum: AtomicU64::new(0),
    });
    (LatencyRecorder(Arc::clone(&shared)), LatencyReader(shared))
}

impl LatencyRecorder {
    /// Counts one value (ns). Never allocates, locks or fails.
    pub fn record(&mut self, ns: u64) {
        let shared = &*self.0;
        let get = |cell: &AtomicU64| cell.load(Ordering::Relaxed);
        if ns < get(&shared.min) {
            shared.min.store(ns, Ordering::Relaxed);
        }
        if ns > get(&shared.max) {
            shared.max.store(ns, Ordering::Relaxed);
        }
        let sum = get(&shared.sum).saturating_add(ns);
        shared.sum.store(sum, Ordering::Relaxed);
        let count = match shared.counts.get(index(ns)) {
            Some(count) if ns <= shared.bound => count,
            _ => &shared.overflow,
        };
        count.store(get(count).wrapping_add(1), Ordering::Release);
    }
}

impl LatencyReader {
    /// A copy of the histogram. This allocates.
    pub fn read(&self) -> LatencyHistogram {
        let shared = &*self.0;
        let mut copy = LatencyHistogram::new(shared.bound);
        for (index, count) in shared.counts.iter().enumerate() {
            let count = count.load(Ordering::Acquire);
            if count > 0 {
                // A value within the bound has an interval.
                let _ = copy.counts.record_n(least(index), count);
            }
        }
        copy.overflow = shared.overflow.load(Ordering::Acquire);
        copy.min = shared.min.load(Ordering::Relaxed);
        copy.max = shared.max.load(Ordering::Relaxed);
        copy.sum = shared.sum.load(Ordering::Relaxed);
        copy
    }
}

/// The number of the interval of a value.
fn index(ns: u64) -> usize {
    let octave = (FINE - 1).leading_zeros() - (ns | (FINE - 1)).leading_zeros();
    ((u64::from(octave) << HALF_BITS) + (ns >> octave)) as usize
}

/// The least value of an interval.
fn least(index: usize) -> u64 {
    let index = index as u64;
    if index < FINE {
        return index;
    }
    let octave = (index >> HALF_BITS) - 1;
    (index - (octave << HALF_BITS)) << octave
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::sync::atomic::AtomicBool;

    #[test]
    fn intervals_follow_each_other() {
        let mut expected = 0;
        for value in (0..5_000).chain((13..40).map(|bit| (1 << bit) - 1)) {
            expected = expected.max(index(value));
            assert_eq!(index(value), expected, "{value}");
            assert!(least(expected) <= value && value < least(expected + 1));
        }
        assert!(index(u64::MAX) < usize::MAX && least(index(u64::MAX)) > u64::MAX / 2);
    }

    proptest! {
        /// For any values in any order, the copy equals a `LatencyHistogram`.
        #[test]
        fn the_copy_is_a_latency_histogram(
            bound in 0_u64..2_000_000_000,
            values in prop::collection::vec(
                prop_oneof![0_u64..5_000, 0_u64..3_000_000_000, any::<u64>(), (0_u32..64).prop_map(|b| 1 << b)],
                0..200,
            ),
        ) {
            let mut plain = LatencyHistogram::new(bound);
            let (mut recorder, reader) = recorder(bound);
            for value in values.into_iter().chain([bound, bound + 1]) {
                plain.record(value);
                recorder.record(value);
                let copy = reader.read();
                prop_assert_eq!(copy.summary(), plain.summary());
                prop_assert_eq!(copy.overflow(), plain.overflow());
            }
            let copy = reader.read();
            prop_assert!(copy.intervals().eq(plain.intervals()));
            prop_assert_eq!(copy.bound_ns(), plain.bound_ns());
        }
    }

    /// Copies that are made while a thread records never contradict themselves, and lose nothing at the end.
    #[test]
    fn a_copy_during_the_run_is_sound() {
        let (mut recorder, reader) = recorder(100_000);
        let begun = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let writer = scope.spawn(|| {
                for value in 0..200_000_u64 {
                    recorder.record(150_000 - value % 150_000);
                    begun.store(true, Ordering::Relaxed);
                }
            });
            let mut before = 0;
            while !writer.is_finished() {
                let summary = reader.read().summary();
                assert!(summary.count >= before && summary.min <= summary.max);
                assert!(summary.count == 0 || (summary.min..=summary.max).contains(&summary.p50));
                before = summary.count;
            }
        });
        let last = reader.read();
        assert_eq!((last.count(), last.summary().min), (200_000, 1));
    }
}
