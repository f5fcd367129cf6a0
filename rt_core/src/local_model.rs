//! The local model: the linearized force of one connected body on all its handles together.
//!
//! The host publishes, for a state that held at [`LocalModel::time_ns`], each handle's pose, twist and
//! wrench on the hand, and the tangent stiffness and damping between every pair of handles, so that two
//! hands on one sheet feel each other. Between publications the tick extrapolates:
//!
//! `w_i = w0_i - sum_j (K_ij d_j + B_ij e_j)`
//!
//! with `d_j` the handle's displacement since the reference (translation; rotation `log(R R0^T)`) and
//! `e_j` its velocity minus the published one. How `K` and `B` come from the finite elements, and why they
//! are not the Schur complement of the step's matrix, stands with the condensation in `physics`.

use crate::geometry::{Mat6, Pose, Twist, Vec6, Wrench};
use crate::{MAX_DEVICES, MAX_HANDLES};

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
}

impl HandleReference {
    /// At the origin, at rest, no wrench, held by the first device.
    pub fn zero() -> Self {
        Self {
            device: 0,
            pose: Pose::identity(),
            twist: Twist::zero(),
            wrench: Wrench::zero(),
        }
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
    /// The publication period it was condensed at (s).
    pub period: f64,
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

/// Why a local model cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelFault {
    /// A number in it is not finite, or its period is not positive.
    NotFinite,
    /// It names more handles than a body can have, none, or a device that does not exist.
    Handles,
    /// It is not newer than the one in use, or knows of fewer changes of topology.
    Outdated,
}

impl LocalModel {
    /// A model without handles.
    pub fn empty() -> Self {
        Self {
            sequence: 0,
            epoch: 0,
            time_ns: 0,
            period: 1.0,
            handle_count: 0,
            handles: [HandleReference::zero(); MAX_HANDLES],
            stiffness: [[Mat6::zeros(); MAX_HANDLES]; MAX_HANDLES],
            damping: [[Mat6::zeros(); MAX_HANDLES]; MAX_HANDLES],
        }
    }

    /// The handles in use.
    pub fn handles(&self) -> impl Iterator<Item = &HandleReference> {
        self.handles.iter().take(usize::from(self.handle_count))
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

    /// The wrench on each hand, extrapolated.
    pub fn wrenches(&self, deviations: &[Deviation; MAX_HANDLES]) -> [Wrench; MAX_HANDLES] {
        let mut wrenches = [Wrench::zero(); MAX_HANDLES];
        let response = self.response(deviations);
        for ((handle, fall), out) in self.handles().zip(&response).zip(&mut wrenches) {
            *out = Wrench::from_stacked(&(handle.wrench.stacked() - fall));
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
            && self
                .handles()
                .all(|h| h.pose.is_finite() && h.twist.is_finite() && h.wrench.is_finite())
            && used_blocks(&self.stiffness, n).all(is_finite)
            && used_blocks(&self.damping, n).all(is_finite);
        if finite {
            Ok(())
        } else {
            Err(ModelFault::NotFinite)
        }
    }

    /// Mixes the forces of two models that share their handles and references: this one's share falls to `1 - share`.
    pub(crate) fn mix(&mut self, other: &Self, share: f64) {
        for (mine, theirs) in self.handles.iter_mut().zip(&other.handles) {
            mine.wrench = mine
                .wrench
                .scaled(1.0 - share)
                .plus(&theirs.wrench.scaled(share));
        }
        let n = usize::from(self.handle_count);
        mix_blocks(&mut self.stiffness, &other.stiffness, share, n);
        mix_blocks(&mut self.damping, &other.damping, share, n);
    }
}

/// The blocks between the first `n` handles.
fn used_blocks(blocks: &PairBlocks, n: usize) -> impl Iterator<Item = &Mat6> {
    blocks
        .iter()
        .take(n)
        .flat_map(move |row| row.iter().take(n))
}

/// Whether every number of a block is finite. It looks at all of them: that takes the same time whatever
/// they are, and less than stopping at the first that is not.
fn is_finite(block: &Mat6) -> bool {
    let numbers = block.as_slice().iter();
    numbers.fold(true, |finite, x| finite & x.is_finite())
}

fn mix_blocks(mine: &mut PairBlocks, theirs: &PairBlocks, share: f64, n: usize) {
    for (mine, theirs) in mine.iter_mut().zip(theirs).take(n) {
        for (a, b) in mine.iter_mut().zip(theirs).take(n) {
            *a = *a * (1.0 - share) + b * share;
        }
    }
}
