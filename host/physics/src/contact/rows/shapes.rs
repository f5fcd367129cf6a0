//! Rows of obstacles with a shape: the vertices near a shape, and points between vertices that a rounded hull meets.
//!
//! **Rounded hulls** also meet points between vertices, see `between`, and their contacts are looked at again in the solution
//! (`Rows::look`).

use super::{Contact, Rows, Step, parting, strung};
use crate::Vec3;
use crate::contact::between::{Between, SHORT};
use crate::contact::feet::{Connection, is_within};
use crate::contact::kept::Key;
use crate::contact::pair::Foot;
use crate::contact::shape::Nearest;
use nalgebra::Point3;

/// The distance from a point that is held, as a fraction of the radius of the shape, within which it stands for all points between vertices.
const NEAR_HELD: f64 = 0.5;
/// The least product of the directions to a shape at the start and at the end of a step, for which the row has the direction
/// at the end. A vertex that slides by an angle `a` around a radius `R` moves by `R a^2 / 2` along the direction at the end,
/// where the force gives energy: more than friction takes, if `a` is large.
const TURNED: f64 = 0.95;
/// The distance, as a fraction of the radius of a rounded hull, by which a row may err, and which a point between vertices may lie in
/// it.
const INEXACT: f64 = 1e-3;

impl Rows {
    /// Makes contacts of an obstacle with the surface near it.
    pub(super) fn obstacle(&mut self, step: &Step<'_>, number: usize) {
        let other = (step.surfaces.parts.len() + number) as u32;
        self.each_near(step, number, &mut |rows, index, thickness| {
            let part = step.hierarchy.clusters()[index].part;
            for vertex in step.hierarchy.members(index) {
                let foot = ([*vertex; 4], [1.0, 0.0, 0.0, 0.0]);
                let key = Key::Vertex(*vertex, other);
                rows.point(step, key, foot, [part, number], thickness);
            }
            rows.facets(step, index, number, thickness);
        });
    }

    /// Makes contacts of the points between vertices that pressed a shape in the last step.
    pub(super) fn pressing(&mut self, step: &Step<'_>) {
        for number in 0..self.kept.len() {
            let state = self.kept[number];
            let Key::Between(point, other) = state.key else {
                continue;
            };
            let part = self.part_of[point.vertices[0] as usize] as usize;
            let meeting = (step.meeting)(part, other as usize);
            if let Some(meeting) = meeting.filter(|_| state.anchor.is_some() || state.acted()) {
                let number = other as usize - step.surfaces.parts.len();
                self.between(step, point, [part, number], meeting.distance);
            }
        }
    }

    /// Takes hold of the contacts that pressed shapes which hold. A contact that is held stands for the points between vertices near it: they
    /// would act against each other.
    pub(super) fn hold(&mut self, step: &Step<'_>) {
        for (number, obstacle) in step.obstacles.iter().enumerate() {
            let other = step.surfaces.parts.len() + number;
            let Some(rounded) = obstacle.rounded().filter(|_| obstacle.holds) else {
                continue;
            };
            let near = NEAR_HELD * rounded.radius();
            let mut place = 0;
            // Vertices come before the points between them.
            while let Some(number) = self.order.get(place) {
                let number = *number as usize;
                let contact = &self.found[number];
                place += 1;
                if contact.parts[1] != other || contact.anchor.is_some() {
                    continue;
                }
                let at = contact.place(step.x);
                let found = |number: &u32| &self.found[*number as usize];
                let mut held = self.order.iter().map(found);
                let is_near = |one: &Contact| {
                    let is_held = one.parts[1] == other && one.anchor.is_some();
                    is_held && (one.place(step.x) - at).norm() < near
                };
                if matches!(contact.key, Key::Between(..)) && held.any(is_near) {
                    place -= 1;
                    self.order.remove(place);
                } else if contact.acted() {
                    let own = obstacle.start.inverse_transform_point(&Point3::from(at));
                    self.found[number].anchor = Some(own.coords);
                }
            }
        }
    }

    /// Looks at the facets of parts that `are_own` where the solution has them: `step.u` is the solved displacement. Points deep in a
    /// rounded hull become contacts, after those that are there.
    pub(crate) fn look(&mut self, step: &Step<'_>, are_own: &dyn Fn(usize) -> bool) {
        for ((end, x), u) in self.ends.iter_mut().zip(step.x).zip(step.u) {
            *end = x + u;
        }
        self.found.clear();
        for number in 0..step.obstacles.len() {
            self.each_near(step, number, &mut |rows, index, thickness| {
                if are_own(step.hierarchy.clusters()[index].part) {
                    rows.facets(step, index, number, thickness);
                }
            });
        }
        self.sort();
        for number in 0..self.order.len() {
            let found = self.found[self.order[number] as usize];
            let is_there = self.contacts.iter().any(|there| there.key == found.key);
            let is_deep = found.predicted < -found.inexact;
            if is_deep && !is_there && self.contacts.len() < self.most {
                let found = Contact {
                    is_parting: found.row.gap < 0.0,
                    ..found
                };
                let found = strung(&found, step, &mut self.report);
                self.contacts.push(found);
            }
        }
    }

    /// The direction and the gap (m) for no displacement of a contact with a rounded hull, linearized at the solved displacement
    /// `step.u`; `None` if those of the row are as good there.
    pub(crate) fn looked_at(&self, step: &Step<'_>, contact: usize) -> Option<(Vec3, f64)> {
        let contact = &self.contacts[contact];
        let number = contact.parts[1].checked_sub(step.surfaces.parts.len())?;
        let obstacle = &step.obstacles[number];
        let each = contact.vertices.iter().zip(contact.weights);
        let sum = |of: &[Vec3]| {
            each.clone()
                .map(|(v, weight)| of[*v as usize] * weight)
                .sum::<Vec3>()
        };
        let u = sum(step.u);
        let near = obstacle.at_end(&(sum(step.x) + u));
        let (row, by) = (&contact.row, u - contact.row.motion);
        let now = row.gap + row.normal.dot(&by);
        let mut gap = near.distance - contact.thickness - near.normal.dot(&by);
        if contact.is_parting {
            gap = parting(gap, step);
        }
        let there = gap + near.normal.dot(&by);
        let is_inexact =
            (there - now).abs() > contact.inexact && there.min(now) < 0.5 * contact.inexact;
        let looks = contact.inexact > 0.0 && !row.is_held;
        (looks && is_inexact && near.normal.dot(&row.normal) > TURNED).then_some((near.normal, gap))
    }

    /// Gives a contact another direction and gap (m).
    pub(crate) fn look_again(&mut self, contact: usize, normal: Vec3, gap: f64) {
        let row = &mut self.contacts[contact].row;
        (row.normal, row.gap) = (normal, gap);
    }

    /// Calls `found` for each cluster that may touch an obstacle, with the distance at which it does (m).
    fn each_near(
        &mut self,
        step: &Step<'_>,
        number: usize,
        found: &mut dyn FnMut(&mut Self, usize, f64),
    ) {
        let obstacle = &step.obstacles[number];
        let parts = &step.surfaces.parts;
        for (index, cluster) in step.hierarchy.clusters().iter().enumerate() {
            let part = &parts[cluster.part];
            if part.is_obstacle {
                continue;
            }
            let Some(meeting) = (step.meeting)(cluster.part, parts.len() + number) else {
                continue;
            };
            let thickness = meeting.distance;
            let most = most_of(step.u, step.hierarchy.members(index));
            let (centre, around) = (&cluster.centre, cluster.extent + most);
            let distance = obstacle.at_end(centre).distance - around;
            // The material points under the vertices are as far from the centre at most.
            let by = most + obstacle.most_motion(centre, distance.abs() + 2.0 * around);
            if is_within(distance, thickness, by) {
                found(self, index, thickness);
            }
        }
    }

    /// Makes contacts of a rounded hull with the nearest points between the vertices of the cluster of this number.
    fn facets(&mut self, step: &Step<'_>, cluster: usize, number: usize, thickness: f64) {
        let obstacle = &step.obstacles[number];
        let Some(rounded) = obstacle.rounded() else {
            return;
        };
        let sides = [step.hierarchy.clusters()[cluster].part, number];
        let short = SHORT * (rounded.radius() + thickness);
        step.hierarchy
            .each_facet(step.surfaces, cluster, &mut |corners| {
                let places = corners.map(|vertex| &step.x[vertex as usize]);
                let [a, b, c] = places;
                let longest = (b - a).norm_squared().max((c - b).norm_squared());
                let longest = longest.max((a - c).norm_squared());
                if longest <= short * short || !self.is_near(step, number, &corners, thickness) {
                    return;
                }
                let ends = corners.map(|vertex| &self.ends[vertex as usize]);
                let near = [(&obstacle.end, ends), (&obstacle.start, places)];
                let near = near.map(|(pose, corners)| rounded.near(pose, corners).weights);
                let points = near.map(|weights| Between::at(corners, weights));
                for point in points.into_iter().flatten() {
                    self.between(step, point, sides, thickness);
                }
            });
    }

    /// Makes a contact of a point between vertices with a shape.
    fn between(&mut self, step: &Step<'_>, point: Between, sides: [usize; 2], thickness: f64) {
        let ([a, b, c], [p, q, r]) = (point.vertices, point.weights());
        let key = Key::Between(point, (step.surfaces.parts.len() + sides[1]) as u32);
        self.point(step, key, ([a, b, c, c], [p, q, r, 0.0]), sides, thickness);
    }

    /// Whether the convex hull of vertices may touch a shape.
    fn is_near(&self, step: &Step<'_>, number: usize, corners: &[u32], thickness: f64) -> bool {
        let obstacle = &step.obstacles[number];
        let at = |vertex: &u32| self.ends[*vertex as usize];
        let centre = corners.iter().map(at).sum::<Vec3>() / corners.len() as f64;
        let around = corners.iter().map(|vertex| (at(vertex) - centre).norm());
        let around = around.fold(0.0, f64::max);
        let distance = obstacle.at_end(&centre).distance - around;
        let by =
            most_of(step.u, corners) + obstacle.most_motion(&centre, distance.abs() + 2.0 * around);
        is_within(distance, thickness, by)
    }

    /// Makes a contact of a point of a part with a shape, if they may touch.
    fn point(
        &mut self,
        step: &Step<'_>,
        key: Key,
        (vertices, weights): ([u32; 4], [f64; 4]),
        [part, number]: [usize; 2],
        thickness: f64,
    ) {
        let obstacle = &step.obstacles[number];
        let sum = |of: &[Vec3]| {
            let each = vertices.iter().zip(weights);
            each.map(|(vertex, weight)| of[*vertex as usize] * weight)
                .sum::<Vec3>()
        };
        let (from, to) = (sum(step.x), sum(&self.ends));
        let (start, end) = (obstacle.at_start(&from), obstacle.at_end(&to));
        let is_end = start.normal.dot(&end.normal) > TURNED;
        let (nearest, point) = if is_end { (end, to) } else { (start, from) };
        let Nearest { normal, distance } = nearest;
        let motion = obstacle.motion_to(&(point - normal * distance));
        let relative = sum(step.u) - motion;
        let predicted = if is_end {
            distance
        } else {
            distance + normal.dot(&relative)
        };
        let anchor = if obstacle.holds {
            self.anchor(key)
        } else {
            None
        };
        if anchor.is_none() && !is_within(predicted.min(end.distance), thickness, relative.norm()) {
            return;
        }
        let connection = Connection {
            foot: Foot {
                vertices,
                weights,
                apart: normal * distance,
            },
            length: distance,
            normal,
            relative,
        };
        let other = step.surfaces.parts.len() + number;
        let mut contact = self.contact(step, key, [part, other], &connection, predicted, thickness);
        (contact.row.motion, contact.anchor) = (motion, anchor);
        contact.start = start.distance - thickness;
        if let Some(rounded) = obstacle.rounded() {
            contact.inexact = INEXACT * rounded.radius();
        }
        self.push(&contact);
    }
}

/// The largest of the vectors `u` of some vertices.
fn most_of(u: &[Vec3], vertices: &[u32]) -> f64 {
    let squares = vertices.iter().map(|v| u[*v as usize].norm_squared());
    squares.fold(0.0, f64::max).sqrt()
}
