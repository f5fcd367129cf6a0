//! Pieces of a torn sheet that lie still sleep while the rest of the sheet moves.

use crate::contacts::{DOWN, H, RADIUS, World, sheet};
use common::Random;
use nalgebra::Isometry3;
use physics::contact::obstacle::{Motion, TimedPose};
use physics::contact::shape::Shape;
use physics::mesh::generate::{self, Pattern};
use physics::mesh::{Mesh, TriMesh};
use physics::topology::{Edit, Growth, Reserve};
use physics::{Border, Freedom, HandlePose, HandleSpec, Vec3};

/// A sheet in pieces: one that a hand holds at a height of 5 cm, and one or more whose middles are at `places` (m).
fn torn(places: &[Vec3], sleeps: bool) -> World {
    let piece = || generate::sheet(0.03, 0.02, 4, 3, Pattern::Alternating).unwrap();
    let mut mesh = TriMesh {
        positions: Vec::new(),
        ..piece()
    };
    mesh.triangles.clear();
    let above = Vec3::new(0.0, 0.04, 0.05);
    for place in [above].iter().chain(places) {
        let (own, first) = (piece(), mesh.positions.len() as u32);
        let triangles = own.triangles.iter();
        (mesh.triangles).extend(triangles.map(|corners| corners.map(|v| v + first)));
        (mesh.positions).extend(own.positions.iter().map(|x| x + place));
    }
    let held = (0..20).filter(|v| mesh.positions[*v as usize].x < above.x - 0.0149);
    let handle = HandleSpec {
        vertices: held.collect(),
        origin: above - Vec3::x() * 0.015,
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    };
    let mut body = sheet(&mesh, DOWN, &[handle]);
    let reserve = Reserve {
        vertices: 8,
        triangles: 16,
    };
    body.make_tearable(reserve).unwrap();
    let mut world = World::new();
    world.add(body, Mesh::Sheet(mesh), RADIUS, sleeps);
    world.hands[0] = vec![hand(0)];
    world
}

/// The pose of the hand after a number of steps: it goes up and down.
fn hand(step: u32) -> HandlePose {
    let phase = f64::from(step) * H * 9.0;
    let at = Vec3::new(-0.015, 0.04, 0.05 + 2e-3 * phase.sin());
    HandlePose::at(at)
}

fn step(world: &mut World) {
    world.hands[0] = vec![hand(world.steps + 1)];
    world.step();
}

/// A table of poses without rotation.
fn poses(rows: &[(f64, Vec3)]) -> Motion {
    let row = |(time, at): &(f64, Vec3)| TimedPose {
        time: *time,
        pose: Isometry3::from_parts((*at).into(), nalgebra::UnitQuaternion::identity()),
    };
    Motion::Poses(rows.iter().map(row).collect())
}

/// The weight (N) of one of the pieces, which are alike.
fn weight(world: &World, pieces: usize) -> f64 {
    world.weight(0) / pieces as f64
}

const LOW: Vec3 = Vec3::new(0.0, 0.0, RADIUS + 0.1e-3);

#[test]
fn a_piece_on_the_floor_sleeps_while_the_rest_moves_and_keeps_its_weight() {
    let [mut world, mut awake] = [true, false].map(|sleeps| {
        let mut world = torn(&[LOW], sleeps);
        world.still(Shape::Plane, Vec3::zeros());
        world.complete(0.5);
        world
    });
    let mut first = None;
    for number in 0..250 {
        step(&mut world);
        step(&mut awake);
        let asleep = world.steppers[0].pieces_asleep();
        first = first.or((asleep > 0).then_some(number));
        // The first contacts take room.
        assert!(world.calls == 0 || number < 20, "{number}");
        if first.is_some() {
            // It sleeps on, and the floor bears what it bore.
            assert_eq!((asleep, world.asleep[0]), (1, false), "{number}");
        }
        if number >= 60 {
            let force = world.force([0, 1]).z / weight(&world, 2);
            assert!((force - 1.0).abs() < 1e-6, "{number} {force}");
        }
    }
    assert!(first.is_some_and(|step| step < 120), "{first:?}");
    assert_eq!(awake.steppers[0].pieces_asleep(), 0);
    // The rest of the sheet moves as it does beside a piece that is awake: pieces share no force.
    let each = world.bodies[0].node_positions().iter();
    let apart = each
        .zip(awake.bodies[0].node_positions())
        .map(|(a, b)| (a - b).norm());
    let apart = apart.fold(0.0, f64::max);
    // Twice the tolerance of the solver (1e-7) times the size of the scene.
    assert!(apart < 2e-8, "{apart}");
}

#[test]
fn a_piece_wakes_when_its_floor_sinks_and_when_an_obstacle_pushes_it() {
    let mut world = torn(&[LOW], true);
    let sinks = [(0.6, Vec3::zeros()), (0.8, Vec3::z() * -1e-3)];
    world.obstacle(Shape::Plane, poses(&sinks));
    let half = Vec3::new(5e-3, 15e-3, 5e-3);
    let pushes = [(1.2, Vec3::x() * 25e-3), (1.7, Vec3::x() * 15e-3)];
    world.obstacle(Shape::Box { half }, poses(&pushes));
    world.complete(0.3);
    let mut woken = [false; 2];
    for number in 0..550 {
        step(&mut world);
        assert_eq!(world.crossings(), 0, "{number}");
        let (time, asleep) = (f64::from(number + 1) * H, world.steppers[0].pieces_asleep());
        if (0.6 + H..0.8).contains(&time) {
            woken[0] = true;
            assert_eq!(asleep, 0, "{time}");
        }
        woken[1] |= (1.2..1.7).contains(&time) && asleep == 0;
        if [145, 290, 549].contains(&number) {
            assert_eq!(asleep, 1, "{time}");
        }
    }
    assert_eq!(woken, [true; 2]);
    let piece = &world.bodies[0].node_positions()[20..];
    let middle = piece.iter().sum::<Vec3>() / piece.len() as f64;
    assert!((middle.z - (RADIUS - 1e-3)).abs() < 1e-4, "{middle}");
    assert!(middle.x < -2e-3, "{middle}");
}

#[test]
fn a_whole_body_wakes_when_its_floor_sinks() {
    let mut world = World::new();
    world.sheet([0.03, 0.02], [4, 3], DOWN, |x| x + LOW);
    let sinks = [(1.0, Vec3::zeros()), (1.2, Vec3::z() * -1e-3)];
    world.obstacle(Shape::Plane, poses(&sinks));
    world.complete(0.5);
    for number in 0..500 {
        world.step();
        if number == 245 {
            assert_eq!(world.asleep, [true]);
        }
    }
    assert_eq!(world.asleep, [true]);
    assert!(
        (world.mean(0).z - (RADIUS - 1e-3)).abs() < 1e-5,
        "{}",
        world.mean(0)
    );
}

/// Random pieces fall on each other and a box passes through them, while the hand moves.
#[test]
fn nothing_crosses_in_random_scenes_and_pieces_come_to_rest() {
    let mut random = Random(7);
    let mut slept = 0;
    for scene in 0..6 {
        let places = [0, 1].map(|layer| {
            let aside = random.vector() * 6e-3;
            Vec3::new(aside.x, aside.y - 0.01, 1e-3 + 3e-3 * f64::from(layer))
        });
        let mut world = torn(&places, true);
        world.still(Shape::Plane, Vec3::zeros());
        let half = Vec3::new(4e-3, 6e-3, 4e-3);
        let from = Vec3::new(30e-3, 10e-3 * random.signed(), 4e-3);
        let to = from - Vec3::new(20e-3, 3e-3 * random.signed(), 0.0);
        world.obstacle(Shape::Box { half }, poses(&[(0.6, from), (0.9, to)]));
        world.complete(0.3 + 0.2 * random.signed());
        let mut most = 0;
        for number in 0..400 {
            step(&mut world);
            let body = &world.bodies[0];
            assert!(
                body.node_positions().iter().all(|x| x.amax() < 1.0),
                "{scene} {number}"
            );
            assert_eq!(world.crossings(), 0, "{scene} {number}");
            // Contacts of a new kind take room.
            assert!(world.calls == 0 || number < 380, "{scene} {number}");
            most = most.max(world.steppers[0].pieces_asleep());
        }
        slept += most;
    }
    assert!(slept > 6, "{slept}");
}

/// A slit into a piece that sleeps wakes it, and no other piece.
#[test]
fn an_edit_wakes_its_piece() {
    let aside = Vec3::new(0.0, -0.03, 0.0);
    let mut world = torn(&[LOW, LOW + aside], true);
    world.still(Shape::Plane, Vec3::zeros());
    world.complete(0.5);
    for _ in 0..150 {
        step(&mut world);
    }
    assert_eq!(world.steppers[0].pieces_asleep(), 2);
    // The middle of the left border of the first loose piece, and the way to the right.
    let (body, stepper) = (&mut world.bodies[0], &mut world.steppers[0]);
    let tip = 20 + 5;
    let to = tip + 1;
    let done = body.edit(&Edit::grow(tip, Growth::Open { to })).unwrap();
    stepper.grow(body, &done.surface).unwrap();
    stepper.settle(body);
    let mesh = body.mesh().unwrap();
    world.contacts.follow(0, body, mesh, None).unwrap();
    step(&mut world);
    assert_eq!(world.steppers[0].pieces_asleep(), 1);
    let asleep = |world: &World, node| world.steppers[0].sleeps_at(node);
    assert!(!asleep(&world, tip) && asleep(&world, 45));
    for _ in 0..150 {
        step(&mut world);
    }
    assert_eq!(world.steppers[0].pieces_asleep(), 2);
}

#[test]
fn a_piece_that_was_torn_off_falls_on_the_face_from_which_it_came() {
    // At rest, both pieces share a border.
    let beside = Vec3::new(0.03, 0.04, 0.05);
    let mut world = torn(&[beside], false);
    world.complete(0.3);
    let surfaces = |world: &World| world.contacts.surfaces().clone();
    let rest = world.bodies[0].rest_positions().to_vec();
    let twins: Vec<[u32; 2]> = (0..20)
        .flat_map(|a| (20..40).map(move |b| [a, b]))
        .filter(|twins| rest[twins[0] as usize] == rest[twins[1] as usize])
        .collect();
    assert_eq!(twins.len(), 4);
    let throw = |world: &mut World, velocity: Vec3| {
        let mut v = world.bodies[0].node_velocities().to_vec();
        v[20..].fill(velocity);
        world.bodies[0].set_velocities(&v).unwrap();
    };
    throw(&mut world, Vec3::new(0.1, 0.0, 0.2));
    for _ in 0..6 {
        step(&mut world);
    }
    let are_open = |[a, b]: &[u32; 2]| surfaces(&world).are_open(*a, *b) == Some(true);
    assert!(twins.iter().all(are_open));
    throw(&mut world, Vec3::new(-0.3, 0.0, 0.0));
    let mut pressed = 0;
    for _ in 0..60 {
        step(&mut world);
        assert_eq!(world.crossings(), 0, "{}", world.steps);
        pressed += u32::from(world.contacts.touching().iter().any(|sum| sum.normal > 0.0));
    }
    assert!(pressed > 10, "{pressed}");
}
