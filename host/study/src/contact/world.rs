//! Bodies that step together, with their contacts, as the host steps them.

use super::crossings::crossings;
use crate::StudyError;
use crate::speed::clock::cpu_time;
use nalgebra::Isometry3;
use physics::contact::obstacle::{ClosedMesh, Geometry, Motion, Obstacle};
use physics::contact::shape::Shape;
use physics::contact::{Meeting, Skin};
use physics::mesh::generate::{self, Pattern};
use physics::mesh::{Mesh, TriMesh};
use physics::motion::contacts::{Contacts, Member, Side};
use physics::{Body, BodyConfig, HandlePose, HandleSpec, Material, Stepper, StepperOptions, Vec3};

/// Length of a step (s).
pub(super) const STEP: f64 = 4e-3;
/// Half the thickness of a sheet (m).
pub(super) const RADIUS: f64 = 0.15e-3;
/// Earth's gravity (m/s^2).
pub(super) const DOWN: Vec3 = Vec3::new(0.0, 0.0, -GRAVITY);
/// Its size (m/s^2).
pub(super) const GRAVITY: f64 = 9.81;
/// Steps between two factors of a body.
const RENEWAL: u32 = 5;

/// The times of the stages of a step (s).
#[derive(Clone, Copy, Debug)]
pub(super) struct Stages {
    /// Surfaces, lists and rows.
    pub(super) begin: f64,
    /// The joint solve of the bodies with their rows.
    pub(super) solve: f64,
    /// Certificate and truncation.
    pub(super) certify: f64,
}

/// Bodies with their contacts.
pub(super) struct World {
    /// The bodies.
    pub(super) bodies: Vec<Body>,
    /// Their contacts.
    pub(super) contacts: Contacts,
    /// The poses of the handles, by body.
    pub(super) hands: Vec<Vec<HandlePose>>,
    /// Whether the solver stops after one iteration of each pass.
    pub(super) is_stopped: bool,
    steppers: Vec<Stepper<f64>>,
    steps: u32,
}

/// A sheet of `size` (m) and `cells`, with its vertices at the place of `put`.
pub(super) fn sheet_mesh(
    size: [f64; 2],
    cells: [u32; 2],
    put: impl Fn(&Vec3) -> Vec3,
) -> Result<TriMesh, StudyError> {
    let mut mesh = generate::sheet(size[0], size[1], cells[0], cells[1], Pattern::Alternating)?;
    mesh.positions.iter_mut().for_each(|x| *x = put(x));
    Ok(mesh)
}

/// The configuration of a sheet.
pub(super) fn config(gravity: Vec3) -> BodyConfig {
    BodyConfig {
        gravity,
        stiffness_damping: 1e-3,
        ..BodyConfig::default()
    }
}

impl World {
    /// A world without bodies.
    pub(super) fn new() -> Self {
        Self {
            bodies: Vec::new(),
            contacts: Contacts::new(),
            hands: Vec::new(),
            is_stopped: false,
            steppers: Vec::new(),
            steps: 0,
        }
    }

    /// Adds a sheet that touches itself. Its `handles` stay where they are, unless `hands` are moved.
    pub(super) fn add_sheet(
        &mut self,
        mesh: TriMesh,
        config: BodyConfig,
        handles: &[HandleSpec],
    ) -> Result<(), StudyError> {
        let options = StepperOptions {
            tolerance: 1e-7,
            // What is measured is the rest of a body that is awake.
            sleep_speed: 0.0,
            ..StepperOptions::default()
        };
        self.add(mesh, config, handles, options)
    }

    /// Adds a sheet as the host steps one: to a thousandth of a per mille of the loads, with a factor that is some steps old.
    pub(super) fn add_as_host(
        &mut self,
        mesh: TriMesh,
        config: BodyConfig,
    ) -> Result<(), StudyError> {
        let options = StepperOptions {
            sleep_speed: 0.0,
            refresh: false,
            max_iterations: 1000,
            ..StepperOptions::default()
        };
        self.add(mesh, config, &[], options)
    }

    fn add(
        &mut self,
        mesh: TriMesh,
        config: BodyConfig,
        handles: &[HandleSpec],
        options: StepperOptions,
    ) -> Result<(), StudyError> {
        let material = Material {
            young: 1e6,
            poisson: 0.3,
            thickness: 2.0 * RADIUS,
            density: 1000.0,
        };
        let body = Body::sheet(&mesh, &[material], config, handles)?;
        self.steppers.push(Stepper::new(&body, options)?);
        let skin = Skin {
            radius: RADIUS,
            touches_itself: true,
            is_obstacle: false,
        };
        let number = self.bodies.len();
        let mesh = Mesh::Sheet(mesh);
        self.contacts.add_body(number, &body, mesh, skin)?;
        self.bodies.push(body);
        let poses = handles.iter().map(|handle| HandlePose::at(handle.origin));
        self.hands.push(poses.collect());
        Ok(())
    }

    /// Adds an obstacle.
    pub(super) fn add_obstacle(&mut self, shape: Shape, motion: Motion) -> Result<(), StudyError> {
        let obstacle = Obstacle::new(Geometry::Shape(shape), motion)?;
        Ok(self.contacts.add_obstacle(obstacle)?)
    }

    /// Adds an obstacle of triangles that stands still.
    pub(super) fn add_mesh(&mut self, mesh: ClosedMesh) -> Result<(), StudyError> {
        let still = Motion::Still(Isometry3::identity());
        let obstacle = Obstacle::new(Geometry::Mesh(mesh), still)?;
        Ok(self.contacts.add_obstacle(obstacle)?)
    }

    /// Adds a floor, which is the plane `z = 0`.
    pub(super) fn add_floor(&mut self) -> Result<(), StudyError> {
        self.add_obstacle(Shape::Plane, Motion::Still(Isometry3::identity()))
    }

    /// Ends the lists of bodies and obstacles, which all touch with `friction`.
    pub(super) fn complete(&mut self, friction: f64) {
        self.contacts.complete(&|one, other| match (one, other) {
            (Side::Obstacle(_), Side::Obstacle(_)) => None,
            (Side::Body(_), Side::Body(_)) => Some(Meeting {
                distance: 2.0 * RADIUS,
                friction,
                pressure: f64::INFINITY,
                force: f64::INFINITY,
            }),
            _ => Some(Meeting {
                distance: RADIUS,
                friction,
                pressure: f64::INFINITY,
                force: f64::INFINITY,
            }),
        });
    }

    /// Makes a step. Returns the processor time of its stages of contact.
    ///
    /// # Errors
    /// [`StudyError::Step`].
    pub(super) fn step(&mut self) -> Result<Stages, StudyError> {
        let each = self.bodies.iter_mut().zip(&mut self.steppers);
        for ((body, stepper), hands) in each.zip(&self.hands) {
            if self.steps.is_multiple_of(RENEWAL) {
                stepper.prepare(body, STEP)?;
            }
            stepper.predict(body, STEP)?;
            stepper.constrain(body, hands)?;
        }
        let each = self.bodies.iter().zip(&mut self.steppers);
        let mut members: Vec<Member<'_, f64>> = each
            .map(|(body, stepper)| Member {
                body,
                stepper: Some(stepper),
            })
            .collect();
        let (time, is_stopped) = (f64::from(self.steps) * STEP, self.is_stopped);
        let start = cpu_time();
        self.contacts.begin(&members, [time, time + STEP], STEP);
        let begun = cpu_time();
        self.contacts.solve(&mut members, &mut |_| is_stopped);
        let solved = cpu_time();
        for member in &mut members {
            if let Some(stepper) = member.stepper.as_mut().filter(|s| !s.is_solved()) {
                stepper.solve(|| is_stopped)?;
            }
        }
        let alone = cpu_time();
        self.contacts.certify(&mut members);
        let certified = cpu_time();
        drop(members);
        for (body, stepper) in self.bodies.iter_mut().zip(&mut self.steppers) {
            stepper.finish(body, || false)?;
        }
        self.steps += 1;
        Ok(Stages {
            begin: begun - start,
            solve: solved - begun,
            certify: certified - alone,
        })
    }

    /// The weight of a body (N).
    pub(super) fn weight(&self, body: usize) -> f64 {
        self.bodies[body].total_mass() * GRAVITY
    }

    /// The mean position of the vertices of a body (m).
    pub(super) fn mean(&self, body: usize) -> Vec3 {
        let x = self.bodies[body].node_positions();
        x.iter().sum::<Vec3>() / x.len() as f64
    }

    /// The velocity of the centre of mass of a body (m/s).
    pub(super) fn velocity(&self, body: usize) -> Vec3 {
        self.bodies[body].momentum() / self.bodies[body].total_mass()
    }

    /// The force (N) between two sides, on the first of them.
    pub(super) fn force(&self, sides: [usize; 2]) -> Vec3 {
        let mut found = self.contacts.touching().iter();
        found
            .find(|sum| sum.sides == sides)
            .map_or_else(Vec3::zeros, |sum| sum.force)
    }

    /// The depth of the deepest contact (m).
    pub(super) fn depth(&self) -> f64 {
        let sums = self.contacts.touching().iter();
        sums.map(|sum| sum.depth).fold(0.0, f64::max)
    }

    /// Number of edges of bodies that pass through a triangle of a body.
    pub(super) fn crossings(&self) -> usize {
        let surfaces = self.contacts.surfaces();
        let bodies = self.bodies.iter();
        let mut x: Vec<Vec3> = bodies
            .flat_map(|body| body.node_positions().iter().copied())
            .collect();
        // What is left are obstacles.
        let of_bodies = x.len() as u32;
        x.resize(surfaces.vertices, Vec3::repeat(f64::NAN));
        let is_body = |part: usize| surfaces.parts[part].vertices.end <= of_bodies;
        let mut count = 0;
        crossings(
            surfaces,
            &x,
            &|one, other| is_body(one) && is_body(other),
            &mut |_, _| count += 1,
        );
        count
    }
}
