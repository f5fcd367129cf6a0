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

#[test]
fn look() {
    let gravity = Vec3::z() * -DOWN;
    let mut world = World::new(
        vec![sheet(flat([6, 4], 0.3, Vec3::z() * 1.3e-3), gravity)],
        vec![floor()],
        false,
    );
    world.friction = 0.5;
    for step in 0..100 {
        let done = world.step(2);
        let low = world.positions()[world.of(0)]
            .iter()
            .map(|x| x.z - THICKNESS)
            .fold(f64::INFINITY, f64::min);
        let high = world.positions()[world.of(0)]
            .iter()
            .map(|x| x.z - THICKNESS)
            .fold(-f64::INFINITY, f64::max);
        let most = world.u.iter().map(Vec3::norm).fold(0.0, f64::max);
        let by_v = world.v.iter().map(Vec3::norm).fold(0.0, f64::max) * 4e-3;
        println!("{step} u {most:e} hv {by_v:e}");
        println!(
            "{step} force {:e} low {low:e} high {high:e} {done:?}",
            world.forces()[0].z / world.weight(0) - 1.0
        );
    }
}
