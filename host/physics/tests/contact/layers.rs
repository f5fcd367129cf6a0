//! Eight layers that are thrown on each other do not cross, although the solver is stopped after one iteration of a pass.

use super::world::{THICKNESS, World, sheet};
use nalgebra::UnitQuaternion;
use physics::Vec3;
use physics::mesh::generate::{self, Pattern};

/// Eight sheets of 40 mm above each other.
fn layers(spread: f64, turn: f64) -> World {
    let each = (0..8).map(|number| {
        let mut mesh = generate::sheet(0.04, 0.04, 4, 4, Pattern::Alternating).unwrap();
        let about = UnitQuaternion::from_axis_angle(&Vec3::z_axis(), turn * f64::from(number));
        for x in &mut mesh.positions {
            *x = about * *x + Vec3::z() * (spread * f64::from(number));
        }
        sheet(mesh, Vec3::zeros())
    });
    let mut world = World::new(each.collect(), vec![], false);
    for (number, body) in world.bodies.iter_mut().enumerate() {
        let down = if number > 0 { -2.0 } else { 0.0 };
        let speeds = vec![Vec3::z() * down; body.vertex_count()];
        body.set_velocities(&speeds).unwrap();
    }
    world
}

#[test]
fn eight_layers_do_not_cross() {
    for (spread, turn) in [(1.2 * THICKNESS, 0.1), (4.0 * THICKNESS, 0.0)] {
        let mut world = layers(spread, turn);
        world.is_stopped = true;
        let (mut rows, mut thinned, mut truncated, mut iterations) = (0, 0, 0, 0);
        for step in 0..40 {
            let done = world.step(0);
            assert_eq!(world.crossings(), 0, "{step}");
            assert_eq!(done.rows.dropped, 0);
            rows = rows.max(done.rows.rows);
            thinned = thinned.max(done.rows.thinned);
            truncated += done.truncated;
            iterations += done.solve.iterations;
        }
        println!("{rows} rows, {thinned} thinned, {truncated} truncated, {iterations} iterations");
        // Of 25 vertices a layer, each with three rows on a side and those of its edges.
        assert!(rows < 8 * 25 * 6 && thinned > 0 && truncated > 0);
    }
}
