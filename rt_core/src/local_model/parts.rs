//! The extrapolated wrenches with what springs hold and what dampers do told apart, and the energy behind the springs:
//! what passivity needs to know of a model.

use super::{Deviation, LocalModel, clip};
use crate::MAX_HANDLES;
use crate::geometry::{Vec3, Vec6};

/// The wrenches on all handles, in parts.
#[derive(Clone, Copy, Debug)]
pub struct Parts {
    /// What springs hold: the reference's wrench without the weight, less the stiffness times the displacement.
    pub elastic: [Vec6; MAX_HANDLES],
    /// What dampers do: less the damping times the velocity.
    pub viscous: [Vec6; MAX_HANDLES],
    /// Energy that hands at rest could get back (J).
    pub stored: f64,
}

impl Parts {
    /// No wrench, no energy.
    pub fn none() -> Self {
        Self {
            elastic: [Vec6::zeros(); MAX_HANDLES],
            viscous: [Vec6::zeros(); MAX_HANDLES],
            stored: 0.0,
        }
    }

    /// A mixture: this one's share falls to `1 - share`. Its energy is no less than that of the mixed model, for
    /// `w^T K^-1 w` is convex in both (S. Boyd and L. Vandenberghe, "Convex optimization", 2004, example 3.4).
    pub(crate) fn mix(&mut self, other: &Self, share: f64) {
        for (mine, theirs) in self.elastic.iter_mut().zip(&other.elastic) {
            *mine = *mine * (1.0 - share) + theirs * share;
        }
        for (mine, theirs) in self.viscous.iter_mut().zip(&other.viscous) {
            *mine = *mine * (1.0 - share) + theirs * share;
        }
        self.stored = self.stored * (1.0 - share) + other.stored * share;
    }
}

impl LocalModel {
    /// The same wrenches, what springs hold and what dampers do told apart, where the drift has gone on for `ahead` (s).
    /// `lead` is a displacement of each handle that the stiffness resists as a damper would: a share of its last step.
    pub fn parts(
        &self,
        deviations: &[Deviation; MAX_HANDLES],
        lead: &[Vec6; MAX_HANDLES],
        ahead: f64,
    ) -> Parts {
        let mut parts = Parts::none();
        let n = usize::from(self.handle_count);
        let rows = self.stiffness.iter().zip(&self.damping);
        let outs = parts.elastic.iter_mut().zip(&mut parts.viscous);
        for (((stiffness, damping), (elastic, viscous)), handle) in
            rows.zip(outs).zip(&self.handles).take(n)
        {
            let mut reference = handle.unweighted() + handle.drift.stacked() * ahead;
            let mut fall = Vec6::zeros();
            let blocks = stiffness.iter().zip(damping).zip(deviations);
            let others = self.handles.iter().zip(lead);
            for (((k, b), deviation), (other, lead)) in blocks.zip(others).take(n) {
                let own = other.twist.stacked();
                reference += b * own;
                fall += k * deviation.displacement;
                *viscous -= b * (deviation.velocity + own) + k * lead;
            }
            *elastic = reference - fall;
        }
        parts.stored = (self.energy + self.change_of_energy(deviations, ahead)).max(0.0);
        for ((elastic, viscous), handle) in parts
            .elastic
            .iter_mut()
            .zip(&mut parts.viscous)
            .zip(self.handles())
        {
            if handle.contact == Vec3::zeros() {
                continue;
            }
            let mut force = Vec3::new(elastic.x, elastic.y, elastic.z);
            let whole = force.norm_squared();
            if clip(&mut force, &handle.contact) {
                // What is not pushed with cannot be got back, and the air does not damp.
                parts.stored *= force.norm_squared() / whole;
                (elastic.x, elastic.y, elastic.z) = (force.x, force.y, force.z);
                *viscous = Vec6::zeros();
            }
        }
        parts
    }

    /// By how much the energy that could be got back differs from that at the reference (J): less the work of the
    /// force on the way, which is linear, so that its mean counts.
    ///
    /// The drift goes on along the handles' path `v0 s`, on which its mean counts, too; off the path it has its whole:
    /// `-p s . (d - v0 s / 2)`.
    pub(crate) fn change_of_energy(
        &self,
        deviations: &[Deviation; MAX_HANDLES],
        ahead: f64,
    ) -> f64 {
        let n = usize::from(self.handle_count);
        let mut change = 0.0;
        let rows = self.stiffness.iter().zip(&self.damping);
        let handles = self.handles.iter().zip(deviations);
        for ((stiffness, damping), (handle, deviation)) in rows.zip(handles).take(n) {
            let mut mean = handle.unweighted();
            let blocks = stiffness.iter().zip(damping).zip(deviations);
            for (((k, b), deviation), other) in blocks.zip(&self.handles).take(n) {
                mean += b * other.twist.stacked() - k * deviation.displacement * 0.5;
            }
            let path = handle.twist.stacked() * (0.5 * ahead);
            let off = deviation.displacement - path;
            change -= mean.dot(&deviation.displacement) + handle.drift.stacked().dot(&off) * ahead;
        }
        change
    }
}
