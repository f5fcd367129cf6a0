//! Certified displacements: nothing crosses, whatever the solver left.

use super::parts::Owner;
use super::{Contacts, Member, Need};
use crate::Vec3;
use crate::contact::certificate::{NEAREST, follow, truncate};
use crate::contact::{Moves, Placed};
use crate::element::precision::Precision;

/// How often bodies are held back that would gain energy, and the displacements shortened again.
const PULLS: usize = 3;
/// The fraction of a thickness by which truncation may part what pushes from what is pushed.
const TOGETHER: f64 = 0.01;
/// An edge that moves by this fraction of its length, less the motion that its ends share, is stretched by half of the
/// square of this fraction, which the linearized equation does not know.
const TURNED: f64 = 0.05;

impl Contacts {
    /// Shortens the solved displacements such that nothing crosses, and keeps the forces for the next step.
    pub fn certify<T: Precision>(&mut self, members: &mut [Member<'_, T>]) {
        match self.need {
            Need::Nothing => return,
            Need::Clearance => {
                let motion = self.motion(members);
                if self.clearance.spend(motion) {
                    return;
                }
                self.gather(members);
                self.list();
            }
            Need::All => self.take_solved(members),
        }
        if self.lists.is_none() {
            return;
        }
        self.shorten();
        if self.hold_together() {
            self.truncate();
        }
        for _ in 0..PULLS {
            if !self.hold_back(members) {
                break;
            }
            // Vertices are counted that crossings stop, and not those of bodies that are held back.
            let by_crossings = self.report.truncated.truncated;
            self.truncate();
            self.report.truncated.truncated = by_crossings;
        }
        let pushed = self.fractions.iter().zip(&self.pushed);
        self.report.truncated.squeezed += pushed.filter(|(found, least)| found < least).count();
        for (part, owner) in self.surfaces.parts.iter().zip(&self.owners) {
            let Owner::Body(body) = owner else { continue };
            let Some(stepper) = members[*body]
                .stepper
                .as_deref_mut()
                .filter(|_| self.is_near[*body])
            else {
                continue;
            };
            let range = part.vertices.start as usize..part.vertices.end as usize;
            let (fractions, pushed) = (&self.fractions[range.clone()], &self.pushed[range]);
            let of = |node: u32| fractions.get(node as usize).copied().unwrap_or(1.0);
            let is_pushed = |node: u32| {
                let least = pushed.get(node as usize).copied().unwrap_or_default();
                least > 0.0 && of(node) == least
            };
            let report = &mut self.report;
            let mut work = |node: u32, work: f64| {
                // A shape that takes a vertex along does this work.
                if work > 0.0 && is_pushed(node) {
                    report.by_obstacles += work;
                } else {
                    report.stopped -= work;
                }
            };
            // A step that has not been solved has an error of its own.
            let _ = stepper.certify(&of, &mut work);
        }
        self.end(members);
        self.clear(members);
    }

    /// Finds the fractions of the displacements with which nothing crosses, and the bodies that are near something.
    pub(super) fn shorten(&mut self) {
        let Some(lists) = &mut self.lists else { return };
        let (surfaces, x, u) = (&self.surfaces, &self.x, &self.u);
        lists.extend(surfaces, x, |hierarchy, cluster| {
            Moves::of(hierarchy.members(cluster), u)
        });
        self.fractions.fill(1.0);
        self.pushed.fill(0.0);
        self.is_near.fill(false);
        for touch in &self.touches {
            for (at, _) in touch.nodes.iter().filter(|(_, weight)| *weight != 0.0) {
                self.is_near[at.body] = true;
            }
        }
        let mut mark = |part: usize| {
            if let Owner::Body(body) = self.owners[part] {
                self.is_near[body] = true;
            }
        };
        lists.each(surfaces, x, &mut |pair| {
            for vertex in pair.vertices(surfaces) {
                mark(surfaces.part_of(vertex));
            }
        });
        let mut run_over = 0;
        let hierarchy = lists.hierarchy();
        for (number, placed) in self.shapes.iter().enumerate() {
            for (index, cluster) in hierarchy.clusters().iter().enumerate() {
                let (part, members) = (cluster.part, hierarchy.members(index));
                let shape = surfaces.parts.len() + number;
                let most = members.iter().map(|v| u[*v as usize].norm_squared());
                let most = most.fold(0.0, f64::max).sqrt();
                if self.meetings.get(part, shape).is_none()
                    || !reaches(placed, &cluster.centre, cluster.extent, most)
                {
                    continue;
                }
                for vertex in members {
                    let (at, fraction) = (*vertex as usize, &mut self.fractions[*vertex as usize]);
                    let Before {
                        is_near,
                        least,
                        most,
                    } = before(placed, &x[at], &u[at]);
                    if is_near {
                        mark(part);
                    }
                    self.pushed[at] = self.pushed[at].max(least);
                    if most.max(0.0) < *fraction {
                        run_over += usize::from(self.mass[at].is_infinite() || most < 0.0);
                        *fraction = most.max(0.0);
                    }
                }
            }
        }
        self.run_over = run_over;
        self.truncate();
    }

    /// Lowers the fractions of vertices that go on while truncation stops those that push them: a force gives no more
    /// work than in the solved step, but for that along [`TOGETHER`]. Returns whether there are such vertices.
    fn hold_together(&mut self) -> bool {
        let mut is_changed = false;
        for (touch, row) in self.touches.iter().zip(&self.of_row) {
            if !touch.response.acts() {
                continue;
            }
            let contact = &self.rows.contacts()[*row];
            let vertices = contact.vertices.iter().zip(contact.weights);
            let along = vertices.map(|(vertex, weight)| {
                let at = *vertex as usize;
                let u = self
                    .u
                    .get(at)
                    .map_or(0.0, |u| weight * contact.row.normal.dot(u));
                (at, if weight == 0.0 { 0.0 } else { u })
            });
            let mut whole = along.clone().filter(|(_, u)| *u != 0.0);
            if whole.all(|(at, _)| self.fractions[at] == 1.0) {
                continue;
            }
            let is_free = |at: usize| self.mass[at].is_finite();
            let [mut solved, mut ahead, mut others] = [0.0; 3];
            for (at, u) in along.clone().filter(|(_, u)| *u != 0.0) {
                let moved = u * self.fractions[at];
                solved += u;
                if u > 0.0 && is_free(at) {
                    ahead += moved;
                } else {
                    others += moved;
                }
            }
            let most = solved.max(0.0) + TOGETHER * contact.thickness;
            if ahead + others <= most || ahead <= 0.0 {
                continue;
            }
            let by = ((most - others) / ahead).max(0.0);
            for (at, _) in along.filter(|(at, u)| *u > 0.0 && is_free(*at)) {
                // A shape that moves takes a vertex along.
                let less = (by * self.fractions[at]).max(self.pushed[at]);
                is_changed |= less < self.fractions[at];
                self.fractions[at] = less.min(self.fractions[at]);
            }
        }
        if is_changed {
            let is_free = |vertex: u32| self.mass[vertex as usize].is_finite();
            follow(
                &self.surfaces,
                &self.x,
                &self.u,
                &is_free,
                &mut self.fractions,
            );
        }
        is_changed
    }

    /// Lowers the fractions of bodies that would gain energy by them. Returns whether there is such a body.
    fn hold_back<T: Precision>(&mut self, members: &mut [Member<'_, T>]) -> bool {
        let mut is_changed = false;
        for (part, owner) in self.surfaces.parts.iter().zip(&self.owners) {
            let Owner::Body(number) = owner else { continue };
            let Member { body, stepper } = &mut members[*number];
            let Some(stepper) = stepper.as_deref_mut().filter(|_| self.is_near[*number]) else {
                continue;
            };
            let range = part.vertices.start as usize..part.vertices.end as usize;
            let fractions = &self.fractions[range.clone()];
            let of = |node: u32| fractions.get(node as usize).copied().unwrap_or(1.0);
            let free = fractions.iter().zip(&self.mass[range.clone()]);
            let free = free.filter(|(_, mass)| mass.is_finite());
            let least = free.fold(1.0, |least, (fraction, _)| fraction.min(least));
            let mut by = 1.0;
            if least < 1.0 {
                by = stepper.fraction_without_gain(&of);
            }
            // A stiff body that stops at a vertex goes further as a whole, which gives no energy either.
            let whole = (by < least).then_some(least);
            let of = |node: u32| whole.unwrap_or_else(|| by * of(node));
            let rows = self.touches.iter().zip(&self.of_row);
            let contacts = |s: f64| {
                let energies = rows.clone().map(|(touch, row)| {
                    let contact = &self.rows.contacts()[*row];
                    let mut ju = Vec3::zeros();
                    for (vertex, weight) in contact.vertices.iter().zip(contact.weights) {
                        let (at, vertex) = (*vertex as usize, *vertex);
                        let Owner::Body(body) = self.owners[self.surfaces.part_of(vertex)] else {
                            continue;
                        };
                        let moves = body == *number && self.mass[at].is_finite();
                        let fraction = if moves {
                            s * of(vertex - part.vertices.start)
                        } else {
                            self.fractions[at]
                        };
                        ju += self.u[at] * (weight * fraction);
                    }
                    touch.row.energy(&ju, &touch.response.friction)
                });
                energies.sum()
            };
            let turns = part.edges.clone().any(|edge| {
                let [a, b] = self.surfaces.edges[edge as usize].map(|vertex| vertex as usize);
                let by = (self.u[a] - self.u[b]).norm_squared();
                by > TURNED * TURNED * (self.x[a] - self.x[b]).norm_squared()
            });
            let mut further = 1.0;
            if turns {
                further = stepper.fraction_of_least(body, &of, &contacts);
            }
            if by < 1.0 || further < 1.0 {
                is_changed = true;
                let free = self.fractions[range.clone()]
                    .iter_mut()
                    .zip(&self.mass[range.clone()])
                    .zip(&self.pushed[range]);
                for ((fraction, _), pushed) in free.filter(|((_, mass), _)| mass.is_finite()) {
                    // A shape that moves takes a vertex along.
                    let least = pushed.min(*fraction);
                    *fraction = (further * whole.unwrap_or(by * *fraction)).max(least);
                }
            }
        }
        is_changed
    }

    /// Shortens the displacements such that no listed pair crosses.
    fn truncate(&mut self) {
        let Some(lists) = &self.lists else { return };
        let (surfaces, x, u) = (&self.surfaces, &self.x, &self.u);
        let mass = &self.mass;
        let is_free = |vertex: u32| mass[vertex as usize].is_finite();
        let each = |found: &mut dyn FnMut(crate::contact::Pair)| lists.each(surfaces, x, found);
        self.report.truncated = truncate(surfaces, x, u, &each, &is_free, &mut self.fractions);
        self.report.truncated.squeezed += self.run_over;
    }

    /// Takes the solved displacements.
    fn take_solved<T: Precision>(&mut self, members: &[Member<'_, T>]) {
        for (part, owner) in self.surfaces.parts.iter().zip(&self.owners) {
            if let Owner::Body(body) = owner
                && let Some(stepper) = &members[*body].stepper
            {
                let nodes = members[*body].body.node_positions().len() as u32;
                for (node, vertex) in (0..nodes).zip(part.vertices.clone()) {
                    self.u[vertex as usize] = stepper.displacement(node);
                }
            }
        }
    }
}

/// The fraction of the distance to a shape that a vertex may use up.
const BEFORE: f64 = 0.95;

/// Whether a point within `extent` (m) of `centre` (m) that moves by `most` (m) may come to a shape.
fn reaches(placed: &Placed, centre: &Vec3, extent: f64, most: f64) -> bool {
    let distance = placed.at_start(centre).distance - extent;
    let motion = placed.most_motion(centre, distance.abs() + 2.0 * extent);
    BEFORE * distance <= most + motion
}

/// What keeps a vertex before a shape in a step.
struct Before {
    /// Whether the vertex is near the shape in the step.
    is_near: bool,
    /// The fractions of its displacement with which it stays before the shape. If the shape moves, the vertex may have to make
    /// way. The larger fraction is negative if the shape moves over the vertex.
    least: f64,
    most: f64,
}

/// Shapes are convex, so the plane at the nearest point, which moves and turns with the shape, divides a vertex from it.
fn before(placed: &Placed, x: &Vec3, u: &Vec3) -> Before {
    let found = placed.at_start(x);
    let motion = placed.motion_from(x);
    let is_near = found.distance <= u.norm() + motion.norm();
    let normal = placed.turned(&found.normal);
    let towards = -normal.dot(u);
    let free = (BEFORE * found.distance).min((found.distance - NEAREST).max(0.0));
    let room = free - normal.dot(&motion);
    let (mut least, mut most) = (0.0, 1.0);
    if found.distance > 0.0 && towards > room {
        most = if room < 0.0 { -1.0 } else { room / towards };
    } else if found.distance > 0.0 && room < 0.0 {
        least = room / towards;
    }
    Before {
        is_near,
        least,
        most,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::shape::Shape;
    use nalgebra::{Isometry3, UnitQuaternion};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_vertex_that_keeps_to_its_fractions_ends_outside_a_shape_that_turns(
            number in 0_usize..5,
            place in [-1.0..1.0, -1.0..1.0, -1.0..1.0],
            by in [-1.0..1.0, -1.0..1.0, -1.0..1.0],
            moved in [-0.3..0.3, -0.3..0.3, -0.3..0.3],
            turned in [-0.8..0.8, -0.8..0.8, -0.8..0.8],
            stood in [-3.0..3.0, -3.0..3.0, -3.0..3.0],
        ) {
            let (half, radius) = (0.4, 0.3);
            let shapes = [
                Shape::Plane,
                Shape::sphere(radius),
                Shape::capsule(half, radius),
                Shape::Cylinder { half, radius },
                Shape::Box { half: Vec3::new(0.3, 0.5, 0.2) },
            ];
            let shape = &shapes[number];
            let [stood, turned] = [stood, turned].map(|by| UnitQuaternion::from_scaled_axis(Vec3::from(by)));
            let start = Isometry3::from_parts(Vec3::new(0.1, -0.2, 0.3).into(), stood);
            let placed = Placed {
                shape: shape.clone(),
                start,
                end: Isometry3::from_parts(Vec3::from(moved).into(), turned) * start,
                holds: false,
            };
            let (place, by) = (Vec3::from(place), Vec3::from(by));
            prop_assume!(placed.at_start(&place).distance > 0.0);
            let Before { least, most, .. } = before(&placed, &place, &by);
            // A shape that moves over the vertex leaves none.
            for fraction in [least, most].into_iter().filter(|_| most >= 0.0 && least <= 1.0) {
                let end = placed.at_end(&(place + by * fraction)).distance;
                prop_assert!(end > -1e-12, "{shape:?} {fraction} {end}");
            }
        }
    }
}
