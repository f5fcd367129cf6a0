//! What the contacts of a step did, and what they keep for the next one.

use super::parts::Owner;
use super::{Contacts, Member};
use crate::Vec3;
use crate::contact::certificate::Truncation;
use crate::contact::{Contact, Counts, RowsReport};
use crate::element::precision::Precision;
use crate::motion::constraint::tangent::Tangent;
use crate::motion::joined::At;
use crate::motion::touching::{Touch, TouchReport};

/// The residual of a step, as a fraction of the forces of the contacts, above which the step is not solved.
const UNSOLVED: f64 = 0.02;

/// A side of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Side {
    /// The body of this number.
    Body(usize),
    /// The obstacle of this number.
    Obstacle(usize),
}

/// The sum of the contacts between two sides in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Touching {
    /// The sides, in ascending order: parts, and after them shapes.
    pub sides: [usize; 2],
    /// Number of contacts with a force.
    pub count: usize,
    /// Sum of the normal forces, by size (N).
    pub normal: f64,
    /// Sum of the friction forces, by size (N).
    pub friction: f64,
    /// The force on the first side (N).
    pub force: Vec3,
    /// The largest depth (m); not negative.
    pub depth: f64,
    /// Number of contacts that slip.
    pub slipping: usize,
}

/// What the contacts of a step did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactReport {
    /// The lists.
    pub counts: Counts,
    /// The rows.
    pub rows: RowsReport,
    /// The solver, over all islands.
    pub solved: TouchReport,
    /// The truncation.
    pub truncated: Truncation,
    /// The energy that the contacts took from both sides, beside the work of obstacles and of parting (J): stored in friction
    /// springs, dissipated by friction, and by normal forces that depart from the law of a rigid contact.
    pub taken: f64,
    /// The work of moving obstacles on vertices that give way, at the latest when an overlap that the obstacles made is undone, and
    /// on vertices that they take along (J).
    pub by_obstacles: f64,
    /// The work with which overlaps parted (J).
    pub parted: f64,
    /// The energy in the springs of friction (J).
    pub stored: f64,
    /// The energy that the forces which shorten displacements took from the bodies (J).
    pub stopped: f64,
}

impl Contacts {
    /// What the contacts of the last step did.
    pub fn report(&self) -> ContactReport {
        self.report
    }

    /// The work of the contacts of the last step on a body (J), one of at most [`MOST_BODIES`](super::MOST_BODIES).
    pub fn work_on(&self, body: usize) -> f64 {
        self.works[body]
    }

    /// The part of that work which contacts with other bodies did (J).
    pub fn work_of_bodies_on(&self, body: usize) -> f64 {
        self.between[body]
    }

    /// The sums of the contacts of the last step, by pair of sides that touch.
    pub fn touching(&self) -> &[Touching] {
        &self.touching
    }

    /// The contacts of the last step with a force: the sides, the place on the first side at the start of the step (m), and
    /// the contact.
    pub fn points(&self) -> impl Iterator<Item = ([usize; 2], Vec3, &Touch)> {
        let touches = self.touches.iter().zip(&self.of_row);
        let acting = touches.filter(|(touch, _)| touch.response.acts());
        acting.map(|(touch, row)| {
            let contact = &self.rows.contacts()[*row];
            let corners = contact.vertices.iter().zip(contact.weights);
            let first = corners.filter(|(_, weight)| *weight > 0.0);
            let place = first.map(|(vertex, weight)| self.x[*vertex as usize] * weight);
            (contact.parts, place.sum(), touch)
        })
    }

    /// Whether the last step was solved, and all vertices that touch a side have moved so. Where truncation or the guard of energy stops
    /// vertices, the forces of the solution are not those of the motion.
    pub fn moved_as_solved(&self, side: Side) -> bool {
        if self.report.solved.left > UNSOLVED {
            return false;
        }
        let touches = self.touches.iter().zip(&self.of_row);
        let acting = touches.filter(|(touch, _)| touch.response.acts());
        let mut contacts = acting.map(|(_, row)| &self.rows.contacts()[*row]);
        contacts.all(|contact| {
            let mut corners = contact.vertices.iter().zip(contact.weights);
            !contact.parts.map(|part| self.side(part)).contains(&side)
                || corners.all(|(v, weight)| weight == 0.0 || self.fractions[*v as usize] == 1.0)
        })
    }

    /// Sums up the contacts, and keeps them.
    pub(super) fn sum_up(&mut self) {
        self.touching.clear();
        let mut responses = core::mem::take(&mut self.room.responses);
        responses.clear();
        responses.resize(self.touches.len(), None);
        for (touch, row) in self.touches.iter().zip(&self.of_row) {
            responses[*row] = Some(touch.response);
            let contact = &self.rows.contacts()[*row];
            if !touch.response.acts() && contact.row.motion == Vec3::zeros() {
                self.rows.set_overrun(*row, 0.0);
                continue;
            }
            let (force, normal) = (touch.force(), &contact.row.normal);
            let motion = contact.row.motion * self.part_of(contact);
            let (mut on_bodies, mut ju) = (0.0, -motion);
            let are_bodies = self.are_two_bodies(contact.parts);
            for (vertex, weight) in contact.vertices.iter().zip(contact.weights) {
                // The motion of a vertex of an obstacle is in the row.
                if let Some(at) = self.at(*vertex).filter(|_| weight != 0.0) {
                    let vertex = *vertex as usize;
                    let moved = self.u[vertex] * self.fractions[vertex];
                    let work = weight * force.dot(&moved);
                    self.works[at.body] += work;
                    if are_bodies {
                        self.between[at.body] += work;
                    }
                    on_bodies += work;
                    ju += moved * weight;
                }
            }
            let opened = normal.dot(&ju);
            let mut by_obstacles = force.dot(&motion);
            let mut overrun = 0.0;
            if contact.is_parting {
                // An overlap that truncation keeps from parting takes energy, as any contact does.
                let parted = touch.response.normal * opened.max(0.0);
                self.report.parted += parted;
                self.report.taken += parted;
            } else if !contact.row.is_held {
                // The obstacle pushes as far as it has come and the vertices give way.
                let [came, all] = [&motion, &contact.row.motion].map(|by| normal.dot(by));
                let room = contact.overrun + all.max(0.0);
                let pushed = (opened + came.max(0.0)).max(0.0).min(room);
                by_obstacles += touch.response.normal * (pushed - came.max(0.0));
                let overlap = all - came - opened - contact.row.gap;
                overrun = (room - pushed).min(overlap).max(0.0);
            }
            self.report.taken += by_obstacles - on_bodies;
            self.report.by_obstacles += by_obstacles;
            if touch.response.acts() {
                add_to(&mut self.touching, contact.parts, touch);
            }
            // Where a vertex was stopped without room, the stiffness may come from rows against each other.
            let mut each = contact.vertices.iter().zip(contact.weights);
            let has_room = self.report.truncated.squeezed == 0
                || each.all(|(v, weight)| weight == 0.0 || self.fractions[*v as usize] == 1.0);
            self.rows.set_overrun(*row, overrun);
            if touch.stiffened > 0.0 && has_room {
                self.rows.set_stiffened(*row, touch.stiffened);
            }
        }
        for (touch, (corner, _)) in self.facets.touches.iter().zip(&self.facets.of) {
            if touch.response.acts() {
                add_to(&mut self.touching, self.facets.pair(corner.0).sides, touch);
            }
        }
        self.touching.sort_unstable_by_key(|sum| sum.sides);
        let fractions = &self.fractions;
        let is_stopped = |vertex: u32| fractions[vertex as usize] < 1.0;
        self.rows.end(responses.iter().flatten(), &is_stopped);
        self.room.responses = responses;
        self.report.stored = self.rows.stored();
    }

    /// The part of the step in which a contact acts, which ends where truncation or the guard of energy stops its vertices (1):
    /// the mean over the vertices of bodies by their weights. An obstacle goes on alone.
    fn part_of(&self, contact: &Contact) -> f64 {
        let [mut sum, mut weights] = [0.0; 2];
        for (vertex, weight) in contact.vertices.iter().zip(contact.weights) {
            if self.at(*vertex).is_some() {
                sum += weight.abs() * self.fractions[*vertex as usize];
                weights += weight.abs();
            }
        }
        if weights > 0.0 { sum / weights } else { 1.0 }
    }

    /// Whether a contact of these sides is one between two bodies.
    fn are_two_bodies(&self, parts: [usize; 2]) -> bool {
        matches!(
            parts.map(|part| self.owners.get(part)),
            [Some(Owner::Body(one)), Some(Owner::Body(other))] if one != other
        )
    }

    /// Ends a step: sums up the contacts, keeps them, and gives them to the bodies for their factors.
    pub(super) fn end<T: Precision>(&mut self, members: &mut [Member<'_, T>]) {
        self.sum_up();
        for (body, member) in members.iter_mut().enumerate() {
            if let Some(stepper) = member.stepper.as_deref_mut().filter(|s| !s.sleeps()) {
                let acting = self.touches.iter().filter(|touch| touch.response.acts());
                stepper.touch(acting.filter_map(|touch| tangent(touch, body)));
            }
        }
    }
}

/// Adds a contact between two `parts` to the sums.
fn add_to<N: AsRef<[(At, f64)]>>(sums: &mut Vec<Touching>, parts: [usize; 2], touch: &Touch<N>) {
    // Vertices of either side may touch the other.
    let [one, other] = parts;
    let (sides, sign) = if one <= other {
        ([one, other], 1.0)
    } else {
        ([other, one], -1.0)
    };
    let found = sums.iter().position(|sum| sum.sides == sides);
    let at = found.unwrap_or_else(|| {
        sums.push(Touching {
            sides,
            ..Touching::default()
        });
        sums.len() - 1
    });
    let sum = &mut sums[at];
    sum.count += 1;
    sum.normal += touch.response.normal.abs();
    sum.friction += touch.response.friction.norm();
    sum.force += touch.force() * sign;
    sum.depth = sum.depth.max(-touch.response.gap);
    sum.slipping += usize::from(touch.response.slips);
}

/// What a contact is for the factor of a body; `None` if the body has no node of it.
fn tangent(touch: &Touch, body: usize) -> Option<Tangent> {
    let is_own = |(at, weight): &(At, f64)| at.body == body && *weight != 0.0;
    touch.nodes.iter().any(is_own).then(|| Tangent {
        // A node without a weight may be one of another body.
        nodes: touch.nodes.map(|node| {
            if is_own(&node) {
                (node.0.node, node.1)
            } else {
                (0, 0.0)
            }
        }),
        stiffness: touch.row.tangent(&touch.response),
    })
}
