//! Sheets that come to rest on obstacles, on each other and on themselves.

use super::world::{Done, H, THICKNESS, World, sheet};
use nalgebra::{Isometry3, UnitQuaternion};
use physics::Vec3;
use physics::contact::Placed;
use physics::contact::shape::Shape;
use physics::mesh::TriMesh;
use physics::mesh::generate::{self, Pattern};

const DOWN: f64 = 9.81;

/// A sheet of 60 by 40 mm, turned and shifted in its plane, at a height (m).
fn flat(cells: [u32; 2], turn: f64, shift: Vec3) -> TriMesh {
    let mut mesh = generate::sheet(0.06, 0.04, cells[0], cells[1], Pattern::Alternating).unwrap();
    let turn = UnitQuaternion::from_axis_angle(&Vec3::z_axis(), turn);
    for x in &mut mesh.positions {
        *x = turn * *x + shift;
    }
    mesh
}

fn floor() -> TriMesh {
    generate::sheet(0.12, 0.1, 7, 5, Pattern::Alternating).unwrap()
}

fn still(shape: Shape, at: Vec3) -> Placed {
    let pose = Isometry3::translation(at.x, at.y, at.z);
    Placed {
        shape,
        start: pose,
        end: pose,
        radius: 0.0,
    }
}

/// Runs steps. Returns the last, and the iterations in all.
fn run(world: &mut World, steps: usize, updates: usize) -> (Done, usize) {
    let mut iterations = 0;
    let mut last = Done::default();
    for _ in 0..steps {
        last = world.step(updates);
        iterations += last.solve.iterations;
    }
    (last, iterations)
}

/// A closed sphere of triangles about a point, from an octahedron that is halved `times`.
fn ball(radius: f64, times: usize, at: Vec3) -> TriMesh {
    let mut positions: Vec<Vec3> = Vec::new();
    for axis in [Vec3::x(), Vec3::y(), Vec3::z()] {
        positions.extend([axis, -axis]);
    }
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for (i, [a, b]) in [[0, 2], [2, 1], [1, 3], [3, 0]].into_iter().enumerate() {
        let _ = i;
        triangles.extend([[a, b, 4], [b, a, 5]]);
    }
    for _ in 0..times {
        let mut halves = std::collections::BTreeMap::new();
        let mut finer = Vec::new();
        for corners in &triangles {
            let middles = [0, 1, 2].map(|i| {
                let (a, b) = (corners[i], corners[(i + 1) % 3]);
                *halves.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                    positions.push((positions[a as usize] + positions[b as usize]).normalize());
                    u32::try_from(positions.len() - 1).unwrap()
                })
            });
            let ([a, b, c], [d, e, f]) = (*corners, middles);
            finer.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
        }
        triangles = finer;
    }
    positions.iter_mut().for_each(|x| *x = *x * radius + at);
    TriMesh::new(positions, triangles).unwrap()
}

/// How far the vertices of a body are inside an obstacle (m), and how fast they are (m/s).
fn rest(world: &World, depth: impl Fn(&Vec3) -> f64) -> [f64; 2] {
    let body = &world.bodies[0];
    let most = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::NEG_INFINITY, f64::max);
    [
        most(&mut body.node_positions().iter().map(depth)),
        most(&mut body.node_velocities().iter().map(Vec3::norm)),
    ]
}

#[test]
fn a_sheet_rests_on_each_shape() {
    let shapes = [
        ("plane", Shape::Plane, 0.0),
        ("sphere", Shape::Sphere { radius: 0.5 }, 0.5),
        (
            "capsule",
            Shape::Capsule {
                half: 0.1,
                radius: 0.3,
            },
            0.4,
        ),
        (
            "cylinder",
            Shape::Cylinder {
                half: 0.1,
                radius: 0.1,
            },
            0.1,
        ),
        (
            "box",
            Shape::Box {
                half: Vec3::new(0.1, 0.1, 0.1),
            },
            0.1,
        ),
    ];
    let gravity = Vec3::z() * -DOWN;
    for (name, shape, top) in shapes {
        let start = Vec3::z() * (0.5 * THICKNESS + 0.5e-3);
        let mut world = World::new(
            vec![sheet(flat([6, 4], 0.3, start), gravity)],
            vec![],
            false,
        );
        world.obstacles = vec![still(shape, Vec3::z() * -top)];
        world.friction = 0.5;
        let (done, iterations) = run(&mut world, 150, 1);
        let force = world.forces()[0].z / world.weight(0) - 1.0;
        let [deep, speed] = rest(&world, |x| {
            0.5 * THICKNESS - shape.nearest(&(x + Vec3::z() * top)).distance
        });
        println!("{name} {force:e} {deep:e} {speed:e} {iterations} {done:?}");
    }
}

#[test]
fn a_sheet_rests_on_meshes() {
    let gravity = Vec3::z() * -DOWN;
    for (name, mesh) in [("floor", floor()), ("ball", ball(0.2, 4, Vec3::z() * -0.2))] {
        let start = Vec3::z() * (THICKNESS + 0.5e-3);
        let mut world = World::new(
            vec![sheet(flat([6, 4], 0.3, start), gravity)],
            vec![mesh],
            false,
        );
        world.friction = 0.5;
        let (done, iterations) = run(&mut world, 150, 1);
        let force = world.forces()[0].z / world.weight(0) - 1.0;
        let deep = world
            .touches
            .iter()
            .map(|touch| -touch.response.gap)
            .fold(f64::NEG_INFINITY, f64::max);
        let [_, speed] = rest(&world, |x| -x.z);
        println!("{name} {force:e} {deep:e} {speed:e} {iterations} {done:?}");
        assert_eq!(world.crossings(), 0);
    }
}

#[test]
fn a_sheet_on_a_meshed_incline_sticks_below_the_cone_and_slides_above() {
    for factor in [0.9, 0.99, 1.01, 1.5] {
        let angle = libm::atan(0.5 * factor);
        let gravity = Vec3::new(9.81 * angle.sin(), 0.0, -9.81 * angle.cos());
        let start = Vec3::new(-0.03, 0.0, THICKNESS);
        let mut mesh = generate::sheet(0.4, 0.1, 27, 5, Pattern::Alternating).unwrap();
        mesh.positions.iter_mut().for_each(|x| x.x += 0.1);
        let mut world = World::new(
            vec![sheet(flat([6, 4], 0.3, start), gravity)],
            vec![mesh],
            false,
        );
        world.friction = 0.5;
        let place = |world: &World| {
            world.bodies[0]
                .node_positions()
                .iter()
                .map(|x| x.x)
                .sum::<f64>()
                / 35.0
        };
        let mut places = vec![place(&world)];
        let mut iterations = 0;
        let (mut lowest, mut highest) = (0.0_f64, 0.0_f64);
        for _ in 0..250 {
            iterations += world.step(1).solve.iterations;
            places.push(place(&world));
            for x in world.bodies[0].node_positions() {
                lowest = lowest.min(x.z - THICKNESS);
                highest = highest.max(x.z - THICKNESS);
            }
        }
        let speed = |step: usize| (places[step] - places[step - 1]) / H;
        let creep = (places[250] - places[200]) / (50.0 * H);
        let found = (speed(125) - speed(25)) / (100.0 * H);
        let exact = 9.81 * (angle.sin() - 0.5 * angle.cos());
        println!(
            "{factor} creep {creep:e} slide {:e} moved {:e} iterations {iterations} {lowest:e} {highest:e}",
            found / exact - 1.0,
            places[250]
        );
    }
}

#[test]
fn a_stack_rests() {
    let gravity = Vec3::z() * -DOWN;
    let layers = (0..3).map(|i| {
        let height = (0.5 + f64::from(i)) * THICKNESS + 0.2e-3 * f64::from(i + 1);
        sheet(
            flat([6, 4], 0.2 * f64::from(i), Vec3::z() * height),
            gravity,
        )
    });
    let mut world = World::new(layers.collect(), vec![], false);
    world.obstacles = vec![still(Shape::Plane, Vec3::zeros())];
    world.friction = 0.3;
    for part in 0..4 {
        let mut before: Vec<physics::contact::Contact> = Vec::new();
        for i in 0..20 {
            let done = world.step(1);
            println!(
                "step {i} {} cross {} passes {} its {} rows {} thin {}",
                done.truncated,
                world.crossings(),
                done.solve.passes,
                done.solve.iterations,
                done.rows.rows,
                done.rows.thinned
            );
            let now = world.rows.contacts().to_vec();
            if part == 2 && i < 4 {
                for (a, b, sign) in [(&before, &now, "-"), (&now, &before, "+")] {
                    for one in a {
                        if !b.iter().any(|other| other.key == one.key) {
                            println!(
                                "step {sign} {:?} {:?} gap {:e} pred {:e} carried {:e} n {:?}",
                                one.key,
                                one.weights,
                                one.row.gap,
                                one.predicted,
                                one.row.carried,
                                one.row.normal
                            );
                        }
                    }
                }
            }
            before = now;
        }
        let (done, iterations) = run(&mut world, 30, 1);
        let forces: Vec<f64> = (0..3)
            .map(|i| world.forces()[i].z / world.weight(i) - 1.0)
            .collect();
        let deep = world
            .touches
            .iter()
            .map(|touch| -touch.response.gap)
            .fold(f64::NEG_INFINITY, f64::max);
        let speeds: Vec<f64> = world
            .bodies
            .iter()
            .map(|body| {
                body.node_velocities()
                    .iter()
                    .map(Vec3::norm)
                    .fold(0.0, f64::max)
            })
            .collect();
        println!("stack {part} {forces:?} {deep:e} {speeds:?} {iterations} {done:?}");
    }
    assert_eq!(world.crossings(), 0);
}

#[test]
fn a_folded_sheet_rests_on_itself() {
    // A strip with a half circle of 3 mm.
    let (radius, front) = (3e-3, 0.0);
    let mut mesh = generate::sheet(0.08, 0.02, 32, 8, Pattern::Alternating).unwrap();
    for x in &mut mesh.positions {
        let (beyond, arc) = (x.x - front, std::f64::consts::PI * radius);
        let (along, up) = if beyond < 0.0 {
            (x.x, 0.0)
        } else if beyond < arc {
            let angle = beyond / radius;
            (front + radius * angle.sin(), radius * (1.0 - angle.cos()))
        } else {
            (front - (beyond - arc), 2.0 * radius)
        };
        *x = Vec3::new(along, x.y, up + THICKNESS);
    }
    let gravity = Vec3::z() * -DOWN;
    let config = physics::BodyConfig {
        gravity,
        mass_damping: 5.0,
        stiffness_damping: 2e-3,
        ..physics::BodyConfig::default()
    };
    let mut flat = generate::sheet(0.08, 0.02, 32, 8, Pattern::Alternating).unwrap();
    flat.positions.iter_mut().for_each(|x| x.z = 0.0);
    let mut body = physics::Body::sheet(&flat, &[super::world::material()], config, &[]).unwrap();
    body.set_positions(&mesh.positions).unwrap();
    let mut world = World::new(vec![(body, physics::mesh::Mesh::Sheet(mesh))], vec![], true);
    world.obstacles = vec![still(Shape::Plane, Vec3::zeros())];
    world.friction = 0.3;
    for part in 0..6 {
        let (done, iterations) = run(&mut world, 50, 1);
        let force = world.forces()[0].z / world.weight(0) - 1.0;
        let own = world
            .rows
            .contacts()
            .iter()
            .zip(&world.touches)
            .filter(|(c, t)| c.parts == [0, 0] && t.response.normal > 0.0)
            .count();
        let deep = world
            .touches
            .iter()
            .map(|touch| -touch.response.gap)
            .fold(f64::NEG_INFINITY, f64::max);
        let [_, speed] = rest(&world, |x| -x.z);
        println!("fold {part} {force:e} own {own} {deep:e} {speed:e} {iterations} {done:?}");
    }
    assert_eq!(world.crossings(), 0);
}
