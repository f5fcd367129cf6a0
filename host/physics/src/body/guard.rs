//! A bound on the energy at the end of a step.
//!
//! Implicit Euler, solved to convergence, never adds energy to a body. TR-BDF2 guarantees this for linear bodies only.
//! A single linearization guarantees nothing if a step is so long that the linearization does not hold: a body may
//! then return the energy of a kick many times over. The guard checks each such step. A step that fails is taken by a
//! safer scheme or shortened, so that a body never releases energy that no hand supplied (after Dinev, Liu and Kavan,
//! "Stabilizing integrators for real-time physics", 2018, who blend with implicit Euler by the energy).

use super::{Body, rounding};
use crate::Vec3;

/// Fraction of kinetic and elastic energy that a step may regain. The energy of a second-order scheme oscillates about
/// the exact energy, and the guard must allow that. The value is half of the hundredth that is promised.
const SLACK: f64 = 0.005;
/// Rounding error of an energy, as a fraction of the stiffness times the squared length of edges and of the loads'
/// work.
const ROUNDING: f64 = 1e-14;
/// Enough for a kick of a thousand cells in one step, in elements whose energy grows with the fourth power.
const MOST_HALVINGS: usize = 30;
/// Number of halvings without success that are allowed. A body that inverts elements meets an energy barrier on its
/// path, and a hand that pulls hard supplies energy that no halving removes.
const MOST_MISSES: usize = 4;

/// The energy that a body may have after the next step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Guard {
    /// Energy after the last step (J). A different energy now means that the body was changed from outside.
    last: f64,
    /// The bound (J), without the work of hands.
    limit: f64,
}

/// A displacement over a step, shortened as far as the energy requires.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HeldBack {
    /// Energy at the end of the shortened displacement (J).
    pub(crate) energy: Energy,
    /// The fraction of the displacement that is kept; usually 1.
    pub(crate) kept: f64,
    /// Whether shorter displacements were tried after this one. The last evaluation then belongs to another
    /// displacement.
    pub(crate) returned: bool,
}

/// Energy of a body (J).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Energy {
    /// Kinetic and elastic energy.
    own: f64,
    /// Kinetic and elastic energy and that of the loads; infinite if the sum is not a number.
    total: f64,
}

impl Energy {
    /// The energy at positions `x` (m) and velocities `v` (m/s) of the nodes.
    pub(crate) fn of(body: &Body, x: &[Vec3], v: impl Fn(usize) -> Vec3) -> Self {
        Self::new(
            body.kinetic_energy_of(v) + body.elastic_energy_at(x),
            body.load_potential_at(x),
        )
    }

    /// The sum of `own`, the kinetic and elastic energy, and the energy of the loads (J).
    pub(crate) fn new(own: f64, loads: f64) -> Self {
        let total = own + loads;
        Self {
            own,
            total: if total.is_nan() { f64::INFINITY } else { total },
        }
    }

    pub(crate) fn now(body: &Body) -> Self {
        Self::of(body, &body.state.x, |node| body.state.v[node])
    }

    /// Kinetic and elastic energy and that of the loads (J).
    pub(crate) fn total(&self) -> f64 {
        self.total
    }

    fn is_below(&self, other: &Self) -> bool {
        self.total < other.total
    }
}

impl Default for Guard {
    fn default() -> Self {
        Self {
            last: f64::NAN,
            limit: f64::INFINITY,
        }
    }
}

impl Guard {
    /// Prepares the bound for a step, from the energy before it.
    pub(crate) fn begin(&mut self, before: Energy) {
        if before.total.to_bits() != self.last.to_bits() {
            self.limit = before.total + SLACK * before.own;
        }
    }

    /// Whether a step may end with the energy `after`, when hands have supplied at most `work` (J).
    pub(crate) fn allows(&self, body: &Body, after: Energy, work: f64) -> bool {
        let limit = self.limit + work;
        // The rounding error costs a pass over the body, so it is computed only if it decides.
        after.total <= limit || after.total <= limit + rounding(body, after.own)
    }

    /// Halves the displacement of `body` over a step until the energy at its end is allowed, when hands have supplied
    /// at most `work` (J). If no fraction is allowed, the displacement with the least energy is kept. `ahead`
    /// computes the energy at the end of the present displacement.
    ///
    /// A body that does not move gains nothing, so some fraction is allowed unless hands pull hard at the body. A body
    /// without handles and supports keeps its momentum: the motion of its centre of mass is not changed.
    pub(crate) fn hold_back(
        &self,
        body: &mut Body,
        work: f64,
        mut ahead: impl FnMut(&mut Body) -> Energy,
    ) -> HeldBack {
        let mut found = HeldBack {
            energy: ahead(body),
            kept: 1.0,
            returned: false,
        };
        if self.allows(body, found.energy, work) {
            return found;
        }
        let drift = body.free_drift();
        let (mut fraction, mut misses) = (1.0, 0);
        for _ in 0..MOST_HALVINGS {
            body.scale_motion(0.5, &drift);
            fraction *= 0.5;
            let shorter = ahead(body);
            if shorter.is_below(&found.energy) {
                (found.energy, found.kept) = (shorter, fraction);
                if self.allows(body, found.energy, work) {
                    break;
                }
            } else {
                misses += 1;
                // A body that no hand pulls stays at the state of least energy that was found.
                if work > 0.0 && misses == MOST_MISSES {
                    break;
                }
            }
        }
        if fraction < found.kept {
            body.scale_motion(found.kept / fraction, &drift);
            found.returned = true;
        }
        found
    }

    /// What part of the velocity a body may keep that ends with the energy `after`, when hands have supplied at most `work` (J).
    /// `own` is the kinetic energy (J) that goes with the square of this part. The displacement stays as it is.
    pub(crate) fn slow(&self, body: &Body, after: Energy, work: f64, own: f64) -> f64 {
        if self.allows(body, after, work) {
            return 1.0;
        }
        let kept = 1.0 - (after.total - self.limit - work) / own;
        // Nothing is kept of a number that is not finite.
        if kept > 0.0 { libm::sqrt(kept) } else { 0.0 }
    }

    /// Moves the bound with the energy, which an edit of the body has changed to `after` since the last step.
    pub(crate) fn note_edit(&mut self, after: Energy) {
        if self.last.is_finite() {
            self.limit += after.total - self.last;
            self.last = after.total;
        }
    }

    /// Accepts the step: energy that was lost may not return, and the work of hands may.
    pub(crate) fn end(&mut self, after: Energy, work: f64) {
        self.last = after.total;
        self.limit = (self.limit + work).min(after.total + SLACK * after.own);
    }
}

impl Body {
    /// Shortens the displacement over a step of `h` until the body ends with no more energy than it had and hands have
    /// supplied, at most `work` (J). Returns the fraction of the displacement that is held back, usually 0.
    pub(crate) fn hold_back(&mut self, h: f64, work: f64) -> f64 {
        let mut guard = self.state.guard;
        guard.begin(Energy::now(self));
        let held = guard.hold_back(self, work, |body| body.energy_ahead(h));
        guard.end(held.energy, work);
        self.state.guard = guard;
        1.0 - held.kept
    }

    /// Energy at the end of a step of `h` by the present displacement.
    fn energy_ahead(&mut self, h: f64) -> Energy {
        let mut ahead = core::mem::take(&mut self.assembly.ahead);
        for ((ahead, x), u) in ahead
            .iter_mut()
            .zip(&self.state.x)
            .zip(&self.state.displacement)
        {
            *ahead = x + u;
        }
        let energy = Energy::of(self, &ahead, |node| self.state.displacement[node] / h);
        self.assembly.ahead = ahead;
        energy
    }

    /// Displacement of the centre of mass in the step (m); zero for a body with handles or supports.
    pub(crate) fn free_drift(&self) -> Vec3 {
        if !self.constraints.handles.is_empty() || !self.constraints.supports.list.is_empty() {
            return Vec3::zeros();
        }
        let moved = |node: usize| self.state.displacement[node] * self.model.mass[node];
        self.constraints.nodes().map(moved).sum::<Vec3>() / self.total_mass()
    }

    /// Multiplies the displacement, less `drift`, by `factor` along all axes that nothing prescribes.
    fn scale_motion(&mut self, factor: f64, drift: &Vec3) {
        let mask = self.constraints.supports.mask();
        for node in self.constraints.free_nodes() {
            let u = &mut self.state.displacement[node];
            let change = (*u - drift) * (factor - 1.0);
            *u += mask.map_or(change, |mask| change.component_mul(&mask[node]));
        }
    }
}

/// The rounding error of a sum of energies, of which `own` is kinetic and elastic (J).
fn rounding(body: &Body, own: f64) -> f64 {
    let free = body.assembly.places.free();
    let (mut sum, mut places) = (0.0, 0.0);
    for (place, &node) in body.assembly.places.nodes().iter().enumerate() {
        let node = node as usize;
        let x = &body.state.x[node];
        sum += body.model.external[node].dot(x).abs();
        if place < free {
            let stiffness = body.assembly.stiffness.diagonal(place).amax();
            let reach = rounding::reach(body, place);
            sum += stiffness * reach * reach;
            places += stiffness * (f64::EPSILON * x.amax()).powi(2);
        }
    }
    // Work of the forces over the rounding errors of positions (Cauchy and Schwarz, as in `rounding`).
    ROUNDING * sum + libm::sqrt(2.0 * own.abs() * places) + places
}
