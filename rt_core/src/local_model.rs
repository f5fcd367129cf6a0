//! The local model: the linearized force of one connected body on all its handles together.
//!
//! For a state at the time [`ModelHead::time_ns`], the host publishes each handle's pose, twist and wrench on the
//! hand, and the drift of each wrench. It also publishes the tangent stiffness and damping between every pair of
//! handles, so that two hands on one sheet feel each other. Between publications the tick extrapolates:
//!
//! `w_i = w0_i + p_i s - sum_j (K_ij d_j + B_ij e_j)`
//!
//! Here `d_j` is the handle's displacement since the reference (translation; rotation `log(R R0^T)`), `e_j` its
//! velocity minus the published one, and `s` the age of the model, levelled off ([`LocalModel::ahead`]). The
//! condensation in `physics` explains how `K` and `B` follow from the finite elements, and why they are not the Schur
//! complement of the step's matrix.
//!
//! **Drift.** A hand that moves steadily meets a body that already moves, but stiffness alone takes the whole
//! displacement of the hand as new. Let `w0'` be the rate of the wrench along the path `d = v0 s` of the handles. The
//! extrapolation from that path is `w0 + w0' s - K (d - v0 s) - B e`. It equals the extrapolation above with
//! `p = w0' + K v0`: the part of the wrench's rate that the stiffness does not predict. A body that answers at once has
//! no drift.
//!
//! **A torn body** may consist of several pieces (`local_model/pieces.rs`), and a tear limits how far the
//! extrapolation goes (`local_model/tear_limit.rs`).

mod parts;
pub(crate) mod pieces;
mod published;
mod tear_limit;

use crate::MAX_HANDLES;
use crate::geometry::{Mat6, Pose, Twist, Vec3, Vec6, Wrench};

pub use parts::{Lead, Parts};
pub use pieces::PieceEnergy;
pub use published::{ModelHead, PackedModel, PublishedModel};
pub use tear_limit::TearLimit;

/// The reference state of one handle in a [`LocalModel`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandleReference {
    /// Index of the device that holds the handle.
    pub device: u8,
    /// Number of the piece of the body to which the handle belongs; zero in a whole body. The numbers of the pieces
    /// begin at zero. The number stays while the topology stays.
    pub piece: u8,
    /// Pose at the reference state (world axes).
    pub pose: Pose,
    /// Twist at the reference state (world axes).
    pub twist: Twist,
    /// Wrench on the hand at the reference state, without the inertia of the handle itself.
    pub wrench: Wrench,
    /// Outward normal of a contact that can push the hand but not pull it; zero if the hand holds the handle
    /// permanently.
    pub contact: Vec3,
    /// The body's weight on the handle (N): the part of the wrench's force that stays the same wherever the handle
    /// goes. The weight is a potential, so it gives back the work that lifting took. Zero is always safe. If the
    /// weight differs from that of the model before, the tick blends the two.
    pub weight: Vec3,
    /// The part of the wrench's rate that the stiffness does not predict (N/s, N m/s): `w0' + K v0`. Zero is always
    /// safe.
    pub drift: Wrench,
    /// Slope of `sqrt(G)` of the nearest tip by the displacement of the handle (sqrt(J/m2) per m, then per rad):
    /// [`TearLimit`]. Unused if the model has no limit.
    pub tear_slope: Vec6,
}

impl HandleReference {
    /// A handle at the origin, at rest and without wrench, held by the first device.
    pub fn zero() -> Self {
        Self {
            device: 0,
            piece: 0,
            pose: Pose::identity(),
            twist: Twist::zero(),
            wrench: Wrench::zero(),
            contact: Vec3::zeros(),
            weight: Vec3::zeros(),
            drift: Wrench::zero(),
            tear_slope: Vec6::zeros(),
        }
    }

    #[inline]
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

    fn has_finite_slope(&self) -> bool {
        self.tear_slope.iter().all(|x| x.is_finite())
    }

    /// The wrench without the weight.
    pub fn unweighted(&self) -> Vec6 {
        let mut wrench = self.wrench;
        wrench.force -= self.weight;
        wrench.stacked()
    }

    /// The wrench at the reference pose and twist after the drift has acted for `ahead` (s).
    pub fn after(&self, ahead: f64) -> Vec6 {
        self.wrench.stacked() + self.drift.stacked() * ahead
    }
}

/// 6 x 6 blocks between every pair of handles, by row, then by column.
pub type PairBlocks = [[Mat6; MAX_HANDLES]; MAX_HANDLES];

/// The linearized force of one body on its handles. The model is plain data of fixed size. Rings pass
/// only its used part ([`PackedModel`]).
///
/// ```
/// use rt_core::geometry::Twist;
/// use rt_core::{LocalModel, Pose, Vec3};
///
/// // One handle, held by device 0, on a spring of 100 N/m along x.
/// let mut model = LocalModel::empty();
/// model.head.sequence = 1;
/// model.head.handle_count = 1;
/// model.stiffness[0][0][(0, 0)] = 100.0;
/// assert_eq!(model.check(), Ok(()));
///
/// // The hand displaces the handle by 2 mm.
/// let device = (Pose::at(Vec3::new(0.002, 0.0, 0.0)), Twist::zero());
/// let deviations = model.deviations(&[device]);
/// let wrenches = model.wrenches(&deviations, model.ahead(0));
/// assert_eq!(wrenches[0].force.x, -0.2);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalModel {
    /// The numbers that do not belong to a handle.
    pub head: ModelHead,
    /// The handles, the first `handle_count` of them in use.
    pub handles: [HandleReference; MAX_HANDLES],
    /// Tangent stiffness between handles (N/m, N/rad, N m/m, N m/rad).
    pub stiffness: PairBlocks,
    /// Damping between handles, in the same layout and in the same units times seconds.
    pub damping: PairBlocks,
}

/// The deviation of one handle from the reference of its model: `d` and `e` of the extrapolation.
#[derive(Clone, Copy, Debug)]
pub struct Deviation {
    /// Displacement since the reference: translation (m), then rotation (rad).
    pub displacement: Vec6,
    /// Velocity minus the reference velocity (m/s, then rad/s).
    pub velocity: Vec6,
}

impl Deviation {
    pub(crate) fn zero() -> Self {
        Self {
            displacement: Vec6::zeros(),
            velocity: Vec6::zeros(),
        }
    }
}

/// The largest row sums of absolute entries in the translational and in the rotational block. No eigenvalue is larger.
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

/// The product of a column and a row, without the library's general product, in which a panic is left.
fn outer(column: &Vec6, row: &Vec6) -> Mat6 {
    let mut product = Mat6::zeros();
    let columns = product.as_mut_slice().chunks_exact_mut(6);
    for (to, scale) in columns.zip(row.iter()) {
        for (to, from) in to.iter_mut().zip(column.iter()) {
            *to = from * scale;
        }
    }
    product
}

/// Removes from `force` the part that pulls against `normal`. Returns whether there was such a part.
fn clip(force: &mut Vec3, normal: &Vec3) -> bool {
    let along = force.dot(normal);
    if along < 0.0 {
        *force -= normal * along;
    }
    along < 0.0
}

/// The reason why a local model cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelFault {
    /// A number of the model is not finite, or its period or horizon is not positive.
    NotFinite,
    /// The model names no handles, more handles than a body can have, or a device that does not exist. The same fault
    /// stands for handles or pieces that differ from those of the model in use although the topology did not change,
    /// and for a number of a piece that is not below the number of handles.
    Handles,
    /// The model is not newer than the one in use, or its topology is older.
    Outdated,
    /// The time of the model lies in the future.
    ToCome,
}

impl LocalModel {
    /// A model without handles.
    #[expect(
        clippy::large_stack_arrays,
        reason = "this crate has no heap; models are made before the first tick, and the caller chooses their place"
    )]
    pub fn empty() -> Self {
        Self {
            head: ModelHead::empty(),
            handles: [HandleReference::zero(); MAX_HANDLES],
            stiffness: [[Mat6::zeros(); MAX_HANDLES]; MAX_HANDLES],
            damping: [[Mat6::zeros(); MAX_HANDLES]; MAX_HANDLES],
        }
    }

    /// The handles in use.
    pub fn handles(&self) -> impl Iterator<Item = &HandleReference> {
        self.handles
            .iter()
            .take(usize::from(self.head.handle_count))
    }

    /// The time for which the drift has acted at `now_ns` (s): the age of the model, levelled off. Up to the horizon
    /// this time is the age. Beyond the horizon it slows down evenly; from twice the horizon on it stays at one and a
    /// half horizons. A model without a successor therefore predicts no further motion.
    pub fn ahead(&self, now_ns: u64) -> f64 {
        let age = now_ns.saturating_sub(self.head.time_ns) as f64 * 1e-9;
        let over = (age - self.head.horizon).max(0.0).min(self.head.horizon);
        age.min(self.head.horizon) + over - 0.5 * over * over / self.head.horizon
    }

    /// The deviation of each handle from the reference, for the given poses and twists of the devices, by device index.
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

    /// `K d`: the fall of the springs' wrench on each hand since the reference (N, then N m), up to the tear limit.
    pub(crate) fn springs(&self, deviations: &[Deviation; MAX_HANDLES]) -> [Vec6; MAX_HANDLES] {
        let mut still = *deviations;
        for deviation in &mut still {
            deviation.velocity = Vec6::zeros();
        }
        self.response(&still)
    }

    /// `K d + B e`: the fall of the wrench on each hand since the reference (N, then N m), with `K d` up to the tear
    /// limit.
    pub fn response(&self, deviations: &[Deviation; MAX_HANDLES]) -> [Vec6; MAX_HANDLES] {
        let mut response = [Vec6::zeros(); MAX_HANDLES];
        let n = usize::from(self.head.handle_count);
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
        if let Some(beyond) = self.beyond_limit(deviations, &[]) {
            for (handle, out) in self.handles().zip(&mut response) {
                *out -= handle.tear_slope * (beyond.spring + beyond.viscous);
            }
        }
        response
    }

    /// The extrapolated wrench on each hand, after the drift has acted for `ahead` (s).
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

    /// Checks that every number in use is finite and that every device index exists.
    ///
    /// # Errors
    /// The first [`ModelFault`] found.
    pub fn check(&self) -> Result<(), ModelFault> {
        PublishedModel::check(self)
    }

    /// The fraction of each handle's own damping that is rendered, for displacements and for turns, if each device
    /// renders at most `most` (N s/m, N m s/rad).
    pub fn rendered_damping(&self, most: impl Fn(u8) -> [f64; 2]) -> [[f64; 2]; MAX_HANDLES] {
        let mut fractions = [[1.0; 2]; MAX_HANDLES];
        let n = usize::from(self.head.handle_count);
        let rows = self.damping.iter().enumerate().zip(&self.handles);
        for (((i, row), handle), fractions) in rows.zip(&mut fractions).take(n) {
            let Some(own) = row.get(i) else { continue };
            let limits = most(handle.device).into_iter().zip(largest(own));
            for (fraction, (most, found)) in fractions.iter_mut().zip(limits) {
                if found > most {
                    *fraction = most / found;
                }
            }
        }
        fractions
    }

    /// Bounds the damping of each handle alone by `most` (N s/m, N m s/rad) of its device. The blocks become
    /// `a_i a_j B_ij`, with the largest `a` up to one that meet the bound. A positive semidefinite matrix stays
    /// positive semidefinite.
    pub(crate) fn bound_damping(&mut self, most: impl Fn(u8) -> [f64; 2]) {
        let mut scales = self.rendered_damping(most);
        let n = usize::from(self.head.handle_count);
        for fraction in scales.iter_mut().take(n).flatten() {
            *fraction = libm::sqrt(*fraction);
        }
        if scales
            .iter()
            .take(n)
            .flatten()
            .all(|&fraction| fraction == 1.0)
        {
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

    /// Takes the dampers' part out of the reference wrenches: they become `w0 + B v0`, and the reference twists become
    /// zero. The wrench of the dampers is then `-B v`, with the whole velocity.
    ///
    /// The dampers' wrench at the reference belongs to the past; the next model has a different one. A device may
    /// render less damping than the body has. If only the rendered damping were taken out of the reference wrenches,
    /// the rest would act as a part of the spring that is late by a publication. A late spring feeds the motion that it
    /// resists.
    pub(crate) fn rest_dampers(&mut self) {
        let n = usize::from(self.head.handle_count);
        let mut twists = [Vec6::zeros(); MAX_HANDLES];
        for (twist, handle) in twists.iter_mut().zip(self.handles()) {
            *twist = handle.twist.stacked();
        }
        for (row, handle) in self.damping.iter().zip(&mut self.handles).take(n) {
            let mut wrench = handle.wrench.stacked();
            for (b, twist) in row.iter().zip(&twists).take(n) {
                wrench += b * twist;
            }
            handle.wrench = Wrench::from_stacked(&wrench);
            handle.twist = Twist::zero();
        }
    }

    /// The largest row sums of each handle's own stiffness (N/m, N m/rad), with the spring of a touch. The stiffness against any
    /// motion of that handle alone is no larger.
    pub(crate) fn own_stiffness(&self) -> [[f64; 2]; MAX_HANDLES] {
        let mut found = [[0.0; 2]; MAX_HANDLES];
        let n = usize::from(self.head.handle_count);
        for ((i, row), found) in self.stiffness.iter().enumerate().zip(&mut found).take(n) {
            if let Some(own) = row.get(i) {
                *found = largest(own);
            }
        }
        if self.head.tear_limit.is_touch() {
            for (found, handle) in found.iter_mut().zip(self.handles()) {
                let slope = outer(&handle.tear_slope, &handle.tear_slope);
                let more = largest(&slope).map(|slope| -self.head.tear_limit.area * slope);
                *found = [found[0] + more[0], found[1] + more[1]];
            }
        }
        found
    }

    /// Mixes stiffness, damping and drift of two models with the same handles: `fraction` of `other`, and
    /// `1 - fraction` of this model. The reference wrenches stay as they are, because the reference changes next.
    pub(crate) fn mix(&mut self, other: &Self, fraction: f64) {
        let n = usize::from(self.head.handle_count);
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

/// Whether every number of these blocks is finite. Zero times a finite number is zero, and zero times any other number is
/// not a number, so a sum of such products tells. Four sums suit vector instructions. The function reads all numbers,
/// so the time does not depend on them.
fn are_finite(blocks: &[Mat6]) -> bool {
    let mut sums = [0.0; 4];
    for block in blocks {
        // The 36 numbers of a block leave no rest.
        let (lanes, _) = block.as_slice().as_chunks::<4>();
        for lane in lanes {
            for (sum, x) in sums.iter_mut().zip(lane) {
                *sum += x * 0.0;
            }
        }
    }
    sums.iter().all(|sum| *sum == 0.0)
}

fn mix_blocks(mine: &mut PairBlocks, theirs: &PairBlocks, fraction: f64, n: usize) {
    for (mine, theirs) in mine.iter_mut().zip(theirs).take(n) {
        for (a, b) in mine.iter_mut().zip(theirs).take(n) {
            *a = *a * (1.0 - fraction) + b * fraction;
        }
    }
}
