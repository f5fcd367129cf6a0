//! The energy that hands could recover from a body, as its published models claim it.
//!
//! There are two estimates, and a model claims the smaller one. The first is the **body's own**,
//!
//! ```text
//! V_W = W_el + U_loads + sum g_i . (p_i - p_i(0)) + c
//! ```
//!
//! the sum of its elastic energy and the potential of its loads, less the potential of the weights `g_i` that its
//! handles bear. The derivative of this sum is exactly minus the wrenches on the hands without their weights, for any
//! law and any division of the weight between supports and handles. The constant `c` makes the two estimates equal in
//! the first model. The second estimate is the **tangent's**, `F^T K^-1 F / 2`. Here `F` are the wrenches on all
//! handles without the weights, and the wrenches of the dampers are added back. On a body that softens as it is
//! pressed (St. Venant-Kirchhoff's law) the tangent's estimate exceeds the work that was done. On a sheet that has
//! buckled, the body's own energy exceeds the work of the hands, because models that came late pulled the hands along
//! during the snap.
//!
//! Hands may get back more than they supplied if the body **released** energy of its own. Models state the sum of these
//! energies, too. The sum begins with the energy in the first model that is the body's own (`initial`): hands may have
//! moved their handles before this model, and have paid nothing for it, for they felt no force yet. If the body's own
//! energy `V_W` falls below zero later, the body has released more. For example, the sag of a strip gives the potential
//! of its weight to the hands. `c` then rises by the same amount.
//!
//! A body that **parts into pieces** has such an account for each piece (`Stored::part`). The energy that the account
//! had is divided by the elastic energies of the pieces.
//!
//! A body whose material becomes softer from one step to the next stores less at the same shape: `c` changes so that
//! the body's own energy falls by the ratio of its elastic energies.

use physics::linear::dense::{Clipper, Square};
use physics::{Body, PieceSums};
use rt_core::{HandleReference, LocalModel, MAX_HANDLES, PieceEnergy, Vec3};

/// Least stiffness of a motion in the tangent's estimate (N/m). A softer motion counts with this stiffness, so that a
/// body that yields does not claim unbounded energy.
const SOFTEST: f64 = 50.0;

/// Least stiffness of a motion that counts along the slope of a tear limit (N/m). It only keeps motions without
/// stiffness, which change no tear, from counting by rounding.
const SLACK: f64 = 1e-6;

/// Computes the energy that the models of one body claim.
pub(super) struct Stored {
    clipper: Clipper,
    stiffness: Square,
    scale: Vec<f64>,
    load: Vec<f64>,
    /// The position of each handle when the body was built (m).
    origins: Vec<Vec3>,
    /// `c` (J); `None` before the first model.
    constant: Option<f64>,
    /// The energies when the hands took hold of the body, before they moved it.
    start: Energies,
    /// The energy released so far (J).
    released: f64,
    /// The account of each piece, by its number; empty for a whole body.
    pieces: Vec<PieceTotals>,
}

/// The energies of a body of which the body's own estimate consists (J).
#[derive(Clone, Copy, Debug, Default)]
struct Energies {
    elastic: f64,
    /// The potential of the loads, less that of the weights on the handles, but for a constant.
    potential: f64,
}

impl Energies {
    fn sum(&self) -> f64 {
        self.elastic + self.potential
    }
}

/// The account of one piece.
#[derive(Clone, Copy, Debug, Default)]
struct PieceTotals {
    /// `c` of the piece (J).
    constant: f64,
    /// The energy that the piece has released since the body parted (J).
    released: f64,
}

impl Stored {
    /// For `body`, which stores the energy `elastic` (J) and whose handles are at `origins` (m). `model` has their weights.
    pub(super) fn new(body: &Body, elastic: f64, origins: Vec<Vec3>, model: &LocalModel) -> Self {
        let mut made = Self::empty(origins);
        made.start = made.energies_now(body, elastic, model);
        made
    }

    /// An account that knows no energy yet, for handles at `origins` (m).
    fn empty(origins: Vec<Vec3>) -> Self {
        let size = 6 * origins.len().min(MAX_HANDLES);
        Self {
            clipper: Clipper::new(size),
            stiffness: Square::zeros(size),
            scale: vec![1.0; size],
            load: vec![0.0; size],
            origins,
            constant: None,
            start: Energies::default(),
            released: 0.0,
            pieces: Vec::with_capacity(MAX_HANDLES),
        }
    }

    /// Parts the account into pieces. `before` are the energies that the account had of the pieces until now (J), by the
    /// number of the old piece; `leads` says whether an old piece leads to a new one. Each new piece takes a part of the energy of
    /// its old piece, in proportion to the elastic energy that it stores. The energies of old pieces that grow together add up.
    pub(super) fn part(
        &mut self,
        before: &[f64],
        leads: &dyn Fn(usize, usize) -> bool,
        body: &Body,
        sums: &[PieceSums],
        model: &LocalModel,
    ) {
        let mut released_by = [0.0; MAX_HANDLES];
        for (to, totals) in released_by.iter_mut().zip(&self.pieces) {
            *to = totals.released;
        }
        self.pieces.clear();
        for (piece, own) in sums.iter().enumerate() {
            let mut energy = 0.0;
            let mut released = 0.0;
            for (old, before) in before
                .iter()
                .enumerate()
                .filter(|(old, _)| leads(*old, piece))
            {
                let siblings = || {
                    let all = sums.iter().enumerate();
                    all.filter(|(new, _)| leads(old, *new))
                        .map(|(_, sums)| sums.elastic)
                };
                let whole: f64 = siblings().sum();
                let share = if whole > 0.0 {
                    own.elastic / whole
                } else {
                    1.0 / siblings().count().max(1) as f64
                };
                energy += before * share;
                if siblings().count() == 1 {
                    released += released_by.get(old).copied().unwrap_or(0.0);
                }
            }
            let now = own.elastic + own.potential + self.lifted(body, model, Some(piece));
            self.pieces.push(PieceTotals {
                constant: energy - now,
                released,
            });
        }
    }

    /// The energies of the account (J), by the number of the piece: one number for a whole body.
    pub(super) fn energies(
        &self,
        body: &Body,
        elastic: f64,
        sums: &[PieceSums],
        model: &LocalModel,
        energies: &mut Vec<f64>,
    ) {
        energies.clear();
        if self.pieces.is_empty() {
            let own = elastic + self.potential(body, model);
            energies.push(own + self.constant.unwrap_or(-own));
            return;
        }
        for (piece, (sums, totals)) in sums.iter().zip(&self.pieces).enumerate() {
            let own = sums.elastic + sums.potential + self.lifted(body, model, Some(piece));
            energies.push(own + totals.constant);
        }
    }

    /// Writes into `model` the energies of its pieces, whose elastic energies and loads are `sums`.
    pub(super) fn publish_pieces(
        &mut self,
        body: &Body,
        sums: &[PieceSums],
        model: &mut LocalModel,
    ) {
        let mut whole = 0.0;
        for (piece, own) in sums.iter().enumerate().take(self.pieces.len()) {
            let tangent = self.tangent(model, Some(piece));
            let now = own.elastic + own.potential + self.lifted(body, model, Some(piece));
            let totals = &mut self.pieces[piece];
            let below = (-(now + totals.constant)).max(0.0);
            totals.constant += below;
            totals.released += below;
            let stored = (now + totals.constant).min(tangent).max(0.0);
            whole += stored;
            if let Some(out) = model.head.pieces.get_mut(piece) {
                *out = PieceEnergy {
                    stored,
                    released: totals.released,
                };
            }
        }
        model.head.energy = whole;
        let released: f64 = self.pieces.iter().map(|totals| totals.released).sum();
        model.head.released = self.released + released;
    }

    /// Keeps the stiffness of `model`, which models publish from now on. A turn causes displacements at the lever arm
    /// `length` (m).
    pub(super) fn keep(&mut self, model: &LocalModel, length: f64) {
        // `clone_from` would allocate: the derived method makes a new matrix.
        for j in 0..self.stiffness.size() {
            for i in 0..self.stiffness.size() {
                self.stiffness[(i, j)] = model.stiffness[i / 6][j / 6][(i % 6, j % 6)];
            }
        }
        for (slot, scale) in self.scale.iter_mut().enumerate() {
            // A turn counts by the displacement that it causes at the body's length.
            *scale = if slot % 6 < 3 { 1.0 } else { length };
        }
    }

    /// Writes into `model` the energy that hands could recover from `body`, and the energy that the body has
    /// released. The elastic energy of the body is `elastic` (J).
    pub(super) fn publish(&mut self, body: &Body, elastic: f64, model: &mut LocalModel) {
        let tangent = self.tangent(model, None);
        let now = self.energies_now(body, elastic, model);
        let own = now.sum();
        if self.constant.is_none() {
            self.released = initial(tangent, &self.start, &now);
        }
        let constant = self.constant.get_or_insert(tangent - own);
        let below = (-(own + *constant)).max(0.0);
        *constant += below;
        self.released += below;
        // `min` and `max` drop an energy that is not a number: nobody may count on it.
        model.head.energy = (own + *constant).min(tangent).max(0.0);
        model.head.released = self.released;
    }

    /// Completes the tear limit of `model`, if it has one, by `a = 1 / (q . K^-1 q)` with the slopes `q` of its
    /// handles ([`rt_core::TearLimit`]).
    pub(super) fn publish_tear_area(&mut self, model: &mut LocalModel) {
        let limit = &model.head.tear_limit;
        if !limit.is_some() || limit.is_touch() {
            return;
        }
        for (load, handle) in self.load.chunks_exact_mut(6).zip(&model.handles) {
            load.copy_from_slice(handle.tear_slope.as_slice());
        }
        let half = self
            .clipper
            .stored(&self.stiffness, &self.scale, &self.load, SLACK);
        // Without a slope there is nothing to limit.
        model.head.tear_limit.area = if half > 0.0 { 0.5 / half } else { 0.0 };
    }

    /// Adjusts `c` to a change of the body's material: the elastic energy falls from `before` to `after` (J) at the
    /// same shape.
    pub(super) fn exchange(&mut self, body: &Body, [before, after]: [f64; 2], model: &LocalModel) {
        let ratio = if before > 0.0 { after / before } else { 1.0 };
        if let Some(constant) = self.constant {
            let potential = self.potential(body, model);
            let own = before + potential + constant;
            self.constant = Some(own * ratio.min(1.0) - after - potential);
        }
        self.start.elastic *= ratio.min(1.0);
    }

    /// The same account for a body that continues this one with other handles. `before` and `after` are the body with
    /// its elastic energy (J), and `model` and `next` its model, on either side of the change. The body's own energy
    /// does not jump: `c` takes up the weights of handles that were released.
    pub(super) fn rebuilt(
        &self,
        (body, elastic, model): (&Body, f64, &LocalModel),
        (next_body, next_elastic, next_model): (&Body, f64, &LocalModel),
        origins: Vec<Vec3>,
    ) -> Self {
        let mut next = Self::empty(origins);
        next.released = self.released;
        let now = self.energies_now(body, elastic, model).sum();
        let then = next.energies_now(next_body, next_elastic, next_model);
        next.constant = self.constant.map(|constant| now + constant - then.sum());
        next.start = if self.origins.is_empty() {
            then
        } else {
            Energies {
                potential: self.start.potential + then.sum() - now,
                ..self.start
            }
        };
        next
    }

    /// The same account for a body whose handles have other groups after a change. Both states are the body with its elastic energy
    /// (J), its model and the sums over its groups. `leads` says whether hands of a former group are in a new one. A group whose
    /// hands have all joined begins without energy.
    pub(super) fn regrouped(
        &self,
        (body, elastic, model, sums): (&Body, f64, &LocalModel, &[PieceSums]),
        (next_body, next_elastic, next_model, next_sums): (&Body, f64, &LocalModel, &[PieceSums]),
        leads: &dyn Fn(usize, usize) -> bool,
        origins: Vec<Vec3>,
    ) -> Self {
        let mut before = Vec::with_capacity(MAX_HANDLES);
        self.energies(body, elastic, sums, model, &mut before);
        let mut next = Self::empty(origins);
        let total = |pieces: &[PieceTotals]| pieces.iter().map(|one| one.released).sum::<f64>();
        next.released = self.released + total(&self.pieces);
        if next_sums.len() > 1 {
            next.pieces.extend_from_slice(&self.pieces);
            next.part(&before, leads, next_body, next_sums, next_model);
            next.released -= total(&next.pieces);
        } else {
            let kept = before.iter().enumerate();
            let kept: f64 = kept.filter(|(old, _)| leads(*old, 0)).map(|(_, e)| e).sum();
            let now = next_elastic + next.potential(next_body, next_model);
            next.constant = Some(kept - now);
        }
        next
    }

    /// The position of handle number `handle` from which the potential of its weight counts (m).
    pub(super) fn origin(&self, handle: usize) -> Option<Vec3> {
        self.origins.get(handle).copied()
    }

    /// The energies of `body`, whose elastic energy is `elastic` (J).
    fn energies_now(&self, body: &Body, elastic: f64, model: &LocalModel) -> Energies {
        Energies {
            elastic,
            potential: self.potential(body, model),
        }
    }

    /// Potential of the loads, less that of the weights on the handles (J), but for a constant.
    fn potential(&self, body: &Body, model: &LocalModel) -> f64 {
        body.load_potential() + self.lifted(body, model, None)
    }

    /// Minus the potential of the weights on the handles (J), but for a constant: of those on one piece, or of all.
    fn lifted(&self, body: &Body, model: &LocalModel, piece: Option<usize>) -> f64 {
        let weights = model.handles().zip(&self.origins).enumerate();
        let counted = weights.filter(|(_, (handle, _))| is_on(handle, piece));
        counted
            .map(|(number, (handle, origin))| {
                let report = body.handle_report(number);
                let position = report.map_or(*origin, |report| report.pose.position);
                handle.weight.dot(&(position - origin))
            })
            .sum()
    }

    /// `F . K^-1 F / 2` (J) with the wrenches of `model` on the handles of one piece, or on all, without their weights.
    /// The wrenches of the dampers are added back, as a reader of the model does.
    fn tangent(&mut self, model: &LocalModel, piece: Option<usize>) -> f64 {
        let loads = self.load.chunks_exact_mut(6).zip(&model.damping);
        for ((load, damping), handle) in loads.zip(&model.handles) {
            if !is_on(handle, piece) {
                load.fill(0.0);
                continue;
            }
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

/// The part of the energy `claimed` (J) by the first model that hands have not put into the body since the `start`. The
/// energy of the body has risen by their work. What the body has beside this work is the elastic energy that it had and
/// the potential that its loads have given since.
fn initial(claimed: f64, start: &Energies, now: &Energies) -> f64 {
    let risen = (now.sum() - start.sum()).max(0.0);
    let own = start.elastic + (start.potential - now.potential).max(0.0);
    (claimed - risen).min(own).max(0.0)
}

/// Whether a handle is on a piece, or the piece is the whole body.
fn is_on(handle: &HandleReference, piece: Option<usize>) -> bool {
    piece.is_none_or(|piece| usize::from(handle.piece) == piece)
}
