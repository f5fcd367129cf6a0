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
use crate::contact::rows::{Meeting, Placed, RowReport, Rows, State};
use crate::contact::{Counts, Lists, Skin, Surfaces};
use crate::element::precision::Precision;
use crate::mesh::{Mesh, MeshError};
use crate::{HandlePose, Vec3};

/// The rows of a scene for each vertex of its surfaces, at most.
const ROWS_PER_VERTEX: usize = 6;
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

/// An obstacle in a step: its vertices or its shape.
#[derive(Clone, Debug)]
pub enum Guided<'a> {
    /// Positions of the vertices of a part at the start and at the end of the step (m).
    Part(&'a [Vec3], &'a [Vec3]),
    /// A shape.
    Shape(Placed),
}

/// What one part of the surfaces is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Owner {
    Body(usize),
    Obstacle,
}

/// The sum of the contacts between two sides in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Touching {
    /// The sides: parts, and after them shapes.
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
    pub rows: RowReport,
    /// The solver, over all islands.
    pub solved: TouchReport,
    /// The truncation.
    pub truncated: Truncation,
    /// The energy that the contacts took from both sides, less the work of obstacles (J): stored in friction springs, dissipated
    /// by friction, and by normal forces that depart from the law of a rigid contact.
    pub taken: f64,
    /// The work of moving obstacles (J).
    pub by_obstacles: f64,
}

/// The contacts of a scene.
#[derive(Debug)]
pub struct Contacts {
    surfaces: Surfaces,
    owners: Vec<Owner>,
    shapes: Vec<Placed>,
    meetings: Meetings,
    lists: Option<Lists>,
    rows: Rows,
    /// By vertex of the surfaces.
    x: Vec<Vec3>,
    u: Vec<Vec3>,
    v: Vec<Vec3>,
    mass: Vec<f64>,
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
}

/// How sides meet, by pair.
#[derive(Clone, Debug, Default)]
struct Meetings {
    count: usize,
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
    /// No surfaces.
    pub fn new() -> Self {
        Self {
            surfaces: Surfaces::default(),
            owners: Vec::new(),
            shapes: Vec::new(),
            meetings: Meetings::default(),
            lists: None,
            rows: Rows::new(0),
            x: Vec::new(),
            u: Vec::new(),
            v: Vec::new(),
            mass: Vec::new(),
            fractions: Vec::new(),
            touches: Vec::new(),
            of_row: Vec::new(),
            islands: Islands::default(),
            is_near: Vec::new(),
            room: Workspace::default(),
            touching: Vec::new(),
            report: ContactReport::default(),
        }
    }

    /// Adds the surface of the body of this number. Returns the number of its side.
    ///
    /// # Errors
    ///
    /// [`MeshError`] if the triangles of the mesh are no surface.
    pub fn add_body(&mut self, body: usize, mesh: &Mesh, skin: Skin) -> Result<usize, MeshError> {
        self.owners.push(Owner::Body(body));
        self.surfaces.add(mesh, skin)
    }

    /// Adds an obstacle of triangles. Returns the number of its side.
    ///
    /// # Errors
    ///
    /// [`MeshError`] if the triangles are no surface.
    pub fn add_obstacle(&mut self, mesh: &Mesh, radius: f64) -> Result<usize, MeshError> {
        self.owners.push(Owner::Obstacle);
        self.surfaces.add(
            mesh,
            Skin {
                radius,
                touches_itself: false,
                is_obstacle: true,
            },
        )
    }

    /// Ends the list of parts: afterwards shapes have the sides after them. `meeting` tells how two sides meet; it is called for
    /// each pair of sides.
    pub fn complete(
        &mut self,
        shapes: Vec<Placed>,
        meeting: &dyn Fn(usize, usize) -> Option<Meeting>,
    ) {
        self.shapes = shapes;
        let count = self.surfaces.parts.len() + self.shapes.len();
        let sides = (0..count).flat_map(|one| (0..count).map(move |other| (one, other)));
        self.meetings = Meetings {
            count,
            of: sides.map(|(one, other)| meeting(one, other)).collect(),
        };
        let meetings = &self.meetings;
        self.surfaces
            .let_meet(&|one, other| meetings.get(one, other).is_some());
        let vertices = self.surfaces.vertices;
        self.x = vec![Vec3::zeros(); vertices];
        self.u = vec![Vec3::zeros(); vertices];
        self.v = vec![Vec3::zeros(); vertices];
        self.mass = vec![f64::INFINITY; vertices];
        self.fractions = vec![1.0; vertices];
        let most = ROWS_PER_VERTEX * vertices;
        self.rows = Rows::new(most);
        self.touches.reserve(most);
        self.of_row.reserve(most);
        self.touching.reserve(count * (count + 1) / 2);
    }

    /// What the contacts of the last step did.
    pub fn report(&self) -> ContactReport {
        self.report
    }

    /// The sums of the contacts of the last step, by pair of sides that touch.
    pub fn touching(&self) -> &[Touching] {
        &self.touching
    }

    /// The contacts of the last step with a force: their place on the first side (m), and the force on it (N).
    pub fn points(&self) -> impl Iterator<Item = ([usize; 2], Vec3, &Touch)> {
        let touches = self.touches.iter().zip(&self.of_row);
        let acting = touches.filter(|(touch, _)| touch.response.normal > 0.0);
        acting.map(|(touch, row)| {
            let contact = &self.rows.contacts()[*row];
            let corners = contact.vertices.iter().zip(contact.weights);
            let first = corners.filter(|(_, weight)| *weight > 0.0);
            let place = first.map(|(vertex, weight)| self.x[*vertex as usize] * weight);
            (contact.sides, place.sum(), touch)
        })
    }

    /// The surfaces.
    pub fn surfaces(&self) -> &Surfaces {
        &self.surfaces
    }

    /// Keeps a body awake as long as a body of its island moves. Called before the bodies are constrained: `rests` tells
    /// whether a body would sleep.
    pub fn keep_awake(&self, bodies: usize, rests: &dyn Fn(usize) -> bool, keep: &mut dyn FnMut(usize, bool)) {
        for body in 0..bodies {
            let root = |of: usize| if of < self.islands.parent.len() { self.islands.root(of) } else { of };
            let mut island = (0..bodies).filter(|other| root(*other) == root(body));
            keep(body, !island.all(rests));
        }
    }

    /// Begins the step of `h` seconds after the bodies have been constrained. `guided` gives the obstacles, by their numbers: those
    /// of triangles in the order of their parts, then the shapes.
    pub fn begin<T: Precision>(
        &mut self,
        members: &[Member<'_, T>],
        guided: &mut dyn FnMut(usize) -> Option<Guided<'static>>,
        h: f64,
    ) {
        let _ = (members, guided, h);
    }
}
