//! Sheets that come to rest on obstacles, on each other and on themselves.

use super::world::{H, THICKNESS, World, config, material, sheet};
use nalgebra::{Isometry3, Point3, UnitQuaternion};
use physics::contact::Placed;
use physics::contact::shape::Shape;
use physics::mesh::generate::{self, Pattern};
use physics::mesh::{Mesh, TriMesh};
use physics::{Body, BodyConfig, Vec3};

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
        holds: false,
    }
}

/// A closed sphere of triangles about a point, from an octahedron that is halved `times`.
fn ball(radius: f64, times: usize, at: Vec3) -> TriMesh {
    let mut positions: Vec<Vec3> = Vec::new();
    for axis in [Vec3::x(), Vec3::y(), Vec3::z()] {
        positions.extend([axis, -axis]);
    }
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for [a, b] in [[0, 2], [2, 1], [1, 3], [3, 0]] {
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
    for x in &mut positions {
        *x = *x * radius + at;
    }
    TriMesh::new(positions, triangles).unwrap()
}

/// Runs steps, in none of which surfaces cross or contacts are deeper than `most` thicknesses. Returns the iterations of the solver in all.
fn run(world: &mut World, steps: usize, most: f64) -> usize {
    let each = (0..steps).map(|step| {
        if step % 10 == 0 {
            world.prepare();
        }
        let done = world.step(1);
        assert_eq!((world.crossings(), done.rows.dropped), (0, 0), "{step}");
        let deepest = deepest(world);
        assert!(deepest < most * THICKNESS, "{step} {deepest}");
        done.solve.iterations
    });
    each.sum()
}

/// How deep the deepest contact is (m).
fn deepest(world: &World) -> f64 {
    let depths = world.touches.iter().map(|touch| -touch.response.gap);
    depths.fold(f64::NEG_INFINITY, f64::max)
}

/// The contacts carry the weight of each body to a fraction, and no vertex is faster than a speed (m/s).
fn check_rest(world: &World, fraction: f64, speed: f64) {
    for (number, body) in world.bodies.iter().enumerate() {
        let carried = world.forces()[number] / world.weight(number);
        let speeds = body.node_velocities().iter().map(Vec3::norm);
        let fastest = speeds.fold(0.0, f64::max);
        assert!(
            (carried - Vec3::z()).norm() < fraction && fastest < speed,
            "{number} {carried} {fastest}"
        );
    }
    let deepest = deepest(world);
    assert!(deepest < 1e-6, "{deepest}");
}

const GRAVITY: Vec3 = Vec3::new(0.0, 0.0, -9.81);

#[test]
fn a_sheet_rests_on_each_shape() {
    let capsule = Shape::capsule(0.1, 0.3);
    let cylinder = Shape::Cylinder {
        half: 0.1,
        radius: 0.1,
    };
    let cube = Shape::Box {
        half: Vec3::new(0.1, 0.1, 0.1),
    };
    let shapes = [
        (Shape::Plane, 0.0),
        (Shape::sphere(0.5), 0.5),
        (capsule, 0.4),
        (cylinder, 0.1),
        (cube, 0.1),
    ];
    for (shape, top) in shapes {
        let start = Vec3::z() * (0.5 * THICKNESS + 0.5e-3);
        let body = sheet(flat([6, 4], 0.3, start), GRAVITY);
        let mut world = World::new(vec![body], vec![], false);
        world.obstacles = vec![still(shape.clone(), Vec3::z() * -top)];
        world.friction = 0.5;
        let iterations = run(&mut world, 150, 0.25);
        check_rest(&world, 1e-6, 1e-6);
        // No vertex is deeper than its contact says.
        for x in world.bodies[0].node_positions() {
            let distance = shape.nearest(&(x + Vec3::z() * top)).distance;
            assert!(distance > 0.5 * THICKNESS - 1e-6, "{shape:?} {distance}");
        }
        assert!(iterations < 10 * 150, "{shape:?} {iterations}");
    }
}

/// Balls below the middles of facets that are many times larger.
#[test]
fn a_coarse_sheet_rests_on_small_balls() {
    let radius = 1e-3;
    let shape = Shape::sphere(radius);
    let start = Vec3::z() * (0.5 * THICKNESS + 0.2e-3);
    let mesh = flat([2, 1], 0.0, start);
    let middles = mesh.triangles.iter().map(|corners| {
        let [a, b, c] = corners.map(|vertex| mesh.positions[vertex as usize]);
        (a + b + c) / 3.0
    });
    let mut at: Vec<Vec3> = middles.map(|at| Vec3::new(at.x, at.y, -radius)).collect();
    // One lies below an edge.
    at.push(Vec3::new(0.0, 0.0, -radius));
    let mut world = World::new(vec![sheet(mesh, GRAVITY)], vec![], false);
    world.obstacles = at.iter().map(|at| still(shape.clone(), *at)).collect();
    world.friction = 0.5;
    run(&mut world, 200, 0.25);
    // It still rocks a little.
    check_rest(&world, 1e-3, 0.02);
    assert!(
        world
            .touches
            .iter()
            .filter(|touch| touch.response.normal > 0.0)
            .count()
            >= 3
    );
}

#[test]
fn a_sheet_rests_on_meshes() {
    for mesh in [floor(), ball(0.2, 4, Vec3::z() * -0.2)] {
        let start = Vec3::z() * (THICKNESS + 0.5e-3);
        let body = sheet(flat([6, 4], 0.3, start), GRAVITY);
        let mut world = World::new(vec![body], vec![mesh], false);
        world.friction = 0.5;
        let iterations = run(&mut world, 150, 0.25);
        println!("{iterations} iterations, {} rows", world.touches.len());
        check_rest(&world, 1e-6, 1e-6);
    }
}

#[test]
fn a_sheet_on_a_meshed_incline_sticks_below_the_cone_and_slides_above() {
    for (factor, steps) in [(0.9, 250), (0.99, 250), (1.01, 125), (1.5, 125)] {
        let angle = libm::atan(0.5 * factor);
        let gravity = Vec3::new(9.81 * angle.sin(), 0.0, -9.81 * angle.cos());
        let start = Vec3::new(-0.03, 0.0, THICKNESS);
        let mut mesh = generate::sheet(0.4, 0.1, 27, 5, Pattern::Alternating).unwrap();
        mesh.positions.iter_mut().for_each(|x| x.x += 0.1);
        let body = sheet(flat([6, 4], 0.3, start), gravity);
        let mut world = World::new(vec![body], vec![mesh], false);
        world.friction = 0.5;
        let place = |world: &World| {
            let x = world.bodies[0].node_positions();
            x.iter().map(|x| x.x).sum::<f64>() / x.len() as f64
        };
        let mut places = vec![place(&world)];
        let mut iterations = 0;
        for _ in 0..steps {
            let done = world.step(1);
            assert_eq!(done.truncated, 0);
            iterations += done.solve.iterations;
            places.push(place(&world));
            for x in world.bodies[0].node_positions() {
                // Of the thickness, which is 300 um.
                assert!((x.z - THICKNESS).abs() < 2e-6, "{factor} {x}");
            }
        }
        println!("{factor}: {iterations} iterations in {steps} steps");
        if factor < 1.0 {
            let creep = (places[steps] - places[steps - 50]) / (50.0 * H);
            assert!(creep.abs() < 0.01e-6, "{factor} {creep}");
        } else {
            let speed = |step: usize| (places[step] - places[step - 1]) / H;
            let found = (speed(steps) - speed(25)) / ((steps - 25) as f64 * H);
            let exact = 9.81 * (angle.sin() - 0.5 * angle.cos());
            let error = found / exact - 1.0;
            assert!(error.abs() < 1e-3, "{factor} {error:e}");
        }
    }
}

#[test]
fn a_stack_rests() {
    let layers = (0..3).map(|i| {
        let height = (0.5 + f64::from(i)) * THICKNESS + 0.2e-3 * f64::from(i + 1);
        let mesh = flat([6, 4], 0.2 * f64::from(i), Vec3::z() * height);
        sheet(mesh, GRAVITY)
    });
    let mut world = World::new(layers.collect(), vec![], false);
    world.obstacles = vec![still(Shape::Plane, Vec3::zeros())];
    world.friction = 0.3;
    let falling = run(&mut world, 60, 0.25);
    let rows = world.touches.len();
    let resting = run(&mut world, 60, 0.25);
    println!("{falling} and {resting} iterations in 60 steps each, {rows} rows");
    check_rest(&world, 1e-6, 1e-6);
    // A stack at rest has the same rows, and the solver has next to nothing to do.
    assert_eq!(world.touches.len(), rows);
    assert!(resting < 20 * 60, "{resting}");
}

#[test]
fn a_folded_sheet_rests_on_itself() {
    // A strip with a half circle of 3 mm.
    let radius = 3e-3;
    let rest = generate::sheet(0.08, 0.02, 20, 5, Pattern::Alternating).unwrap();
    let mut folded = rest.clone();
    for x in &mut folded.positions {
        let arc = std::f64::consts::PI * radius;
        let (along, up) = if x.x < 0.0 {
            (x.x, 0.0)
        } else if x.x < arc {
            let angle = x.x / radius;
            (radius * angle.sin(), radius * (1.0 - angle.cos()))
        } else {
            (arc - x.x, 2.0 * radius)
        };
        *x = Vec3::new(along, x.y, up + THICKNESS);
    }
    let config = BodyConfig {
        mass_damping: 5.0,
        stiffness_damping: 2e-3,
        ..config(GRAVITY)
    };
    let mut body = Body::sheet(&rest, &[material()], config, &[]).unwrap();
    body.set_positions(&folded.positions).unwrap();
    let mut world = World::new(vec![(body, Mesh::Sheet(folded))], vec![], true);
    world.obstacles = vec![still(Shape::Plane, Vec3::zeros())];
    world.friction = 0.3;
    // The fold springs open at first, faster than the solver follows.
    let iterations = run(&mut world, 200, 1.0);
    println!(
        "{iterations} iterations in 200 steps, {} rows",
        world.touches.len()
    );
    let each = world.rows.contacts().iter().zip(&world.touches);
    let own =
        each.filter(|(contact, touch)| contact.parts == [0, 0] && touch.response.normal > 0.0);
    assert!(own.count() > 50);
    // The fold still opens slowly.
    check_rest(&world, 1e-4, 1e-4);
}

/// A sheet lies on a ball that takes hold of it and turns upside down. The sheet hangs from the ball until that lets go.
#[test]
fn a_sheet_hangs_from_a_ball_that_holds_it() {
    let radius = 0.02;
    let mesh = flat([12, 8], 0.3, Vec3::z() * (0.5 * THICKNESS));
    let config = BodyConfig {
        mass_damping: 20.0,
        ..config(GRAVITY)
    };
    let body = Body::sheet(&mesh, &[material()], config, &[]).unwrap();
    let mut world = World::new(vec![(body, Mesh::Sheet(mesh))], vec![], false);
    world.obstacles = vec![still(Shape::sphere(radius), Vec3::z() * -radius)];
    let turned = |angle: f64| {
        let by = UnitQuaternion::from_axis_angle(&Vec3::x_axis(), angle);
        Isometry3::from_parts(Vec3::new(0.0, 0.0, -radius).into(), by)
    };
    let turn = |world: &mut World, [from, to]: [f64; 2], steps: usize| {
        for step in 0..steps {
            if step % 10 == 0 {
                world.prepare();
            }
            let at = |step: usize| turned(from + (to - from) * step as f64 / steps as f64);
            (world.obstacles[0].start, world.obstacles[0].end) = (at(step), at(step + 1));
            world.step(1);
        }
    };
    turn(&mut world, [0.0, 0.0], 20);
    world.obstacles[0].holds = true;
    turn(&mut world, [0.0, 0.0], 1);
    let first = apart(&world);
    assert!(
        first.len() > 2 && first.iter().all(|by| *by < 1e-5),
        "{first:?}"
    );
    let half = core::f64::consts::PI;
    turn(&mut world, [0.0, half], 250);
    turn(&mut world, [half, half], 250);
    let force = world.forces()[0] / world.weight(0);
    assert!((force - Vec3::z()).norm() < 0.01, "{force}");
    // The middle of the sheet is below the ball, which draws it up.
    let pulled = world.touches.iter().map(|touch| touch.response.normal);
    assert!(pulled.fold(0.0, f64::min) < -0.1 * world.weight(0));
    let last = apart(&world);
    assert!(
        last.len() >= first.len() && last.iter().all(|by| *by < 1e-6),
        "{last:?}"
    );
    // It falls as soon as the ball lets go.
    world.obstacles[0].holds = false;
    turn(&mut world, [half, half], 10);
    let pulled = world.touches.iter().map(|touch| touch.response.normal);
    assert!(pulled.fold(0.0, f64::min) >= 0.0);
    let speeds = world.bodies[0].node_velocities().iter().map(|v| v.z);
    let mean = speeds.sum::<f64>() / world.bodies[0].vertex_count() as f64;
    assert!((mean / (-9.81 * 10.0 * H) - 1.0).abs() < 0.5, "{mean}");
}

/// How far the points that the first obstacle holds are from where it holds them (m).
fn apart(world: &World) -> Vec<f64> {
    let x = world.positions();
    let contacts = world.rows.contacts().iter();
    let held = contacts.filter_map(|contact| Some((contact, contact.anchor?)));
    held.map(|(contact, anchor)| {
        let corners = contact.vertices.iter().zip(contact.weights);
        let place: Vec3 = corners
            .map(|(vertex, weight)| x[*vertex as usize] * weight)
            .sum();
        (world.obstacles[0].end * Point3::from(anchor) - Point3::from(place)).norm()
    })
    .collect()
}
