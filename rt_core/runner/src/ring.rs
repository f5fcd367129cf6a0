//! One ring: a fixed number of slots between one writer and one reader, mapped before use.
//!
//! The ring is wait-free in both directions (`rtrb`). The system only reserves the memory of a new ring. Every slot is
//! therefore written once when the ring is made, so no push ever waits for a page.

use crate::memory::MemoryRange;
use rtrb::{Consumer, Producer, RingBuffer};

/// Largest number of slots of a ring: five seconds at 12 kHz.
pub const MOST_SLOTS: usize = 1 << 16;

/// The number of slots that cover `stall` seconds at `rate` (Hz), plus one slot for the record that is being read. The
/// number is at least two and at most [`MOST_SLOTS`].
///
/// ```
/// assert_eq!(runner::ring::slots_for(1000.0, 5.0), 5001);
/// assert_eq!(runner::ring::slots_for(f64::NAN, 5.0), 2);
/// ```
pub fn slots_for(rate: f64, stall: f64) -> usize {
    // The conversion maps NaN and negative numbers to zero, and infinity to the largest integer.
    ((rate * stall).ceil() as usize)
        .saturating_add(1)
        .clamp(2, MOST_SLOTS)
}

/// A ring of `slots` records, in which every slot was written once with `filler`, and the memory that the ring
/// occupies.
pub fn prefaulted<T: Copy>(
    slots: usize,
    filler: T,
) -> (Producer<T>, Consumer<T>, [MemoryRange; 2]) {
    let (mut producer, mut consumer) = RingBuffer::new(slots);
    let mut memory = [
        MemoryRange::of(producer.buffer()),
        MemoryRange::of::<[T]>(&[]),
    ];
    if let Ok(chunk) = producer.write_chunk_uninit(slots) {
        chunk.fill_from_iter(std::iter::repeat_n(filler, slots));
    }
    if let Ok(chunk) = consumer.read_chunk(slots) {
        // A ring that was never used is filled from its first slot, so one slice holds all records.
        memory[1] = MemoryRange::of(chunk.as_slices().0);
        chunk.commit_all();
    }
    (producer, consumer, memory)
}

/// Calls `see` with every record that waits now, oldest first; returns their number. Slots are freed in batches, so the
/// writer finds free slots while a slow reader works through a long backlog.
pub(crate) fn drain<T>(ring: &mut Consumer<T>, see: impl FnMut(&T)) -> usize {
    drain_up_to(ring.slots(), ring, see)
}

/// Does what `drain` does, for the oldest `waiting` records only.
pub(crate) fn drain_up_to<T>(
    waiting: usize,
    ring: &mut Consumer<T>,
    mut see: impl FnMut(&T),
) -> usize {
    const BATCH: usize = 64;
    let mut left = waiting;
    while left > 0 {
        let Ok(chunk) = ring.read_chunk(left.min(BATCH)) else {
            break;
        };
        let (first, second) = chunk.as_slices();
        for record in first.iter().chain(second) {
            see(record);
        }
        left -= chunk.len();
        chunk.commit_all();
    }
    waiting - left
}

/// Calls `see` with the newest record of a ring and the number of records that waited, then frees all of them; `None`
/// if none waits. The time does not depend on the number of records.
pub fn take_newest<T: Copy, R>(
    ring: &mut Consumer<T>,
    see: impl FnOnce(&T, u64) -> R,
) -> Option<R> {
    let waiting = ring.slots();
    let chunk = ring.read_chunk(waiting).ok()?;
    let (first, second) = chunk.as_slices();
    let result = see(second.last().or(first.last())?, waiting as u64);
    chunk.commit_all();
    Some(result)
}

/// Counts the numbers that are missing from a sequence, which should increase by one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sequence {
    /// The number expected next.
    next: u64,
    lost: u64,
}

impl Sequence {
    /// A sequence whose first number should be `first`.
    pub(crate) fn from(first: u64) -> Self {
        Self {
            next: first,
            lost: 0,
        }
    }

    /// Records the last of `count` numbers that arrived together. The numbers missing before them are counted as lost.
    pub(crate) fn see(&mut self, number: u64, count: u64) {
        let passed = number.wrapping_add(1).saturating_sub(self.next);
        self.lost += passed.saturating_sub(count);
        self.next = number.wrapping_add(1);
    }

    pub(crate) fn lost(&self) -> u64 {
        self.lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prefaulted_ring_is_empty_and_takes_exactly_its_slots() {
        let (mut producer, mut consumer, memory) = prefaulted(5, 0_u64);
        assert!(consumer.is_empty());
        assert_eq!(memory[1].bytes(), 5 * 8);
        for k in 0..5 {
            assert!(producer.push(k).is_ok());
        }
        assert!(producer.push(5).is_err());
        assert_eq!(consumer.pop(), Ok(0));
    }

    #[test]
    fn a_gap_is_counted_once() {
        let mut sequence = Sequence::from(0);
        for number in [0, 1, 4, 5] {
            sequence.see(number, 1);
        }
        assert_eq!(sequence.lost(), 2);
        // Of the numbers 6 to 9, three arrived.
        sequence.see(9, 3);
        assert_eq!(sequence.lost(), 3);
        // A writer that starts again from zero causes no loss.
        sequence.see(0, 1);
        sequence.see(1, 1);
        assert_eq!(sequence.lost(), 3);
    }
}
