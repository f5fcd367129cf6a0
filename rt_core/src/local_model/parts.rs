//! The extrapolated wrenches with what springs hold and what dampers do told apart, and the energy behind the springs:
//! what passivity needs to know of a model.

use super::{Deviation, LocalModel, clip};
use crate::MAX_HANDLES;
use crate::geometry::{Vec3, Vec6};

/// The wrenches on all handles, in parts.
#[derive(Clone, Copy, Debug)]
pub struct Parts {
    /// What springs hold: the reference's wrench without the weight, drifted, less the stiffness times the displacement.
    pub elastic: [Vec6; MAX_HANDLES],
    /// What dampers do: less the damping times the velocity.
    pub viscous: [Vec6; MAX_HANDLES],
    /// Energy that hands at rest could get back (J): that of the reference, less the work of the springs from there.
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

    /// A mixture: this one's fraction falls to `1 - fraction`. Its energy is no less than that of the mixed model, for
    /// `w^T K^-1 w` is convex in both (S. Boyd and L. Vandenberghe, "Convex optimization", 2004, example 3.4).
    pub(crate) fn mix(&mut self, other: &Self, fraction: f64) {
        for (mine, theirs) in self.elastic.iter_mut().zip(&other.elastic) {
            *mine = *mine * (1.0 - fraction) + theirs * fraction;
        }
        for (mine, theirs) in self.viscous.iter_mut().zip(&other.viscous) {
            *mine = *mine * (1.0 - fraction) + theirs * fraction;
        }
        self.stored = self.stored * (1.0 - fraction) + other.stored * fraction;
    }
}

impl LocalModel {
    /// The same wrenches, what springs hold and what dampers do told apart, where the drift has gone on for `ahead` (s).
    /// `lead` is a displacement of each handle that the stiffness resists as a damper would: a fraction of its last step.
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
        let handles = self.handles.iter().zip(deviations);
        let mut work = 0.0;
        for (((stiffness, damping), (elastic, viscous)), (handle, own)) in
            rows.zip(outs).zip(handles).take(n)
        {
            let begin = handle.unweighted() + handle.drift.stacked() * ahead;
            let mut fall = Vec6::zeros();
            let blocks = stiffness.iter().zip(damping);
            for ((k, b), (deviation, lead)) in blocks.zip(deviations.iter().zip(lead)).take(n) {
                fall += k * deviation.displacement;
                *viscous -= b * deviation.velocity + k * lead;
            }
            *elastic = begin - fall;
            // The force is linear along the displacement, so its mean counts.
            work += (begin - fall * 0.5).dot(&own.displacement);
        }
        parts.stored = (self.energy - work).max(0.0);
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

    /// Work of the springs from the reference to where the handles are (J), where the drift has gone on for `ahead` (s).
    pub(crate) fn work(&self, deviations: &[Deviation; MAX_HANDLES], ahead: f64) -> f64 {
        let n = usize::from(self.handle_count);
        let handles = self.handles.iter().zip(deviations);
        let mut work = 0.0;
        for (row, (handle, own)) in self.stiffness.iter().zip(handles).take(n) {
            let mut mean = handle.unweighted() + handle.drift.stacked() * ahead;
            for (k, deviation) in row.iter().zip(deviations).take(n) {
                mean -= k * deviation.displacement * 0.5;
            }
            work += mean.dot(&own.displacement);
        }
        work
    }
}
