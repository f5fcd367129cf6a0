//! Publications: messages from the host to the tick whose size varies.
//!
//! A publication has a **head** of fixed size, **rows** (such as the handles of a local model) and **blocks** (such as the
//! stiffness between two handles). Its type in memory may have room for the largest number of rows and blocks. A ring
//! stores the parts in use one after another, so a writer and a reader touch only the parts in use. [`Packed`] refers
//! to these parts, so the tick reads a publication from its ring without a copy.
//!
//! The head names the kind: a new kind of publication is a type that implements [`Head`], and one that implements
//! [`Publication`]. The ring of any kind is `runner::packed_ring`.

use core::fmt::Debug;

/// Numbers of rows and of blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extent {
    /// Number of rows.
    pub rows: usize,
    /// Number of blocks.
    pub blocks: usize,
}

/// The numbers of a publication that belong to no row and to no block.
pub trait Head: Copy + Debug {
    /// The name of the kind, for people: with what its number in a list is a number of.
    const NAME: &'static str;
    /// A row.
    type Row: Copy + Debug;
    /// A block.
    type Block: Copy + Debug;

    /// The content of the slots of a ring before their first use.
    fn filler() -> (Self, Self::Row, Self::Block);

    /// Number of the publication among those of its ring, from one. A gap tells the reader that publications were lost.
    fn sequence(&self) -> u64;

    /// The rows and the blocks that this head has.
    fn extent(&self) -> Extent;
}

/// A publication, wherever its parts are stored.
pub trait Publication {
    /// Its head.
    type Head: Head;

    /// The head.
    fn head(&self) -> &Self::Head;

    /// The rows in use.
    fn rows(&self) -> &[<Self::Head as Head>::Row];

    /// The blocks in use, in pieces that lie one after another.
    fn blocks(&self) -> impl Iterator<Item = &[<Self::Head as Head>::Block]>;
}

/// A publication as it lies in a ring.
///
/// ```
/// use rt_core::LocalModel;
/// use rt_core::local_model::PackedModel;
/// use rt_core::publication::Publication;
///
/// let mut model = LocalModel::empty();
/// model.head.handle_count = 1;
/// model.stiffness[0][0][(0, 0)] = 100.0;
///
/// // The parts in use, as they follow one another in a ring.
/// let blocks = model.blocks().collect::<Vec<_>>().concat();
/// assert_eq!((model.rows().len(), blocks.len()), (1, 2));
/// let packed = PackedModel::new(model.head, model.rows(), &blocks).unwrap();
///
/// let mut copy = LocalModel::empty();
/// copy.copy_used_from(&packed);
/// assert_eq!(copy, model);
///
/// // If the number of parts differs from that in the head, there is no publication.
/// assert!(PackedModel::new(model.head, &[], &blocks).is_none());
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Packed<'a, H: Head> {
    /// The head.
    pub head: H,
    rows: &'a [H::Row],
    pub(crate) blocks: &'a [H::Block],
}

impl<'a, H: Head> Packed<'a, H> {
    /// The publication of these parts. `None` if their numbers differ from those in the head.
    pub fn new(head: H, rows: &'a [H::Row], blocks: &'a [H::Block]) -> Option<Self> {
        let found = Extent {
            rows: rows.len(),
            blocks: blocks.len(),
        };
        (found == head.extent()).then_some(Self { head, rows, blocks })
    }
}

impl<H: Head> Publication for Packed<'_, H> {
    type Head = H;

    fn head(&self) -> &H {
        &self.head
    }

    fn rows(&self) -> &[H::Row] {
        self.rows
    }

    fn blocks(&self) -> impl Iterator<Item = &[H::Block]> {
        core::iter::once(self.blocks)
    }
}

/// Copies rows of blocks to the beginnings of rows that have room for more.
pub(crate) fn copy_rows<'a, T: Copy + 'a, const N: usize>(
    mine: &mut [[T; N]],
    theirs: impl Iterator<Item = &'a [T]>,
) {
    // Not `zip`, which divides by the length of a chunk and would panic for zero.
    let mut mine = mine.iter_mut();
    for theirs in theirs {
        if let Some(mine) = mine.next() {
            copy_row(mine, theirs);
        }
    }
}

/// Copies the first blocks of a row, all in one copy of memory.
#[allow(clippy::disallowed_methods)]
fn copy_row<T: Copy>(mine: &mut [T], theirs: &[T]) {
    if let Some(mine) = mine.get_mut(..theirs.len()) {
        // The copy panics only for slices of different lengths. These slices have the same length by construction, so
        // the compiler removes the panic; `tests/tests/no_panic.rs` proves that.
        mine.copy_from_slice(theirs);
    }
}
