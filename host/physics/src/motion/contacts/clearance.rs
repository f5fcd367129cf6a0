//! How far everything may move before anything touches. While it lasts, a scene pays for one measure of its displacements.
//!
//! A step of contact that finds nothing near measures the least distance between sides that may touch, less the distance at
//! which they do. No point of a side changes its distance to another side by more than both move, an obstacle seen from the
//! axes in which it stands. So the sum of the largest motions of all later steps is less than this clearance, or the step is
//! one of contact again. A rate of change that bounds how long a distance need not be computed is that of Mirtich,
//! "Timewarp rigid body simulation" (2000).

use super::parts::{Meetings, Owner};
use super::{Contacts, Member};
use crate::Vec3;
use crate::contact::{Hierarchy, Placed, Surfaces};
use crate::element::precision::Precision;

/// A step makes rows if it may move this many times as far as the last step.
const FURTHER: f64 = 4.0;

/// The clearance of a scene.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clearance {
    /// What is left (m); zero if something is near.
    left: f64,
    /// The motion of the last step (m).
    last: f64,
    /// A ball that contains all bodies (m), until the clearance is used up.
    centre: Vec3,
    radius: f64,
}

impl Clearance {
    /// Whether nothing comes near in a step as far as one can tell before the step is solved.
    pub(super) fn is_enough(&self) -> bool {
        self.left > FURTHER * self.last
    }

    /// Whether nothing comes near in some steps like the last one.
    pub(super) fn is_enough_for(&self, steps: f64) -> bool {
        self.left > FURTHER * steps * self.last
    }

    /// Whether the clearance is larger than a motion of `way` (m).
    pub(super) fn is_more_than(&self, way: f64) -> bool {
        self.left > way
    }

    /// Takes the motion of a step (m). Returns whether it is certain that nothing has touched.
    pub(super) fn spend(&mut self, motion: f64) -> bool {
        self.last = motion;
        self.left -= motion;
        self.left > 0.0
    }
}

impl Contacts {
    /// The motion of the present step (m): no distance between two sides changes by more.
    pub(super) fn motion<T: Precision>(&self, members: &[Member<'_, T>]) -> f64 {
        let [mut first, mut second] = [0.0_f64; 2];
        for stepper in members
            .iter()
            .filter_map(|member| member.stepper.as_deref())
        {
            let most = stepper.largest_displacement();
            second = second.max(most.min(first));
            first = first.max(most);
        }
        let ball = (&self.clearance.centre, self.clearance.radius);
        let obstacles = self.obstacles.iter();
        let moved = obstacles.map(|obstacle| obstacle.most_motion(self.times, ball.0, ball.1));
        first + second + moved.fold(0.0, f64::max)
    }

    /// Measures the clearance after a step with certified displacements of the lists' `motion` (m).
    pub(super) fn clear<T: Precision>(&mut self, members: &[Member<'_, T>]) {
        let is_near = self
            .lists
            .as_ref()
            .is_none_or(|lists| lists.counts().near > 0);
        if is_near || !self.touches.is_empty() {
            self.clearance.left = 0.0;
            return;
        }
        let Some(lists) = &self.lists else { return };
        let all = All {
            surfaces: &self.surfaces,
            hierarchy: lists.hierarchy(),
            owners: &self.owners,
            meetings: &self.meetings,
            x: &self.x,
        };
        let left = all.apart().min(all.before_shapes(&self.shapes));
        (self.clearance.centre, self.clearance.radius) = all.ball();
        // Bodies leave the ball by what is left at most.
        self.clearance.radius += left;
        self.clearance.left = left;
        let motion = self.motion(members);
        self.clearance.spend(motion);
    }
}

/// The surfaces at the start of a step.
struct All<'a> {
    surfaces: &'a Surfaces,
    hierarchy: &'a Hierarchy,
    owners: &'a [Owner],
    meetings: &'a Meetings,
    x: &'a [Vec3],
}

impl All<'_> {
    /// The least distance between two parts that may touch, less the sum of their radii (m).
    fn apart(&self) -> f64 {
        let clusters = self.hierarchy.clusters();
        let mut least = f64::INFINITY;
        for (number, one) in clusters.iter().enumerate() {
            for other in &clusters[number..] {
                if !self.surfaces.may_touch(one.part, other.part) {
                    continue;
                }
                let radius = |part: usize| self.surfaces.parts[part].radius;
                let around = one.extent + other.extent + radius(one.part) + radius(other.part);
                least = least.min((one.centre - other.centre).norm() - around);
            }
        }
        least
    }

    /// The least distance between a vertex and a shape that may touch, or between a facet and a rounded hull, less the distance at which
    /// they touch (m).
    fn before_shapes(&self, shapes: &[Placed]) -> f64 {
        let parts = self.surfaces.parts.len();
        let mut least = f64::INFINITY;
        for (number, placed) in shapes.iter().enumerate() {
            for (index, cluster) in self.hierarchy.clusters().iter().enumerate() {
                let Some(meeting) = self.meetings.get(cluster.part, parts + number) else {
                    continue;
                };
                let distance = |p: &Vec3| placed.at_start(p).distance - meeting.distance;
                if distance(&cluster.centre) - cluster.extent >= least {
                    continue;
                }
                if let Some(rounded) = placed.rounded() {
                    let touches = rounded.radius() + meeting.distance;
                    self.hierarchy
                        .each_facet(self.surfaces, index, &mut |corners| {
                            let corners = corners.map(|vertex| &self.x[vertex as usize]);
                            let distance = rounded.distance_from_hull(&placed.start, corners);
                            least = least.min(distance - touches);
                        });
                } else {
                    let members = self.hierarchy.members(index).iter();
                    let each = members.map(|vertex| distance(&self.x[*vertex as usize]));
                    least = each.fold(least, f64::min);
                }
            }
        }
        least
    }

    /// A ball around the bodies (m).
    fn ball(&self) -> (Vec3, f64) {
        let clusters = self.hierarchy.clusters().iter();
        let bodies = clusters.filter(|cluster| matches!(self.owners[cluster.part], Owner::Body(_)));
        let sum = bodies.clone().map(|cluster| cluster.centre).sum::<Vec3>();
        let centre = sum / bodies.clone().count().max(1) as f64;
        let reach = bodies.map(|cluster| (cluster.centre - centre).norm() + cluster.extent);
        (centre, reach.fold(0.0, f64::max))
    }
}
