//! The ring of local models: a model costs the handles that it has.
//!
//! A [`LocalModel`] has room for the largest number of handles. The ring passes only the parts in use. It consists of
//! three rings: one of heads, one of handles and one of blocks. The writer writes the handles and the blocks of a model
//! first, and its head last, so a reader that sees the head finds all parts. The reader frees the parts first and the
//! head last.
//!
//! The handles of a model lie one after another in memory, and so do its blocks. The writer skips the end of a ring
//! that is too short for them. A ring never contains more than one skipped end. It has room for the largest model that
//! its configuration names in every slot of the ring of heads, and for one model more in place of the skipped end. For
//! such models, the number of models alone decides whether a model finds room. A larger model finds room or is refused.
//!
//! A head states where its parts end. The reader thus finds the newest model in constant time, and reads it in place.

use crate::memory::MemoryRange;
use crate::ring::prefaulted;
use rt_core::local_model::{ModelHead, PackedModel, PublishedModel};
use rt_core::{HandleReference, LocalModel, Mat6};
use rtrb::{Consumer, Producer, RingBuffer};

/// Number of blocks of a model of `handles` handles.
fn blocks_of(handles: usize) -> usize {
    2 * handles * handles
}

/// Numbers of handles and of blocks, with the skipped ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Parts {
    handles: usize,
    blocks: usize,
}

/// A slot of the ring of heads.
#[derive(Clone, Copy, Debug)]
struct Entry {
    body: u8,
    head: ModelHead,
    /// The parts up to the last one of this model, counted from the first model on.
    end: Parts,
}

/// The writer's end.
#[derive(Debug)]
pub(crate) struct ModelWriter {
    heads: Producer<Entry>,
    handles: PartWriter<HandleReference>,
    blocks: PartWriter<Mat6>,
}

/// The reader's end.
#[derive(Debug)]
pub(crate) struct ModelReader {
    heads: Consumer<Entry>,
    handles: Consumer<HandleReference>,
    blocks: Consumer<Mat6>,
    /// The parts read or skipped so far.
    read: Parts,
}

/// A ring for `slots` models of up to `handles` handles. Its memory is mapped when it is first used.
pub(crate) fn model_ring(slots: usize, handles: usize) -> (ModelWriter, ModelReader) {
    join(
        RingBuffer::new(slots),
        RingBuffer::new((slots + 1) * handles),
        RingBuffer::new((slots + 1) * blocks_of(handles)),
    )
}

/// A ring for `slots` models of up to `most_handles` handles, in which every slot was written once, and the memory that
/// the ring occupies.
pub(crate) fn prefaulted_model_ring(
    slots: usize,
    most_handles: usize,
) -> (ModelWriter, ModelReader, impl Iterator<Item = MemoryRange>) {
    let filler = Entry {
        body: 0,
        head: LocalModel::empty().head(),
        end: Parts::default(),
    };
    let (to_heads, heads, a) = prefaulted(slots, filler);
    let (to_handles, handles, b) = prefaulted((slots + 1) * most_handles, HandleReference::zero());
    let (to_blocks, blocks, c) = prefaulted((slots + 1) * blocks_of(most_handles), Mat6::zeros());
    let (writer, reader) = join(
        (to_heads, heads),
        (to_handles, handles),
        (to_blocks, blocks),
    );
    (writer, reader, a.into_iter().chain(b).chain(c))
}

fn join(
    heads: (Producer<Entry>, Consumer<Entry>),
    handles: (Producer<HandleReference>, Consumer<HandleReference>),
    blocks: (Producer<Mat6>, Consumer<Mat6>),
) -> (ModelWriter, ModelReader) {
    let writer = ModelWriter {
        heads: heads.0,
        handles: PartWriter::new(handles.0),
        blocks: PartWriter::new(blocks.0),
    };
    let reader = ModelReader {
        heads: heads.1,
        handles: handles.1,
        blocks: blocks.1,
        read: Parts::default(),
    };
    (writer, reader)
}

impl ModelWriter {
    /// Writes the used part of a model. Returns whether the ring had room for it.
    pub(crate) fn push(&mut self, body: u8, model: &LocalModel) -> bool {
        if self.heads.is_full() {
            return false;
        }
        let head = model.head();
        let handles = model.handles.get(..head.handles()).unwrap_or_default();
        if !self.handles.begin(head.handles(), HandleReference::zero())
            || !self.blocks.begin(head.blocks(), Mat6::zeros())
        {
            return false;
        }
        self.handles.push(handles);
        model.rows().for_each(|row| self.blocks.push(row));
        let end = Parts {
            handles: self.handles.written,
            blocks: self.blocks.written,
        };
        self.heads.push(Entry { body, head, end }).is_ok()
    }

    /// Number of models that the ring can hold.
    pub(crate) fn capacity(&self) -> usize {
        self.heads.buffer().capacity()
    }

    /// Whether the reader is gone.
    pub(crate) fn is_abandoned(&self) -> bool {
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
    fn begin(&mut self, count: usize, filler: T) -> bool {
        let capacity = self.ring.buffer().capacity();
        let left = capacity - self.written % capacity;
        let skipped = if count > left { left } else { 0 };
        if self.ring.slots() < skipped + count {
            return false;
        }
        if let Ok(end) = self.ring.write_chunk_uninit(skipped) {
            self.written += end.fill_from_iter(std::iter::repeat_n(filler, skipped));
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

impl ModelReader {
    /// Calls `see` with the newest model and the number of models that waited, then frees all of them. Does nothing
    /// where none waits. The time does not depend on the number of models.
    pub(crate) fn take_newest(&mut self, see: impl FnOnce(&PackedModel<'_>, u64)) {
        self.take(self.heads.slots(), |_, model, waiting| see(model, waiting));
    }

    /// Calls `see` with every model that waits now, oldest first, and the index of its body.
    pub(crate) fn drain(&mut self, mut see: impl FnMut(u8, &PackedModel<'_>)) {
        for _ in 0..self.heads.slots() {
            self.take(1, |body, model, _| see(body, model));
        }
    }

    /// Frees the oldest `count` models, and calls `see` with the last of them.
    fn take(&mut self, count: usize, see: impl FnOnce(u8, &PackedModel<'_>, u64)) -> Option<()> {
        let heads = self.heads.read_chunk(count).ok()?;
        let (first, second) = heads.as_slices();
        let newest = second.last().or(first.last())?;
        let handles = newest.end.handles.wrapping_sub(self.read.handles);
        let handles = self.handles.read_chunk(handles).ok()?;
        let blocks = newest.end.blocks.wrapping_sub(self.read.blocks);
        let blocks = self.blocks.read_chunk(blocks).ok()?;
        let model = PackedModel::new(
            newest.head,
            last(handles.as_slices(), newest.head.handles()),
            last(blocks.as_slices(), newest.head.blocks()),
        );
        if let Some(model) = model {
            see(newest.body, &model, count as u64);
        }
        self.read = newest.end;
        blocks.commit_all();
        handles.commit_all();
        heads.commit_all();
        Some(())
    }
}

/// The last `count` parts of a ring, which lie one after another; fewer where there are not as many.
fn last<'a, T>((first, second): (&'a [T], &'a [T]), count: usize) -> &'a [T] {
    let piece = if second.is_empty() { first } else { second };
    let before = piece.len().saturating_sub(count);
    piece.get(before..).unwrap_or_default()
}
