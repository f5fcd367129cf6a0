//! Contacts of bodies, of a body with itself and with obstacles, in the step of several bodies.
//!
//! A step of contact has these stages between those of the bodies (`stepper/calls`):
//!
//! ```text
//! keep_awake   before constrain   bodies sleep together with those that they touch
//! begin        after constrain    surfaces at the start, predicted motion, lists, rows
//! solve                           each island of bodies that share a row, together
//! certify      after solve        nothing crosses, whatever the solver left
//! ```
//!
//! `parts` are the surfaces, and `islands` the bodies that share rows. `certify` and `report` end the step. A scene with nothing
//! near leaves the stages out (`clearance`). `springs` are for the local models, and `still` are the contacts of bodies in
//! equilibrium, with `facets` between solids.
//!
//! Bodies without a row are solved alone between `solve` and `certify`. Nothing is allocated in a step, once the vectors have
//! served as many rows.

mod certify;
mod clearance;
mod facets;
mod islands;
mod look;
mod parts;
mod report;
mod springs;
mod still;
mod way;

pub use report::{ContactReport, Side, Touching};
use springs::Foreseen;
pub use springs::Spring;
pub use still::Pressed;
pub(crate) use still::Still;

use super::joined::{At, Workspace};
use super::stepper::{Equation, Stepper};
use super::touching::{self, Touch, TouchReport};
use crate::Vec3;
use crate::body::Body;
use crate::contact::obstacle::TimedPose;
use crate::contact::row::Response;
use crate::contact::{Contact, Lists, Moves, Obstacle, Placed, Rows, RowsReport, Step, Surfaces};
use crate::element::precision::Precision;
use clearance::Clearance;
use facets::Facets;
use islands::Islands;
use parts::{Meetings, Owner, Source};

/// The most bodies of a scene.
pub const MOST_BODIES: usize = 8;
/// The rows of a scene for each vertex of its surfaces, at most.
const ROWS_PER_VERTEX: usize = 6;
/// How often the contacts with spheres are looked at again in a step, at the displacements that the solver found.
const LOOKS: usize = 4;
/// The speed at which sides part that overlap at the start (m/s).
const PARTING: f64 = 0.2;
/// The normal of a contact in a local model is stiffer than its row by this factor: the carried multiplier makes
/// the row rigid, up to its largest force.
const RIGID: f64 = 100.0;

/// A body in a step.
#[derive(Debug)]
pub struct Member<'a, T> {
    /// The body.
    pub body: &'a Body,
    /// Its stepper; `None` if a stage of its step has failed.
    pub stepper: Option<&'a mut Stepper<T>>,
}

impl<T: Precision> Member<'_, T> {
    fn is_awake(&self) -> bool {
        let stepper = self.stepper.as_ref();
        stepper.is_some_and(|stepper| !stepper.sleeps())
    }
}

/// What a step needs of contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Need {
    /// All stages.
    All,
    /// A measure of the displacements: the clearance is enough.
    Clearance,
    /// Nothing: nothing can move.
    Nothing,
}

/// The contacts of a scene.
#[derive(Debug)]
pub struct Contacts {
    surfaces: Surfaces,
    /// By part.
    sources: Vec<Source>,
    owners: Vec<Owner>,
    obstacles: Vec<Obstacle>,
    /// The shapes, and the numbers of their obstacles.
    shapes: Vec<Placed>,
    of_shapes: Vec<usize>,
    meetings: Meetings,
    lists: Option<Lists>,
    rows: Rows,
    facets: Facets,
    /// By vertex of the surfaces.
    x: Vec<Vec3>,
    u: Vec<Vec3>,
    v: Vec<Vec3>,
    mass: Vec<f64>,
    fractions: Vec<f64>,
    /// Vertices over which a shape moves in the step.
    run_over: usize,
    /// By vertex: the least fraction of the displacement with which it makes way for a moving shape.
    pushed: Vec<f64>,
    /// The contacts in the order of their islands; of each the number of its row.
    touches: Vec<Touch>,
    of_row: Vec<usize>,
    islands: Islands,
    /// Bodies with a listed pair or a shape nearby, which have to be certified.
    is_near: Vec<bool>,
    room: Workspace,
    /// The contacts as the local models take them, by island.
    springs: Vec<Spring>,
    foreseen: Foreseen,
    /// By pair of sides that touch.
    touching: Vec<Touching>,
    report: ContactReport,
    /// By body, see [`Contacts::work_on`].
    works: [f64; MOST_BODIES],
    /// By body, see [`Contacts::work_of_bodies_on`].
    between: [f64; MOST_BODIES],
    began: RowsReport,
    clearance: Clearance,
    /// The times (s) between which the obstacles move in the present step, and its length (s).
    times: [f64; 2],
    h: f64,
    /// What the present step needs.
    need: Need,
}

impl Contacts {
    /// The contacts of no surface.
    pub fn new() -> Self {
        Self {
            surfaces: Surfaces::default(),
            sources: Vec::new(),
            owners: Vec::new(),
            obstacles: Vec::new(),
            shapes: Vec::new(),
            of_shapes: Vec::new(),
            meetings: Meetings::default(),
            lists: None,
            rows: Rows::new(&Surfaces::default(), 0),
            facets: Facets::default(),
            x: Vec::new(),
            u: Vec::new(),
            v: Vec::new(),
            mass: Vec::new(),
            fractions: Vec::new(),
            run_over: 0,
            pushed: Vec::new(),
            touches: Vec::new(),
            of_row: Vec::new(),
            islands: Islands::default(),
            is_near: Vec::new(),
            room: Workspace::default(),
            springs: Vec::new(),
            foreseen: Foreseen {
                rows: Rows::new(&Surfaces::default(), 0),
                x: Vec::new(),
                u: Vec::new(),
                v: Vec::new(),
            },
            touching: Vec::new(),
            report: ContactReport::default(),
            works: [0.0; MOST_BODIES],
            between: [0.0; MOST_BODIES],
            began: RowsReport::default(),
            clearance: Clearance::default(),
            times: [0.0; 2],
            h: 0.0,
            need: Need::All,
        }
    }

    /// The surfaces.
    pub fn surfaces(&self) -> &Surfaces {
        &self.surfaces
    }

    /// The obstacle of this number.
    ///
    /// # Panics
    /// For an obstacle that does not exist.
    pub fn obstacle(&self, number: usize) -> &Obstacle {
        &self.obstacles[number]
    }

    /// Keeps each of the `bodies` awake unless all bodies of its island rest on obstacles that stand. Called before the bodies are
    /// constrained.
    pub fn keep_awake(
        &self,
        bodies: usize,
        rests: &dyn Fn(usize) -> bool,
        keep: &mut dyn FnMut(usize, bool),
    ) {
        let mut is_carried = [false; MOST_BODIES];
        for contact in self.rows.contacts() {
            let [one, other] = contact.parts.map(|part| self.side(part));
            if let (Side::Body(body), Side::Obstacle(obstacle))
            | (Side::Obstacle(obstacle), Side::Body(body)) = (one, other)
            {
                is_carried[body] |= !self.stands_on(obstacle);
            }
        }
        let rests = |body: &usize| rests(*body) && !is_carried[*body];
        for body in 0..bodies {
            let root = self.islands.root(body);
            let mut island = (0..bodies).filter(|other| self.islands.root(*other) == root);
            keep(body, !island.all(|body| rests(&body)));
        }
    }

    /// Whether an obstacle stood in the last step and stands in the next one, which may be twice as long.
    fn stands_on(&self, obstacle: usize) -> bool {
        let [from, to] = self.times;
        self.obstacles[obstacle].stands(from, to - from + 2.0 * self.h)
    }

    /// Moves an obstacle from one of these rows to the other in the next step, see [`Obstacle::lead`].
    ///
    /// # Panics
    /// For an obstacle that does not exist.
    pub fn lead(&mut self, obstacle: usize, rows: [TimedPose; 2]) {
        self.obstacles[obstacle].lead(rows);
    }

    /// Tells whether an obstacle with a shape `holds` the points that it touches: from the next step on, those that pressed it in the last
    /// step neither part from it nor slip.
    pub fn take_hold(&mut self, obstacle: usize, holds: bool) {
        let each = self.shapes.iter_mut().zip(&self.of_shapes);
        for (placed, _) in each.filter(|(_, number)| **number == obstacle) {
            placed.holds = holds;
        }
    }

    /// Begins the step of `h` seconds, after the bodies have been constrained: finds the rows. The obstacles move from one
    /// of the `times` (s) to the other.
    pub fn begin<T: Precision>(&mut self, members: &[Member<'_, T>], times: [f64; 2], h: f64) {
        let stands = |obstacle: &Obstacle| obstacle.stands(times[0], times[1] - times[0]);
        (self.times, self.h) = (times, h);
        self.need = if self.lists.is_some()
            && !members.iter().any(Member::is_awake)
            && self.obstacles.iter().all(stands)
        {
            Need::Nothing
        } else if self.clearance.is_enough() {
            Need::Clearance
        } else {
            Need::All
        };
        if self.need == Need::Clearance {
            self.began = RowsReport::default();
        }
        if self.need != Need::All {
            return;
        }
        self.gather(members);
        if self.surfaces.open_twins(&self.x)
            && let Some(lists) = &mut self.lists
        {
            lists.search_again();
        }
        self.find(h);
    }

    /// Finds the rows of the positions and predicted displacements, for a step of `h` seconds.
    fn find(&mut self, h: f64) {
        self.list();
        let Some(lists) = &mut self.lists else { return };
        let (surfaces, x, u) = (&self.surfaces, &self.x, &self.u);
        let meetings = &self.meetings;
        let step = Step {
            surfaces,
            obstacles: &self.shapes,
            x,
            u,
            v: &self.v,
            masses: &self.mass,
            parting: PARTING,
            hierarchy: lists.hierarchy(),
            pairs: &|found| lists.each(surfaces, x, found),
            h,
            meeting: &|one, other| meetings.get(one, other),
        };
        self.began = self.rows.begin(&step);
    }

    /// Lists the pairs of the step.
    fn list(&mut self) {
        let (surfaces, x, u) = (&self.surfaces, &self.x, &self.u);
        let lists = match &mut self.lists {
            Some(lists) => lists,
            none => none.insert(Lists::new(surfaces, x)),
        };
        lists.follow(surfaces, x, |hierarchy, cluster| {
            Moves::of(hierarchy.members(cluster), u)
        });
    }

    /// Takes the state of the bodies and the obstacles.
    fn gather<T: Precision>(&mut self, members: &[Member<'_, T>]) {
        let (times, h) = (self.times, self.h);
        for (part, owner) in self.surfaces.parts.iter().zip(&self.owners) {
            let range = part.vertices.start as usize..part.vertices.end as usize;
            let (x, u) = (&mut self.x[range.clone()], &mut self.u[range.clone()]);
            let v = &mut self.v[range.clone()];
            match owner {
                Owner::Body(body) => {
                    let member = &members[*body];
                    // Room for further vertices has no node.
                    let count = x.len().min(member.body.node_positions().len());
                    let (x, u, v) = (&mut x[..count], &mut u[..count], &mut v[..count]);
                    x.copy_from_slice(&member.body.node_positions()[..count]);
                    v.copy_from_slice(&member.body.node_velocities()[..count]);
                    let masses = &member.body.node_masses()[..count];
                    let nodes = u.iter_mut().zip(&mut self.mass[range]).zip(masses);
                    for (node, ((u, mass), own)) in (0..).zip(nodes) {
                        let stepper = member.stepper.as_deref();
                        *u = stepper.map_or_else(Vec3::zeros, |stepper| stepper.displacement(node));
                        let is_free = stepper.is_some_and(|stepper| stepper.is_free(node));
                        *mass = if is_free { *own } else { f64::INFINITY };
                    }
                }
                Owner::Obstacle(number) => {
                    let obstacle = &self.obstacles[*number];
                    obstacle.write_positions(times[0], x);
                    obstacle.write_positions(times[1], u);
                    for ((x, u), v) in x.iter().zip(u).zip(v) {
                        *u -= x;
                        *v = *u / h;
                    }
                }
            }
        }
        for (placed, number) in self.shapes.iter_mut().zip(&self.of_shapes) {
            let pose = |t| self.obstacles[*number].pose(t);
            (placed.start, placed.end) = (pose(times[0]), pose(times[1]));
        }
    }

    /// Wakes pieces of torn sheets that share a row with something that moves.
    fn stir<T: Precision>(&self, members: &mut [Member<'_, T>]) {
        for contact in self.rows.contacts() {
            let corners = contact.vertices.iter().zip(contact.weights);
            let corners = corners.filter(|(_, weight)| *weight != 0.0);
            let nodes = corners.filter_map(|(vertex, _)| self.at(*vertex));
            let is_still = |at: At| {
                let stepper = members[at.body].stepper.as_deref();
                stepper.is_some_and(|stepper| stepper.is_still(at.node))
            };
            if contact.row.motion == Vec3::zeros() && nodes.clone().all(is_still) {
                continue;
            }
            for at in nodes {
                if let Some(stepper) = &mut members[at.body].stepper {
                    stepper.stir(at.node);
                }
            }
        }
    }

    /// Makes the contacts of the solver, in the order of their islands.
    fn make_touches<T: Precision>(&mut self, members: &[Member<'_, T>]) {
        self.islands.begin(MOST_BODIES);
        let contacts = self.rows.contacts();
        for contact in contacts {
            let mut first = None;
            for (vertex, weight) in contact.vertices.into_iter().zip(contact.weights) {
                if let Some(at) = self.at(vertex).filter(|_| weight != 0.0) {
                    let one = *first.get_or_insert(at.body);
                    self.islands.join(one, at.body);
                }
            }
        }
        let mut order = core::mem::take(&mut self.of_row);
        order.clear();
        order.extend(0..self.rows.contacts().len());
        order.sort_unstable_by_key(|row| (self.island_of(*row, members), *row));
        let mut touches = core::mem::take(&mut self.touches);
        touches.clear();
        for row in &order {
            let contact = &self.rows.contacts()[*row];
            let mut touch = Touch::new(self.nodes(contact), contact.row);
            if self.island_of(*row, members).is_none() {
                // Nothing moves here: the forces stay.
                touch.response = Response {
                    normal: contact.forces()[0],
                    friction: contact.row.anchored,
                    ..touch.response
                };
            }
            touches.push(touch);
        }
        // The rows of bodies that rest come first.
        (self.of_row, self.touches) = (order, touches);
    }

    /// The island of a row; `None` if all its bodies and pieces rest.
    fn island_of<T: Precision>(&self, row: usize, members: &[Member<'_, T>]) -> Option<usize> {
        let contact = &self.rows.contacts()[row];
        let vertices = contact.vertices.iter().zip(contact.weights);
        let mut nodes = vertices
            .filter(|(_, weight)| *weight != 0.0)
            .filter_map(|(vertex, _)| self.at(*vertex));
        let awake = |at: &At| {
            let stepper = members[at.body].stepper.as_deref();
            stepper.is_some_and(|stepper| !stepper.sleeps_at(at.node))
        };
        nodes.find(awake).map(|at| self.islands.root(at.body))
    }

    /// The nodes of a contact and their weights.
    fn nodes(&self, contact: &Contact) -> [(At, f64); 4] {
        [0, 1, 2, 3].map(|i| {
            let none = (At { body: 0, node: 0 }, 0.0);
            let at = self.at(contact.vertices[i]);
            at.map_or(none, |at| (at, contact.weights[i]))
        })
    }

    /// The node of a vertex; `None` for a vertex of an obstacle.
    fn at(&self, vertex: u32) -> Option<At> {
        let part = self.surfaces.part_of(vertex);
        match self.owners[part] {
            Owner::Body(body) => Some(At {
                body,
                node: vertex - self.surfaces.parts[part].vertices.start,
            }),
            Owner::Obstacle(_) => None,
        }
    }

    /// Solves the bodies that have rows, island by island. `out_of_time` is called with the first body of the island after
    /// each iteration.
    pub fn solve<T: Precision>(
        &mut self,
        members: &mut [Member<'_, T>],
        out_of_time: &mut dyn FnMut(usize) -> bool,
    ) {
        let lists = self.lists.as_ref().filter(|_| self.need == Need::All);
        self.report = ContactReport {
            counts: lists.map(Lists::counts).unwrap_or_default(),
            rows: self.began,
            ..ContactReport::default()
        };
        self.report.solved.converged = true;
        self.works = [0.0; MOST_BODIES];
        self.between = [0.0; MOST_BODIES];
        match self.need {
            Need::Nothing => return,
            Need::Clearance => {}
            Need::All => {
                self.stir(members);
                self.make_touches(members);
            }
        }
        let mut from = 0;
        while from < self.touches.len() {
            let island = self.island_of(self.of_row[from], members);
            let rest = self.of_row[from..].iter();
            let same = rest.take_while(|row| self.island_of(**row, members) == island);
            let end = from + same.count();
            let Some(root) = island else {
                from = end;
                continue;
            };
            let mut lent: [Option<Equation<'_, T>>; MOST_BODIES] = [const { None }; MOST_BODIES];
            let mut nodes = [0; MOST_BODIES];
            for (count, member) in nodes.iter_mut().zip(&*members) {
                *count = member.body.node_positions().len();
            }
            for (body, (lent, member)) in lent.iter_mut().zip(&mut *members).enumerate() {
                if self.islands.root(body) == root
                    && let Some(stepper) = &mut member.stepper
                {
                    *lent = stepper.equation().ok().flatten();
                }
            }
            let mut rows = self.of_row[from..end].iter();
            let is_impact = rows.any(|row| self.rows.contacts()[*row].is_impact);
            let mut updates = if is_impact { 2 } else { 1 };
            let (mut report, mut end) = (TouchReport::default(), end);
            touching::begin(&mut lent);
            for look in 0..=LOOKS {
                if look > 0 {
                    let Some(further) = self.look(&mut lent, &nodes, from..end) else {
                        break;
                    };
                    (end, updates) = (further, 1);
                }
                let found = touching::approach(
                    &mut lent,
                    &mut self.touches[from..end],
                    updates,
                    &mut self.room,
                    &mut || out_of_time(root),
                );
                report = TouchReport {
                    passes: report.passes + found.passes,
                    iterations: report.iterations + found.iterations,
                    searched: report.searched + found.searched,
                    ..found
                };
            }
            let solved = &self.touches[from..end];
            touching::end(&mut lent, solved, &mut self.room, &report);
            let solved = &mut self.report.solved;
            solved.passes = solved.passes.max(report.passes);
            solved.iterations += report.iterations;
            solved.searched += report.searched;
            solved.converged &= report.converged;
            solved.left = solved.left.max(report.left);
            from = end;
        }
    }
}

impl Default for Contacts {
    fn default() -> Self {
        Self::new()
    }
}
