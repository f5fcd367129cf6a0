//! The message of the host for one tool: the surface that lies near it, and how the surface yields.
//!
//! Sites are material points of the surface. A point keeps its place in the list while it stays near the tool. The compliance
//! is that of the elastic forces alone; damping is one time (`tools.md` of the designs has the figures that speak for both).

use super::{MAX_SITES, MAX_TRIANGLES};
use crate::geometry::{Mat3, Pose, Vec3};
use crate::publication::{Extent, Head, Packed, Publication, copy_rows};

/// A material point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// Number of the vertex. Another number at the same place in the list is another point.
    pub vertex: u32,
    /// Position (m, world).
    pub place: Vec3,
    /// Velocity over the last step of the host (m/s).
    pub velocity: Vec3,
    /// The part of the velocity that inertia keeps over a publication (m/s): all of that of a loose piece, and the less of that of an elastic
    /// motion, the stiffer the motion is. The point goes on with it.
    pub drift: Vec3,
    /// Force of the tool on the body at this point (N), in the host's step.
    pub force: Vec3,
}

impl Site {
    /// A point at the origin, at rest and without force.
    pub fn zero() -> Self {
        Self {
            vertex: 0,
            place: Vec3::zeros(),
            velocity: Vec3::zeros(),
            drift: Vec3::zeros(),
            force: Vec3::zeros(),
        }
    }

    fn is_finite(&self) -> bool {
        let each = [&self.place, &self.velocity, &self.drift, &self.force];
        each.iter().all(|v| v.iter().all(|x| x.is_finite()))
    }

    /// The place (m) to which the point has drifted in a time (s).
    pub(super) fn drifted(&self, time: f64) -> Vec3 {
        self.place + self.drift * time
    }
}

/// A triangle between sites. Its normal, by the order of its corners, is on the side of the tool.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Triangle {
    /// Its corners, as places in the list of sites.
    pub corners: [u8; 3],
    /// Coefficient of friction.
    pub friction: f64,
}

/// The numbers of a patch that do not belong to a site.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchHead {
    /// Number of the patch among those of this tool, from one.
    pub sequence: u64,
    /// Number of changes of the topology. In another topology all sites are other points.
    pub epoch: u32,
    /// Time of the state (ns, the tick's clock): the end of the host's step.
    pub time_ns: u64,
    /// The publication period (s).
    pub period: f64,
    /// Where the tool was in the host's step.
    pub pose: Pose,
    /// The distance beyond the tool up to which the patch has the surface (m): a tool that goes farther may meet a surface that the patch
    /// lacks.
    pub reach: f64,
    /// The ratio of damping to stiffness (s), as one Rayleigh time.
    pub damping: f64,
    /// The fraction of the energy under the forces of the sites that is elastic (1). The rest is that of motions which nothing but inertia
    /// holds, and gives the hand nothing back.
    pub elastic: f64,
    /// The stiffness of the surface against the resultant of the contact (N/m), in its direction; infinite for an obstacle.
    pub stiffness: f64,
    /// The compliance (m/N) that the device adds where the surface is stiffer than the device can render: `1/K_t - 1/K`, if
    /// positive, by direction.
    pub floor: Mat3,
    /// The same of the tool's rotation about its centre (rad/(N m)).
    pub turning_floor: Mat3,
    /// Number of sites, as the patch claims.
    pub site_count: u8,
    /// Number of triangles, as the patch claims.
    pub triangle_count: u8,
    /// The triangles, the first `triangle_count` in use.
    pub triangles: [Triangle; MAX_TRIANGLES],
}

impl PatchHead {
    /// The head of a patch without sites.
    pub fn empty() -> Self {
        Self {
            sequence: 0,
            epoch: 0,
            time_ns: 0,
            period: 1.0,
            pose: Pose::identity(),
            reach: f64::INFINITY,
            damping: 0.0,
            elastic: 1.0,
            stiffness: f64::INFINITY,
            floor: Mat3::zeros(),
            turning_floor: Mat3::zeros(),
            site_count: 0,
            triangle_count: 0,
            triangles: [Triangle::default(); MAX_TRIANGLES],
        }
    }

    /// The extent of a patch of `sites` sites.
    pub fn extent_of(sites: usize) -> Extent {
        Extent {
            rows: sites,
            blocks: sites.saturating_mul(sites),
        }
    }

    /// The triangles in use.
    pub fn triangles(&self) -> impl Iterator<Item = &Triangle> {
        self.triangles.iter().take(usize::from(self.triangle_count))
    }
}

/// The blocks of compliance between sites, by row, then by column (m/N).
pub type Compliance = [[Mat3; MAX_SITES]; MAX_SITES];

/// The surface near a tool.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// The numbers of the whole patch.
    pub head: PatchHead,
    /// The sites, the first `site_count` in use.
    pub sites: [Site; MAX_SITES],
    /// The elastic displacement of each site by a force at each other (m/N); zero for an obstacle.
    pub compliance: Compliance,
}

/// The reason why a patch cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PatchFault {
    /// A number is not finite, or one that must be positive is not.
    NotFinite,
    /// More sites or triangles than a patch can have, or a corner that is no site.
    Sites,
    /// The patch is not newer than the one in use, or its topology is older.
    Outdated,
    /// The time of the patch lies in the future.
    ToCome,
    /// The device has no tool.
    NoTool,
}

impl Head for PatchHead {
    const NAME: &'static str = "patch of device";
    type Row = Site;
    type Block = Mat3;

    fn filler() -> (Self, Site, Mat3) {
        (Self::empty(), Site::zero(), Mat3::zeros())
    }

    fn sequence(&self) -> u64 {
        self.sequence
    }

    fn extent(&self) -> Extent {
        Self::extent_of(usize::from(self.site_count).min(MAX_SITES))
    }
}

/// A patch as it lies in a ring.
pub type PackedPatch<'a> = Packed<'a, PatchHead>;

impl Publication for Patch {
    type Head = PatchHead;

    fn head(&self) -> &PatchHead {
        &self.head
    }

    fn rows(&self) -> &[Site] {
        let sites = usize::from(self.head.site_count);
        self.sites.get(..sites).unwrap_or(&self.sites)
    }

    fn blocks(&self) -> impl Iterator<Item = &[Mat3]> {
        let sites = usize::from(self.head.site_count);
        let rows = self.compliance.iter().take(sites);
        rows.map(move |row| row.get(..sites).unwrap_or(row))
    }
}

impl Patch {
    /// A patch without sites.
    #[expect(
        clippy::large_stack_arrays,
        reason = "this crate has no heap; patches are made before the first tick"
    )]
    pub fn empty() -> Self {
        Self {
            head: PatchHead::empty(),
            sites: [Site::zero(); MAX_SITES],
            compliance: [[Mat3::zeros(); MAX_SITES]; MAX_SITES],
        }
    }

    /// Whether no site yields.
    pub fn is_rigid(&self) -> bool {
        self.blocks().flatten().all(|block| *block == Mat3::zeros())
    }

    /// Copies the used part of another patch.
    pub fn copy_used_from(&mut self, other: &impl Publication<Head = PatchHead>) {
        self.head = *other.head();
        for (mine, theirs) in self.sites.iter_mut().zip(other.rows()) {
            *mine = *theirs;
        }
        // A patch without sites has no blocks; a chunk must not be empty.
        let sites = usize::from(self.head.site_count).max(1);
        let rows = other.blocks().flat_map(|blocks| blocks.chunks_exact(sites));
        copy_rows(&mut self.compliance, rows);
    }
}

/// Checks the numbers of a patch that are in use.
///
/// # Errors
/// The first [`PatchFault`] found.
pub(super) fn check(patch: &impl Publication<Head = PatchHead>) -> Result<(), PatchFault> {
    let head = patch.head();
    let (sites, triangles) = (
        usize::from(head.site_count),
        usize::from(head.triangle_count),
    );
    let mut corners = head.triangles().flat_map(|triangle| triangle.corners);
    if sites > MAX_SITES
        || triangles > MAX_TRIANGLES
        || corners.any(|corner| corner >= head.site_count)
    {
        return Err(PatchFault::Sites);
    }
    let frictions = head.triangles().map(|triangle| triangle.friction);
    let mut numbers = frictions.chain([head.damping]);
    let is_sound = head.period.is_finite()
        && head.period > 0.0
        && head.stiffness > 0.0
        && head.reach >= 0.0
        && head.pose.is_finite()
        && (0.0..=1.0).contains(&head.elastic)
        && numbers.all(|number| number.is_finite() && number >= 0.0)
        && is_finite(&head.floor)
        && is_finite(&head.turning_floor)
        && patch.rows().iter().all(Site::is_finite)
        && patch.blocks().flatten().all(is_finite);
    if is_sound {
        Ok(())
    } else {
        Err(PatchFault::NotFinite)
    }
}

fn is_finite(block: &Mat3) -> bool {
    block.iter().all(|x| x.is_finite())
}
