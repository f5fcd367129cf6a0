//! The exchange of a body for another body of the same mesh and another material.

use common::*;
use physics::{
    Body, BodyConfig, BodyError, BodyMap, Freedom, HandlePose, Material, Stepper, StepperOptions,
    Vec3,
};

const LX: f64 = 0.1;
const STEP: f64 = 1e-3;

/// A strip between two handles. Its modulus is this fraction of that of rubber.
fn strip(fraction: f64, cells: u32) -> (Body, Vec<HandlePose>) {
    let mesh = grid(cells, 4, LX, 0.04, Split::Right);
    let handles = [
        handle(&mesh, Freedom::Translation, |x| x.x < 1e-9),
        handle(&mesh, Freedom::Translation, |x| x.x > LX - 1e-9),
    ];
    let base = rubber(0.3);
    let material = Material {
        young: fraction * base.young,
        ..base
    };
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        bending: 1.0,
        ..tight()
    };
    let body = Body::sheet(&mesh, &[material], config, &handles).unwrap();
    (body, rest_poses(&handles))
}

/// The poses after `steps` steps. The right hand pulls with increasing speed.
fn pulled(rest: &[HandlePose], steps: i32) -> [HandlePose; 2] {
    let t = f64::from(steps) * STEP;
    let mut poses = [rest[0], rest[1]];
    poses[1].position.x += 0.5 * t * t;
    poses
}

#[test]
fn an_exchange_for_the_same_material_changes_no_force() {
    let (mut body, rest) = strip(1.0, 10);
    let (mut other, _) = strip(1.0, 10);
    for step in 1..=100 {
        body.step(STEP, &pulled(&rest, step)).unwrap();
    }
    other
        .continue_from(&body, &BodyMap::identity(&body))
        .unwrap();
    for step in 101..=110 {
        body.step(STEP, &pulled(&rest, step)).unwrap();
        other.step(STEP, &pulled(&rest, step)).unwrap();
        // The exchange restarts the bound on the energy of a step. No step here reaches that bound, so the arithmetic
        // is the same.
        assert_eq!(body.handle_report(1), other.handle_report(1));
        assert_eq!(body.node_positions(), other.node_positions());
    }
}

#[test]
fn a_softer_body_keeps_the_motion_and_the_energy_falls_with_its_modulus() {
    let (mut body, rest) = strip(1.0, 10);
    let (mut soft, _) = strip(0.25, 10);
    for step in 1..=200 {
        body.step(STEP, &pulled(&rest, step)).unwrap();
    }
    soft.continue_from(&body, &BodyMap::identity(&body))
        .unwrap();
    assert_eq!(soft.momentum(), body.momentum());
    // Membrane and bending are linear in Young's modulus. The difference is the rounding of a few hundred sums.
    let fraction = soft.elastic_energy() / body.elastic_energy();
    assert!((fraction - 0.25).abs() < 1e-12, "{fraction}");
    // At rest the handles pull with a quarter of the force, with either stepper.
    let mut stepper = Stepper::<f64>::new(&soft, StepperOptions::default()).unwrap();
    let targets = pulled(&rest, 200);
    for _ in 0..4000 {
        body.step(STEP, &targets).unwrap();
        stepper.step(&mut soft, STEP, &targets, || false).unwrap();
    }
    let pull = |body: &Body| body.handle_report(1).unwrap().wrench_on_hand.force.x;
    // The tolerance of the solver is 1e-6, and a small motion remains after 4 s.
    assert!((pull(&soft) / pull(&body) - 0.25).abs() < 1e-4);
}

#[test]
fn another_mesh_is_refused_and_nothing_changed() {
    let (mut body, _) = strip(1.0, 10);
    let (other, _) = strip(1.0, 12);
    let before = body.node_positions().to_vec();
    let refused = body
        .continue_from(&other, &BodyMap::identity(&other))
        .unwrap_err();
    assert!(
        matches!(
            refused,
            BodyError::Length {
                found: 65,
                expected: 55,
                ..
            }
        ),
        "{refused}"
    );
    assert_eq!(body.node_positions(), before);
}
