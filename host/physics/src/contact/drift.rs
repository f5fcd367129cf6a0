//! How far each cluster departs from rigid motions in one step, which bounds how far two clusters depart from each other.
//!
//! The departure of two clusters from *any* common rigid motion bounds the change of their distances. In each step three
//! motions serve all clusters: that of their part, that of all parts together, and none. The sums of the bounds over the
//! steps say for most pairs of clusters that their list holds on, without a fit of their own. The motions are fitted to the
//! centres of the clusters.

use super::hierarchy::Hierarchy;
use super::rigid::Motion;
use crate::Vec3;
use nalgebra::UnitQuaternion;

/// The motion of the part of a cluster, that of all parts, and none.
const MOTIONS: usize = 3;

/// The departures of the present step.
#[derive(Clone, Debug)]
pub(super) struct Drift {
    /// Positions (m) and centres of clusters (m) at the end of the previous step.
    before: Vec<Vec3>,
    centres: Vec<Vec3>,
    /// Departures of each cluster (m).
    departures: Vec<[f64; MOTIONS]>,
}

impl Drift {
    /// No departures, at the positions `x` (m).
    pub(super) fn new(hierarchy: &Hierarchy, x: &[Vec3]) -> Self {
        let clusters = hierarchy.clusters();
        Self {
            before: x.to_vec(),
            centres: clusters.iter().map(|cluster| cluster.centre).collect(),
            departures: vec![[0.0; MOTIONS]; clusters.len()],
        }
    }

    /// Takes the positions `x` (m) after a step, to which the hierarchy has been refitted.
    pub(super) fn follow(&mut self, hierarchy: &Hierarchy, x: &[Vec3]) {
        let clusters = hierarchy.clusters();
        let fitted = |first: usize, count: usize| {
            let mut rotation = UnitQuaternion::identity();
            let before = |i: usize| self.centres[first + i];
            let after = |i: usize| clusters[first + i].centre;
            Motion::fit(count, before, after, &mut rotation)
        };
        let all = fitted(0, clusters.len());
        let mut first = 0;
        // The clusters of a part follow each other.
        for of_part in clusters.chunk_by(|a, b| a.part == b.part) {
            let motions = [fitted(first, of_part.len()), all, Motion::none()];
            for number in first..first + of_part.len() {
                let mut most = [0.0_f64; MOTIONS];
                for vertex in hierarchy.members(number) {
                    let (before, after) = (&self.before[*vertex as usize], &x[*vertex as usize]);
                    for (most, motion) in most.iter_mut().zip(&motions) {
                        *most = most.max(motion.departure(before, after));
                    }
                }
                self.departures[number] = most.map(f64::sqrt);
            }
            first += of_part.len();
        }
        self.before.copy_from_slice(x);
        for (centre, cluster) in self.centres.iter_mut().zip(clusters) {
            *centre = cluster.centre;
        }
    }

    /// A bound (m) on the change of the distance of any two points of two clusters in the present step.
    pub(super) fn between(&self, hierarchy: &Hierarchy, [a, b]: [usize; 2]) -> f64 {
        let clusters = hierarchy.clusters();
        let is_same_part = clusters[a].part == clusters[b].part;
        let common = usize::from(!is_same_part);
        let sums = (common..MOTIONS).map(|k| self.departures[a][k] + self.departures[b][k]);
        sums.fold(f64::INFINITY, f64::min)
    }
}
