//! A bound on the energy that a step may leave.
//!
//! Implicit Euler, solved to its end, takes energy from any body. TR-BDF2 promises that for linear ones only,
//! and one linearization promises nothing where a step is so long that it does not hold: a kick may then be
//! given back many times over. Each of them is checked here, and taken in a safer way where it fails, so that
//! what no hand puts in never comes (after Dinev, Liu and Kavan, "Stabilizing integrators for real-time
//! physics", 2018, who blend with implicit Euler by the energy).

use super::{Body, rounding};
use crate::Vec3;

/// Fraction of kinetic and elastic energy that a step may regain. A scheme of second order swings about the right
/// energy, and must be let: half of the hundredth that is promised.
const SLACK: f64 = 0.005;
/// Energies are known to this fraction of stiffness times the length of edges squared, and of the loads' work.
const ROUNDING: f64 = 1e-14;
/// A kick of a thousand cells in a step, in cells that resist with the fourth power.
const MOST_HALVINGS: usize = 30;
/// Halvings that may bring nothing: a body that turns cells over has energy on the way, and a hand that tears at it
/// brings energy that no halving takes away.
const MOST_MISSES: usize = 4;

/// What a body's energy may be after the next step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Guard {
    /// Energy after the last step (J): another one now means that the body was changed from outside.
    last: f64,
    /// The bound (J), but for the work of hands.
    limit: f64,
}

/// A motion held back as far as energy asks for it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HeldBack {
    /// Energy where it leads (J).
    pub(crate) energy: Energy,
    /// The fraction of it that is left; 1 is the rule.
    pub(crate) kept: f64,
    /// Whether shorter ones were looked at after this one, so that what came of the last look is of another.
    pub(crate) returned: bool,
}

/// Energy of a body (J).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Energy {
    /// Kinetic and elastic.
    own: f64,
    /// With that of the loads; infinite where it is not a number.
    total: f64,
}

impl Energy {
    /// At positions `x` (m) and velocities `v` (m/s) by node.
    pub(crate) fn of(body: &Body, x: &[Vec3], v: impl Iterator<Item = Vec3>) -> Self {
        let kinetic: f64 = v
            .zip(&body.model.mass)
            .map(|(v, mass)| 0.5 * mass * v.norm_squared())
            .sum();
        Self::new(
            kinetic + body.elastic_energy_at(x),
            body.load_potential_at(x),
        )
    }

    /// Kinetic and elastic energy together, and that of the loads (J).
    pub(crate) fn new(own: f64, loads: f64) -> Self {
        let total = own + loads;
        Self {
            own,
            total: if total.is_nan() { f64::INFINITY } else { total },
        }
    }

    pub(crate) fn now(body: &Body) -> Self {
        Self::of(body, &body.state.x, body.state.v.iter().copied())
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
    /// Before a step, from the energy as it is.
    pub(crate) fn begin(&mut self, before: Energy) {
        if before.total.to_bits() != self.last.to_bits() {
            self.limit = before.total + SLACK * before.own;
        }
    }

    /// Whether a step may end at `after`, when hands have put in at most `work` (J).
    pub(crate) fn allows(&self, body: &Body, after: Energy, work: f64) -> bool {
        let limit = self.limit + work;
        // Rounding costs a pass over the body: only where it decides.
        after.total <= limit || after.total <= limit + rounding(body, after.own)
    }

    /// Halves the displacement of `body` over a step until it may end where that leads, when hands have put in at
    /// most `work` (J); where no half will do, the one with the least energy is left. `ahead` gives the energy after
    /// the displacement as it is.
    ///
    /// A body that stays where it is gains nothing, so some fraction will do unless hands tear it along. One that
    /// nothing holds keeps its momentum: the motion of its centre of mass is not touched.
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
                // What nothing tears stays at the least where it is, with the energy that it had.
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

    /// The step is taken: what is lost may not come back, whatever hands have put in may.
    pub(crate) fn end(&mut self, after: Energy, work: f64) {
        self.last = after.total;
        self.limit = (self.limit + work).min(after.total + SLACK * after.own);
    }
}

impl Body {
    /// Holds back so much of the displacement over a step of `h` that the body ends with no more energy than it
    /// had and hands have put in, at most `work` (J). Returns the fraction held back; 0 is the rule.
    pub(crate) fn hold_back(&mut self, h: f64, work: f64) -> f64 {
        let mut guard = self.assembly.guard;
        guard.begin(Energy::now(self));
        let held = guard.hold_back(self, work, |body| body.energy_ahead(h));
        guard.end(held.energy, work);
        self.assembly.guard = guard;
        1.0 - held.kept
    }

    /// Energy after a step of `h` by the displacement as it is.
    fn energy_ahead(&mut self, h: f64) -> Energy {
        let mut ahead = core::mem::take(&mut self.assembly.ahead);
        for ((ahead, x), u) in ahead
            .iter_mut()
            .zip(&self.state.x)
            .zip(&self.assembly.displacement)
        {
            *ahead = x + u;
        }
        let energy = Energy::of(
            self,
            &ahead,
            self.assembly.displacement.iter().map(|u| u / h),
        );
        self.assembly.ahead = ahead;
        energy
    }

    /// How far the centre of mass goes in the step (m), where nothing but itself decides that.
    fn free_drift(&self) -> Vec3 {
        if !self.constraints.handles.is_empty() || !self.constraints.supports.list.is_empty() {
            return Vec3::zeros();
        }
        let moved = self.assembly.displacement.iter().zip(&self.model.mass);
        moved.map(|(u, mass)| u * *mass).sum::<Vec3>() / self.total_mass()
    }

    /// Multiplies what nothing prescribes of the displacement, less `drift`.
    fn scale_motion(&mut self, factor: f64, drift: &Vec3) {
        let free = self.assembly.stiffness.free();
        let mask = self.constraints.supports.mask();
        for (node, u) in self.assembly.displacement[..free].iter_mut().enumerate() {
            let change = (*u - drift) * (factor - 1.0);
            *u += mask.map_or(change, |mask| change.component_mul(&mask[node]));
        }
    }
}

/// What cannot be told from a sum of energies of which `own` is not that of loads (J).
fn rounding(body: &Body, own: f64) -> f64 {
    let free = body.assembly.stiffness.free();
    let (mut sum, mut places) = (0.0, 0.0);
    for (node, x) in body.state.x.iter().enumerate() {
        sum += body.model.external[node].dot(x).abs();
        if node < free {
            let stiffness = body.assembly.stiffness.diagonal(node).amax();
            let reach = rounding::reach(body, node);
            sum += stiffness * reach * reach;
            places += stiffness * (f64::EPSILON * x.amax()).powi(2);
        }
    }
    // Forces over what rounding takes from positions (Cauchy and Schwarz, as in `rounding`).
    ROUNDING * sum + libm::sqrt(2.0 * own.abs() * places) + places
}
