//! The tear limit of a model: the extrapolation beyond which a tear grows, or beyond which a contact slips or parts.
//!
//! A tear grows if the energy release rate `G` of its tip reaches the toughness `G_c` (A. A. Griffith, "The phenomena
//! of rupture and flow in solids", 1921). Beyond this point, the force no longer grows with the stiffness of the model,
//! because the body gives way. If the tick extrapolated a stiff model beyond this point, the model would overestimate
//! the force, and the next model would take the excess back. The hand would feel a sawtooth at the publication rate.
//!
//! The host therefore publishes, for the tip nearest to its start, `s = sqrt(G)` at the reference, the slope `q` of `s`
//! by the displacements of the handles, and `s_c = sqrt(G_c)`. `G` is quadratic in the displacements, so `s` is linear
//! in them if one load governs. The excess of a displacement `d` is `x = (s + q . d - s_c)+`. If the reference is
//! beyond the limit already (a running tear), the excess is `x = (q . d)+`: the force at the reference is the body's
//! own, and only a further opening counts.
//!
//! The tick replaces `d` by its projection onto the half-space `x = 0` in the metric of the stiffness. With
//! `a = 1 / (q . K^-1 q)`, this projection is `d - a x K^-1 q`, and the wrenches and the energy become
//!
//! ```text
//! w = w_linear + a x q          V = V_linear - a x^2 / 2
//! ```
//!
//! No inverse remains but the number `a`, which the host publishes. Beyond the limit, the stiffness is `K - a q q^T`.
//! This matrix is symmetric and, for this `a`, positive semidefinite: it is the stiffness of a body that yields along
//! `q` alone. The wrench is continuous, and has the potential `V`. Hands that turn back find the whole stiffness below
//! the limit.
//!
//! **Contacts** have limits of the same form, and a model without the limit of a tear may have one of them. Two sides part
//! where the resultant of their normal forces `N + n . d` is zero: `s = 0`, `q = -n`, `s_c = N` (N, N/m). They slip where the
//! resultant of their friction forces `T + t . d` reaches the cone: `s = T`, `q = t - mu n`, `s_c = mu N`. The stiffness of the
//! model is that of contacts that stick. A body that slides is at its limit: further in its direction it yields, and back it
//! sticks. The area has then the unit m/N.
//!
//! The certificate of the cap does not rely on these numbers. A model with a wrong limit gives a wrong force, and no
//! energy that hands have not supplied.

use super::{Deviation, Lead, LocalModel};
use crate::MAX_HANDLES;
use crate::geometry::Vec6;

/// The tear limit of a model. Each handle has its part of the slope
/// ([`HandleReference::tear_slope`](super::HandleReference::tear_slope)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TearLimit {
    /// `s = sqrt(G)` at the reference (sqrt(J/m2)).
    pub root: f64,
    /// `s_c = sqrt(G_c)` (sqrt(J/m2)). Zero if the model has no limit.
    pub critical: f64,
    /// `a = 1 / (q . K^-1 q)` (m2), over the stiffness between all handles. A smaller value leaves a part of the
    /// stiffness along the slope. Zero is always safe.
    pub area: f64,
}

impl TearLimit {
    /// No limit.
    pub fn none() -> Self {
        Self {
            root: 0.0,
            critical: 0.0,
            area: 0.0,
        }
    }

    /// Whether there is a limit.
    pub fn is_some(&self) -> bool {
        self.critical > 0.0
    }

    /// Whether every number is finite and the area is not negative.
    pub(super) fn is_sound(&self) -> bool {
        self.root.is_finite()
            && self.critical.is_finite()
            && self.area.is_finite()
            && self.area >= 0.0
    }

    /// `x` for `q . d`.
    fn excess(&self, along: f64) -> f64 {
        (along - (self.critical - self.root).max(0.0)).max(0.0)
    }
}

/// The additions to the parts of a model that is extrapolated beyond the limit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beyond {
    /// `a x`: the wrench of the springs on each handle is `a x q_i` above the linear wrench.
    pub(super) spring: f64,
    /// The growth of `a x` by the lead of each handle.
    pub(super) lead: f64,
    /// `a x^2 / (2 q . d)`: the springs do this work, times `q_i . d_i`, above the linear work on each handle.
    pub(super) work: f64,
}

impl LocalModel {
    /// `q . d` for displacements of the handles.
    fn along_slope<'a>(&self, displacements: impl Iterator<Item = &'a Vec6>) -> f64 {
        let each = self.handles().zip(displacements);
        each.map(|(handle, displacement)| handle.tear_slope.dot(displacement))
            .fold(0.0, |sum, along| sum + along)
    }

    /// The additions, if the displacements, or the displacements with the `lead` of each handle, are beyond the limit;
    /// `None` otherwise, and for a model without a limit. No `lead` means a lead of zero.
    pub(super) fn beyond_limit(
        &self,
        deviations: &[Deviation; MAX_HANDLES],
        lead: &[Lead],
    ) -> Option<Beyond> {
        let limit = &self.head.tear_limit;
        if !limit.is_some() {
            return None;
        }
        let along = self.along_slope(deviations.iter().map(|deviation| &deviation.displacement));
        let excess = limit.excess(along);
        let further = limit.excess(along + self.along_slope(lead.iter().map(|lead| &lead.step)));
        (excess > 0.0 || further > 0.0).then(|| Beyond {
            spring: limit.area * excess,
            lead: limit.area * (further - excess),
            // If there is an excess, `q . d` is positive and no smaller.
            work: if excess > 0.0 {
                0.5 * limit.area * excess * (excess / along)
            } else {
                0.0
            },
        })
    }
}
