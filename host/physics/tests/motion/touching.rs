//! Bodies that meet an obstacle: rest, an incline, and a belt over a cylinder.

use physics::contact::row::{Row, Stiffness, carried};
use physics::contact::shape::{Nearest, Shape};
use physics::mesh::LineMesh;
use physics::mesh::generate::{self, Pattern};
use physics::motion::joined::{At, Workspace};
use physics::motion::touching::{self, Touch, TouchReport};
use physics::{
    Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Material, Stepper, StepperOptions,
    ThreadMaterial, Vec3,
};
use std::f64::consts::PI;

/// Length of a step (s).
const H: f64 = 4e-3;
/// Half the thickness of the sheet and of the belt (m).
const THETA: f64 = 0.15e-3;

/// The last forces of a vertex (N).
#[derive(Clone, Copy, Default)]
struct Carried {
    forces: [f64; 2],
    friction: Vec3,
}

/// An obstacle, and the friction on it.
struct Law {
    obstacle: fn(&Vec3) -> Nearest,
    friction: f64,
}

impl Law {
    /// The contact of a vertex that the guess of the step moves by `u` (m), if it comes near, and whether it hits the
    /// obstacle.
    fn touch(&self, body: &Body, node: u32, last: &Carried, u: &Vec3) -> Option<(Touch, bool)> {
        let at = node as usize;
        let (x, v) = (body.node_positions()[at], body.node_velocities()[at]);
        let near = (self.obstacle)(&(x + u));
        if near.distance > THETA + 1.3 * u.norm() + 0.1 * THETA {
            return None;
        }
        let opening = v.dot(&near.normal);
        let stiffness = Stiffness {
            mass: body.node_masses()[at],
            step: H,
            thickness: THETA,
            approach: -opening,
            force: last.forces[0].max(last.forces[1]),
            friction: self.friction,
        };
        // The friction force keeps its size, and turns with the surface.
        let across = last.friction - near.normal * near.normal.dot(&last.friction);
        let turned = across * (last.friction.norm() / across.norm().max(f64::MIN_POSITIVE));
        let row = Row {
            depth: 0.25 * THETA,
            most: f64::INFINITY,
            normal: near.normal,
            gap: near.distance - THETA - near.normal.dot(u),
            motion: Vec3::zeros(),
            friction: self.friction,
            normal_stiffness: stiffness.normal(),
            friction_stiffness: stiffness.friction(),
            carried: carried(last.forces, opening, H, stiffness.depth()),
            anchored: turned,
            is_held: false,
        };
        let is_impact = last.forces[0] == 0.0 && -opening * H > stiffness.depth();
        let of = |weight: f64| (At { body: 0, node }, weight);
        let nodes = [of(1.0), of(0.0), of(0.0), of(0.0)];
        Some((Touch::new(nodes, row), is_impact))
    }
}

/// A body and an obstacle.
struct Scene {
    body: Body,
    stepper: Stepper<f64>,
    room: Workspace,
    law: Law,
    carried: Vec<Carried>,
    /// The contacts of the last step.
    touches: Vec<Touch>,
}

impl Scene {
    fn new(body: Body, obstacle: fn(&Vec3) -> Nearest, friction: f64) -> Self {
        let options = StepperOptions {
            tolerance: 1e-7,
            sleep_speed: 0.0,
            ..StepperOptions::default()
        };
        let mut stepper = Stepper::new(&body, options).unwrap();
        stepper.prepare(&body, H).unwrap();
        Self {
            carried: vec![Carried::default(); body.vertex_count()],
            body,
            stepper,
            room: Workspace::default(),
            law: Law { obstacle, friction },
            touches: Vec::new(),
        }
    }

    /// A sheet parallel to the floor at a height (m).
    fn sheet(height: f64, gravity: Vec3) -> Self {
        let mut mesh = generate::sheet(0.06, 0.04, 6, 4, Pattern::Alternating).unwrap();
        mesh.positions.iter_mut().for_each(|x| x.z = height);
        let material = Material {
            young: 1e6,
            poisson: 0.3,
            thickness: 2.0 * THETA,
            density: 1000.0,
        };
        let config = BodyConfig {
            gravity,
            ..BodyConfig::default()
        };
        let body = Body::sheet(&mesh, &[material], config, &[]).unwrap();
        Self::new(body, |x| Shape::Plane.nearest(x), 0.5)
    }

    /// Makes a step. Returns the work of the solver, and the part of the step that the guard on the energy held back.
    fn step(&mut self, hands: &[HandlePose]) -> (TouchReport, f64) {
        self.stepper.predict(&self.body, H).unwrap();
        self.stepper.constrain(&mut self.body, hands).unwrap();
        let mut lent = [self.stepper.equation().unwrap()];
        let mut touches = Vec::new();
        let mut updates = 1;
        for (node, last) in (0..).zip(&self.carried) {
            let guess = lent[0].as_ref().unwrap().displacement(node);
            let Some((touch, is_impact)) = self.law.touch(&self.body, node, last, &guess) else {
                continue;
            };
            if is_impact {
                updates = 2;
            }
            touches.push(touch);
        }
        let report = touching::solve(
            &mut lent,
            &mut touches,
            updates,
            &mut self.room,
            &mut || false,
        );
        let done = self.stepper.finish(&mut self.body, || false).unwrap();
        let mut next = vec![Carried::default(); self.carried.len()];
        for touch in &touches {
            let node = touch.nodes[0].0.node as usize;
            next[node] = Carried {
                forces: [touch.response.normal, self.carried[node].forces[0]],
                friction: touch.response.friction,
            };
        }
        (self.carried, self.touches) = (next, touches);
        (report, done.held_back)
    }

    /// The mean of a coordinate (m).
    fn mean(&self, axis: usize) -> f64 {
        let x = self.body.node_positions();
        x.iter().map(|x| x[axis]).sum::<f64>() / x.len() as f64
    }
}

#[test]
fn a_dropped_sheet_comes_to_rest_without_penetration() {
    let mut scene = Scene::sheet(2e-3 + THETA, Vec3::z() * -9.81);
    let weight = scene.body.node_masses().iter().sum::<f64>() * 9.81;
    let (mut deepest, mut rebound) = (0.0_f64, 0.0_f64);
    for step in 0..100 {
        let (report, held_back) = scene.step(&[]);
        assert_eq!(held_back, 0.0);
        let gaps = scene.body.node_positions().iter().map(|x| x.z - THETA);
        let [low, high] = [f64::min, f64::max].map(|of| gaps.clone().reduce(of).unwrap());
        deepest = deepest.min(low);
        // The sheet falls for five steps.
        if step > 5 {
            rebound = rebound.max(high);
        }
        if step > 45 {
            let force: f64 = scene
                .touches
                .iter()
                .map(|touch| touch.response.normal)
                .sum();
            assert!(
                (force / weight - 1.0).abs() < 1e-6,
                "{step} {force} {weight}"
            );
            assert!(low > -1e-6 && high < 1e-6, "{step} {low} {high}");
            assert!(report.iterations <= 2, "{step} {report:?}");
        }
    }
    assert!(deepest > -0.25 * THETA, "{deepest}");
    assert!(rebound < 0.01 * 2e-3, "{rebound}");
}

#[test]
fn a_sheet_on_an_incline_sticks_below_the_cone_and_slides_above() {
    for factor in [0.9, 0.99, 1.01, 1.5] {
        let angle = libm::atan(0.5 * factor);
        let gravity = Vec3::new(9.81 * angle.sin(), 0.0, -9.81 * angle.cos());
        let mut scene = Scene::sheet(THETA, gravity);
        let mut places = vec![scene.mean(0)];
        let mut iterations = 0;
        for _ in 0..250 {
            iterations += scene.step(&[]).0.iterations;
            places.push(scene.mean(0));
        }
        let speed = |step: usize| (places[step] - places[step - 1]) / H;
        if factor < 1.0 {
            let creep = (places[250] - places[200]) / (50.0 * H);
            assert!(creep.abs() < 0.01e-6, "{factor} {creep}");
            assert!(iterations <= 2 * 250, "{iterations}");
        } else {
            let found = (speed(250) - speed(50)) / (200.0 * H);
            let exact = 9.81 * (angle.sin() - 0.5 * angle.cos());
            assert!(
                (found / exact - 1.0).abs() < 1e-3,
                "{factor} {found} {exact}"
            );
            assert!(iterations <= 6 * 250, "{iterations}");
        }
    }
}

/// Radius of the cylinder, about the y axis (m).
const RADIUS: f64 = 0.02;

#[test]
fn the_forces_of_a_belt_over_a_cylinder_are_those_of_eytelwein() {
    // The belt hangs down on both sides, and lies on the upper half.
    let (outer, free, segments) = (RADIUS + THETA, 0.04, 56_u32);
    let length = 2.0 * free + PI * outer;
    let at = |i: u32| {
        let s = length * f64::from(i) / f64::from(segments) - free;
        let angle = (s / outer).clamp(0.0, PI);
        let down = (-s).max(0.0) + (s - PI * outer).max(0.0);
        Vec3::new(-outer * angle.cos(), 0.0, outer * angle.sin() - down)
    };
    let positions: Vec<Vec3> = (0..=segments).map(at).collect();
    let lines = (0..segments).map(|i| [i, i + 1]).collect();
    let material = ThreadMaterial {
        young: 1e7,
        area: 1e-6,
        density: 1000.0,
        tension_only: false,
    };
    let ends = [0, segments];
    let handles = ends.map(|vertex| HandleSpec {
        vertices: vec![vertex],
        origin: at(vertex),
        freedom: Freedom::Fixed,
        border: Border::Hinged,
    });
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        stiffness_damping: 2e-3,
        ..BodyConfig::default()
    };
    let mesh = LineMesh::new(positions, lines).unwrap();
    let body = Body::thread(&mesh, &[material; 56], config, &handles).unwrap();
    let nearest = |x: &Vec3| {
        // The shape lies along z.
        let found = Shape::Cylinder {
            half: 1.0,
            radius: RADIUS,
        }
        .nearest(&Vec3::new(x.x, x.z, x.y));
        Nearest {
            normal: Vec3::new(found.normal.x, found.normal.z, found.normal.y),
            ..found
        }
    };
    let mut scene = Scene::new(body, nearest, 0.3);
    // Both ends pull by 1 mm, then the belt runs at 40 mm/s.
    let mut ratios = Vec::new();
    for step in 0..300_u32 {
        let stretch = 1e-3 * f64::from(step.min(50)) / 50.0;
        let run = 0.04 * H * f64::from(step.saturating_sub(50));
        let hands = [run - stretch, -run - stretch];
        let hands = [0, 1].map(|i| HandlePose::at(at(ends[i]) + Vec3::z() * hands[i]));
        if step % 10 == 0 {
            scene.stepper.prepare(&scene.body, H).unwrap();
        }
        scene.step(&hands);
        if step >= 100 {
            let force = |handle| {
                scene
                    .body
                    .handle_report(handle)
                    .unwrap()
                    .wrench_on_hand
                    .force
                    .norm()
            };
            ratios.push(force(1) / force(0));
            // The hands bear what the contacts press, also after a pass that was shortened.
            let pressed: Vec3 = scene.touches.iter().map(Touch::force).sum();
            let pulled = force(0) + force(1);
            assert!(
                (pulled / pressed.z - 1.0).abs() < 1e-4,
                "{pulled} {pressed}"
            );
        }
    }
    // A vertex follows the one before it after 18 steps: the mean over ten of them.
    let mean = ratios[..180].iter().sum::<f64>() / 180.0;
    let exact = (0.3 * PI).exp();
    // These rows find their feet once, at the guess. The rows of `contact::rows` hold half a percent in the study of contact.
    assert!((mean / exact - 1.0).abs() < 2e-2, "{mean} {exact}");
}
