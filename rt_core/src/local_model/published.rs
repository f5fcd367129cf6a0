//! A local model as a publication ([`crate::publication`]): a head, a row for each handle, and the blocks between the
//! handles. A model with one handle uses a fiftieth of the memory of a [`LocalModel`].

use super::{HandleReference, LocalModel, ModelFault, PieceEnergy, TearLimit, are_finite, pieces};
use crate::geometry::Mat6;
use crate::publication::{Extent, Head, Packed, Publication, copy_rows};
use crate::{MAX_DEVICES, MAX_HANDLES};

/// The numbers of a model that do not belong to a handle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelHead {
    /// Number of the model among the models of this body, from one. A gap tells the reader that models were lost.
    pub sequence: u64,
    /// Number of changes of the topology up to this model.
    pub epoch: u32,
    /// Time of the linearized state (ns, the tick's clock).
    pub time_ns: u64,
    /// The publication period (s).
    pub period: f64,
    /// The age at which the next model is due (s). The model was condensed for this time ahead.
    pub horizon: f64,
    /// Energy that hands at rest could get back from the reference state, without the weight (J). This energy is the
    /// one that the body itself stores, and is at most the tangent's `w^T K^-1 w / 2` of the wrenches on all handles.
    /// The cap on a body's energy needs this value. Zero is always safe.
    pub energy: f64,
    /// Energy that the body itself has released (J): the energy that it stored before hands moved it, and more later. For
    /// instance, a strip that sags further gives the potential of its weight to the hands. The value only grows. Zero
    /// is always safe.
    pub released: f64,
    /// Work that contacts with other bodies have done on the body so far (J), signed. Zero is always safe: it only keeps the
    /// hands of bodies that touch from sharing the energy that one of them supplied.
    pub received: f64,
    /// The energies of the pieces, by the number of the piece. Unused in a whole body, whose energies are `energy` and
    /// `released`.
    pub pieces: [PieceEnergy; MAX_HANDLES],
    /// The limit of the extrapolation, beyond which a tear grows.
    pub tear_limit: TearLimit,
    /// Number of handles, as the model claims. It may exceed [`MAX_HANDLES`]; such a model is refused.
    pub handle_count: u8,
}

impl ModelHead {
    /// The head of a model without handles.
    pub fn empty() -> Self {
        Self {
            sequence: 0,
            epoch: 0,
            time_ns: 0,
            period: 1.0,
            horizon: 1.0,
            energy: 0.0,
            released: 0.0,
            received: 0.0,
            pieces: [PieceEnergy::default(); MAX_HANDLES],
            tear_limit: TearLimit::none(),
            handle_count: 0,
        }
    }

    /// The extent of a model of `handles` handles.
    pub fn extent_of(handles: usize) -> Extent {
        let pairs = handles.saturating_mul(handles);
        Extent {
            rows: handles,
            // Those of the stiffness and those of the damping.
            blocks: pairs.saturating_mul(2),
        }
    }
}

impl Head for ModelHead {
    const NAME: &'static str = "local model of body";
    type Row = HandleReference;
    type Block = Mat6;

    fn filler() -> (Self, HandleReference, Mat6) {
        (Self::empty(), HandleReference::zero(), Mat6::zeros())
    }

    fn sequence(&self) -> u64 {
        self.sequence
    }

    fn extent(&self) -> Extent {
        Self::extent_of(usize::from(self.handle_count).min(MAX_HANDLES))
    }
}

impl Publication for LocalModel {
    type Head = ModelHead;

    fn head(&self) -> &ModelHead {
        &self.head
    }

    fn rows(&self) -> &[HandleReference] {
        let n = usize::from(self.head.handle_count);
        self.handles.get(..n).unwrap_or(&self.handles)
    }

    /// The rows of the stiffness, then those of the damping.
    fn blocks(&self) -> impl Iterator<Item = &[Mat6]> {
        let [stiffness, damping] = self.block_rows();
        stiffness.chain(damping)
    }
}

/// A local model as it lies in a ring.
pub type PackedModel<'a> = Packed<'a, ModelHead>;

/// A published local model, wherever its numbers are stored.
pub trait PublishedModel: Publication<Head = ModelHead> {
    /// The rows of blocks in use: those of the stiffness, and those of the damping.
    fn block_rows(&self) -> [impl Iterator<Item = &[Mat6]>; 2];

    /// Checks that every number in use is finite and that every device index exists.
    ///
    /// # Errors
    /// The first [`ModelFault`] found.
    fn check(&self) -> Result<(), ModelFault> {
        let (head, handles) = (self.head(), self.rows());
        let n = usize::from(head.handle_count);
        if n == 0 || n > MAX_HANDLES {
            return Err(ModelFault::Handles);
        }
        let mut devices = handles.iter().map(|handle| usize::from(handle.device));
        if devices.any(|device| device >= MAX_DEVICES) {
            return Err(ModelFault::Handles);
        }
        let count = pieces::count(handles.iter());
        if count > head.handle_count {
            return Err(ModelFault::Handles);
        }
        let finite = head.period.is_finite()
            && head.period > 0.0
            && head.horizon.is_finite()
            && head.horizon > 0.0
            && head.energy.is_finite()
            && head.released.is_finite()
            && head.received.is_finite()
            && handles.iter().all(HandleReference::is_finite)
            && self.blocks().all(are_finite)
            && head.tear_limit.is_sound()
            && (!head.tear_limit.is_some()
                || handles.iter().all(HandleReference::has_finite_slope));
        let mut energies = head.pieces.iter().take(usize::from(count));
        if finite && (count == 1 || energies.all(PieceEnergy::is_finite)) {
            Ok(())
        } else {
            Err(ModelFault::NotFinite)
        }
    }
}

impl PublishedModel for LocalModel {
    fn block_rows(&self) -> [impl Iterator<Item = &[Mat6]>; 2] {
        let n = usize::from(self.head.handle_count);
        let row = move |row| <[Mat6]>::get(row, ..n).unwrap_or(row);
        [&self.stiffness, &self.damping].map(|blocks| blocks.iter().take(n).map(move |r| row(r)))
    }
}

impl PublishedModel for PackedModel<'_> {
    fn block_rows(&self) -> [impl Iterator<Item = &[Mat6]>; 2] {
        let n = self.head.extent().rows;
        let middle = self.blocks.split_at_checked(n.saturating_mul(n));
        let (stiffness, damping) = middle.unwrap_or_default();
        // A model without handles has no blocks; a chunk must not be empty.
        [stiffness, damping].map(|blocks| blocks.chunks_exact(n.max(1)))
    }
}

impl LocalModel {
    /// Copies the used part of another model. The unused part stays as it was.
    pub fn copy_used_from(&mut self, other: &impl PublishedModel) {
        self.head = *other.head();
        for (mine, theirs) in self.handles.iter_mut().zip(other.rows()) {
            *mine = *theirs;
        }
        let [stiffness, damping] = other.block_rows();
        copy_rows(&mut self.stiffness, stiffness);
        copy_rows(&mut self.damping, damping);
    }
}
