//! The extrapolated wrenches, split into the parts of springs and of dampers, and the energy of the springs. The energy
//! account and the cap need the parts of a model.

use super::{Deviation, HandleReference, LocalModel, clip};
use crate::MAX_HANDLES;
use crate::geometry::{Mat6, Vec3, Vec6};

/// The wrenches on all handles, in parts.
#[derive(Clone, Copy, Debug)]
pub struct Parts {
    /// Wrench of the springs: the reference wrench without the weight, plus the drift, minus the stiffness times the
    /// displacement.
    pub elastic: [Vec6; MAX_HANDLES],
    /// Wrench of the dampers: minus the damping times the velocity, and the change of the springs' wrench by the lead.
    pub viscous: [Vec6; MAX_HANDLES],
    /// Energy that hands at rest could get back (J): the energy at the reference, minus the work of the springs since
    /// then.
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

    /// Mixes two sets of parts of `handles` handles: `1 - fraction` of this one and `fraction` of `other`. The mixed
    /// energy is no less than the energy of the mixed model, for `w^T K^-1 w` is jointly convex in `w` and `K` (S. Boyd
    /// and L. Vandenberghe, "Convex optimization", 2004, example 3.4).
    pub(crate) fn mix(&mut self, other: &Self, fraction: f64, handles: usize) {
        for (mine, theirs) in self.elastic.iter_mut().zip(&other.elastic).take(handles) {
            *mine = *mine * (1.0 - fraction) + theirs * fraction;
        }
        for (mine, theirs) in self.viscous.iter_mut().zip(&other.viscous).take(handles) {
            *mine = *mine * (1.0 - fraction) + theirs * fraction;
        }
        self.stored = self.stored * (1.0 - fraction) + other.stored * fraction;
    }

    /// The parts of the wrench on each handle.
    fn rows(&mut self) -> impl Iterator<Item = RowParts<'_>> {
        let each = self.elastic.iter_mut().zip(&mut self.viscous);
        each.map(|(elastic, viscous)| RowParts { elastic, viscous })
    }
}

/// The lag of a held force behind the motion of a handle. A damper makes up for the lag.
#[derive(Clone, Copy, Debug)]
pub struct Lead {
    /// The fraction of the handle's last step that the stiffness resists in advance: a displacement.
    pub step: Vec6,
    /// The time for which the drift acts in advance, by motion (s).
    pub time: Vec6,
}

impl Lead {
    /// No lag.
    pub fn none() -> Self {
        Self {
            step: Vec6::zeros(),
            time: Vec6::zeros(),
        }
    }
}

/// What a model says of one handle.
struct Row<'a> {
    handle: &'a HandleReference,
    /// Stiffness and damping between the handle and each other one.
    stiffness: &'a [Mat6; MAX_HANDLES],
    damping: &'a [Mat6; MAX_HANDLES],
}

/// The parts of the wrench on one handle.
struct RowParts<'a> {
    elastic: &'a mut Vec6,
    viscous: &'a mut Vec6,
}

impl LocalModel {
    /// The rows of the handles in use.
    fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        let blocks = self.stiffness.iter().zip(&self.damping);
        let all = self.handles().zip(blocks);
        all.map(|(handle, (stiffness, damping))| Row {
            handle,
            stiffness,
            damping,
        })
    }

    /// The extrapolated wrenches, split into the parts of springs and of dampers, after the drift has acted for `ahead`
    /// (s).
    pub fn parts(
        &self,
        deviations: &[Deviation; MAX_HANDLES],
        lead: &[Lead; MAX_HANDLES],
        ahead: f64,
    ) -> Parts {
        let mut parts = Parts::none();
        let n = usize::from(self.head.handle_count);
        let motions = || deviations.iter().zip(lead);
        let mut work = 0.0;
        for ((row, out), (own, own_lead)) in self.rows().zip(parts.rows()).zip(motions()) {
            let drift = row.handle.drift.stacked();
            let begin = row.handle.unweighted() + drift * ahead;
            *out.viscous = drift.component_mul(&own_lead.time);
            let mut fall = Vec6::zeros();
            let blocks = row.stiffness.iter().zip(row.damping);
            for ((k, b), (deviation, lead)) in blocks.zip(motions()).take(n) {
                fall += k * deviation.displacement;
                *out.viscous -= b * deviation.velocity + k * lead.step;
            }
            *out.elastic = begin - fall;
            // The force is linear along the displacement, so the mean force does the work.
            work += (begin - fall * 0.5).dot(&own.displacement);
        }
        if let Some(beyond) = self.beyond_limit(deviations, lead) {
            let moved = self.handles().zip(deviations);
            for (out, (handle, own)) in parts.rows().zip(moved) {
                *out.elastic += handle.tear_slope * beyond.spring;
                *out.viscous += handle.tear_slope * beyond.viscous;
                work += handle.tear_slope.dot(&own.displacement) * beyond.work;
            }
        }
        parts.stored = (self.head.energy - work).max(0.0);
        let outs = parts.elastic.iter_mut().zip(&mut parts.viscous);
        for ((elastic, viscous), handle) in outs.zip(self.handles()) {
            if handle.contact == Vec3::zeros() {
                continue;
            }
            let mut force = Vec3::new(elastic.x, elastic.y, elastic.z);
            let whole = force.norm_squared();
            if clip(&mut force, &handle.contact) {
                // The clipped part of the force gives no energy back, and air does not damp.
                parts.stored *= force.norm_squared() / whole;
                (elastic.x, elastic.y, elastic.z) = (force.x, force.y, force.z);
                *viscous = Vec6::zeros();
            }
        }
        parts
    }

    /// Work of the springs from the reference to the present poses (J), after the drift has acted for `ahead` (s).
    pub(crate) fn work(&self, deviations: &[Deviation; MAX_HANDLES], ahead: f64) -> f64 {
        let works = self.works(deviations, ahead);
        works.iter().fold(0.0, |sum, work| sum + work)
    }

    /// The part of each handle in [`LocalModel::work`] (J).
    pub(crate) fn works(
        &self,
        deviations: &[Deviation; MAX_HANDLES],
        ahead: f64,
    ) -> [f64; MAX_HANDLES] {
        let n = usize::from(self.head.handle_count);
        let mut works = [0.0; MAX_HANDLES];
        for ((row, own), work) in self.rows().zip(deviations).zip(&mut works) {
            let mut mean = row.handle.unweighted() + row.handle.drift.stacked() * ahead;
            for (k, deviation) in row.stiffness.iter().zip(deviations).take(n) {
                mean -= k * deviation.displacement * 0.5;
            }
            *work = mean.dot(&own.displacement);
        }
        if let Some(beyond) = self.beyond_limit(deviations, &[]) {
            for ((handle, own), work) in self.handles().zip(deviations).zip(&mut works) {
                *work += handle.tear_slope.dot(&own.displacement) * beyond.work;
            }
        }
        works
    }
}
