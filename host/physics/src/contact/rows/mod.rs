//! The rows of a step: listed pairs and obstacles, each with the law by which it responds, and what it keeps.
//!
//! [`Rows::begin`] makes the rows of a step from its prediction, and [`Rows::end`] takes what the solver found. A row looks
//! further than the predicted motion, so that what comes near in the step meets a row. Each contact is one row: see `nearest`
//! for vertices; two edges are a contact if both feet are inside them, and otherwise a vertex is. A thread has no triangles:
//! the ends of its segments meet other segments as vertices.
//!
//! **Overlap.** A contact that begins with an overlap, or a vertex inside a shape, parts in a tenth of a second, at a bounded
//! speed (`Step::parting`). Its work is booked until the overlap is gone. Then it is like others, and carries nothing.
//!
//! The rows depend on the pairs, and not on their order. Nothing is allocated after [`Rows::new`].

mod shapes;

use crate::Vec3;
use crate::contact::certificate::Each;
use crate::contact::feet::{Connection, Feet};
use crate::contact::hierarchy::Hierarchy;
use crate::contact::kept::{Kept, Key, take};
use crate::contact::nearest::{Candidate, of_group};
use crate::contact::pair::{Foot, Pair};
use crate::contact::placed::Placed;
use crate::contact::row::{Response, Row, Stiffness, carried};
use crate::contact::surface::Surfaces;
use crate::contact::thinning::Thinning;
use nalgebra::Point3;

/// Room for rows before they are thinned, as a multiple of the rows.
const FOUND: usize = 4;
/// The depth (m) that a contact with a sphere may have.
const EXACT: f64 = 5e-6;
/// The fraction of a thickness by which a contact overlaps while it parts.
const PARTED: f64 = 0.02;
/// The time (s) in which an overlap falls to 1/e, within the bounds of its speed, the lower one of which is [`SLOWEST`] (m/s).
/// The energy that a small overlap gives goes with the square of its speed: eight sheets that land on each other get 3.2 mJ at
/// 0.2 m/s, and 0.5 mJ at 5 mm/s.
const PARTING_TIME: f64 = 0.1;
/// See [`PARTING_TIME`].
const SLOWEST: f64 = 5e-3;
/// The depth, in thicknesses, beyond which the multiplier of a contact is carried on within the step. A contact
/// undoes its overlap with a larger force than the force that made it, and gives the difference as energy.
const DEEP: f64 = 0.05;
/// A contact that held a force goes before others that are deeper by less than this fraction of its thickness.
const HELD: f64 = 0.05;
/// A vertex goes before edges that are deeper by less than this fraction.
const FIRST: f64 = 0.1;
/// The least force (N) of a contact that is held, for its stiffness: a hand that pulls gains force without having pressed before.
const HELD_FORCE: f64 = 1.0;
/// The thickness (m) by which the stiffness of surfaces without thickness goes.
const THINNEST: f64 = 1e-5;

/// How two parts meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// The distance at which they touch (m): at most the sum of their radii, up to which pairs are listed.
    pub distance: f64,
    /// The coefficient of friction.
    pub friction: f64,
    /// The largest pressure (Pa) of a contact. Where there is no room for the thickness between things that are pushed, rows act
    /// against each other, and their forces would grow without bound.
    pub pressure: f64,
    /// The largest normal force (N) of a contact.
    pub force: f64,
}

impl Meeting {
    /// All parts touch at the sum of their radii, and obstacles with a shape have none.
    pub fn by_radii(surfaces: &Surfaces, friction: f64) -> impl Fn(usize, usize) -> Option<Self> {
        move |one, other| {
            let radius = |part: usize| surfaces.parts.get(part).map_or(0.0, |part| part.radius);
            Some(Self {
                distance: radius(one) + radius(other),
                friction,
                pressure: f64::INFINITY,
                force: f64::INFINITY,
            })
        }
    }
}

/// A step, as it is predicted. Slices have an entry for each vertex of the surfaces.
#[derive(Clone, Copy)]
pub struct Step<'a> {
    /// The surfaces.
    pub surfaces: &'a Surfaces,
    /// Positions at the start (m).
    pub x: &'a [Vec3],
    /// Predicted displacements (m). Those of vertices of obstacles are prescribed.
    pub u: &'a [Vec3],
    /// Velocities after the last step (m/s).
    pub v: &'a [Vec3],
    /// Masses (kg), infinite for vertices that are held or prescribed.
    pub masses: &'a [f64],
    /// Length of the step (s).
    pub h: f64,
    /// The speed at which an overlap parts (m/s).
    pub parting: f64,
    /// How two parts meet; `None` for parts that do not touch. Obstacles are counted on after the parts.
    pub meeting: &'a dyn Fn(usize, usize) -> Option<Meeting>,
    /// The obstacles with a shape.
    pub obstacles: &'a [Placed],
    /// The boxes over the surfaces at `x`.
    pub hierarchy: &'a Hierarchy,
    /// The pairs that may touch: all that `Lists` gives.
    pub pairs: &'a Each<'a>,
}

/// A contact of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// By what the contact is known in the next step.
    pub key: Key,
    /// The vertices, and their weights: those of the first foot sum to one. A weight of zero has no vertex.
    pub vertices: [u32; 4],
    /// See `vertices`.
    pub weights: [f64; 4],
    /// The parts of both feet. Obstacles are counted on after the parts.
    pub parts: [usize; 2],
    /// The law.
    pub row: Row,
    /// The distance at which the two things touch (m).
    pub thickness: f64,
    /// The gap at the predicted end of the step (m).
    pub predicted: f64,
    /// The gap to a shape at the start of the step (m); zero between surfaces, which never cross.
    pub start: f64,
    /// The mass (kg) that the row moves.
    pub mass: f64,
    /// The part of the overlap that the motion of an obstacle made (m). The obstacle does its work when the contact
    /// undoes this part, with the force that the contact then has.
    pub overrun: f64,
    /// The stiffness along the normal that the contact took within a step (N/m); zero if it has taken none.
    pub stiffened: f64,
    /// The distance by which the row may err (m): the surface of a sphere is not plane.
    pub inexact: f64,
    /// Steps since the contact was found.
    pub age: u32,
    /// Where a shape holds the first foot (m, axes of the shape); `None` for a contact that is not held.
    pub anchor: Option<Vec3>,
    /// Whether an overlap parts.
    pub is_parting: bool,
    /// Whether the contact closes fast: its island needs a second update of the multipliers.
    pub is_impact: bool,
    /// The normal forces of the last two steps (N), the latest first.
    forces: [f64; 2],
    /// The speed (m/s) at which it opened in the last step, if it had a force.
    opened: Option<f64>,
}

impl Contact {
    /// The normal forces of the last two steps (N), the latest first.
    pub fn forces(&self) -> [f64; 2] {
        self.forces
    }

    /// From where a shape holds the first foot to where the foot is, if it does not move against the shape (m).
    fn away(&self, step: &Step<'_>) -> Option<Vec3> {
        let anchor = Point3::from(self.anchor?);
        let number = self.parts[1].checked_sub(step.surfaces.parts.len())?;
        let held = step.obstacles[number].end * anchor;
        Some(self.place(step.x) + self.row.motion - held.coords)
    }

    /// Where the first foot is at places `x` of the vertices (m).
    fn place(&self, x: &[Vec3]) -> Vec3 {
        let corners = self.vertices.iter().zip(self.weights);
        let first = corners.filter(|(_, weight)| *weight > 0.0);
        first
            .map(|(vertex, weight)| x[*vertex as usize] * weight)
            .sum()
    }

    /// Whether the contact had a force in the last step.
    fn acted(&self) -> bool {
        self.forces[0] != 0.0
    }

    /// The vertices that move, each with the direction in which the normal force pushes it.
    fn pushed<'a>(&'a self, masses: &'a [f64]) -> impl Iterator<Item = (u32, Vec3)> + Clone + 'a {
        let each = self.vertices.iter().zip(&self.weights);
        let each = each.filter(|(v, weight)| **weight != 0.0 && masses[**v as usize].is_finite());
        each.map(|(v, weight)| (*v, self.row.normal * weight.signum()))
    }

    /// How deep the contact is, in thicknesses: the smaller, the deeper.
    fn depth(&self) -> f64 {
        let held = if self.acted() { HELD } else { 0.0 };
        let first = match self.key {
            Key::Vertex(..) => FIRST,
            Key::Between(..) | Key::Edges(..) => 0.0,
        };
        self.predicted / self.thickness.max(THINNEST) - held - first
    }
}

/// What [`Rows::begin`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RowsReport {
    /// Rows.
    pub rows: usize,
    /// Contacts that are left out because each of their vertices has three deeper ones.
    pub thinned: usize,
    /// Contacts that are left out because there was no room. The deepest ones have rows.
    pub dropped: usize,
    /// Contacts whose overlap parts.
    pub parting: usize,
    /// The energy (J) that springs of friction gained because their stiffness changed and their force did not.
    pub restrung: f64,
    /// The energy (J) in springs of friction whose contacts are no longer there.
    pub released: f64,
}

/// The rows of the steps.
#[derive(Debug)]
pub struct Rows {
    part_of: Vec<u32>,
    /// Positions at the predicted end (m).
    ends: Vec<Vec3>,
    candidates: Vec<Candidate>,
    found: Vec<Contact>,
    order: Vec<u32>,
    /// The order from the deepest on, and which are kept.
    deepest: Vec<u32>,
    is_kept: Vec<bool>,
    contacts: Vec<Contact>,
    kept: Vec<Kept>,
    thinning: Thinning,
    most: usize,
    /// Length of the step (s).
    h: f64,
    report: RowsReport,
}

impl Rows {
    /// Room for `most` rows.
    pub fn new(surfaces: &Surfaces, most: usize) -> Self {
        let mut part_of = vec![0; surfaces.vertices];
        for (number, part) in (0_u32..).zip(&surfaces.parts) {
            part_of[part.vertices.start as usize..part.vertices.end as usize].fill(number);
        }
        let found = FOUND * most;
        Self {
            ends: vec![Vec3::zeros(); part_of.len()],
            thinning: Thinning::new(part_of.len()),
            part_of,
            candidates: Vec::with_capacity(found),
            found: Vec::with_capacity(found),
            order: Vec::with_capacity(found),
            deepest: Vec::with_capacity(found),
            is_kept: Vec::with_capacity(found),
            contacts: Vec::with_capacity(most),
            kept: Vec::with_capacity(most),
            most,
            h: 1.0,
            report: RowsReport::default(),
        }
    }

    /// Makes the rows of a step.
    pub fn begin(&mut self, step: &Step<'_>) -> RowsReport {
        self.report = RowsReport::default();
        self.h = step.h;
        self.candidates.clear();
        self.found.clear();
        // The rows of a step may be made again for another prediction.
        for state in &mut self.kept {
            state.is_taken = false;
        }
        for ((end, x), u) in self.ends.iter_mut().zip(step.x).zip(step.u) {
            *end = x + u;
        }
        (step.pairs)(&mut |pair| self.pair(step, pair));
        self.vertices(step);
        for number in 0..step.obstacles.len() {
            self.obstacle(step, number);
        }
        self.pressing(step);
        self.sort();
        self.carry();
        self.hold(step);
        self.choose(step);
        self.report.rows = self.contacts.len();
        self.report
    }

    /// The contacts of the step, ascending by key.
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Sets the overlap that the motion of an obstacle made in a contact (m).
    pub(crate) fn set_overrun(&mut self, contact: usize, overrun: f64) {
        self.contacts[contact].overrun = overrun;
    }

    /// Sets the stiffness along the normal that a contact took within the step (N/m).
    pub(crate) fn set_stiffened(&mut self, contact: usize, stiffened: f64) {
        self.contacts[contact].stiffened = stiffened;
    }

    /// Ends a step: takes the response of each contact, in their order. A vertex `is_stopped` if it did not make the
    /// displacement that was solved.
    pub fn end<'a>(
        &mut self,
        responses: impl Iterator<Item = &'a Response>,
        is_stopped: &dyn Fn(u32) -> bool,
    ) {
        self.kept.clear();
        for (contact, response) in self.contacts.iter().zip(responses) {
            // The multiplier grows with what is left of the gap. Where the solution did not come about, nothing tells
            // whether a larger force would close it, and rows against each other would grow without bound.
            let mut each = contact.vertices.iter().zip(contact.weights);
            let most = if each.any(|(vertex, weight)| weight != 0.0 && is_stopped(*vertex)) {
                contact.forces[0].max(contact.forces[1])
            } else {
                f64::INFINITY
            };
            self.kept.push(Kept {
                key: contact.key,
                normal: contact.row.normal,
                forces: [response.normal.min(most), contact.forces[0]],
                opening: (response.gap - contact.row.gap) / self.h,
                friction: response.friction,
                stiffness: contact.row.friction_stiffness,
                stiffened: contact.stiffened,
                overrun: contact.overrun,
                age: contact.age + 1,
                is_parting: contact.is_parting,
                anchor: contact.anchor,
                is_taken: false,
            });
        }
        // Contacts that were found in the solution are the last ones.
        self.kept.sort_unstable_by_key(|state| state.key);
    }

    /// Where a contact was held in the last step.
    fn anchor(&self, key: Key) -> Option<Vec3> {
        let found = self.kept.binary_search_by_key(&key, |kept| kept.key);
        self.kept[found.ok()?].anchor
    }

    /// Whether a contact had a force in the last step.
    pub(crate) fn holds(&self, key: Key) -> bool {
        let found = self.kept.binary_search_by_key(&key, |kept| kept.key);
        found.is_ok_and(|at| self.kept[at].acted())
    }

    /// What the contacts keep from the last step, to be taken [back](Self::go_back_to).
    pub(crate) fn kept(&self) -> Vec<Kept> {
        self.kept.clone()
    }

    /// Takes back what contacts kept at another time.
    pub(crate) fn go_back_to(&mut self, kept: &[Kept]) {
        self.kept.clear();
        self.kept.extend_from_slice(kept);
    }

    /// The states of `former` rows whose vertices have got the numbers that `number` gives. Those of vertices that are no longer
    /// there fall away, and so does the stiffness that the contacts took: the bodies are others.
    pub(crate) fn take_from(&mut self, former: &Self, number: &dyn Fn(u32) -> Option<u32>) {
        self.kept.clear();
        let renumbered = former.kept.iter().filter_map(|state| {
            let key = state.key.renumbered(number)?;
            Some(Kept {
                key,
                stiffened: 0.0,
                ..*state
            })
        });
        self.kept.extend(renumbered.take(self.most));
        self.kept.sort_by_key(|state| state.key);
    }

    /// The energy (J) in the springs of friction after the last step.
    pub fn stored(&self) -> f64 {
        self.kept.iter().map(Kept::stored).sum()
    }

    /// Takes in a listed pair.
    fn pair(&mut self, step: &Step<'_>, pair: Pair) {
        let surfaces = step.surfaces;
        let pair = match pair {
            Pair::EdgeEdge(a, b) if surfaces.edges[a as usize] > surfaces.edges[b as usize] => {
                Pair::EdgeEdge(b, a)
            }
            _ => pair,
        };
        let is_flat = match pair {
            Pair::VertexTriangle(vertex, _) => surfaces.flat_vertices[vertex as usize],
            Pair::EdgeEdge(a, b) => {
                surfaces.flat_edges[a as usize] || surfaces.flat_edges[b as usize]
            }
        };
        if is_flat {
            return;
        }
        let vertices = pair.vertices(surfaces);
        let parts = [vertices[0], vertices[3]].map(|v| self.part_of[v as usize] as usize);
        let Some(meeting) = (step.meeting)(parts[0], parts[1]) else {
            return;
        };
        let thickness = pair.thickness(surfaces, meeting.distance);
        let places = [step.x, step.u, &self.ends];
        let Some(found) = Feet::of(pair, surfaces, places, thickness) else {
            return;
        };
        if let Pair::VertexTriangle(..) = pair {
            return self.candidate(vertices[0], parts[1], &vertices[1..], &found, thickness);
        }
        let is_end = found.is_certain;
        let at = found.at(is_end);
        let inside = |weights: &[f64]| weights.iter().all(|weight| *weight != 0.0);
        let (first, second) = at.foot.weights.split_at(2);
        let is_thread = parts.map(|part| surfaces.parts[part].triangles.is_empty());
        // The vertex at which a foot lies.
        let end_of = |from: usize| {
            let is_second = at.foot.weights[from] == 0.0;
            vertices[from + usize::from(is_second)]
        };
        // Two ends meet once: as the vertex with the smaller number, and the other segment.
        let is_turned = match (inside(first), inside(second)) {
            (true, true) => {
                let x = if is_end { &self.ends } else { step.x };
                if found.may_touch(is_end, thickness) && is_least(surfaces, pair, &at.normal, x) {
                    let predicted = found.predicted(is_end);
                    let key = Key::Edges(vertices);
                    let contact = self.contact(step, key, parts, at, predicted, thickness);
                    self.push(&contact);
                }
                return;
            }
            (false, true) if is_thread[1] => false,
            (true, false) if is_thread[0] => true,
            (false, false) if is_thread == [true; 2] => end_of(0) > end_of(2),
            _ => return,
        };
        let settled = found.settled(is_turned);
        if is_turned {
            self.candidate(end_of(2), parts[0], &vertices[..2], &settled, thickness);
        } else {
            self.candidate(end_of(0), parts[1], &vertices[2..], &settled, thickness);
        }
    }

    fn candidate(&mut self, vertex: u32, part: usize, of: &[u32], feet: &Feet, thickness: f64) {
        let mut corners = [of[0], of[1], of[of.len() - 1]];
        corners.sort_unstable();
        if self.candidates.len() == FOUND * self.most {
            self.report.dropped += half(&mut self.candidates, |one| one.feet.end.length);
        }
        self.candidates.push(Candidate {
            vertex,
            part: part as u32,
            corners,
            feet: *feet,
            thickness,
        });
    }

    /// Makes contacts of the candidates.
    fn vertices(&mut self, step: &Step<'_>) {
        let candidates = core::mem::take(&mut self.candidates);
        let mut order = core::mem::take(&mut self.order);
        order.clear();
        order.extend(0..candidates.len() as u32);
        let of = |number: u32| &candidates[number as usize];
        let group = |number: u32| (of(number).vertex, of(number).part);
        order.sort_unstable_by_key(|number| (group(*number), of(*number).corners));
        // A segment that meets a vertex at the end of two others is the candidate of both.
        order.dedup_by_key(|number| (group(*number), of(*number).corners));
        for numbers in order.chunk_by(|a, b| group(*a) == group(*b)) {
            of_group(numbers, of, &mut |one, is_end| {
                let key = Key::Vertex(one.vertex, one.part);
                let parts = [self.part_of[one.vertex as usize], one.part].map(|part| part as usize);
                let (at, predicted) = (one.feet.at(is_end), one.feet.predicted(is_end));
                let contact = self.contact(step, key, parts, at, predicted, one.thickness);
                self.push(&contact);
            });
        }
        (self.candidates, self.order) = (candidates, order);
    }

    /// A contact, without what it keeps.
    fn contact(
        &self,
        step: &Step<'_>,
        key: Key,
        parts: [usize; 2],
        at: &Connection,
        predicted: f64,
        thickness: f64,
    ) -> Contact {
        let all = &step.surfaces.parts;
        let meeting = (step.meeting)(parts[0], parts[1]);
        let friction = meeting.map_or(0.0, |of| of.friction);
        let Foot {
            vertices, weights, ..
        } = at.foot;
        let each = || vertices.into_iter().map(|v| v as usize).zip(weights);
        let compliance: f64 = each().map(|(v, w)| w * w / step.masses[v]).sum();
        // The system of the bodies has no prescribed vertices. Their part of the difference is that of an obstacle.
        let is_prescribed = |v: usize| all[self.part_of[v] as usize].is_obstacle;
        let prescribed = each().filter(|(v, _)| is_prescribed(*v));
        Contact {
            key,
            vertices,
            weights,
            parts,
            row: Row {
                normal: at.normal,
                gap: predicted - thickness - at.normal.dot(&at.relative),
                motion: prescribed.map(|(v, w)| step.u[v] * -w).sum(),
                friction,
                depth: 0.0,
                normal_stiffness: 0.0,
                friction_stiffness: 0.0,
                carried: 0.0,
                most: meeting.map_or(f64::INFINITY, |of| {
                    of.force.min(of.pressure * least_area(step.surfaces, at))
                }),
                anchored: Vec3::zeros(),
                is_held: false,
            },
            thickness,
            predicted: predicted - thickness,
            start: 0.0,
            mass: compliance.recip(),
            overrun: 0.0,
            stiffened: 0.0,
            inexact: 0.0,
            age: 0,
            anchor: None,
            is_parting: false,
            is_impact: false,
            forces: [0.0; 2],
            opened: None,
        }
    }

    fn push(&mut self, contact: &Contact) {
        // Nothing moves between vertices that are all held.
        if !contact.mass.is_finite() {
            return;
        }
        if self.found.len() == FOUND * self.most {
            self.report.dropped += half(&mut self.found, |contact| contact.predicted);
        }
        self.found.push(*contact);
    }

    /// Brings the contacts in the order of their keys. Clusters share vertices, so that an obstacle may meet one twice.
    fn sort(&mut self) {
        self.order.clear();
        self.order.extend(0..self.found.len() as u32);
        let of = |number: u32| {
            let contact = &self.found[number as usize];
            (contact.key, contact.vertices)
        };
        self.order.sort_unstable_by_key(|number| of(*number));
        self.order.dedup_by_key(|number| of(*number));
    }

    /// Gives the contacts what they keep from the last step.
    fn carry(&mut self) {
        let mut from = 0;
        for number in &self.order {
            let contact = &mut self.found[*number as usize];
            let row = &mut contact.row;
            let state = take(&mut self.kept, &mut from, contact.key, &row.normal);
            let overlaps = row.gap < -PARTED * contact.thickness;
            // A shape may have moved over a vertex that truncation stopped.
            let is_inside = contact.start < -contact.thickness;
            let parts = is_inside || state.is_none_or(|state| state.is_parting);
            contact.is_parting = overlaps && parts;
            let Some(state) = state else { continue };
            contact.age = state.age;
            contact.overrun = state.overrun;
            if state.is_parting && !overlaps {
                self.report.released += state.stored();
                continue;
            }
            contact.forces = state.forces;
            contact.opened = state.acted().then_some(state.opening);
            contact.stiffened = state.stiffened;
            row.anchored = state.friction_across(&row.normal);
            // Kept for the change of the stiffness.
            row.friction_stiffness = state.stiffness;
        }
        let left = self.kept.iter().filter(|state| !state.is_taken);
        self.report.released += left.map(Kept::stored).fold(0.0, |sum, one| sum + one);
    }

    /// Thins the contacts, and gives those that are left their stiffness.
    fn choose(&mut self, step: &Step<'_>) {
        self.deepest.clear();
        self.deepest.extend(0..self.order.len() as u32);
        let of = |place: u32| &self.found[self.order[place as usize] as usize];
        self.deepest.sort_unstable_by(|a, b| {
            let by_depth = of(*a).depth().total_cmp(&of(*b).depth());
            by_depth.then(a.cmp(b))
        });
        self.is_kept.clear();
        self.is_kept.resize(self.order.len(), false);
        self.thinning.clear();
        let mut rows = 0;
        for place in &self.deepest {
            if rows == self.most {
                self.report.dropped += 1;
                continue;
            }
            let contact = of(*place);
            let is_kept = match contact.key {
                Key::Vertex(vertex, _) => self.thinning.keep_vertex(vertex, &contact.row.normal),
                Key::Between(..) | Key::Edges(..) => {
                    self.thinning.keep_edges(contact.pushed(step.masses))
                }
            };
            // Rounding must not change the rows of layers at rest.
            if is_kept || contact.acted() || contact.anchor.is_some() {
                self.is_kept[*place as usize] = true;
                rows += 1;
            } else {
                self.report.thinned += 1;
            }
        }
        self.contacts.clear();
        for (number, is_kept) in self.order.iter().zip(&self.is_kept) {
            let contact = &self.found[*number as usize];
            if *is_kept {
                self.contacts.push(strung(contact, step, &mut self.report));
            } else if contact.row.friction_stiffness > 0.0 {
                self.report.released +=
                    contact.row.anchored.norm_squared() / (2.0 * contact.row.friction_stiffness);
            }
        }
    }
}

/// Whether the connection of two edges, with the `normal` from the second one to the first one, leads away from the surfaces at both.
fn is_least(surfaces: &Surfaces, pair: Pair, normal: &Vec3, x: &[Vec3]) -> bool {
    let Pair::EdgeEdge(first, second) = pair else {
        return true;
    };
    surfaces.leaves_edge(first, &-normal, x) && surfaces.leaves_edge(second, normal, x)
}

/// The area (m²) on which a contact presses: the smaller one of both feet.
fn least_area(surfaces: &Surfaces, at: &Connection) -> f64 {
    let [mut first, mut second] = [0.0; 2];
    let Foot {
        vertices, weights, ..
    } = at.foot;
    for (vertex, weight) in vertices.into_iter().zip(weights) {
        let area = weight.abs() * surfaces.areas[vertex as usize];
        if weight > 0.0 {
            first += area;
        } else if weight < 0.0 {
            second += area;
        }
    }
    // A shape has no vertices.
    if second > 0.0 {
        first.min(second)
    } else {
        first
    }
}

/// The gap (m) that an overlap has in a step in which it parts, from its gap.
fn parting(gap: f64, step: &Step<'_>) -> f64 {
    let speed = (-gap / PARTING_TIME).clamp(SLOWEST, step.parting.max(SLOWEST));
    gap.max(-speed * step.h)
}

/// A contact with the stiffness that it has in the step.
fn strung(contact: &Contact, step: &Step<'_>, report: &mut RowsReport) -> Contact {
    let mut contact = *contact;
    let away = contact.away(step);
    let row = &mut contact.row;
    row.is_held = away.is_some();
    let each = || {
        let each = contact.vertices.into_iter().zip(contact.weights);
        each.filter(|(_, weight)| *weight != 0.0)
    };
    let velocity: Vec3 = each().map(|(v, w)| step.v[v as usize] * w).sum();
    // The motion of an obstacle with vertices is in their velocities.
    let of_shape = if contact.parts[1] >= step.surfaces.parts.len() {
        row.motion / step.h
    } else {
        Vec3::zeros()
    };
    let opening = row.normal.dot(&(velocity - of_shape));
    // Between two chords of an obstacle that turns, the normal velocity jumps, although nothing opens.
    let opening = contact.opened.unwrap_or(opening);
    let stiffness = Stiffness {
        mass: contact.mass,
        step: step.h,
        thickness: contact.thickness.max(THINNEST),
        approach: -opening,
        force: if row.is_held {
            let [latest, former] = contact.forces.map(f64::abs);
            latest.max(former).max(HELD_FORCE)
        } else {
            contact.forces[0].max(contact.forces[1])
        },
        friction: if row.is_held { 1.0 } else { row.friction },
    };
    let before = core::mem::replace(&mut row.friction_stiffness, stiffness.friction());
    if before > 0.0 {
        let softer = row.friction_stiffness.recip() - before.recip();
        report.restrung += 0.5 * row.anchored.norm_squared() * softer;
    }
    row.normal_stiffness = stiffness.normal().max(contact.stiffened);
    row.depth = (DEEP * stiffness.thickness).max(contact.inexact.min(EXACT));
    row.carried = if row.is_held {
        contact.forces[0]
    } else {
        carried(contact.forces, opening, step.h, stiffness.depth()).clamp(0.0, row.most)
    };
    if let Some(away) = away {
        (row.gap, contact.is_parting) = (row.normal.dot(&away), false);
        row.anchored -= (away - row.normal * row.gap) * row.friction_stiffness;
    } else if contact.is_parting {
        row.gap = parting(row.gap, step);
    }
    report.parting += usize::from(contact.is_parting);
    let closes = !contact.acted() && contact.predicted < 0.0;
    contact.is_impact = closes && -opening * step.h > stiffness.depth();
    contact
}

/// Leaves the half with the smallest measure. Returns how many are gone.
fn half<T>(all: &mut Vec<T>, measure: impl Fn(&T) -> f64) -> usize {
    let (length, left) = (all.len(), all.len() / 2);
    if left > 0 {
        all.select_nth_unstable_by(left, |a, b| measure(a).total_cmp(&measure(b)));
    }
    all.truncate(left);
    length - left
}
