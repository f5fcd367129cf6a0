//! Bodies that step together, with the contacts between them and with obstacles.

use physics::contact::certificate::truncate;
use physics::contact::crossing::passes;
use physics::contact::{
    Lists, Meeting, Moves, Pair, Placed, Rows, RowsReport, Skin, Step, Surfaces,
};
use physics::mesh::Mesh;
use physics::mesh::TriMesh;
use physics::motion::joined::{At, Workspace};
use physics::motion::touching::{Touch, TouchReport, fill, solve};
use physics::{Body, BodyConfig, Guess, Material, Stepper, StepperOptions, Vec3};

/// Length of a step (s).
pub(crate) const H: f64 = 4e-3;
/// Thickness of a sheet (m).
pub(crate) const THICKNESS: f64 = 0.3e-3;

/// What a step did.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Done {
    pub rows: RowsReport,
    pub solve: TouchReport,
    pub truncated: usize,
    pub parting_work: f64,
}

pub(crate) struct World {
    pub surfaces: Surfaces,
    pub bodies: Vec<Body>,
    pub obstacles: Vec<Placed>,
    pub friction: f64,
    pub touches: Vec<Touch>,
    pub rows: Rows,
    pub lists: Lists,
    /// Whether the solver stops after the first iteration of each pass.
    pub is_stopped: bool,
    /// The velocity of the obstacles with a mesh (m/s).
    pub mesh_velocity: Vec3,
    /// The pairs that the rows are made of, instead of those of the lists.
    pub pairs: Option<Vec<Pair>>,
    steppers: Vec<Stepper<f64>>,
    room: Workspace,
    /// The first vertex of each body.
    firsts: Vec<u32>,
    /// Of all vertices.
    pub x: Vec<Vec3>,
    pub u: Vec<Vec3>,
    pub v: Vec<Vec3>,
    masses: Vec<f64>,
    fractions: Vec<f64>,
}

pub(crate) fn material() -> Material {
    Material {
        young: 1e6,
        poisson: 0.3,
        thickness: THICKNESS,
        density: 1000.0,
    }
}

pub(crate) fn config(gravity: Vec3) -> BodyConfig {
    BodyConfig {
        gravity,
        ..BodyConfig::default()
    }
}

/// A sheet as a body that may touch others, and itself if asked.
pub(crate) fn sheet(mesh: TriMesh, gravity: Vec3) -> (Body, Mesh) {
    let body = Body::sheet(&mesh, &[material()], config(gravity), &[]).unwrap();
    (body, Mesh::Sheet(mesh))
}

impl World {
    /// A world of bodies and of obstacles with a mesh.
    pub(crate) fn new(bodies: Vec<(Body, Mesh)>, meshes: Vec<TriMesh>, itself: bool) -> Self {
        let skin = |is_obstacle: bool| Skin {
            radius: 0.5 * THICKNESS,
            touches_itself: itself && !is_obstacle,
            is_obstacle,
        };
        let mut surfaces = Surfaces::default();
        let (mut x, mut masses, mut firsts) = (Vec::new(), Vec::new(), Vec::new());
        for (body, mesh) in &bodies {
            firsts.push(u32::try_from(x.len()).unwrap());
            x.extend_from_slice(body.node_positions());
            for (vertex, mass) in (0..).zip(body.node_masses()) {
                masses.push(if body.is_held(vertex) {
                    f64::INFINITY
                } else {
                    *mass
                });
            }
            surfaces.add(mesh, skin(false)).unwrap();
        }
        firsts.push(u32::try_from(x.len()).unwrap());
        for mesh in meshes {
            x.extend_from_slice(&mesh.positions);
            surfaces.add(&Mesh::Sheet(mesh), skin(true)).unwrap();
        }
        masses.resize(x.len(), f64::INFINITY);
        let options = StepperOptions {
            tolerance: 1e-7,
            sleep_speed: 0.0,
            // A trend that ends in a collision has no bounds.
            guess: Guess::Velocity,
            ..StepperOptions::default()
        };
        let bodies: Vec<Body> = bodies.into_iter().map(|(body, _)| body).collect();
        let steppers = bodies.iter().map(|body| {
            let mut stepper = Stepper::new(body, options).unwrap();
            stepper.prepare(body, H).unwrap();
            stepper
        });
        Self {
            steppers: steppers.collect(),
            rows: Rows::new(&surfaces, 8 * x.len()),
            lists: Lists::new(&surfaces, &x),
            obstacles: Vec::new(),
            friction: 0.0,
            touches: Vec::new(),
            is_stopped: false,
            mesh_velocity: Vec3::zeros(),
            pairs: None,
            room: Workspace::default(),
            u: vec![Vec3::zeros(); x.len()],
            v: vec![Vec3::zeros(); x.len()],
            fractions: vec![1.0; x.len()],
            firsts,
            masses,
            surfaces,
            bodies,
            x,
        }
    }

    /// The vertices of a body.
    pub(crate) fn of(&self, body: usize) -> core::ops::Range<usize> {
        self.firsts[body] as usize..self.firsts[body + 1] as usize
    }

    /// Makes the rows of the predicted step `u`.
    fn begin(&mut self) -> RowsReport {
        let (surfaces, x, u) = (&self.surfaces, &self.x, &self.u);
        self.lists.follow(surfaces, x, |hierarchy, cluster| {
            Moves::of(hierarchy.members(cluster), u)
        });
        let (lists, given) = (&self.lists, &self.pairs);
        let friction = self.friction;
        self.rows.begin(&Step {
            surfaces,
            x,
            u,
            v: &self.v,
            masses: &self.masses,
            h: H,
            parting: 0.2,
            meeting: &Meeting::by_radii(surfaces, friction),
            obstacles: &self.obstacles,
            hierarchy: lists.hierarchy(),
            pairs: &|found| match given {
                Some(pairs) => pairs.iter().for_each(|pair| found(*pair)),
                None => lists.each(surfaces, x, found),
            },
        })
    }

    /// Computes the factors of the bodies anew.
    pub(crate) fn prepare(&mut self) {
        for (stepper, body) in self.steppers.iter_mut().zip(&self.bodies) {
            stepper.prepare(body, H).unwrap();
        }
    }

    /// Makes a step. The solver updates the multipliers `updates` times.
    pub(crate) fn step(&mut self, updates: usize) -> Done {
        let mut steppers = core::mem::take(&mut self.steppers);
        let bodies = self.firsts.len() - 1;
        for (number, (stepper, body)) in steppers.iter_mut().zip(&mut self.bodies).enumerate() {
            let first = self.firsts[number] as usize;
            self.x[first..first + body.vertex_count()].copy_from_slice(body.node_positions());
            self.v[first..first + body.vertex_count()].copy_from_slice(body.node_velocities());
            stepper.predict(body, H).unwrap();
            stepper.constrain(body, &[]).unwrap();
        }
        let mut lent: Vec<_> = steppers
            .iter_mut()
            .map(|stepper| stepper.equation().unwrap())
            .collect();
        for (number, equation) in lent.iter().enumerate() {
            for vertex in self.of(number) {
                let node = u32::try_from(vertex).unwrap() - self.firsts[number];
                self.u[vertex] = equation.as_ref().unwrap().displacement(node);
            }
        }
        let meshes = self.firsts[bodies] as usize..self.x.len();
        self.u[meshes.clone()].fill(self.mesh_velocity * H);
        self.v[meshes.clone()].fill(self.mesh_velocity);
        let rows = self.begin();
        let firsts = &self.firsts;
        let at = |vertex: u32| {
            let body = firsts.partition_point(|first| *first <= vertex) - 1;
            let node = vertex - firsts[body];
            (body < bodies).then_some(At { body, node })
        };
        fill(&mut self.touches, self.rows.contacts(), &at);
        let is_stopped = self.is_stopped;
        let solve = solve(
            &mut lent,
            &mut self.touches,
            updates,
            &mut self.room,
            &mut || is_stopped,
        );
        let mut done = Done {
            rows,
            solve,
            ..Done::default()
        };
        let parting = self.rows.contacts().iter().zip(&self.touches);
        let parting = parting.filter(|(contact, _)| contact.is_parting);
        let work = |touch: &Touch| touch.response.normal * (touch.response.gap - touch.row.gap);
        done.parting_work = parting.map(|(_, touch)| work(touch)).sum();
        let responses = self.touches.iter().map(|touch| &touch.response);
        self.rows.end(responses, &|_| false);
        for (stepper, body) in steppers.iter_mut().zip(&mut self.bodies) {
            stepper.finish(body, || false).unwrap();
        }
        self.steppers = steppers;
        for x in &mut self.x[meshes] {
            *x += self.mesh_velocity * H;
        }
        done.truncated = self.truncate();
        done
    }

    /// Has no vertex move so far that surfaces cross.
    fn truncate(&mut self) -> usize {
        for (number, body) in self.bodies.iter().enumerate() {
            let first = self.firsts[number] as usize;
            for (vertex, x) in body.node_positions().iter().enumerate() {
                self.u[first + vertex] = x - self.x[first + vertex];
            }
        }
        let (surfaces, x, u) = (&self.surfaces, &self.x, &self.u);
        self.lists.extend(surfaces, x, |hierarchy, cluster| {
            Moves::of(hierarchy.members(cluster), u)
        });
        let lists = &self.lists;
        let each = |found: &mut dyn FnMut(Pair)| lists.each(surfaces, x, found);
        self.fractions.fill(1.0);
        let report = truncate(surfaces, x, u, &each, &|_| true, &mut self.fractions);
        for (number, body) in self.bodies.iter_mut().enumerate() {
            let first = self.firsts[number] as usize;
            let moved = self.fractions[first..].iter().zip(&u[first..]);
            let ends: Vec<Vec3> = (x[first..].iter().zip(moved))
                .map(|(x, (fraction, u))| x + u * *fraction)
                .take(body.vertex_count())
                .collect();
            let speeds: Vec<Vec3> = (ends.iter().zip(&x[first..]))
                .map(|(end, x)| (end - x) / H)
                .collect();
            if report.truncated > 0 {
                body.set_positions(&ends).unwrap();
                body.set_velocities(&speeds).unwrap();
            }
        }
        report.truncated
    }

    /// The present positions of all vertices (m).
    pub(crate) fn positions(&self) -> Vec<Vec3> {
        let mut all: Vec<Vec3> = self
            .bodies
            .iter()
            .flat_map(|body| body.node_positions().iter().copied())
            .collect();
        all.extend_from_slice(&self.x[all.len()..]);
        all
    }

    /// The sum of the forces of all contacts on each body (N).
    pub(crate) fn forces(&self) -> Vec<Vec3> {
        let mut sums = vec![Vec3::zeros(); self.bodies.len()];
        for touch in &self.touches {
            for (at, weight) in touch.nodes {
                sums[at.body] += touch.force() * weight;
            }
        }
        sums
    }

    /// The weight of a body (N).
    pub(crate) fn weight(&self, body: usize) -> f64 {
        self.bodies[body].total_mass() * 9.81
    }

    /// Number of edges that pass through a triangle.
    pub(crate) fn crossings(&self) -> usize {
        let x = self.positions();
        crossings(&self.surfaces, &x)
    }
}

/// Number of edges that pass through a triangle.
pub(crate) fn crossings(surfaces: &Surfaces, x: &[Vec3]) -> usize {
    let at = |vertex: u32| &x[vertex as usize];
    let pairs = surfaces.triangles.iter().flat_map(|corners| {
        let apart = move |ends: &&[u32; 2]| ends.iter().all(|v| !corners.contains(v));
        surfaces
            .edges
            .iter()
            .filter(apart)
            .map(move |ends| (ends, corners))
    });
    pairs
        .filter(|(ends, corners)| passes(ends.map(at), corners.map(at)))
        .count()
}
