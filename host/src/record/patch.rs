//! A patch as a log keeps it: the surface near a tool, in the parts in use.

use super::field::{Record, Visitor, fields, record};
use super::kind::{Stamp, kind};
use nalgebra::{Quaternion, UnitQuaternion};
use rt_core::Vec3;
use rt_core::publication::Publication;
use rt_core::tool::{MAX_SITES, MAX_TRIANGLES, Patch, PatchHead, Site, Triangle};

/// A patch with the index of its tool's device, and the parts of the patch that are in use.
#[derive(Clone, Debug, PartialEq)]
pub struct PatchRow {
    /// Index of the device.
    pub device: u8,
    /// Number of the patch among those of the tool, from one.
    pub sequence: u64,
    /// Number of changes of the topology.
    pub epoch: u32,
    /// Time of the state (ns).
    pub time_ns: u64,
    period: f64,
    damping: f64,
    stiffness: f64,
    elastic: f64,
    /// The floor, rows first, and that of rotation.
    floor: Vec<f64>,
    /// The corners of the triangles, and their coefficients of friction.
    corners: Vec<u8>,
    friction: Vec<f64>,
    sites: Vec<Site>,
    /// The compliance, rows first, of which each block has its nine numbers.
    compliance: Vec<f64>,
    /// The drifts of the sites, which logs of earlier versions lack.
    drift: Vec<f64>,
    /// Where the tool was (m; rotation w, x, y, z), and the distance up to which the patch has the surface (m); [`REACH`] numbers.
    reach: Vec<f64>,
}

/// See [`PatchRow::reach`].
const REACH: usize = 8;

impl PatchRow {
    /// The used part of a patch for the tool of the device of this index.
    pub fn new(device: u8, patch: &Patch) -> Self {
        let head = &patch.head;
        let triangles = || head.triangles();
        Self {
            device,
            sequence: head.sequence,
            epoch: head.epoch,
            time_ns: head.time_ns,
            period: head.period,
            damping: head.damping,
            stiffness: head.stiffness,
            elastic: head.elastic,
            floor: (head.floor.iter().chain(&head.turning_floor).copied()).collect(),
            corners: triangles().flat_map(|triangle| triangle.corners).collect(),
            friction: triangles().map(|triangle| triangle.friction).collect(),
            sites: patch.rows().to_vec(),
            compliance: (patch.blocks().flatten())
                .flat_map(|block| block.iter().copied())
                .collect(),
            drift: (patch.rows().iter())
                .flat_map(|site| site.drift.iter().copied())
                .collect(),
            reach: reach(head),
        }
    }

    /// The stamp of its message.
    pub fn stamp(&self) -> Stamp {
        Stamp {
            body: 0,
            number: None,
            time_ns: self.time_ns,
        }
    }

    /// The sites in use.
    pub fn sites(&self) -> &[Site] {
        &self.sites
    }

    /// The patch as the host published it.
    pub fn patch(&self) -> Patch {
        let mut patch = Patch::empty();
        let head = &mut patch.head;
        (head.sequence, head.epoch, head.time_ns) = (self.sequence, self.epoch, self.time_ns);
        (head.period, head.damping, head.stiffness) = (self.period, self.damping, self.stiffness);
        head.elastic = self.elastic;
        if let [x, y, z, w, i, j, k, reach] = self.reach[..] {
            head.pose.position = Vec3::new(x, y, z);
            head.pose.rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
            head.reach = reach;
        }
        let floors = head.floor.iter_mut().chain(&mut head.turning_floor);
        for (to, from) in floors.zip(&self.floor) {
            *to = *from;
        }
        let corners = self.corners.as_chunks::<3>().0.iter();
        let triangles = corners.zip(&self.friction);
        for (to, (corners, friction)) in head.triangles.iter_mut().zip(triangles) {
            *to = Triangle {
                corners: *corners,
                friction: *friction,
            };
        }
        head.site_count = self.sites.len() as u8;
        head.triangle_count = self.friction.len() as u8;
        for (to, from) in patch.sites.iter_mut().zip(&self.sites) {
            *to = *from;
        }
        for (site, drift) in patch.sites.iter_mut().zip(self.drift.as_chunks::<3>().0) {
            site.drift = (*drift).into();
        }
        let mut numbers = self.compliance.iter();
        let count = self.sites.len();
        for row in patch.compliance.iter_mut().take(count) {
            for (to, from) in row.iter_mut().take(count).flatten().zip(&mut numbers) {
                *to = *from;
            }
        }
        patch
    }

    /// `None` if the lengths of the lists contradict each other.
    fn check(&mut self) -> Option<()> {
        let (sites, triangles) = (self.sites.len(), self.friction.len());
        // Logs of earlier versions lack the floor of rotation.
        let is_whole = [9, 18].contains(&self.floor.len())
            && self.reach.len() == REACH
            && self.corners.len() == 3 * triangles
            && self.compliance.len() == 9 * sites * sites
            && [0, 3 * sites].contains(&self.drift.len());
        (is_whole && sites <= MAX_SITES && triangles <= MAX_TRIANGLES).then_some(())
    }
}

/// The numbers of [`PatchRow::reach`].
fn reach(head: &PatchHead) -> Vec<f64> {
    let ([x, y, z], rotation) = (head.pose.position.into(), head.pose.rotation);
    vec![
        x, y, z, rotation.w, rotation.i, rotation.j, rotation.k, head.reach,
    ]
}

kind! { PatchRow: "palpate_msgs/msg/Patch", Tools, |_| "/patch".to_owned(); }

record! { PatchRow: Self::new(0, &Patch::empty()), Self::check;
    "# The surface near a tool, as the tick uses it. SI units; world axes.";
    "# The tick that took it into use is the first whose list of patches has its number at the place of the tool.";
    "uint64 sequence     # counts the patches of this tool, from one" sequence;
    "uint64 time_ns      # when the state held" time_ns;
    "float64 period      # of publication" period;
    "float64 damping     # ratio of damping to stiffness (s)" damping;
    "float64 stiffness   # against the resultant of the contact (N/m)" stiffness;
    "float64[] floor     # compliance that the device adds (m/N), nine numbers; and of rotation (rad/(N m))" floor;
    "uint32 epoch        # of the topology" epoch;
    "uint8 device        # index in a tick's devices" device;
    "uint8[] corners     # of the triangles, three each, as places in the list of sites" corners;
    "float64[] friction  # coefficient, by triangle" friction;
    "palpate_msgs/Site[] sites" sites: list "site";
    "float64[] compliance # between the sites (m/N), nine numbers a block, rows first" compliance;
    "float64 elastic     # optional: fraction of the energy under the forces of the sites that is elastic" elastic: late;
    "float64[] drift      # optional: velocities of the sites that inertia keeps (m/s), three numbers each" drift: late;
    "float64[] reach     # optional: where the tool was (x, y, z; rotation w, x, y, z), and how far beyond it the surface is told (m)" reach: late;
}

record! { Site: Self::zero();
    "geometry_msgs/Vector3 place" place;
    "geometry_msgs/Vector3 velocity" velocity;
    "geometry_msgs/Vector3 force  # of the tool on the body" force;
    "uint32 vertex                # number of the vertex" vertex;
    drift: skip;
}
