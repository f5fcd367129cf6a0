//! The tear limit of a model: the extrapolation beyond which a tear grows, or beyond which a contact parts or closes.
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
//! where the resultant of their normal forces `N + n . d` is zero: `s = 0`, `q = -n`, `s_c = N` (N, N/m). The area has then the
//! unit m/N.
//!
//! **A touch** is a contact that closes before the next model comes. Its limit stiffens the model, `a < 0`: hands that move by
//! `q . d = s_c` close the gap, and further on feel the spring `-a` and its damper `-a t` along `q`, with the time `t`. The
//! opposite signs give the same wrench and potential. The damper is never stronger than the spring: it comes in without a step,
//! and a hand that leaves is not pulled.
//!
//! A model that is followed by another one while it is beyond the limit of a contact hands the spring on that it has there, and
//! the damper of a touch: the force passes from one model to the next by the stiffness that the hands met last. A tear hands nothing
//! on, because the next model finds the tip elsewhere.
//!
//! The certificate of the cap does not rely on these numbers. A model with a wrong limit gives a wrong force, and no
//! energy that hands have not supplied.

use super::{Deviation, Lead, LocalModel, largest, outer};
use crate::MAX_HANDLES;
use crate::geometry::{Pose, Twist, Vec6};

/// The tear limit of a model. Each handle has its part of the slope
/// ([`HandleReference::tear_slope`](super::HandleReference::tear_slope)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TearLimit {
    /// `s = sqrt(G)` at the reference (sqrt(J/m2)). Of a touch `-t` (s): no spring stretches before the gap is closed.
    pub root: f64,
    /// `s_c = sqrt(G_c)` (sqrt(J/m2)). Zero if the model has no limit.
    pub critical: f64,
    /// `a = 1 / (q . K^-1 q)` (m2), over the stiffness between all handles. A smaller value leaves a part of the
    /// stiffness along the slope. Zero is always safe. Negative for a touch, whose stiffness is `-a`.
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

    /// Whether the limit is that of a contact that closes.
    pub fn is_touch(&self) -> bool {
        self.is_some() && self.area < 0.0
    }

    /// Whether the limit is that of contacts, of which no spring stretches at the reference.
    fn is_of_contacts(&self) -> bool {
        self.is_some() && self.root <= 0.0
    }

    /// Whether every number is finite, and the area is not negative but for a touch, whose gap is open and whose time is not
    /// negative.
    pub(super) fn is_sound(&self) -> bool {
        self.root.is_finite()
            && self.critical.is_finite()
            && self.area.is_finite()
            && (self.area >= 0.0 || (self.critical > 0.0 && self.root <= 0.0))
    }

    /// `x` for `q . d`.
    fn excess(&self, along: f64) -> f64 {
        let left = if self.is_touch() {
            self.critical
        } else {
            (self.critical - self.root).max(0.0)
        };
        (along - left).max(0.0)
    }

    /// The force of the damper of a touch along the slope at this excess and its rate: at most that of the spring.
    fn damper(&self, excess: f64, rate: f64) -> f64 {
        let most = -self.area * excess;
        if self.is_touch() {
            (self.damping() * rate).max(-most).min(most)
        } else {
            0.0
        }
    }

    /// The damping along the slope (N s/m for a slope without unit), while the excess is positive.
    fn damping(&self) -> f64 {
        if self.is_touch() {
            self.area * self.root
        } else {
            0.0
        }
    }
}

/// The additions to the parts of a model that is extrapolated beyond the limit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beyond {
    /// `a x`: the wrench of the springs on each handle is `a x q_i` above the linear wrench.
    pub(super) spring: f64,
    /// The growth of `a x` by the lead of each handle, less the force of the damper.
    pub(super) viscous: f64,
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
        let speed = if excess > 0.0 && limit.is_touch() {
            let moves = self.handles().zip(deviations);
            moves.fold(0.0, |sum, (handle, own)| {
                let velocity = own.velocity + handle.twist.stacked();
                sum + handle.tear_slope.dot(&velocity)
            })
        } else {
            0.0
        };
        let further = limit.excess(along + self.along_slope(lead.iter().map(|lead| &lead.step)));
        (excess > 0.0 || further > 0.0).then(|| Beyond {
            spring: limit.area * excess,
            viscous: limit.area * (further - excess) - limit.damper(excess, speed),
            // If there is an excess, `q . d` is positive and no smaller. The damper does no work that is stored.
            work: if excess > 0.0 {
                0.5 * limit.area * excess * (excess / along)
            } else {
                0.0
            },
        })
    }

    /// Bounds the damper of a touch such that each handle's own damping with it is at most `most` (N s/m, N m s/rad) of its device.
    pub(crate) fn bound_touch(&mut self, most: impl Fn(u8) -> [f64; 2]) {
        if !self.head.tear_limit.is_touch() {
            return;
        }
        let mut damping = self.head.tear_limit.damping();
        let handles = usize::from(self.head.handle_count);
        let own = self.damping.iter().enumerate().zip(&self.handles);
        for ((i, row), handle) in own.take(handles) {
            let Some(block) = row.get(i) else { continue };
            let slope = outer(&handle.tear_slope, &handle.tear_slope);
            let each = largest(block).into_iter().zip(largest(&slope));
            for ((found, slope), most) in each.zip(most(handle.device)) {
                if slope > 0.0 {
                    damping = damping.min(((most - found) / slope).max(0.0));
                }
            }
        }
        let limit = &mut self.head.tear_limit;
        limit.root = damping / limit.area;
    }

    /// Adds a fraction of the spring and the damper of a limit of contacts that is exceeded to stiffness and damping. `limited` is
    /// the model that has it, and `fraction` is that of `limited` in this [mix](Self::mix): a mix of bounded models is bounded.
    pub(crate) fn hand_on(&mut self, limited: &Self, fraction: f64, devices: &[(Pose, Twist)]) {
        let limit = &limited.head.tear_limit;
        let deviations = limited.deviations(devices);
        let along =
            || limited.along_slope(deviations.iter().map(|deviation| &deviation.displacement));
        if !limit.is_of_contacts() || limit.excess(along()) == 0.0 {
            return;
        }
        let rows = self.stiffness.iter_mut().zip(&mut self.damping);
        for ((stiffness, damping), own) in rows.zip(limited.handles()) {
            let blocks = stiffness.iter_mut().zip(damping);
            for ((k, b), other) in blocks.zip(limited.handles()) {
                let slopes = outer(&own.tear_slope, &other.tear_slope);
                *k -= slopes * (fraction * limit.area);
                *b += slopes * (fraction * limit.damping());
            }
        }
    }
}
