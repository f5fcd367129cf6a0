//! The sites between messages: how the surface yields, goes on and relaxes.
//!
//! **Yield.** With `W` the elastic compliance, `f` the forces at the sites and `b` the damping time, the displacement `u` since
//! the message obeys `u + r = W (f - f0) + b v`, with the viscous stretch `r' = (b / t) u' - r / t`: a standard linear solid, a
//! spring and a Maxwell arm in parallel, which is passive. Its relaxation time `t` is at least two milliseconds, and long enough for
//! the transient stiffness to stay below what the device can render. Implicit Euler gives the places of the sites as an affine
//! function of the forces.
//!
//! **Drift.** A surface goes on with the part of its velocity that inertia keeps: a tap would otherwise meet a dent that has stopped. Nothing but
//! inertia holds a loose piece, whose compliance is that of its inertia over one publication. A hand that carries the piece would feel its sites
//! stay behind, and its friction would slip and be lost when the hand stops.

use super::patch::PatchHead;
use super::{MAX_SITES, Tool};
use crate::geometry::Vec3;

/// Least relaxation time of the viscous stretch (s): two ticks of the usual loop.
const RELAXES: f64 = 2e-3;
/// The publication periods after which the sites of a late host drift no further, and the least such time (s): a fast host may be as late as a
/// slow one.
const DRIFTS: f64 = 3.0;
const LEAST_DRIFT: f64 = 0.02;
/// A viscous stretch (m) that no device renders: 30 pN at 3 kN/m.
const AT_REST: f64 = 1e-14;

/// A site between ticks.
#[derive(Clone, Copy, Debug)]
pub(super) struct SiteState {
    /// Elastic displacement since the message (m): `u`.
    pub(super) stretch: Vec3,
    /// Viscous stretch (m): `r`.
    pub(super) viscous: Vec3,
    /// The difference to the place of the message when it came (m), which fades.
    pub(super) offset: Vec3,
    /// `b v - W f0` (m), with the velocity without the drift.
    pub(super) bias: Vec3,
}

impl SiteState {
    pub(super) const ZERO: Self = Self {
        stretch: Vec3::new(0.0, 0.0, 0.0),
        viscous: Vec3::new(0.0, 0.0, 0.0),
        offset: Vec3::new(0.0, 0.0, 0.0),
        bias: Vec3::new(0.0, 0.0, 0.0),
    };
}

/// How the viscous stretch of a patch relaxes in a tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct Relaxation {
    /// The fraction of the viscous stretch that is left after a tick.
    pub(super) left: f64,
    /// The viscous stretch by an elastic displacement in the tick.
    pub(super) gain: f64,
}

/// The time (s) after which the sites of a patch drift no further.
pub(super) fn most_drift(patch: &PatchHead) -> f64 {
    (DRIFTS * patch.period).max(LEAST_DRIFT)
}

impl Tool {
    /// The time (s) for which the sites of a patch have drifted, if it is the newest. It is negative before the first tick of a patch that is
    /// not older than this tick.
    pub(super) fn drift_time(&self, patch: &PatchHead) -> f64 {
        self.age.min(most_drift(patch))
    }

    /// How the viscous stretch of the patch relaxes. The transient stiffness `K (1 + gain)` is at most that of the device's stiffest
    /// spring, and the damping is at most that which the device can render.
    pub(super) fn relaxation(&self) -> Relaxation {
        let (head, config) = (&self.patch.head, &self.config);
        let most = config.stiffest / head.stiffness - 1.0;
        let damping = head.damping.min(config.most_damping / head.stiffness);
        if most <= 0.0 || damping <= 0.0 {
            return Relaxation {
                left: 0.0,
                gain: 0.0,
            };
        }
        let time = RELAXES.max(damping / most - config.period);
        Relaxation {
            left: time / (time + config.period),
            gain: damping / (time + config.period),
        }
    }

    /// The sites without contact forces (m).
    pub(super) fn free(&self) -> [Vec3; MAX_SITES] {
        let Relaxation { left, gain } = self.relaxation;
        let mut free = [Vec3::zeros(); MAX_SITES];
        let count = usize::from(self.patch.head.site_count);
        let drift_time = self.drift_time(&self.patch.head);
        let each = self.sites.iter().zip(&self.patch.sites);
        for (free, (state, site)) in free.iter_mut().zip(each).take(count) {
            let stretch = state.bias - state.viscous * left + state.stretch * gain;
            *free = site.drifted(drift_time) + state.offset * self.fade + stretch / (1.0 + gain);
        }
        free
    }

    /// The sites under contact forces (m).
    pub(super) fn loaded(
        &self,
        free: &[Vec3; MAX_SITES],
        forces: &[Vec3; MAX_SITES],
        fraction: f64,
    ) -> [Vec3; MAX_SITES] {
        let mut places = *free;
        if self.is_rigid {
            return places;
        }
        let count = usize::from(self.patch.head.site_count);
        let mut loaded = heapless::Vec::<(usize, Vec3), MAX_SITES>::new();
        for (force, at) in forces.iter().zip(0..count) {
            if *force != Vec3::zeros() {
                // There is room for all sites.
                let _ = loaded.push((at, force * fraction));
            }
        }
        for (place, row) in places.iter_mut().zip(&self.patch.compliance).take(count) {
            for (at, force) in &loaded {
                *place += row.get(*at).map_or(Vec3::zeros(), |block| block * force);
            }
        }
        places
    }

    /// The largest way of a site since the last tick if the contact forces stay, with the sites without contact forces (m).
    pub(super) fn most_way(&self, free: &[Vec3; MAX_SITES]) -> f64 {
        let count = usize::from(self.patch.head.site_count);
        let each = free.iter().zip(&self.unloaded).take(count);
        each.map(|(place, before)| (place - before).norm())
            .fold(0.0, f64::max)
    }

    /// Ends a tick: the displacement and the viscous stretch of each site.
    pub(super) fn relax(&mut self, places: &[Vec3; MAX_SITES]) {
        let Relaxation { left, gain } = self.relaxation;
        let count = usize::from(self.patch.head.site_count);
        let drift_time = self.drift_time(&self.patch.head);
        let each = self.sites.iter_mut().zip(&self.patch.sites).zip(places);
        for ((state, site), place) in each.take(count) {
            let stretch = place - site.drifted(drift_time) - state.offset * self.fade;
            state.viscous = state.viscous * left + (stretch - state.stretch) * gain;
            state.stretch = stretch;
        }
        let mut each = self.sites.iter_mut().take(count);
        let is_free = self.contacts.is_empty();
        self.is_at_rest = is_free && each.all(|state| state.viscous.amax() < AT_REST);
        if self.is_at_rest {
            for state in self.sites.iter_mut().take(count) {
                (state.viscous, state.stretch) = (Vec3::zeros(), state.bias);
            }
        }
    }
}
