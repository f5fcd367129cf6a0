//! The ring of publications of one kind. The cost of a publication depends on its size.
//!
//! The ring passes only the parts in use ([`rt_core::publication`]). It consists of three rings: one of heads, one of
//! rows and one of blocks. The writer writes the rows and the blocks of a publication first, and its head last, so a
//! reader that sees the head finds all parts. The reader frees the parts first and the head last.
//!
//! The rows of a publication lie one after another in memory, and so do its blocks. The writer skips the end of a ring
//! that is too short for them. A ring never contains more than one skipped end. The rings of rows and blocks have room
//! for one publication of the largest configured size for every slot of the ring of heads, and for one more in place of
//! the skipped end. For publications up to this size, the number of waiting publications alone decides whether a
//! publication finds room. A larger publication finds room or is refused.
//!
//! A head states the end of its parts. The reader thus finds the newest publication in constant time, and reads it in
//! place.

use crate::memory::MemoryRange;
use crate::ring::{Sequence, prefaulted};
use rt_core::publication::{Extent, Head, Packed, Publication};
use rtrb::{Consumer, Producer, RingBuffer};

/// A slot of the ring of heads.
#[derive(Clone, Copy, Debug)]
struct Entry<H> {
    body: u8,
    head: H,
    /// The parts up to the last one of this publication, counted from the first one on, with the skipped ones.
    end: Extent,
}

/// The writer's end.
#[derive(Debug)]
pub struct PackedWriter<H: Head> {
    heads: Producer<Entry<H>>,
    rows: PartWriter<H::Row>,
    blocks: PartWriter<H::Block>,
}

/// The reader's end.
#[derive(Debug)]
pub struct PackedReader<H: Head> {
    heads: Consumer<Entry<H>>,
    rows: Consumer<H::Row>,
    blocks: Consumer<H::Block>,
    /// The parts read or skipped so far.
    read: Extent,
    sequence: Sequence,
    superseded: u64,
}

/// Both ends of a ring.
pub type PackedRing<H> = (PackedWriter<H>, PackedReader<H>);

/// A ring for `slots` publications of up to `most` parts. Its memory is mapped when it is first used.
pub fn packed_ring<H: Head>(slots: usize, most: Extent) -> PackedRing<H> {
    join(
        RingBuffer::new(slots),
        RingBuffer::new((slots + 1) * most.rows),
        RingBuffer::new((slots + 1) * most.blocks),
    )
}

/// A ring for `slots` publications of up to `most` parts, in which every slot was written once, and the memory that the
/// ring occupies.
pub fn prefaulted_packed_ring<H: Head>(
    slots: usize,
    most: Extent,
) -> (PackedRing<H>, impl Iterator<Item = MemoryRange>) {
    let (head, row, block) = H::filler();
    let filler = Entry {
        body: 0,
        head,
        end: Extent::default(),
    };
    let (to_heads, heads, a) = prefaulted(slots, filler);
    let (to_rows, rows, b) = prefaulted((slots + 1) * most.rows, row);
    let (to_blocks, blocks, c) = prefaulted((slots + 1) * most.blocks, block);
    let ring = join((to_heads, heads), (to_rows, rows), (to_blocks, blocks));
    (ring, a.into_iter().chain(b).chain(c))
}

fn join<H: Head>(
    heads: (Producer<Entry<H>>, Consumer<Entry<H>>),
    rows: (Producer<H::Row>, Consumer<H::Row>),
    blocks: (Producer<H::Block>, Consumer<H::Block>),
) -> PackedRing<H> {
    let writer = PackedWriter {
        heads: heads.0,
        rows: PartWriter::new(rows.0),
        blocks: PartWriter::new(blocks.0),
    };
    let reader = PackedReader {
        heads: heads.1,
        rows: rows.1,
        blocks: blocks.1,
        read: Extent::default(),
        sequence: Sequence::from(1),
        superseded: 0,
    };
    (writer, reader)
}

impl<H: Head> PackedWriter<H> {
    /// Writes the used part of a publication, with the index of the body to which it belongs. Returns whether the ring
    /// had room for it.
    pub fn push(&mut self, body: u8, publication: &impl Publication<Head = H>) -> bool {
        if self.heads.is_full() {
            return false;
        }
        let head = *publication.head();
        let extent = head.extent();
        if !self.rows.begin(extent.rows, || H::filler().1)
            || !self.blocks.begin(extent.blocks, || H::filler().2)
        {
            return false;
        }
        self.rows.push(publication.rows());
        publication
            .blocks()
            .for_each(|blocks| self.blocks.push(blocks));
        let end = Extent {
            rows: self.rows.written,
            blocks: self.blocks.written,
        };
        self.heads.push(Entry { body, head, end }).is_ok()
    }

    /// Number of publications that the ring can hold.
    pub fn capacity(&self) -> usize {
        self.heads.buffer().capacity()
    }

    /// Whether the reader is gone.
    pub fn is_abandoned(&self) -> bool {
        self.heads.is_abandoned()
    }
}

/// The writer's end of a ring of parts.
#[derive(Debug)]
struct PartWriter<T> {
    ring: Producer<T>,
    /// Number of parts written or skipped so far.
    written: usize,
}

impl<T: Copy> PartWriter<T> {
    fn new(ring: Producer<T>) -> Self {
        Self { ring, written: 0 }
    }

    /// Skips the end of the ring if it is too short for `count` parts. Returns whether there is room for them.
    fn begin(&mut self, count: usize, filler: impl FnMut() -> T) -> bool {
        let capacity = self.ring.buffer().capacity();
        // A kind without blocks has a ring without slots.
        let left = capacity - self.written.checked_rem(capacity).unwrap_or(0);
        let skipped = if count > left { left } else { 0 };
        if self.ring.slots() < skipped + count {
            return false;
        }
        if let Ok(end) = self.ring.write_chunk_uninit(skipped) {
            self.written += end.fill_from_iter(std::iter::repeat_with(filler).take(skipped));
        }
        true
    }

    /// Writes parts for which there is room.
    fn push(&mut self, parts: &[T]) {
        if self.ring.push_entire_slice(parts).is_ok() {
            self.written += parts.len();
        }
    }
}

impl<H: Head> PackedReader<H> {
    /// Calls `see` with the newest publication, then frees all that wait. Does nothing if none waits. The time does not
    /// depend on their number. Publications that never arrived, and those before the newest, are counted.
    pub fn take_newest(&mut self, see: impl FnOnce(&Packed<'_, H>)) {
        let waiting = self.heads.slots();
        let mut number = 0;
        let taken = self.take(waiting, |_, newest| {
            number = newest.head.sequence();
            see(newest);
        });
        if taken.is_some() {
            self.sequence.see(number, waiting as u64);
            self.superseded += waiting as u64 - 1;
        }
    }

    /// Number of publications that never arrived, by the gaps in the numbers of those that were taken.
    pub fn lost(&self) -> u64 {
        self.sequence.lost()
    }

    /// Number of publications that arrived together with a newer one, and were skipped.
    pub fn superseded(&self) -> u64 {
        self.superseded
    }

    /// Calls `see` with every publication that waits now, oldest first, and the index of its body.
    pub fn drain(&mut self, mut see: impl FnMut(u8, &Packed<'_, H>)) {
        for _ in 0..self.heads.slots() {
            self.take(1, &mut see);
        }
    }

    /// Frees the oldest `count` publications, and calls `see` with the last of them.
    fn take(&mut self, count: usize, see: impl FnOnce(u8, &Packed<'_, H>)) -> Option<()> {
        let heads = self.heads.read_chunk(count).ok()?;
        let (first, second) = heads.as_slices();
        let newest = second.last().or(first.last())?;
        let extent = newest.head.extent();
        let rows = newest.end.rows.wrapping_sub(self.read.rows);
        let rows = self.rows.read_chunk(rows).ok()?;
        let blocks = newest.end.blocks.wrapping_sub(self.read.blocks);
        let blocks = self.blocks.read_chunk(blocks).ok()?;
        let packed = Packed::new(
            newest.head,
            last(rows.as_slices(), extent.rows),
            last(blocks.as_slices(), extent.blocks),
        );
        if let Some(packed) = packed {
            see(newest.body, &packed);
        }
        self.read = newest.end;
        blocks.commit_all();
        rows.commit_all();
        heads.commit_all();
        Some(())
    }
}

/// The last `count` parts of a ring, which lie one after another; fewer if the ring contains fewer.
fn last<'a, T>((first, second): (&'a [T], &'a [T]), count: usize) -> &'a [T] {
    let piece = if second.is_empty() { first } else { second };
    let before = piece.len().saturating_sub(count);
    piece.get(before..).unwrap_or_default()
}
