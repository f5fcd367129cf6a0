//! Bodies that touch each other, themselves and obstacles, through all stages of a step.

use alloc_count::calls::{are_counted, count};
use physics::contact::obstacle::{Geometry, Motion, Obstacle, TimedPose};
use physics::contact::shape::Shape;
use physics::contact::{Meeting, Skin, crossing::passes};
use physics::mesh::generate::{self, Pattern};
use physics::mesh::{LineMesh, Mesh, TriMesh};
use physics::motion::contacts::{Contacts, MOST_BODIES, Member, Side};
use physics::{
    Body, BodyConfig, HandlePose, HandleSpec, Material, Stepper, StepperOptions, ThreadMaterial,
    Vec3,
};

/// Length of a step (s).
pub(crate) const H: f64 = 4e-3;
/// Half the thickness of a sheet (m).
pub(crate) const RADIUS: f64 = 0.15e-3;

/// Bodies with their contacts.
pub(crate) struct World {
    pub(crate) bodies: Vec<Body>,
    pub(crate) steppers: Vec<Stepper<f64>>,
    pub(crate) contacts: Contacts,
    pub(crate) meshes: Vec<Mesh>,
    pub(crate) hands: Vec<Vec<HandlePose>>,
    pub(crate) steps: u32,
    /// Calls of the allocator by `constrain` and by the contacts in the last step.
    pub(crate) calls: u64,
    pub(crate) radius: f64,
    /// The largest pressure of the contacts (Pa).
    pub(crate) pressure: f64,
    pub(crate) asleep: Vec<bool>,
}

impl World {
    pub(crate) fn new() -> Self {
        Self {
            bodies: Vec::new(),
            steppers: Vec::new(),
            contacts: Contacts::new(),
            meshes: Vec::new(),
            hands: Vec::new(),
            steps: 0,
            calls: 0,
            radius: RADIUS,
            pressure: f64::INFINITY,
            asleep: Vec::new(),
        }
    }

    pub(crate) fn add(&mut self, body: Body, mesh: Mesh, radius: f64, sleeps: bool) {
        let options = StepperOptions {
            tolerance: 1e-7,
            sleep_speed: if sleeps { 1e-7 } else { 0.0 },
            may_touch: true,
            ..StepperOptions::default()
        };
        let mut stepper = Stepper::new(&body, options).unwrap();
        stepper.prepare(&body, H).unwrap();
        let skin = Skin {
            radius,
            touches_itself: true,
            is_obstacle: false,
        };
        let number = self.bodies.len();
        self.contacts
            .add_body(number, &body, mesh.clone(), skin)
            .unwrap();
        self.bodies.push(body);
        self.steppers.push(stepper);
        self.meshes.push(mesh);
        self.hands.push(Vec::new());
    }

    /// A sheet of `cells` cells at the place of `put`.
    pub(crate) fn sheet(
        &mut self,
        size: [f64; 2],
        cells: [u32; 2],
        gravity: Vec3,
        put: impl Fn(&Vec3) -> Vec3,
    ) {
        let mut mesh =
            generate::sheet(size[0], size[1], cells[0], cells[1], Pattern::Alternating).unwrap();
        mesh.positions.iter_mut().for_each(|x| *x = put(x));
        let body = sheet(&mesh, gravity, &[]);
        self.add(body, Mesh::Sheet(mesh), RADIUS, true);
    }

    pub(crate) fn obstacle(&mut self, shape: Shape, motion: Motion) {
        let obstacle = Obstacle::new(Geometry::Shape(shape), motion).unwrap();
        self.contacts.add_obstacle(obstacle).unwrap();
    }

    pub(crate) fn still(&mut self, shape: Shape, at: Vec3) {
        self.obstacle(
            shape,
            Motion::Still(nalgebra::Isometry3::from_parts(
                at.into(),
                nalgebra::UnitQuaternion::identity(),
            )),
        );
    }

    pub(crate) fn complete(&mut self, friction: f64) {
        let (radius, pressure) = (self.radius, self.pressure);
        self.contacts.complete(&|one, other| match (one, other) {
            (Side::Obstacle(_), Side::Obstacle(_)) => None,
            (Side::Body(_), Side::Body(_)) => Some(Meeting {
                distance: 2.0 * radius,
                friction,
                pressure,
                force: f64::INFINITY,
            }),
            _ => Some(Meeting {
                distance: radius,
                friction,
                pressure,
                force: f64::INFINITY,
            }),
        });
    }

    pub(crate) fn step(&mut self) {
        let (bodies, steppers) = (&mut self.bodies, &mut self.steppers);
        let mut kept = vec![false; bodies.len()];
        self.contacts.keep_awake(
            bodies.len(),
            &|body| steppers[body].rests(&bodies[body], H, &self.hands[body]),
            &mut |body, is_kept| kept[body] = is_kept,
        );
        for (body, (stepper, kept)) in bodies.iter_mut().zip(steppers.iter_mut().zip(kept)) {
            stepper.keep_awake(kept);
            if self.steps.is_multiple_of(5) {
                stepper.prepare(body, H).unwrap();
            }
            stepper.predict(body, H).unwrap();
        }
        let constrained = count(|| {
            for ((body, stepper), hands) in bodies.iter_mut().zip(&mut *steppers).zip(&self.hands) {
                stepper.constrain(body, hands).unwrap();
            }
        });
        let mut members: Vec<Member<'_, f64>> = bodies
            .iter()
            .zip(&mut *steppers)
            .map(|(body, stepper)| Member {
                body,
                stepper: Some(stepper),
            })
            .collect();
        let time = f64::from(self.steps) * H;
        self.calls = count(|| {
            self.contacts.begin(&members, [time, time + H], H);
            self.contacts.solve(&mut members, &mut |_| false);
        });
        for member in &mut members {
            let stepper = member.stepper.as_mut().unwrap();
            if !stepper.is_solved() {
                stepper.solve(|| false).unwrap();
            }
        }
        self.calls += constrained + count(|| self.contacts.certify(&mut members));
        drop(members);
        self.asleep.clear();
        for (body, stepper) in bodies.iter_mut().zip(steppers) {
            let report = stepper.finish(body, || false).unwrap();
            self.asleep.push(report.asleep);
        }
        self.steps += 1;
    }

    pub(crate) fn weight(&self, body: usize) -> f64 {
        self.bodies[body].node_masses().iter().sum::<f64>() * 9.81
    }

    pub(crate) fn mean(&self, body: usize) -> Vec3 {
        let x = self.bodies[body].node_positions();
        x.iter().sum::<Vec3>() / x.len() as f64
    }

    /// The force (N) between two sides, on the first of them.
    pub(crate) fn force(&self, sides: [usize; 2]) -> Vec3 {
        let mut found = self.contacts.touching().iter();
        found
            .find(|sum| sum.sides == sides)
            .map_or_else(Vec3::zeros, |sum| sum.force)
    }

    /// Number of edges that pass through a triangle.
    pub(crate) fn crossings(&self) -> usize {
        let surfaces = self.contacts.surfaces();
        let mut x = Vec::new();
        for body in &self.bodies {
            x.extend_from_slice(body.node_positions());
        }
        let count = x.len() as u32;
        let at = |vertex: u32| &x[vertex as usize];
        let triangles = surfaces
            .triangles
            .iter()
            .filter(|c| c.iter().all(|v| *v < count));
        let pairs = triangles.flat_map(|corners| {
            let apart =
                move |ends: &&[u32; 2]| ends.iter().all(|v| !corners.contains(v) && *v < count);
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
}

pub(crate) fn sheet(mesh: &TriMesh, gravity: Vec3, handles: &[HandleSpec]) -> Body {
    let material = Material {
        young: 1e6,
        poisson: 0.3,
        thickness: 2.0 * RADIUS,
        density: 1000.0,
    };
    let config = BodyConfig {
        gravity,
        stiffness_damping: 1e-3,
        ..BodyConfig::default()
    };
    Body::sheet(mesh, &[material], config, handles).unwrap()
}

pub(crate) const DOWN: Vec3 = Vec3::new(0.0, 0.0, -9.81);

#[test]
fn a_dropped_sheet_rests_on_a_plane_and_sleeps() {
    let mut world = World::new();
    world.sheet([0.06, 0.04], [6, 4], DOWN, |x| x + Vec3::z() * 2e-3);
    world.still(Shape::Plane, Vec3::zeros());
    world.complete(0.5);
    for step in 0..150 {
        world.step();
        if (60..100).contains(&step) {
            let force = world.force([0, 1]);
            assert!(
                (force.z / world.weight(0) - 1.0).abs() < 1e-6,
                "{step} {force}"
            );
        }
    }
    let x = world.bodies[0].node_positions();
    assert!(x.iter().all(|x| (x.z - RADIUS).abs() < 1e-6));
    assert_eq!(world.asleep, [true]);
    // The force of a body that sleeps stays.
    assert!((world.force([0, 1]).z / world.weight(0) - 1.0).abs() < 1e-6);
}

/// Sheets above each other over a plane. Their meshes do not match.
fn layers(count: u8) -> World {
    let mut world = World::new();
    for layer in 0..count {
        let z = RADIUS + f64::from(layer) * 0.5e-3;
        let turn = nalgebra::Rotation3::from_axis_angle(&Vec3::z_axis(), 0.3 * f64::from(layer));
        world.sheet([0.06, 0.04], [6, 4], DOWN, |x| turn * x + Vec3::z() * z);
    }
    world.still(Shape::Plane, Vec3::zeros());
    world.complete(0.5);
    world
}

#[test]
fn sheets_on_each_other_carry_each_other_s_weight_and_sleep_together() {
    let mut world = layers(3);
    for step in 0..400 {
        world.step();
        assert_eq!(world.crossings(), 0, "{step}");
    }
    let w = world.weight(0);
    assert!((world.force([0, 3]).z / w - 3.0).abs() < 1e-5);
    assert!((-world.force([0, 1]).z / w - 2.0).abs() < 1e-5);
    assert!((-world.force([1, 2]).z / w - 1.0).abs() < 1e-5);
    assert_eq!(world.asleep, [true; 3]);
    // A sheet that is moved wakes those that it touches, and the stack comes to rest again.
    let lifted = vec![Vec3::z() * 0.01; world.bodies[2].vertex_count()];
    world.bodies[2].set_velocities(&lifted).unwrap();
    world.step();
    assert_eq!(world.asleep, [false; 3]);
    for _ in 0..400 {
        world.step();
    }
    assert_eq!(world.asleep, [true; 3]);
    assert!((world.force([0, 3]).z / w - 3.0).abs() < 1e-5);
}

#[test]
fn a_sheet_falls_over_the_edge_of_a_box() {
    let mut world = World::new();
    world.sheet([0.06, 0.04], [12, 8], DOWN, |x| {
        x + Vec3::z() * (1e-3 + RADIUS)
    });
    world.still(
        Shape::Box {
            half: Vec3::new(0.01, 0.03, 0.005),
        },
        Vec3::new(0.0, 0.0, -0.005),
    );
    world.complete(0.5);
    for step in 0..300 {
        world.step();
        assert_eq!(world.contacts.report().truncated.squeezed, 0, "{step}");
    }
    // The sheet hangs and still swings a little.
    assert!((world.force([0, 1]).z / world.weight(0) - 1.0).abs() < 0.02);
}

#[test]
fn a_block_on_an_incline_sags_slides_a_little_and_sticks() {
    let mut world = World::new();
    let mut mesh = physics::mesh::generate_box::solid_box([0.1; 3], [4; 3]).unwrap();
    let angle = libm::atan(0.3);
    for x in &mut mesh.positions {
        *x += Vec3::z() * (0.05 + 0.05e-3);
    }
    let material = physics::SolidMaterial {
        young: 20e3,
        poisson: 0.3,
        density: 1000.0,
    };
    let config = BodyConfig {
        gravity: Vec3::new(9.81 * angle.sin(), 0.0, -9.81 * angle.cos()),
        stiffness_damping: 30e-3,
        ..BodyConfig::default()
    };
    let body = Body::solid(
        &mesh,
        &[material],
        physics::SolidLaw::Corotational,
        config,
        &[],
    )
    .unwrap();
    world.radius = 0.05e-3;
    world.add(body, Mesh::Solid(mesh), 0.05e-3, true);
    world.still(Shape::Plane, Vec3::zeros());
    world.complete(0.5);
    let mut place = world.mean(0);
    for step in 0..400 {
        world.step();
        let report = world.contacts.report();
        assert!(report.solved.converged, "{step} {report:?}");
        let before = core::mem::replace(&mut place, world.mean(0));
        if step >= 350 {
            assert!(
                (place - before).norm() < 1e-10,
                "{step} {}",
                (place - before).norm()
            );
            let force = world.force([0, 1]).norm() / world.weight(0);
            assert!((force - 1.0).abs() < 1e-5, "{step} {force}");
        }
    }
    assert!(place.x < 5e-3, "{place}");
}

/// A soft block under a hand that presses it on the floor: the local model has the stiffness that the hand finds if it moves
/// and waits.
#[test]
fn the_local_model_of_a_pressed_block_feels_the_floor() {
    let mut world = World::new();
    world.radius = 0.5e-3;
    let mut mesh = physics::mesh::generate_box::solid_box([0.1; 3], [4; 3]).unwrap();
    for x in &mut mesh.positions {
        *x += Vec3::z() * (0.05 + world.radius);
    }
    let top = 0.1 + world.radius;
    let held: Vec<u32> = (0..)
        .zip(&mesh.positions)
        .filter(|(_, x)| x.z > top - 1e-6)
        .map(|(v, _)| v)
        .collect();
    let handle = HandleSpec {
        vertices: held,
        origin: Vec3::z() * top,
        freedom: physics::Freedom::Translation,
        border: physics::Border::Hinged,
    };
    let material = physics::SolidMaterial {
        young: 20e3,
        poisson: 0.3,
        density: 1000.0,
    };
    let config = BodyConfig {
        gravity: DOWN,
        stiffness_damping: 5e-3,
        ..BodyConfig::default()
    };
    let body = Body::solid(
        &mesh,
        &[material],
        physics::SolidLaw::Corotational,
        config,
        &[handle],
    )
    .unwrap();
    let radius = world.radius;
    world.add(body, Mesh::Solid(mesh), radius, false);
    world.still(Shape::Plane, Vec3::zeros());
    world.complete(0.6);
    let at = |z: f64, x: f64| HandlePose::at(Vec3::new(x, 0.0, top + z));
    world.hands[0] = vec![at(0.0, 0.0)];
    for step in 0..=60_u32 {
        world.hands[0] = vec![at(-0.5e-3 * f64::from(step) / 60.0, 0.0)];
        world.step();
    }
    for _ in 0..150 {
        world.step();
    }
    let force = |world: &World| {
        world.bodies[0]
            .handle_report(0)
            .unwrap()
            .wrench_on_hand
            .force
    };
    let before = force(&world);
    let mut shapes = physics::Shapes::default();
    let options = physics::ShapeOptions {
        max_iterations: 2000,
        ..physics::ShapeOptions::default()
    };
    let stepper = &mut world.steppers[0];
    world.contacts.hold();
    let (springs, room) = world.contacts.held(0);
    let mut around = physics::Around {
        number: 0,
        springs: springs[0],
        coming: springs[1],
        others: [const { None }; MOST_BODIES],
        room,
    };
    let (condensed, _) = shapes
        .condense_among(stepper, &world.bodies[0], 10.0, &options, Some(&mut around))
        .unwrap();
    let stiffness = condensed.stiffness.clone();
    for (axis, by) in [(2, -20e-6), (0, 10e-6)] {
        let mut offset = Vec3::zeros();
        offset[axis] = by;
        world.hands[0] = vec![at(-0.5e-3 + offset.z, offset.x)];
        for _ in 0..200 {
            world.step();
        }
        let found = -(force(&world) - before)[axis] / by;
        assert!(
            (stiffness[(axis, axis)] / found - 1.0).abs() < 0.01,
            "{axis}: {} for {found}",
            stiffness[(axis, axis)]
        );
        world.hands[0] = vec![at(-0.5e-3, 0.0)];
        for _ in 0..200 {
            world.step();
        }
    }
}

/// Sheets on each other, through all stages of a step: the lists, the rows, the islands, the solver, the certificate.
#[test]
fn a_step_with_contact_allocates_nothing() {
    assert!(are_counted());
    let mut world = layers(2);
    for step in 0..60 {
        // The first contacts of each kind take room.
        world.step();
        if step > 20 {
            assert_eq!(world.calls, 0, "{step}");
        }
    }
    assert!(world.contacts.report().rows.rows > 50);
}

/// The certificate stops a vertex of a stiff block before the others. To go on with the others alone would take much energy.
/// A block of a soft material.
struct Soft {
    /// Along each axis (m).
    size: [f64; 3],
    cells: [u32; 3],
    /// Of the centre (m).
    place: [f64; 3],
    /// (kg/m3)
    density: f64,
}

/// A lower block and an upper one on a floor.
fn two_blocks(blocks: [Soft; 2], friction: f64) -> World {
    let mut world = World::new();
    world.radius = 20e-6;
    for block in blocks {
        let mut mesh = physics::mesh::generate_box::solid_box(block.size, block.cells).unwrap();
        (mesh.positions.iter_mut()).for_each(|x| *x += Vec3::from(block.place));
        let rubber = physics::SolidMaterial {
            young: 40e3,
            poisson: 0.3,
            density: block.density,
        };
        let config = BodyConfig {
            gravity: DOWN,
            mass_damping: 5.0,
            stiffness_damping: 20e-3,
            ..BodyConfig::default()
        };
        let law = physics::SolidLaw::Corotational;
        let body = Body::solid(&mesh, &[rubber], law, config, &[]).unwrap();
        world.add(body, Mesh::Solid(mesh), 20e-6, true);
    }
    world.still(Shape::Plane, Vec3::zeros());
    world.complete(friction);
    world
}

#[test]
fn a_stiff_block_that_stops_at_a_vertex_lands() {
    let lower = Soft {
        size: [0.05, 0.05, 0.03],
        cells: [4, 4, 2],
        place: [0.0, 0.0, 0.01502],
        density: 1000.0,
    };
    let upper = Soft {
        size: [0.03, 0.03, 0.02],
        cells: [2, 2, 2],
        place: [0.002, 0.001, 0.04007],
        density: 1000.0,
    };
    let mut world = two_blocks([lower, upper], 0.4);
    for _ in 0..250 {
        world.step();
    }
    let carried = -world.force([0, 1]).z / world.weight(1);
    assert!((carried - 1.0).abs() < 5e-3, "{carried}");
}

#[test]
fn blocks_that_lie_flush_on_each_other_do_not_lock() {
    // The upper block is as heavy as the lower one, and eight times as heavy. All vertices and edges between the blocks lie on
    // each other, and the blocks bulge over each other's borders.
    for (density, friction) in [(1000.0, 0.0), (1000.0, 0.5), (8000.0, 0.5)] {
        let block = |height: f64, density: f64| Soft {
            size: [0.05; 3],
            cells: [3; 3],
            place: [0.0, 0.0, height],
            density,
        };
        let (lower, upper) = (block(0.02502, 1000.0), block(0.07507, density));
        let mut world = two_blocks([lower, upper], friction);
        let weight = world.weight(1);
        let mut most: f64 = 0.0;
        for _ in 0..150 {
            world.step();
            most = most.max(world.force([0, 1]).norm());
        }
        // What lands on a spring presses with twice its weight.
        assert!(most < 2.0 * weight, "{density} {friction}: {most} {weight}");
        let carried = -world.force([0, 1]).z / weight;
        assert!(
            (carried - 1.0).abs() < 0.1,
            "{density} {friction}: {carried}"
        );
    }
}

#[test]
fn a_vertex_does_not_snap_across_what_lies_in_a_fold() {
    // A sheet that is folded at a right angle. A thread lies in the fold, where the triangles of a vertex that moves away from the
    // fold would cut off the corner.
    let cells = 4;
    let length = 0.02;
    let fold = |x: &Vec3| Vec3::new(x.x.min(0.0), x.y, x.x.max(0.0));
    let thread = |away: f64| {
        let mut world = World::new();
        world.sheet([length, length], [cells, cells], Vec3::zeros(), fold);
        let ends = [-1.0, 1.0].map(|y| Vec3::new(-0.4e-3 - away, 1e-3 * y, 0.4e-3));
        let mesh = LineMesh {
            positions: ends.to_vec(),
            lines: vec![[0, 1]],
            ..LineMesh::default()
        };
        let material = ThreadMaterial {
            young: 1e6,
            area: 1e-8,
            density: 1000.0,
            tension_only: true,
        };
        let body = Body::thread(&mesh, &[material], BodyConfig::default(), &[]).unwrap();
        world.add(body, Mesh::Thread(mesh), RADIUS, false);
        world.complete(0.3);
        world.step();
        world.step();
        world
    };
    let near = thread(0.0);
    let places = near.bodies[0].node_positions();
    let at_fold = |(_, x): &(usize, &Vec3)| x.norm() < 1e-6;
    let (vertex, _) = places.iter().enumerate().find(at_fold).unwrap();
    let vertex = u32::try_from(vertex).unwrap();
    let clear =
        |world: &World, to: Vec3| (world.contacts).is_clear(0, &world.bodies[0], vertex, &to, true);
    let way = -Vec3::x() * 1.5e-3;
    assert!(!clear(&near, way));
    // Away from the thread, and where no thread lies, the way is clear.
    assert!(clear(&near, way * 0.05));
    assert!(clear(&thread(4e-3), way));
    // Beside things that are near, nothing is known of a surface that does not follow its body.
    assert!(!(near.contacts).is_clear(0, &near.bodies[0], vertex, &(way * 0.05), false));
    // Nothing is known of a way that is longer than all is far away.
    assert!(clear(&thread(0.5), way));
    assert!(!clear(&thread(0.5), way * 1e3));
}

#[test]
fn an_overlap_that_parts_gives_the_work_that_lifts_the_sheet() {
    let (depth, gravity) = (0.05e-3, 9.81);
    let mut world = World::new();
    world.sheet([0.02, 0.02], [4, 4], Vec3::z() * -gravity, |x| {
        x + Vec3::z() * (RADIUS - depth)
    });
    world.still(Shape::Plane, Vec3::zeros());
    world.complete(0.0);
    let start = world.mean(0).z;
    let (mut parted, mut taken) = (0.0, 0.0);
    for _ in 0..100 {
        world.step();
        let report = world.contacts.report();
        (parted, taken) = (parted + report.parted, taken + report.taken);
    }
    let lifted = world.weight(0) * (world.mean(0).z - start);
    assert!(lifted > 0.9 * depth * world.weight(0), "{lifted}");
    // The sheet moves slowly, and some of the work is that of the contacts after they have parted.
    assert!((parted / lifted - 1.0).abs() < 0.1, "{parted} {lifted}");
    assert!(taken.abs() < 0.1 * lifted, "{taken} {lifted}");
}

/// The vertices at the foot of a stiff column have an eightieth of the mass that they stop.
#[test]
fn a_row_stops_what_stands_on_its_vertices() {
    let mut world = World::new();
    let mut mesh = physics::mesh::generate_box::solid_box([0.01, 0.01, 0.4], [1, 1, 40]).unwrap();
    for x in &mut mesh.positions {
        *x += Vec3::z() * (0.2 + 3e-3);
    }
    let material = physics::SolidMaterial {
        young: 1e7,
        poisson: 0.3,
        density: 1000.0,
    };
    let config = BodyConfig {
        gravity: Vec3::z() * -9.81,
        stiffness_damping: 1e-3,
        ..BodyConfig::default()
    };
    let law = physics::SolidLaw::Corotational;
    let body = Body::solid(&mesh, &[material], law, config, &[]).unwrap();
    world.add(body, Mesh::Solid(mesh), RADIUS, false);
    world.still(Shape::Plane, Vec3::zeros());
    world.complete(0.3);
    let mut deepest = 0.0_f64;
    for _ in 0..50 {
        world.step();
        let touching = world.contacts.touching().iter();
        deepest = touching.map(|sum| sum.depth).fold(deepest, f64::max);
    }
    // A contact may be a twentieth deep.
    assert!(deepest > 0.0 && deepest < 0.05 * RADIUS, "{deepest}");
}

#[test]
fn a_plane_that_lifts_a_sheet_does_the_work() {
    let mut world = World::new();
    world.sheet([0.02, 0.02], [4, 4], DOWN, |x| x + Vec3::z() * RADIUS);
    let at = |time: f64, z: f64| TimedPose {
        time,
        pose: (Vec3::z() * z).into(),
    };
    world.obstacle(
        Shape::Plane,
        Motion::Poses(vec![
            at(0.0, 0.0),
            at(0.1, 0.0),
            at(0.3, 2e-3),
            at(0.5, 2e-3),
        ]),
    );
    world.complete(0.3);
    let energy = |world: &World| world.bodies[0].total_energy();
    let start = energy(&world);
    let [mut driven, mut taken, mut given] = [0.0_f64; 3];
    for _ in 0..120 {
        world.step();
        let report = world.contacts.report();
        driven += report.by_obstacles;
        taken += report.taken + report.stopped;
        given = given.max(-taken);
    }
    let lifted = world.weight(0) * 2e-3;
    // What the plane does at first against the inertia of the sheet is lost again.
    let gained = energy(&world) - start;
    assert!((gained / lifted - 1.0).abs() < 1e-3, "{gained} {lifted}");
    assert!((driven / lifted - 1.0).abs() < 1e-2, "{driven} {lifted}");
    assert!(given < 2e-3 * driven, "{given} {driven}");
}

#[test]
fn what_lands_elsewhere_changes_nothing() {
    // Sheets that fall from these heights (m), side by side. Returns where the first one that falls from 1 mm is, step by step.
    let fall = |heights: &[f64]| {
        let mut world = World::new();
        for (place, height) in (0_u8..).zip(heights) {
            // The sheet that is followed is at the same place in all worlds.
            let x = if *height == 1e-3 {
                0.0
            } else {
                0.1 * f64::from(place + 1)
            };
            let put = Vec3::new(x, 0.0, RADIUS + height);
            world.sheet([0.04, 0.04], [4, 4], DOWN, |at| at + put);
        }
        world.still(Shape::Plane, Vec3::zeros());
        world.complete(0.5);
        let followed = heights.iter().position(|height| *height == 1e-3).unwrap();
        let places = (0..60).map(|_| {
            world.step();
            world.bodies[followed].node_positions().to_vec()
        });
        places.collect::<Vec<_>>()
    };
    let alone = fall(&[1e-3]);
    for heights in [[1e-3, 4e-3, 30e-3], [9e-3, 1e-3, 2e-3]] {
        assert!(fall(&heights) == alone, "{heights:?}");
    }
}

#[test]
fn a_floor_carries_its_largest_pressure_and_no_more() {
    // A sheet of 0.3 kg/m2 presses 2.943 Pa.
    let weight = 1000.0 * 2.0 * RADIUS * 9.81;
    // Rows of a kappa of eight leave 1/81 of a force that is new, after one further update.
    for (most, is_carried, off, count) in [
        (2.0 * weight, 1.0, 1.001 / 81.0, 1),
        (0.9 * weight, 0.9, 1e-6, 2),
    ] {
        let mut world = World::new();
        // The vertices' areas and masses are in the same ratio everywhere. The second sheet is one of another mesh.
        for (cells, x) in [([4, 4], 0.0), ([5, 3], 0.1)] {
            world.sheet([0.04, 0.04], cells, DOWN, |at| {
                at + Vec3::new(x, 0.0, RADIUS)
            });
        }
        world.still(Shape::Plane, Vec3::zeros());
        world.pressure = most;
        world.complete(0.5);
        for steps in 1_u8..=count {
            world.step();
            for body in 0..2 {
                let carried = world.force([body, 2]).z / world.weight(body);
                let is_near = |found: f64, expected: f64| (found - expected).abs() < off;
                assert!(is_near(carried, is_carried), "{most} {body} {carried}");
                let fall = (1.0 - is_carried) * f64::from(steps);
                for v in world.bodies[body].node_velocities() {
                    let v = -v.z / (9.81 * H);
                    assert!(is_near(v, fall), "{most} {body} {v}");
                }
            }
        }
    }
}

/// A half tube of 3 GPa stands on a plane, and a lid comes down on its edge at `speed` (m/s), `down` (m) beyond the touch.
/// Returns the work of the lid, the most that contacts gave on the way, and the most that the tube gained beyond that work (J).
fn press_edge(cells: [u32; 2], friction: f64, speed: f64, down: f64) -> [f64; 3] {
    let mut world = World::new();
    let (around, height) = (8e-3, 0.02);
    let [along, up] = cells;
    let mut mesh = generate::sheet(0.024, height, along, up, Pattern::Alternating).unwrap();
    for x in &mut mesh.positions {
        let angle = x.x / around;
        *x = Vec3::new(angle.cos() * around, angle.sin() * around, x.y);
    }
    let low = mesh.positions.iter().fold(f64::INFINITY, |z, x| z.min(x.z));
    mesh.positions.iter_mut().for_each(|x| x.z += RADIUS - low);
    let material = Material {
        young: 3e9,
        poisson: 0.3,
        thickness: 2.0 * RADIUS,
        density: 1000.0,
    };
    let config = BodyConfig {
        gravity: DOWN,
        stiffness_damping: 1e-3,
        ..BodyConfig::default()
    };
    let body = Body::sheet(&mesh, &[material], config, &[]).unwrap();
    world.add(body, Mesh::Sheet(mesh), RADIUS, false);
    world.still(Shape::Plane, Vec3::zeros());
    let half = Vec3::new(0.03, 0.03, 5e-3);
    let touches = height + 2.0 * RADIUS + half.z;
    let at = |time: f64, z: f64| TimedPose {
        time,
        pose: (Vec3::z() * z).into(),
    };
    let (rests, above) = (0.1, 1e-5);
    let stands = rests + (down + above) / speed;
    world.obstacle(
        Shape::Box { half },
        Motion::Poses(vec![
            at(0.0, touches + above),
            at(rests, touches + above),
            at(stands, touches - down),
        ]),
    );
    world.complete(friction);
    let energy = |world: &World| world.bodies[0].total_energy();
    let start = energy(&world);
    let [mut driven, mut taken, mut given, mut beyond] = [0.0_f64; 4];
    while f64::from(world.steps) * H < stands + 0.1 {
        world.step();
        let report = world.contacts.report();
        driven += report.by_obstacles;
        taken += report.taken + report.stopped;
        given = given.max(-taken);
        beyond = beyond.max(energy(&world) - start - driven);
    }
    [driven, given, beyond]
}

#[test]
fn a_stiff_edge_that_is_pressed_gets_the_work_of_what_presses() {
    let down = 0.2e-3;
    // Each of the two ends may overlap by 0.05 thicknesses at the whole force; the press goes `down` at half of it on average.
    let most = 2.0 * 0.05 * RADIUS / (0.5 * down);
    for cells in [[12, 10], [9, 7], [14, 5]] {
        for friction in [0.0, 0.3] {
            for speed in [0.5e-3, 1e-3, 4e-3] {
                let [driven, given, beyond] = press_edge(cells, friction, speed, down);
                let [given, beyond] = [given / driven, beyond / driven];
                assert!(given < most, "{cells:?} {friction} {speed}: {given}");
                assert!(beyond < 0.02, "{cells:?} {friction} {speed}: {beyond}");
            }
        }
    }
}

#[test]
fn a_long_box_that_slides_beneath_a_block_leaves_it_room() {
    for speed in [0.5, 1.0, 3.0] {
        let mut world = World::new();
        world.radius = 25e-6;
        let mut mesh = physics::mesh::generate_box::solid_box([0.05; 3], [3, 3, 3]).unwrap();
        mesh.positions.iter_mut().for_each(|x| x.z += 0.05 + 2e-4);
        let material = physics::SolidMaterial {
            young: 1e5,
            poisson: 0.3,
            density: 1000.0,
        };
        let config = BodyConfig {
            gravity: DOWN,
            stiffness_damping: 5e-3,
            ..BodyConfig::default()
        };
        let law = physics::SolidLaw::Corotational;
        let body = Body::solid(&mesh, &[material], law, config, &[]).unwrap();
        let radius = world.radius;
        world.add(body, Mesh::Solid(mesh), radius, false);
        let half = Vec3::new(2.0, 0.15, 0.025);
        let at = |time: f64, x: f64| TimedPose {
            time,
            pose: (Vec3::x() * x).into(),
        };
        world.obstacle(
            Shape::Box { half },
            Motion::Poses(vec![at(0.0, -0.5 * speed), at(1.0, 0.5 * speed)]),
        );
        world.complete(0.1);
        for _ in 0..100 {
            world.step();
            let report = world.contacts.report();
            assert_eq!(report.truncated.squeezed, 0, "{speed} {}", world.steps);
        }
    }
}
