//! Contacts of bodies, of a body with itself and with obstacles, in the step of several bodies.
//!
//! A step of contact has these stages between those of the bodies (`stepper/stages`):
//!
//! ```text
//! keep_awake   before constrain   bodies sleep together with those that they touch
//! begin        after constrain    surfaces at the start, predicted motion, lists, rows
//! solve                           each island of bodies that share a row, together
//! certify      after solve        nothing crosses, whatever the solver left
//! ```
//!
//! Bodies without a row are solved alone between `solve` and `certify`. Nothing is allocated in a step, once the vectors have
//! served as many rows.

use super::constraint::spring::Spring;
use super::joined::{At, Workspace};
use super::stepper::{Equation, Stepper};
use super::touching::{self, Touch, TouchReport};
use crate::body::Body;
use crate::contact::certificate::{Truncation, truncate};
use crate::contact::obstacle::{Geometry, Obstacle};
use crate::contact::row::Response;
use crate::contact::shape::Shape;
use crate::contact::{
    Counts, Lists, Meeting, Placed, Rows, RowsReport, Skin, Step, Surfaces, reach,
};
use crate::element::precision::Precision;
use crate::mesh::{Mesh, MeshError, TriMesh};
use crate::{Mat3, Vec3};
use nalgebra::Point3;

/// The most bodies of a scene.
pub const MOST_BODIES: usize = 8;
/// The rows of a scene for each vertex of its surfaces, at most.
const ROWS_PER_VERTEX: usize = 6;
/// The speed at which sides part that overlap at the start (m/s).
const PARTING: f64 = 0.2;
/// The normal of a contact in a local model is stiffer than its row by this factor: the carried multiplier makes the row rigid.
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

/// What one part of the surfaces is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Owner {
    Body(usize),
    Obstacle(usize),
}

/// A side of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
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
    /// The energy that the contacts took from both sides, less the work of obstacles (J): stored in friction springs, dissipated
    /// by friction, and by normal forces that depart from the law of a rigid contact.
    pub taken: f64,
    /// The work of moving obstacles (J).
    pub by_obstacles: f64,
    /// The work with which overlaps parted (J).
    pub parted: f64,
    /// The energy in the springs of friction (J).
    pub stored: f64,
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
    /// By vertex of the surfaces.
    x: Vec<Vec3>,
    u: Vec<Vec3>,
    v: Vec<Vec3>,
    mass: Vec<f64>,
    stiffest: Vec<f64>,
    fractions: Vec<f64>,
    /// The contacts in the order of their islands; of each the number of its row.
    touches: Vec<Touch>,
    of_row: Vec<usize>,
    islands: Islands,
    /// Bodies with a listed pair or a shape nearby, which have to be certified.
    is_near: Vec<bool>,
    room: Workspace,
    /// By pair of sides that touch.
    touching: Vec<Touching>,
    report: ContactReport,
    began: RowsReport,
    /// Whether nothing can move in the present step.
    is_idle: bool,
}

/// Where the surface of a part comes from.
#[derive(Clone, Debug)]
struct Source {
    /// The mesh. Positions are those at rest; those without an element are room for vertices that tears will add.
    mesh: Mesh,
    skin: Skin,
    tears: bool,
}

impl Source {
    /// The surface of a body with this mesh.
    fn of(body: &Body, mut mesh: Mesh, skin: Skin) -> Self {
        let tears = body.surface().is_some();
        if let (Some(surface), Mesh::Sheet(mesh)) = (body.surface(), &mut mesh) {
            mesh.positions.clear();
            mesh.positions.extend_from_slice(&body.model.rest);
            (mesh.positions).resize(surface.limits().vertices, Vec3::zeros());
        }
        Self { mesh, skin, tears }
    }

    fn add_to(&self, surfaces: &mut Surfaces) -> Result<(), MeshError> {
        let part = surfaces.add(&self.mesh, self.skin)?;
        if self.tears {
            surfaces.tears(part, self.mesh.positions());
        }
        Ok(())
    }
}

/// How sides meet, by pair.
#[derive(Clone, Debug, Default)]
struct Meetings {
    count: usize,
    /// `None` for sides that do not touch.
    of: Vec<Option<Meeting>>,
}

impl Meetings {
    fn get(&self, one: usize, other: usize) -> Option<Meeting> {
        self.of[one * self.count + other]
    }
}

/// Bodies that share rows: a forest (Tarjan, "Efficiency of a good but not linear set union algorithm", 1975).
#[derive(Debug, Default)]
struct Islands {
    parent: Vec<usize>,
}

impl Islands {
    /// Each body is an island.
    fn begin(&mut self, bodies: usize) {
        self.parent.clear();
        self.parent.extend(0..bodies);
    }

    fn root(&self, mut body: usize) -> usize {
        while self.parent[body] != body {
            body = self.parent[body];
        }
        body
    }

    fn join(&mut self, one: usize, other: usize) {
        let (one, other) = (self.root(one), self.root(other));
        let (first, second) = (one.min(other), one.max(other));
        self.parent[second] = first;
    }
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
            x: Vec::new(),
            u: Vec::new(),
            v: Vec::new(),
            mass: Vec::new(),
            stiffest: Vec::new(),
            fractions: Vec::new(),
            touches: Vec::new(),
            of_row: Vec::new(),
            islands: Islands::default(),
            is_near: Vec::new(),
            room: Workspace::default(),
            touching: Vec::new(),
            report: ContactReport::default(),
            began: RowsReport::default(),
            is_idle: false,
        }
    }

    /// Adds the surface of the body of this number, of at most [`MOST_BODIES`].
    ///
    /// # Errors
    ///
    /// [`MeshError`] if the triangles of the mesh are no surface.
    pub fn add_body(
        &mut self,
        number: usize,
        body: &Body,
        mesh: Mesh,
        skin: Skin,
    ) -> Result<(), MeshError> {
        let source = Source::of(body, mesh, skin);
        source.add_to(&mut self.surfaces)?;
        self.sources.push(source);
        self.owners.push(Owner::Body(number));
        Ok(())
    }

    /// Follows the body of this number, whose connectivity has changed, with its new mesh. Contacts keep their forces if the
    /// body has as much room for vertices as before. This allocates.
    ///
    /// # Errors
    ///
    /// [`MeshError`] if the triangles of the mesh are no surface; the contacts are unchanged then.
    pub fn follow(&mut self, number: usize, body: &Body, mesh: Mesh) -> Result<(), MeshError> {
        let Some(part) = self.owners.iter().position(|of| *of == Owner::Body(number)) else {
            return Ok(());
        };
        let source = Source::of(body, mesh, self.sources[part].skin);
        let mut surfaces = Surfaces::default();
        for (other, old) in self.sources.iter().enumerate() {
            let source = if other == part { &source } else { old };
            source.add_to(&mut surfaces)?;
        }
        self.sources[part] = source;
        let has_room = surfaces.vertices == self.surfaces.vertices;
        self.surfaces = surfaces;
        self.keep_apart();
        self.lists = None;
        if !has_room {
            self.reserve();
        }
        Ok(())
    }

    /// Adds an obstacle. The sides of a box are triangles: its edges can hold a surface up between the vertices of the surface.
    ///
    /// # Errors
    ///
    /// [`MeshError`] if the triangles are no surface.
    pub fn add_obstacle(&mut self, obstacle: Obstacle) -> Result<(), MeshError> {
        let number = self.obstacles.len();
        let triangles = match obstacle.geometry() {
            Geometry::Mesh(mesh) => Some((mesh.positions().to_vec(), mesh.triangles().to_vec())),
            Geometry::Shape(Shape::Box { half }) => Some(box_of(half)),
            Geometry::Shape(shape) => {
                let pose = obstacle.pose(0.0);
                self.of_shapes.push(number);
                self.shapes.push(Placed {
                    shape: *shape,
                    start: pose,
                    end: pose,
                });
                None
            }
        };
        if let Some((positions, triangles)) = triangles {
            let skin = Skin {
                radius: 0.0,
                touches_itself: false,
                is_obstacle: true,
            };
            let source = Source {
                mesh: Mesh::Sheet(TriMesh::new(positions, triangles)?),
                skin,
                tears: false,
            };
            source.add_to(&mut self.surfaces)?;
            self.sources.push(source);
            self.owners.push(Owner::Obstacle(number));
        }
        self.obstacles.push(obstacle);
        Ok(())
    }

    /// Ends the lists of bodies and obstacles. `meeting` tells how two sides meet;
    /// `None` for sides that do not touch.
    pub fn complete(&mut self, meeting: &dyn Fn(Side, Side) -> Option<Meeting>) {
        let sides = self.sides();
        let mut of = Vec::with_capacity(sides.len() * sides.len());
        for one in &sides {
            of.extend(sides.iter().map(|other| meeting(*one, *other)));
        }
        self.meetings = Meetings {
            count: sides.len(),
            of,
        };
        self.keep_apart();
        self.reserve();
    }

    /// Keeps parts from touching that do not meet. Pairs are listed up to the sum of the radii of their parts, which is at least
    /// the distance at which they meet.
    fn keep_apart(&mut self) {
        for part in 0..self.surfaces.parts.len() {
            let meetings =
                (0..self.meetings.count).filter_map(|other| self.meetings.get(part, other));
            let farthest = meetings.map(|meeting| meeting.distance).fold(0.0, f64::max);
            let radius = &mut self.surfaces.parts[part].radius;
            *radius = radius.max(0.5 * farthest);
        }
        for one in 0..self.surfaces.parts.len() {
            for other in one + 1..self.surfaces.parts.len() {
                if self.meetings.get(one, other).is_none() {
                    self.surfaces.keep_apart(one, other);
                }
            }
        }
    }

    /// Makes the vectors of a step.
    fn reserve(&mut self) {
        let vertices = self.surfaces.vertices;
        for vectors in [&mut self.x, &mut self.u, &mut self.v] {
            *vectors = vec![Vec3::zeros(); vertices];
        }
        self.mass = vec![f64::INFINITY; vertices];
        self.stiffest = vec![f64::INFINITY; vertices];
        self.fractions = vec![1.0; vertices];
        let most = ROWS_PER_VERTEX * vertices;
        self.rows = Rows::new(&self.surfaces, most);
        self.touches.reserve(most);
        self.of_row.reserve(most);
        let sides = self.meetings.count;
        self.touching.reserve(sides * (sides + 1) / 2);
        self.is_near = vec![false; MOST_BODIES];
        self.islands.begin(MOST_BODIES);
    }

    /// The sides: the parts, and after them the shapes.
    pub fn sides(&self) -> Vec<Side> {
        let parts = self.owners.iter().map(|owner| match owner {
            Owner::Body(body) => Side::Body(*body),
            Owner::Obstacle(obstacle) => Side::Obstacle(*obstacle),
        });
        let shapes = self
            .of_shapes
            .iter()
            .map(|obstacle| Side::Obstacle(*obstacle));
        parts.chain(shapes).collect()
    }

    /// The surfaces.
    pub fn surfaces(&self) -> &Surfaces {
        &self.surfaces
    }

    /// What the contacts of the last step did.
    pub fn report(&self) -> ContactReport {
        self.report
    }

    /// The sums of the contacts of the last step, by pair of sides that touch.
    pub fn touching(&self) -> &[Touching] {
        &self.touching
    }

    /// The contacts of the last step with a force: the sides, the place on the first side at the start of the step (m), and
    /// the contact.
    pub fn points(&self) -> impl Iterator<Item = ([usize; 2], Vec3, &Touch)> {
        let touches = self.touches.iter().zip(&self.of_row);
        let acting = touches.filter(|(touch, _)| touch.response.normal > 0.0);
        acting.map(|(touch, row)| {
            let contact = &self.rows.contacts()[*row];
            let corners = contact.vertices.iter().zip(contact.weights);
            let first = corners.filter(|(_, weight)| *weight > 0.0);
            let place = first.map(|(vertex, weight)| self.x[*vertex as usize] * weight);
            (contact.parts, place.sum(), touch)
        })
    }

    /// Keeps each of the `bodies` awake unless all bodies of its island rest. Called before the bodies are constrained.
    pub fn keep_awake(
        &self,
        bodies: usize,
        rests: &dyn Fn(usize) -> bool,
        keep: &mut dyn FnMut(usize, bool),
    ) {
        for body in 0..bodies {
            let root = self.islands.root(body);
            let mut island = (0..bodies).filter(|other| self.islands.root(*other) == root);
            keep(body, !island.all(rests));
        }
    }

    /// Begins the step of `h` seconds, after the bodies have been constrained: finds the rows. The obstacles move from one
    /// of the `times` (s) to the other.
    pub fn begin<T: Precision>(&mut self, members: &[Member<'_, T>], times: [f64; 2], h: f64) {
        let stands = |obstacle: &Obstacle| obstacle.stands(times[0], times[1] - times[0]);
        self.is_idle = self.lists.is_some()
            && !members.iter().any(Member::is_awake)
            && self.obstacles.iter().all(stands);
        if self.is_idle {
            return;
        }
        self.gather(members, times, h);
        let lists = match &mut self.lists {
            Some(lists) => lists,
            none => none.insert(Lists::new(&self.surfaces, &self.x)),
        };
        let (surfaces, x, u) = (&self.surfaces, &self.x, &self.u);
        lists.follow(surfaces, x, |hierarchy, cluster| {
            reach(surfaces, u, hierarchy, cluster)
        });
        let meetings = &self.meetings;
        let step = Step {
            surfaces,
            obstacles: &self.shapes,
            x,
            u,
            v: &self.v,
            masses: &self.mass,
            stiffest: &self.stiffest,
            parting: PARTING,
            hierarchy: lists.hierarchy(),
            pairs: &|found| lists.each(surfaces, x, found),
            h,
            meeting: &|one, other| meetings.get(one, other),
        };
        self.began = self.rows.begin(&step);
        self.make_touches(members);
    }

    /// Takes the state of the bodies and the obstacles.
    fn gather<T: Precision>(&mut self, members: &[Member<'_, T>], times: [f64; 2], h: f64) {
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
                    place(obstacle, times[0], x);
                    place(obstacle, times[1], u);
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
            let node = |i: usize| {
                let none = (At { body: 0, node: 0 }, 0.0);
                let at = self.at(contact.vertices[i]);
                at.map_or(none, |at| (at, contact.weights[i]))
            };
            let mut touch = Touch::new([0, 1, 2, 3].map(node), contact.row);
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

    /// The island of a row; `None` if all its bodies rest.
    fn island_of<T: Precision>(&self, row: usize, members: &[Member<'_, T>]) -> Option<usize> {
        let contact = &self.rows.contacts()[row];
        let vertices = contact.vertices.iter().zip(contact.weights);
        let mut bodies = vertices
            .filter(|(_, weight)| *weight != 0.0)
            .filter_map(|(vertex, _)| self.at(*vertex))
            .map(|at| at.body);
        let awake = |body: &usize| members[*body].is_awake();
        bodies.find(awake).map(|body| self.islands.root(body))
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
        self.report = ContactReport {
            counts: self.lists.as_ref().map(Lists::counts).unwrap_or_default(),
            rows: self.began,
            ..ContactReport::default()
        };
        self.report.solved.converged = true;
        if self.is_idle {
            return;
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
            for (body, (lent, member)) in lent.iter_mut().zip(&mut *members).enumerate() {
                if self.islands.root(body) == root
                    && let Some(stepper) = &mut member.stepper
                {
                    *lent = stepper.equation().ok().flatten();
                }
            }
            let report = touching::solve(
                &mut lent,
                &mut self.touches[from..end],
                if self.began.impacts > 0 { 2 } else { 1 },
                &mut self.room,
                &mut || out_of_time(root),
            );
            let solved = &mut self.report.solved;
            solved.passes = solved.passes.max(report.passes);
            solved.iterations += report.iterations;
            solved.searched += report.searched;
            solved.converged &= report.converged;
            from = end;
        }
    }

    /// Shortens the solved displacements such that nothing crosses, and keeps the forces for the next step.
    pub fn certify<T: Precision>(&mut self, members: &mut [Member<'_, T>]) {
        let Some(lists) = self.lists.as_mut().filter(|_| !self.is_idle) else {
            return;
        };
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
        let (surfaces, x, u) = (&self.surfaces, &self.x, &self.u);
        lists.extend(surfaces, x, |hierarchy, cluster| {
            let members = hierarchy.members(cluster).iter();
            members
                .map(|vertex| u[*vertex as usize].norm())
                .fold(0.0, f64::max)
        });
        self.fractions.fill(1.0);
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
        let mut squeezed = 0;
        for (number, placed) in self.shapes.iter().enumerate() {
            for (part, side) in surfaces.parts.iter().enumerate() {
                if self
                    .meetings
                    .get(part, surfaces.parts.len() + number)
                    .is_none()
                {
                    continue;
                }
                for vertex in side.vertices.clone() {
                    let (at, fraction) = (vertex as usize, &mut self.fractions[vertex as usize]);
                    let (is_near, most) = before(placed, &x[at], &u[at]);
                    if is_near {
                        mark(part);
                    }
                    if most < 1.0 {
                        squeezed += usize::from(self.mass[at].is_infinite() || most < 0.0);
                        *fraction = most.max(0.0);
                    }
                }
            }
        }
        let mass = &self.mass;
        let is_free = |vertex: u32| mass[vertex as usize].is_finite();
        let each = |found: &mut dyn FnMut(crate::contact::Pair)| lists.each(surfaces, x, found);
        self.report.truncated = truncate(surfaces, x, u, &each, &is_free, &mut self.fractions);
        self.report.truncated.squeezed += squeezed;
        for (part, owner) in surfaces.parts.iter().zip(&self.owners) {
            let Owner::Body(body) = owner else { continue };
            let Some(stepper) = members[*body]
                .stepper
                .as_deref_mut()
                .filter(|_| self.is_near[*body])
            else {
                continue;
            };
            let range = part.vertices.start as usize..part.vertices.end as usize;
            let fractions = &self.fractions[range];
            // A step that has not been solved has an error of its own.
            let _ = stepper.certify(&|node| fractions.get(node as usize).copied().unwrap_or(1.0));
        }
        self.end(members);
    }

    /// Sums up the contacts, and keeps them.
    fn end<T: Precision>(&mut self, members: &mut [Member<'_, T>]) {
        self.touching.clear();
        let mut responses = core::mem::take(&mut self.room.responses);
        responses.clear();
        responses.resize(self.touches.len(), None);
        for (touch, row) in self.touches.iter().zip(&self.of_row) {
            responses[*row] = Some(touch.response);
            let contact = &self.rows.contacts()[*row];
            if touch.response.normal == 0.0 {
                continue;
            }
            let force = touch.force();
            let corners = contact.vertices.iter().zip(contact.weights);
            let moved: Vec3 = corners
                .filter(|(_, weight)| *weight != 0.0)
                .map(|(vertex, weight)| {
                    let at = *vertex as usize;
                    self.u[at] * (weight * self.fractions[at])
                })
                .sum();
            self.report.taken -= force.dot(&(moved - contact.row.motion));
            self.report.by_obstacles += force.dot(&contact.row.motion);
            // Vertices of either side may touch the other.
            let [one, other] = contact.parts;
            let (sides, sign) = if one <= other {
                ([one, other], 1.0)
            } else {
                ([other, one], -1.0)
            };
            let found = self.touching.iter().position(|sum| sum.sides == sides);
            let at = found.unwrap_or_else(|| {
                self.touching.push(Touching {
                    sides,
                    ..Touching::default()
                });
                self.touching.len() - 1
            });
            let sum = &mut self.touching[at];
            sum.count += 1;
            sum.normal += touch.response.normal;
            sum.friction += touch.response.friction.norm();
            sum.force += force * sign;
            sum.depth = sum.depth.max(-touch.response.gap);
            sum.slipping += usize::from(touch.response.slips);
        }
        self.touching.sort_unstable_by_key(|sum| sum.sides);
        self.report.parted = self.rows.end(responses.iter().flatten());
        self.room.responses = responses;
        self.report.stored = self.rows.stored();
        for (body, member) in members.iter_mut().enumerate() {
            if let Some(stepper) = member.stepper.as_deref_mut().filter(|s| !s.sleeps()) {
                let acting = self
                    .touches
                    .iter()
                    .filter(|touch| touch.response.normal > 0.0);
                stepper.touch(acting.filter_map(|touch| spring(touch, body)));
            }
        }
    }
}

impl Default for Contacts {
    fn default() -> Self {
        Self::new()
    }
}

/// What a contact is for the local model of a body: its normal is rigid, because the multiplier is carried; across it acts the
/// friction spring of the step. `None` if the body has no node of it.
fn spring(touch: &Touch, body: usize) -> Option<Spring> {
    let is_own = |(at, weight): &(At, f64)| at.body == body && *weight != 0.0;
    touch.nodes.iter().any(is_own).then(|| {
        let row = &touch.row;
        let along: Mat3 = row.normal * row.normal.transpose();
        Spring {
            nodes: touch.nodes.map(|node| {
                let weight = if is_own(&node) { node.1 } else { 0.0 };
                (node.0.node, weight)
            }),
            stiffness: row.tangent(&touch.response)
                + along * (row.normal_stiffness * (RIGID - 1.0)),
        }
    })
}

/// Whether a vertex is near a shape in the step, and the fraction of its displacement with which it stays before the shape:
/// shapes are convex, so the plane at the nearest point divides them. Negative if the shape moves over the vertex.
fn before(placed: &Placed, x: &Vec3, u: &Vec3) -> (bool, f64) {
    let found = placed.at_start(x);
    let motion = placed.motion_to(&(x - found.normal * found.distance));
    let is_near = found.distance <= u.norm() + motion.norm();
    let towards = -found.normal.dot(u);
    let room = 0.95 * found.distance - found.normal.dot(&motion);
    if found.distance <= 0.0 || towards <= room {
        return (is_near, 1.0);
    }
    let most = if room < 0.0 { -1.0 } else { room / towards };
    (is_near, most)
}

/// The positions of an obstacle of triangles (m).
fn place(obstacle: &Obstacle, time: f64, x: &mut [Vec3]) {
    if let Geometry::Shape(Shape::Box { half }) = obstacle.geometry() {
        let pose = obstacle.pose(time);
        for (x, corner) in x.iter_mut().zip(corners(half)) {
            *x = (pose * Point3::from(corner)).coords;
        }
    } else {
        obstacle.write_positions(time, x);
    }
}

/// The corners of a box.
fn corners(half: &Vec3) -> [Vec3; 8] {
    [0, 1, 2, 3, 4, 5, 6, 7].map(|corner: usize| {
        Vec3::from_fn(|axis, _| {
            if corner >> axis & 1 == 1 {
                half[axis]
            } else {
                -half[axis]
            }
        })
    })
}

/// The corners and the triangles of a box, counterclockwise seen from outside.
fn box_of(half: &Vec3) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let faces = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let triangles = faces
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    (corners(half).to_vec(), triangles.collect())
}
