//! A body that continues the motion of a body with another mesh, along a map of vertices and handles.

use common::*;
use nalgebra::UnitQuaternion;
use physics::mesh::TriMesh;
use physics::{Body, BodyConfig, BodyError, BodyMap, Freedom, HandlePose, HandleSpec, Vec3};

const LX: f64 = 0.1;
const STEP: f64 = 1e-3;
const CELLS: u32 = 10;
const ROWS: u32 = 4;

fn mesh() -> TriMesh {
    grid(CELLS, ROWS, LX, 0.04, Split::Right)
}

fn handles(mesh: &TriMesh) -> [HandleSpec; 2] {
    [
        handle(mesh, Freedom::Translation, |x| x.x < 1e-9),
        handle(mesh, Freedom::Translation, |x| x.x > LX - 1e-9),
    ]
}

fn strip(mesh: &TriMesh) -> Body {
    let config = BodyConfig {
        bending: 1.0,
        ..tight()
    };
    Body::sheet(mesh, &[rubber(0.3)], config, &handles(mesh)).unwrap()
}

/// The poses after `steps` steps. The right hand pulls and lifts with increasing speed.
fn pulled(steps: i32) -> [HandlePose; 2] {
    let t = f64::from(steps) * STEP;
    let mut poses: Vec<HandlePose> = rest_poses(&handles(&mesh()));
    poses[1].position += Vec3::new(0.5, 0.0, 0.2) * (t * t);
    [poses[0], poses[1]]
}

fn moving() -> Body {
    let mut body = strip(&mesh());
    for step in 1..=100 {
        body.step(STEP, &pulled(step)).unwrap();
    }
    body
}

#[test]
fn the_motion_continues_on_a_mesh_that_is_numbered_in_reverse() {
    let mut body = moving();
    let mut reversed = mesh();
    reversed.positions.reverse();
    let last = reversed.positions.len() as u32 - 1;
    for vertex in reversed.triangles.iter_mut().flatten() {
        *vertex = last - *vertex;
    }
    let mut other = strip(&reversed);
    let map = BodyMap {
        vertices: (0..=last).rev().collect(),
        ..BodyMap::identity(&body)
    };
    other.continue_from(&body, &map).unwrap();
    for step in 101..=200 {
        body.step(STEP, &pulled(step)).unwrap();
        other.step(STEP, &pulled(step)).unwrap();
        let mut back: Vec<Vec3> = other.positions().collect();
        back.reverse();
        for (x, y) in body.positions().zip(back) {
            // The sums are taken in another order; `tight` solves to 1e-12 of forces that move a vertex by millimetres.
            assert!((x - y).norm() < 1e-12, "{}", (x - y).norm());
        }
    }
}

#[test]
fn a_cut_gives_both_sides_the_motion_of_the_vertex() {
    let body = moving();
    // The column of vertices in the middle is doubled; the cells to its right take the copies.
    let mut cut = mesh();
    let count = cut.positions.len() as u32;
    let column = CELLS / 2;
    let mut vertices: Vec<u32> = (0..count).collect();
    for row in 0..=ROWS {
        let vertex = row * (CELLS + 1) + column;
        cut.positions.push(cut.positions[vertex as usize]);
        vertices.push(vertex);
    }
    let middle = cut.positions[column as usize].x;
    for triangle in &mut cut.triangles {
        let right = triangle
            .iter()
            .any(|&vertex| cut.positions[vertex as usize].x > middle + 1e-9);
        for vertex in triangle.iter_mut().filter(|_| right) {
            if *vertex % (CELLS + 1) == column {
                *vertex = count + *vertex / (CELLS + 1);
            }
        }
    }
    let mut torn = strip(&cut);
    let map = BodyMap {
        vertices,
        ..BodyMap::identity(&body)
    };
    torn.continue_from(&body, &map).unwrap();
    // Two sides of a vertex move alike and share its mass, so that no momentum is lost but by rounding.
    let (before, after) = (body.momentum(), torn.momentum());
    assert!(
        (after - before).norm() < 1e-12 * before.norm(),
        "{after} after {before}"
    );
    for step in 101..=400 {
        torn.step(STEP, &pulled(step)).unwrap();
    }
    // The halves have parted: the lips of the cut, which started as one vertex, are apart.
    let positions: Vec<Vec3> = torn.positions().collect();
    let lips = (positions[column as usize] - positions[count as usize]).norm();
    assert!(lips > 0.01, "{lips} m");
}

#[test]
fn a_hand_takes_hold_at_its_own_pose_without_moving_the_body() {
    let body = moving();
    let mut other = body.clone();
    let spec = handle(&mesh(), Freedom::Rigid, |x| (x.x - LX / 2.0).abs() < 1e-9);
    let held = spec.vertices.clone();
    other.grab(&spec).unwrap();
    let mut map = BodyMap::identity(&body);
    map.handles.push(None);
    other.continue_from(&body, &map).unwrap();
    let pose = HandlePose {
        position: Vec3::new(0.03, 0.05, -0.02),
        rotation: UnitQuaternion::from_scaled_axis(Vec3::new(0.3, -0.8, 0.5)),
    };
    other.hold_at(2, &pose).unwrap();
    let before: Vec<Vec3> = other.positions().collect();
    // A step with the hand at rest moves none of its vertices; a step with the hand's shift moves each by this shift.
    let targets = |shift: Vec3| {
        let [left, right] = pulled(100);
        let position = pose.position + shift;
        [left, right, HandlePose { position, ..pose }]
    };
    for shift in [Vec3::zeros(), Vec3::new(1e-3, 0.0, 2e-3)] {
        other.step(STEP, &targets(shift)).unwrap();
        let after: Vec<Vec3> = other.positions().collect();
        for &vertex in &held {
            let moved = after[vertex as usize] - before[vertex as usize];
            // Rounding of positions of some centimetres.
            assert!((moved - shift).norm() < 1e-15, "{moved} of {shift}");
        }
    }
    let refused = other.hold_at(3, &pose).unwrap_err();
    assert_eq!(
        refused,
        BodyError::NoHandle {
            handle: 3,
            count: 3
        }
    );
    let nowhere = HandlePose::at(Vec3::repeat(f64::NAN));
    assert_eq!(
        other.hold_at(2, &nowhere),
        Err(BodyError::Pose { handle: 2 })
    );
}

#[test]
fn a_map_that_leads_nowhere_is_refused_and_nothing_has_changed() {
    let body = moving();
    let mut other = strip(&mesh());
    let before: Vec<Vec3> = other.positions().collect();
    let mut map = BodyMap::identity(&body);
    map.vertices[3] = 55;
    let refused = other.continue_from(&body, &map).unwrap_err();
    let text =
        "the map of vertices leads from number 55, but the old body has 55 of them, counted from 0";
    assert_eq!(refused.to_string(), text);
    let mut map = BodyMap::identity(&body);
    map.handles.pop();
    assert!(matches!(
        other.continue_from(&body, &map),
        Err(BodyError::Length {
            found: 1,
            expected: 2,
            ..
        })
    ));
    assert!(other.positions().eq(before));
}

#[test]
fn two_maps_follow_each_other() {
    let map = |vertices: &[u32], handles: &[Option<usize>]| BodyMap {
        vertices: vertices.to_vec(),
        handles: handles.to_vec(),
        supports: Vec::new(),
    };
    // First vertex 2 is doubled and handle 0 released; then the vertices are reversed and a handle is grabbed.
    let first = map(&[0, 1, 2, 2], &[Some(1)]);
    let second = map(&[3, 2, 1, 0], &[Some(0), None]);
    assert_eq!(first.then(&second), map(&[2, 2, 1, 0], &[Some(1), None]));
}
