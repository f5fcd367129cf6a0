//! Sheets that are thrown at each other do not cross, although nothing solves their contact.

use super::world::crossings;
use physics::Vec3;
use physics::contact::certificate::truncate;
use physics::contact::{Lists, Moves, Skin, Surfaces};
use physics::mesh::Mesh;
use physics::mesh::generate::{self, Pattern};
use proptest::prelude::*;

/// Sheets with a start and a velocity of each vertex.
struct Throw {
    surfaces: Surfaces,
    x: Vec<Vec3>,
    v: Vec<Vec3>,
}

/// Two sheets of 40 mm, the upper one turned and thrown.
fn throw(angles: [f64; 3], height: f64, velocity: Vec3, spin: Vec3) -> Throw {
    let mut surfaces = Surfaces::default();
    let (mut x, mut v) = (Vec::new(), Vec::new());
    let skin = Skin {
        radius: 0.15e-3,
        touches_itself: true,
        is_obstacle: false,
    };
    for number in 0..2 {
        let mut mesh = generate::sheet(0.04, 0.04, 6, 6, Pattern::Alternating).unwrap();
        let turn = nalgebra::Rotation3::from_euler_angles(angles[0], angles[1], angles[2]);
        for at in &mut mesh.positions {
            if number == 1 {
                *at = turn * *at + Vec3::z() * height;
                v.push(velocity + spin.cross(at));
            } else {
                v.push(Vec3::zeros());
            }
        }
        x.extend_from_slice(&mesh.positions);
        surfaces.add(&Mesh::Sheet(mesh), skin).unwrap();
    }
    Throw { surfaces, x, v }
}

/// Moves each vertex freely for `steps` of 4 ms, but for the truncation. Returns the vertices that were truncated.
fn fly(throw: Throw, steps: usize, jitter: f64) -> usize {
    let Throw { surfaces, mut x, v } = throw;
    let mut lists = Lists::new(&surfaces, &x);
    let mut fractions = vec![1.0; x.len()];
    let mut truncated = 0;
    for step in 0..steps {
        let wave = |i: usize| (i as f64 * 1.7 + step as f64 * 2.3).sin() * jitter;
        let moves = v.iter().enumerate();
        let u: Vec<Vec3> = moves
            .map(|(i, v)| (v + Vec3::z() * wave(i)) * 4e-3)
            .collect();
        lists.follow(&surfaces, &x, |hierarchy, cluster| {
            Moves::of(hierarchy.members(cluster), &u)
        });
        let each = |found: &mut dyn FnMut(physics::contact::Pair)| lists.each(&surfaces, &x, found);
        fractions.fill(1.0);
        let report = truncate(&surfaces, &x, &u, &each, &|_| true, &mut fractions);
        assert_eq!(report.squeezed, 0);
        truncated += report.truncated;
        for ((x, u), fraction) in x.iter_mut().zip(&u).zip(&fractions) {
            *x += u * *fraction;
        }
        assert_eq!(crossings(&surfaces, &x), 0, "step {step}");
    }
    truncated
}

#[test]
fn the_test_sees_a_crossing() {
    let Throw { surfaces, mut x, v } =
        throw([0.3, 0.2, 0.0], 0.02, Vec3::z() * -5.0, Vec3::zeros());
    assert_eq!(crossings(&surfaces, &x), 0);
    for (x, v) in x.iter_mut().zip(&v) {
        *x += v * 4e-3;
    }
    assert!(crossings(&surfaces, &x) > 0);
}

#[test]
fn a_flat_throw_is_stopped() {
    let truncated = fly(
        throw([0.0; 3], 0.01, Vec3::z() * -2.0, Vec3::zeros()),
        10,
        0.0,
    );
    assert!(truncated > 49, "{truncated}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_throw_crosses(
        angles in [-1.6..1.6, -1.6..1.6, -1.6..1.6],
        aside in [-1.0..1.0, -1.0..1.0],
        spin in [-30.0..30.0, -30.0..30.0, -30.0..30.0],
        jitter in 0.0..0.5,
    ) {
        let velocity = Vec3::new(aside[0], aside[1], -2.0);
        fly(throw(angles, 0.045, velocity, Vec3::from(spin)), 16, jitter);
    }
}
