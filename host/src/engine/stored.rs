//! What a body's hands could get back: the energy that its published wrenches and stiffness amount to.

use physics::fem::Condensed;
use physics::fem::dense::{Clipper, Square};
use rt_core::{LocalModel, MAX_HANDLES};

/// Motions that are resisted less than this (N/m) are taken to be resisted by this much: what is left of a body that
/// gives way is not unbounded energy.
const SOFTEST: f64 = 50.0;

/// Finds the energy of one body's models.
pub(super) struct Stored {
    clipper: Clipper,
    stiffness: Square,
    scale: Vec<f64>,
    load: Vec<f64>,
}

impl Stored {
    /// For a body with so many handles.
    pub(super) fn new(handles: usize) -> Self {
        let size = 6 * handles.min(MAX_HANDLES);
        Self {
            clipper: Clipper::new(size),
            stiffness: Square::zeros(size),
            scale: vec![1.0; size],
            load: vec![0.0; size],
        }
    }

    /// Keeps the stiffness that models publish from now on.
    pub(super) fn keep(&mut self, condensed: &Condensed) {
        // `clone_from` would allocate: a derived one makes a new matrix.
        for j in 0..self.stiffness.size() {
            for i in 0..self.stiffness.size() {
                self.stiffness[(i, j)] = condensed.stiffness[(i, j)];
            }
        }
        for (slot, scale) in self.scale.iter_mut().enumerate() {
            // A turn counts by how far it moves what is held.
            *scale = if slot % 6 < 3 { 1.0 } else { condensed.length };
        }
    }

    /// `w . K^-1 w / 2` (J) with the wrenches of `model`, without their weights, what dampers hold included as a reader of the model does.
    pub(super) fn of(&mut self, model: &LocalModel) -> f64 {
        let loads = self.load.chunks_exact_mut(6).zip(&model.damping);
        for ((load, damping), handle) in loads.zip(&model.handles) {
            let mut wrench = handle.unweighted();
            for (b, other) in damping.iter().zip(model.handles()) {
                wrench += b * other.twist.stacked();
            }
            load.copy_from_slice(wrench.as_slice());
        }
        self.clipper
            .stored(&self.stiffness, &self.scale, &self.load, SOFTEST)
    }
}
