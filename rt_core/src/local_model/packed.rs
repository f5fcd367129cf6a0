//! A local model as it lies in a ring: only the parts in use.
//!
//! A [`LocalModel`] has room for [`MAX_HANDLES`] handles, 39 kB. With one handle, a fiftieth of the room is in use. A
//! ring stores the parts in use one after another, so a writer and a reader touch only these. [`PackedModel`] refers to
//! them, and [`Controller::accept`](crate::Controller::accept) takes the model from the ring without a copy in between.

use super::{
    HandleReference, LocalModel, ModelFault, PairBlocks, PieceEnergy, TearLimit, are_finite, pieces,
};
use crate::geometry::Mat6;
use crate::{MAX_DEVICES, MAX_HANDLES};

/// The numbers of a model that do not belong to a handle; each is documented at [`LocalModel`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelHead {
    /// Number of the model among the models of this body, from one.
    pub sequence: u64,
    /// Number of changes of the topology up to this model.
    pub epoch: u32,
    /// Time of the linearized state (ns, the tick's clock).
    pub time_ns: u64,
    /// The publication period (s).
    pub period: f64,
    /// The age at which the next model is due (s).
    pub horizon: f64,
    /// Energy that hands at rest could get back (J).
    pub energy: f64,
    /// Energy that the body has released of its own (J).
    pub released: f64,
    /// Energies of the pieces; unused in a whole body.
    pub pieces: [PieceEnergy; MAX_HANDLES],
    /// How far the model may be extrapolated.
    pub tear_limit: TearLimit,
    /// Number of handles, as the model claims. It may exceed [`MAX_HANDLES`]; such a model is refused.
    pub handle_count: u8,
}

impl ModelHead {
    /// Number of handles that the model can contain.
    pub fn handles(&self) -> usize {
        usize::from(self.handle_count).min(MAX_HANDLES)
    }

    /// Number of blocks between these handles: those of the stiffness and those of the damping.
    pub fn blocks(&self) -> usize {
        let pairs = self.handles().saturating_mul(self.handles());
        pairs.saturating_mul(2)
    }
}

/// A model that was published, wherever its numbers lie.
pub trait PublishedModel {
    /// The numbers that do not belong to a handle.
    fn head(&self) -> ModelHead;

    /// The handles in use.
    fn handles(&self) -> impl Iterator<Item = &HandleReference>;

    /// Whether all numbers of the blocks in use are finite.
    fn has_finite_blocks(&self) -> bool;

    /// Copies the blocks in use.
    fn copy_blocks(&self, stiffness: &mut PairBlocks, damping: &mut PairBlocks);

    /// Checks that every number in use is finite and that every device index exists.
    ///
    /// # Errors
    /// The first [`ModelFault`] found.
    fn check(&self) -> Result<(), ModelFault> {
        let head = self.head();
        let n = usize::from(head.handle_count);
        if n == 0 || n > MAX_HANDLES {
            return Err(ModelFault::Handles);
        }
        if self.handles().any(|h| usize::from(h.device) >= MAX_DEVICES) {
            return Err(ModelFault::Handles);
        }
        let count = pieces::count(self.handles());
        if count > head.handle_count {
            return Err(ModelFault::Handles);
        }
        let finite = head.period.is_finite()
            && head.period > 0.0
            && head.horizon.is_finite()
            && head.horizon > 0.0
            && head.energy.is_finite()
            && head.released.is_finite()
            && self.handles().all(HandleReference::is_finite)
            && self.has_finite_blocks()
            && head.tear_limit.is_sound()
            && (!head.tear_limit.is_some()
                || self.handles().all(HandleReference::has_finite_slope));
        if finite && count > 1 {
            let mut energies = head.pieces.iter().take(usize::from(count));
            if energies.any(|piece| !piece.is_finite()) {
                return Err(ModelFault::NotFinite);
            }
        }
        if finite {
            Ok(())
        } else {
            Err(ModelFault::NotFinite)
        }
    }
}

impl PublishedModel for LocalModel {
    fn head(&self) -> ModelHead {
        ModelHead {
            sequence: self.sequence,
            epoch: self.epoch,
            time_ns: self.time_ns,
            period: self.period,
            horizon: self.horizon,
            energy: self.energy,
            released: self.released,
            pieces: self.pieces,
            tear_limit: self.tear_limit,
            handle_count: self.handle_count,
        }
    }

    fn handles(&self) -> impl Iterator<Item = &HandleReference> {
        Self::handles(self)
    }

    fn has_finite_blocks(&self) -> bool {
        self.rows().all(are_finite)
    }

    fn copy_blocks(&self, stiffness: &mut PairBlocks, damping: &mut PairBlocks) {
        let n = usize::from(self.handle_count);
        copy_used_blocks(stiffness, &self.stiffness, n);
        copy_used_blocks(damping, &self.damping, n);
    }
}

fn copy_used_blocks(mine: &mut PairBlocks, theirs: &PairBlocks, n: usize) {
    for (mine, theirs) in mine.iter_mut().zip(theirs).take(n) {
        copy_row(mine, theirs.get(..n).unwrap_or(theirs));
    }
}

/// Copies the first blocks of a row, all in one copy of memory.
#[allow(clippy::disallowed_methods)]
fn copy_row(mine: &mut [Mat6], theirs: &[Mat6]) {
    if let Some(mine) = mine.get_mut(..theirs.len()) {
        // It panics only for slices of different lengths. These have the same length by construction, so the compiler
        // removes the panic; `tests/tests/no_panic.rs` shows that.
        mine.copy_from_slice(theirs);
    }
}

/// A model as it lies in a ring.
///
/// ```
/// use rt_core::LocalModel;
/// use rt_core::local_model::{HandleReference, PackedModel, PublishedModel};
///
/// let mut model = LocalModel::empty();
/// model.handle_count = 1;
/// model.stiffness[0][0][(0, 0)] = 100.0;
///
/// // The parts in use, as they follow one another in a ring.
/// let handles: Vec<HandleReference> = model.handles().copied().collect();
/// let blocks = model.rows().collect::<Vec<_>>().concat();
/// assert_eq!((handles.len(), blocks.len()), (1, 2));
/// let packed = PackedModel::new(model.head(), &handles, &blocks).unwrap();
///
/// let mut copy = LocalModel::empty();
/// copy.copy_used_from(&packed);
/// assert_eq!(copy, model);
///
/// // Parts that are not as many as the head says are no model.
/// assert!(PackedModel::new(model.head(), &[], &blocks).is_none());
/// ```
#[derive(Clone, Copy, Debug)]
pub struct PackedModel<'a> {
    /// The numbers that do not belong to a handle.
    pub head: ModelHead,
    handles: &'a [HandleReference],
    blocks: &'a [Mat6],
}

impl<'a> PackedModel<'a> {
    /// The model of these parts: [`ModelHead::handles`] handles, and [`ModelHead::blocks`] blocks in the order of
    /// [`LocalModel::rows`]. `None` for any other number of parts.
    pub fn new(
        head: ModelHead,
        handles: &'a [HandleReference],
        blocks: &'a [Mat6],
    ) -> Option<Self> {
        let fits = handles.len() == head.handles() && blocks.len() == head.blocks();
        fits.then_some(Self {
            head,
            handles,
            blocks,
        })
    }
}

impl PublishedModel for PackedModel<'_> {
    fn head(&self) -> ModelHead {
        self.head
    }

    fn handles(&self) -> impl Iterator<Item = &HandleReference> {
        self.handles.iter()
    }

    fn has_finite_blocks(&self) -> bool {
        are_finite(self.blocks)
    }

    fn copy_blocks(&self, stiffness: &mut PairBlocks, damping: &mut PairBlocks) {
        // A model without handles has no blocks; a chunk must not be empty.
        let n = self.head.handles().max(1);
        let rows = stiffness
            .iter_mut()
            .take(n)
            .chain(damping.iter_mut().take(n));
        for (mine, theirs) in rows.zip(self.blocks.chunks_exact(n)) {
            copy_row(mine, theirs);
        }
    }
}
