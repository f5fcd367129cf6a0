//! The local model: the linearized force of one connected body on all its handles together.
//!
//! The host publishes, for a state that held at [`LocalModel::time_ns`], each handle's pose, twist and
//! wrench on the hand, the tangent stiffness and damping between every pair of handles, so that two
//! hands on one sheet feel each other, and the drift of each wrench. Between publications the tick extrapolates:
//!
//! `w_i = w0_i + p_i s - sum_j (K_ij d_j + B_ij e_j)`
//!
//! with `d_j` the handle's displacement since the reference (translation; rotation `log(R R0^T)`),
//! `e_j` its velocity minus the published one, and `s` the age of the model, levelled off ([`LocalModel::ahead`]). How
//! `K` and `B` come from the finite elements, and why they are not the Schur complement of the step's matrix, stands
//! with the condensation in `physics`.
//!
//! **Drift.** A hand that moves steadily finds a body that moves already, and stiffness alone takes all of the hand's
//! displacement for news. Where `w0'` is the rate of the wrench along the path `d = v0 s` that the handles are on, the
//! extrapolation from that path is `w0 + w0' s - K (d - v0 s) - B e`. It is the same as above with
//! `p = w0' + K v0`: the part of the wrench's rate that stiffness does not foretell. A body that answers at once has
//! no drift.

mod parts;

use crate::geometry::{Mat6, Pose, Twist, Vec3, Vec6, Wrench};
use crate::{MAX_DEVICES, MAX_HANDLES};

pub use parts::Parts;

/// One handle's place in a [`LocalModel`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandleReference {
    /// Index of the device that holds it.
    pub device: u8,
    /// Pose at the reference state (world axes).
    pub pose: Pose,
    /// Twist at the reference state (world axes).
    pub twist: Twist,
    /// Wrench on the hand at the reference state, the handle's own inertia left out.
    pub wrench: Wrench,
    /// Outward normal of a contact that can push the hand but not pull it; zero where the handle is held for good.
    pub contact: Vec3,
    /// The part of the wrench's force that is the body's weight and stays the same wherever the handle goes (N): a
    /// potential, which gives back what it was given. Zero is always safe.
    pub weight: Vec3,
    /// Rate of the wrench beside what the stiffness makes of the twist (N/s, N m/s): `w0' + K v0`. Zero is always safe.
    pub drift: Wrench,
}

impl HandleReference {
    /// At the origin, at rest, no wrench, held by the first device.
    pub fn zero() -> Self {
        Self {
            device: 0,
            pose: Pose::identity(),
            twist: Twist::zero(),
            wrench: Wrench::zero(),
            contact: Vec3::zeros(),
            weight: Vec3::zeros(),
            drift: Wrench::zero(),
        }
    }

    fn is_finite(&self) -> bool {
        self.pose.is_finite()
            && self.twist.is_finite()
            && self.wrench.is_finite()
            && self.drift.is_finite()
            && self
                .contact
                .iter()
                .chain(self.weight.iter())
                .all(|x| x.is_finite())
    }

    /// The wrench without the weight.
    pub fn unweighted(&self) -> Vec6 {
        let mut wrench = self.wrench;
        wrench.force -= self.weight;
        wrench.stacked()
    }

    /// The wrench at the reference pose and twist after a drift of `ahead` (s).
    pub fn after(&self, ahead: f64) -> Vec6 {
        self.wrench.stacked() + self.drift.stacked() * ahead
    }
}

/// Blocks between every pair of handles; rows first.
pub type PairBlocks = [[Mat6; MAX_HANDLES]; MAX_HANDLES];

/// The linearized force of one body on its handles. Plain data of fixed size, made to travel in a ring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalModel {
    /// Counts the models of this body, from one; a gap tells the reader that some were lost.
    pub sequence: u64,
    /// Counts the changes of topology that the model knows of.
    pub epoch: u32,
    /// When the linearized state held (ns, the tick's clock).
    pub time_ns: u64,
    /// The publication period (s).
    pub period: f64,
    /// How far ahead the model is to be good for (s), which it was condensed for: the age at which the next is due.
    pub horizon: f64,
    /// Energy that hands at rest could get back from the reference state (J), without the weight: what the body itself
    /// stores, and no more than the tangent's `w^T K^-1 w / 2` of the wrenches on all handles. What bounds the energy of
    /// a body needs it; zero is always safe.
    pub energy: f64,
    /// Energy that the body has released of its own beyond what the first model told of (J), since then: a strip that
    /// sags further gives its weight's potential to the hands. It only grows. Zero is always safe.
    pub released: f64,
    /// How many of `handles` are in use.
    pub handle_count: u8,
    /// The handles, the first `handle_count` of them in use.
    pub handles: [HandleReference; MAX_HANDLES],
    /// Tangent stiffness between handles (N/m, N/rad, N m/m, N m/rad).
    pub stiffness: PairBlocks,
    /// Damping between handles, in the same layout times seconds.
    pub damping: PairBlocks,
}

/// Where a model's handles are now, relative to its reference: `d` and `e` of the extrapolation.
#[derive(Clone, Copy, Debug)]
pub struct Deviation {
    /// Displacement since the reference, translation then rotation.
    pub displacement: Vec6,
    /// Velocity minus the reference velocity.
    pub velocity: Vec6,
}

impl Deviation {
    fn zero() -> Self {
        Self {
            displacement: Vec6::zeros(),
            velocity: Vec6::zeros(),
        }
    }
}

/// The largest sum of absolute entries in a row of the translational block, and of the rotational one: no eigenvalue
/// is larger.
fn largest(block: &Mat6) -> [f64; 2] {
    let sums = |first: usize| {
        let part = block.fixed_view::<3, 3>(first, first);
        let rows = part
            .row_iter()
            .map(|row| row.iter().fold(0.0, |sum, x| sum + x.abs()));
        rows.fold(0.0, f64::max)
    };
    [sums(0), sums(3)]
}

/// Takes from `force` what would pull against `normal`; says whether there was such a part.
fn clip(force: &mut Vec3, normal: &Vec3) -> bool {
    let along = force.dot(normal);
    if along < 0.0 {
        *force -= normal * along;
    }
    along < 0.0
}

/// Why a local model cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelFault {
    /// A number in it is not finite, or its period or horizon is not positive.
    NotFinite,
    /// It names more handles than a body can have, none, or a device that does not exist; or handles other
    /// than those of the model in use, though the topology did not change.
    Handles,
    /// It is not newer than the one in use, or knows of fewer changes of topology.
    Outdated,
    /// The time that it speaks of has not come.
    ToCome,
}

impl LocalModel {
    /// A model without handles.
    pub fn empty() -> Self {
        Self {
            sequence: 0,
            epoch: 0,
            time_ns: 0,
            period: 1.0,
            horizon: 1.0,
            energy: 0.0,
            released: 0.0,
            handle_count: 0,
            handles: [HandleReference::zero(); MAX_HANDLES],
            stiffness: [[Mat6::zeros(); MAX_HANDLES]; MAX_HANDLES],
            damping: [[Mat6::zeros(); MAX_HANDLES]; MAX_HANDLES],
        }
    }

    /// Copies what is in use of another model: with one handle a tenth of what all would take. What is not in use stays as
    /// it was.
    pub fn copy_used_from(&mut self, other: &Self) {
        let n = usize::from(other.handle_count);
        let Self {
            sequence,
            epoch,
            time_ns,
            period,
            horizon,
            energy,
            released,
            handle_count,
            handles,
            stiffness,
            damping,
        } = self;
        *sequence = other.sequence;
        *epoch = other.epoch;
        *time_ns = other.time_ns;
        *period = other.period;
        *horizon = other.horizon;
        *energy = other.energy;
        *released = other.released;
        *handle_count = other.handle_count;
        for (mine, theirs) in handles.iter_mut().zip(other.handles()) {
            *mine = *theirs;
        }
        copy_used_blocks(stiffness, &other.stiffness, n);
        copy_used_blocks(damping, &other.damping, n);
    }

    /// The handles in use.
    pub fn handles(&self) -> impl Iterator<Item = &HandleReference> {
        self.handles.iter().take(usize::from(self.handle_count))
    }

    /// How long the drift has gone on at `now_ns` (s): the model's age, levelled off. Up to the horizon it is the age;
    /// from there it slows down evenly, and at twice the horizon it stays at one and a half. A model that no other
    /// follows then says nothing more of a motion that nobody has seen.
    pub fn ahead(&self, now_ns: u64) -> f64 {
        let age = now_ns.saturating_sub(self.time_ns) as f64 * 1e-9;
        let over = (age - self.horizon).max(0.0).min(self.horizon);
        age.min(self.horizon) + over - 0.5 * over * over / self.horizon
    }

    /// Each handle's deviation from the reference, for the poses and twists of the devices that hold them.
    pub fn deviations(&self, devices: &[(Pose, Twist)]) -> [Deviation; MAX_HANDLES] {
        let mut deviations = [Deviation::zero(); MAX_HANDLES];
        for (handle, deviation) in self.handles().zip(&mut deviations) {
            if let Some((pose, twist)) = devices.get(usize::from(handle.device)) {
                deviation.displacement = pose.displacement_from(&handle.pose);
                deviation.velocity = twist.stacked() - handle.twist.stacked();
            }
        }
        deviations
    }

    /// `K d + B e`: how much the wrench on each hand has fallen since the reference.
    pub fn response(&self, deviations: &[Deviation; MAX_HANDLES]) -> [Vec6; MAX_HANDLES] {
        let mut response = [Vec6::zeros(); MAX_HANDLES];
        let n = usize::from(self.handle_count);
        let rows = self
            .stiffness
            .iter()
            .zip(&self.damping)
            .zip(&mut response)
            .take(n);
        for ((stiffness, damping), out) in rows {
            for ((k, b), deviation) in stiffness.iter().zip(damping).zip(deviations).take(n) {
                *out += k * deviation.displacement + b * deviation.velocity;
            }
        }
        response
    }

    /// The wrench on each hand, extrapolated, where the drift has gone on for `ahead` (s).
    pub fn wrenches(
        &self,
        deviations: &[Deviation; MAX_HANDLES],
        ahead: f64,
    ) -> [Wrench; MAX_HANDLES] {
        let mut wrenches = [Wrench::zero(); MAX_HANDLES];
        let response = self.response(deviations);
        for ((handle, fall), out) in self.handles().zip(&response).zip(&mut wrenches) {
            *out = Wrench::from_stacked(&(handle.after(ahead) - fall));
            if handle.contact != Vec3::zeros() {
                clip(&mut out.force, &handle.contact);
            }
        }
        wrenches
    }

    /// Whether every number that would be used is finite and every device index exists.
    ///
    /// # Errors
    /// The first [`ModelFault`] found.
    pub fn check(&self) -> Result<(), ModelFault> {
        let n = usize::from(self.handle_count);
        if n == 0 || n > MAX_HANDLES {
            return Err(ModelFault::Handles);
        }
        if self.handles().any(|h| usize::from(h.device) >= MAX_DEVICES) {
            return Err(ModelFault::Handles);
        }
        let finite = self.period.is_finite()
            && self.period > 0.0
            && self.horizon.is_finite()
            && self.horizon > 0.0
            && self.energy.is_finite()
            && self.released.is_finite()
            && self.handles().all(HandleReference::is_finite)
            && used_blocks(&self.stiffness, n).all(is_finite)
            && used_blocks(&self.damping, n).all(is_finite);
        if finite {
            Ok(())
        } else {
            Err(ModelFault::NotFinite)
        }
    }

    /// Bounds the damping of each handle alone by `most` (N s/m, N m s/rad) of its device: `a_i a_j B_ij` with the
    /// largest `a` up to one that do it, which keeps the matrix positive where it was.
    pub(crate) fn bound_damping(&mut self, most: impl Fn(u8) -> [f64; 2]) {
        let mut scales = [[1.0; 2]; MAX_HANDLES];
        let n = usize::from(self.handle_count);
        let rows = self.damping.iter().enumerate().zip(&self.handles);
        for (((i, row), handle), scales) in rows.zip(&mut scales).take(n) {
            let Some(own) = row.get(i) else { continue };
            for ((fraction, most), found) in
                scales.iter_mut().zip(most(handle.device)).zip(largest(own))
            {
                if found > most {
                    *fraction = libm::sqrt(most / found);
                }
            }
        }
        if scales.iter().flatten().all(|&fraction| fraction == 1.0) {
            return;
        }
        let scale = |[linear, angular]: [f64; 2]| {
            Vec6::new(linear, linear, linear, angular, angular, angular)
        };
        for (row, mine) in self.damping.iter_mut().zip(&scales).take(n) {
            let mine = scale(*mine);
            for (block, theirs) in row.iter_mut().zip(&scales).take(n) {
                let theirs = scale(*theirs);
                block.component_mul_assign(&(mine * theirs.transpose()));
            }
        }
    }

    /// Takes out of the reference wrenches what its dampers do there: they become `w0 + B v0`, and the twists zero. What
    /// dampers do now is then `-B v` of the whole velocity.
    ///
    /// The wrench of the damping at the reference is history: with the next model it is a different one. Where a device
    /// renders less damping than the body has, and only so much of it were taken out, the rest would act as a part of the
    /// spring that is a publication late, and a late spring feeds the motion that it answers.
    pub(crate) fn rest_dampers(&mut self) {
        let n = usize::from(self.handle_count);
        let twists = self.handles.map(|handle| handle.twist.stacked());
        for (row, handle) in self.damping.iter().zip(&mut self.handles).take(n) {
            let mut wrench = handle.wrench.stacked();
            for (b, twist) in row.iter().zip(&twists).take(n) {
                wrench += b * twist;
            }
            handle.wrench = Wrench::from_stacked(&wrench);
            handle.twist = Twist::zero();
        }
    }

    /// The largest entry sums of each handle's own stiffness (N/m, N m/rad): no motion of one handle alone is resisted
    /// more.
    pub(crate) fn own_stiffness(&self) -> [[f64; 2]; MAX_HANDLES] {
        let mut found = [[0.0; 2]; MAX_HANDLES];
        let n = usize::from(self.handle_count);
        for ((i, row), found) in self.stiffness.iter().enumerate().zip(&mut found).take(n) {
            if let Some(own) = row.get(i) {
                *found = largest(own);
            }
        }
        found
    }

    /// Mixes stiffness, damping and drift of two models that have the same handles: this one's fraction falls to `1 - fraction`.
    /// The reference wrenches are left as they are, for the reference changes next.
    pub(crate) fn mix(&mut self, other: &Self, fraction: f64) {
        let n = usize::from(self.handle_count);
        for (mine, theirs) in self.handles.iter_mut().zip(&other.handles).take(n) {
            mine.drift = mine
                .drift
                .scaled(1.0 - fraction)
                .plus(&theirs.drift.scaled(fraction));
        }
        mix_blocks(&mut self.stiffness, &other.stiffness, fraction, n);
        mix_blocks(&mut self.damping, &other.damping, fraction, n);
    }
}

/// The blocks between the first `n` handles.
fn used_blocks(blocks: &PairBlocks, n: usize) -> impl Iterator<Item = &Mat6> {
    blocks
        .iter()
        .take(n)
        .flat_map(move |row| row.iter().take(n))
}

fn copy_used_blocks(mine: &mut PairBlocks, theirs: &PairBlocks, n: usize) {
    for (mine, theirs) in mine.iter_mut().zip(theirs).take(n) {
        for (mine, theirs) in mine.iter_mut().zip(theirs).take(n) {
            *mine = *theirs;
        }
    }
}

/// Whether every number of a block is finite. It looks at all of them: that takes the same time whatever
/// they are, and less than stopping at the first that is not.
fn is_finite(block: &Mat6) -> bool {
    let numbers = block.as_slice().iter();
    numbers.fold(true, |finite, x| finite & x.is_finite())
}

fn mix_blocks(mine: &mut PairBlocks, theirs: &PairBlocks, fraction: f64, n: usize) {
    for (mine, theirs) in mine.iter_mut().zip(theirs).take(n) {
        for (a, b) in mine.iter_mut().zip(theirs).take(n) {
            *a = *a * (1.0 - fraction) + b * fraction;
        }
    }
}
