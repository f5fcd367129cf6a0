//! What hands could get back from a body: the energy that its published models claim.
//!
//! Two answers are at hand, and the smaller is told. The first is the **body's own**,
//!
//! ```text
//! V_W = W_el + U_loads + sum g_i . (p_i - p_i(0)) + c
//! ```
//!
//! its elastic energy and the potential of its loads, less what is the potential of the weights `g_i` that its handles
//! bear. Its derivative is exactly minus the wrenches on the hands without their weights, whatever the law and however
//! supports share the weight. The constant `c` makes it the second answer in the first model. The second is the
//! **tangent's**, `F^T K^-1 F / 2` with `F` the wrenches on all handles without the weights and with what dampers hold
//! added back. On a body that softens as it is pressed (St. Venant-Kirchhoff's law) the tangent's is more than the work
//! that was done; on a sheet that has buckled the body's own is more than hands have paid, for models that came late
//! pulled along during the snap.
//!
//! Where the body's own energy falls below nothing, it has **released** more than the first model told of: the sag of a
//! strip gives its weight's potential to the hands. Models tell of that, too, and `c` rises by as much.
//!
//! A body that is made of something softer from one step to the next stores less at the same shape: `c` changes so that
//! the body's own energy falls by the ratio of its elastic energies.

use physics::linear::dense::{Clipper, Square};
use physics::{Body, Condensed};
use rt_core::{LocalModel, MAX_HANDLES, Vec3};

/// Motions that are resisted less than this (N/m) are taken to be resisted by this much: what is left of a body that
/// gives way is not unbounded energy.
const SOFTEST: f64 = 50.0;

/// Finds the energy of one body's models.
pub(super) struct Stored {
    clipper: Clipper,
    stiffness: Square,
    scale: Vec<f64>,
    load: Vec<f64>,
    /// Where each handle was when the body was built (m).
    origins: Vec<Vec3>,
    /// `c` (J); none before the first model.
    constant: Option<f64>,
    /// What was released so far (J).
    released: f64,
}

impl Stored {
    /// For a body whose handles are at `origins` (m).
    pub(super) fn new(origins: Vec<Vec3>) -> Self {
        let size = 6 * origins.len().min(MAX_HANDLES);
        Self {
            clipper: Clipper::new(size),
            stiffness: Square::zeros(size),
            scale: vec![1.0; size],
            load: vec![0.0; size],
            origins,
            constant: None,
            released: 0.0,
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

    /// Tells in `model` what hands could get back from `body`, whose elastic energy is `elastic` (J), and what it has
    /// released.
    pub(super) fn tell(&mut self, body: &Body, elastic: f64, model: &mut LocalModel) {
        let tangent = self.tangent(model);
        let own = elastic + self.potential(body, model);
        let constant = self.constant.get_or_insert(tangent - own);
        let below = (-(own + *constant)).max(0.0);
        *constant += below;
        self.released += below;
        // An energy that is not a number is none that anyone may count on.
        model.energy = (own + *constant).min(tangent).max(0.0);
        model.released = self.released;
    }

    /// The body's elastic energy falls from `before` to `after` (J) as its material changes, at the same shape.
    pub(super) fn exchange(&mut self, body: &Body, before: f64, after: f64, model: &LocalModel) {
        if let Some(constant) = self.constant {
            let potential = self.potential(body, model);
            let own = before + potential + constant;
            let ratio = if before > 0.0 { after / before } else { 1.0 };
            self.constant = Some(own * ratio.min(1.0) - after - potential);
        }
    }

    /// Potential of the loads, less that of the weights on the handles (J), but for a constant.
    fn potential(&self, body: &Body, model: &LocalModel) -> f64 {
        let weights = model.handles().zip(&self.origins);
        let lifted: f64 = weights
            .enumerate()
            .map(|(number, (handle, origin))| {
                let report = body.handle_report(number);
                let position = report.map_or(*origin, |report| report.pose.position);
                handle.weight.dot(&(position - origin))
            })
            .sum();
        body.load_potential() + lifted
    }

    /// `F . K^-1 F / 2` (J) with the wrenches of `model`, without their weights, what dampers hold included as a reader
    /// of the model does.
    fn tangent(&mut self, model: &LocalModel) -> f64 {
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
