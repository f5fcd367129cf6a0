//! The time step: momentum, weight, handles, stability and budgets.

use common::*;
use nalgebra::UnitQuaternion;
use physics::Vec3;

use physics::{
    Body, BodyConfig, Budget, Equilibrium, EquilibriumOptions, Freedom, HandlePose, StepError,
};

const LX: f64 = 0.1;

fn held_strip(config: BodyConfig, freedom: Freedom) -> (Body, Vec<HandlePose>) {
    let mesh = grid(10, 4, LX, 0.04, Split::Right);
    let handles = [
        handle(&mesh, freedom, |x| x.x < 1e-9),
        handle(&mesh, freedom, |x| x.x > LX - 1e-9),
    ];
    let sheet = Body::sheet(&mesh, &[rubber(0.3)], config, &handles).unwrap();
    (sheet, rest_poses(&handles))
}

#[test]
fn a_free_sheet_keeps_its_momentum() {
    let mesh = irregular(6, 5, 0.1, 0.08, 0.3, 31);
    let config = BodyConfig {
        bending: 1.0,
        ..tight()
    };
    let mut sheet = Body::sheet(&mesh, &[rubber(0.3)], config, &[]).unwrap();
    let mut random = Random(37);
    let drift = Vec3::new(0.3, -0.2, 0.1);
    let v: Vec<Vec3> = mesh
        .positions
        .iter()
        .map(|_| drift + random.vector())
        .collect();
    sheet.set_velocities(&v).unwrap();
    let before = sheet.momentum();
    for _ in 0..1000 {
        sheet.step(1e-3, &[]).unwrap();
    }
    // Each step leaves 1e-13 of its first residual, and rounding of the same size. Over 1000 steps the error is 1e-10.
    let change = (sheet.momentum() - before).norm() / before.norm();
    assert!(change < 1e-10, "{change:e}");
}

#[test]
fn handles_bear_the_weight_that_supports_leave_them() {
    let config = BodyConfig {
        gravity: Vec3::new(0.0, 0.0, -9.81),
        bending: 1.0,
        ..tight()
    };
    let settle = |sheet: &mut Body, poses: &[HandlePose]| {
        let mut equilibrium = Equilibrium::new(sheet, EquilibriumOptions::default()).unwrap();
        equilibrium.solve(sheet, poses, 1.0).unwrap();
    };
    let (mut sheet, poses) = held_strip(config, Freedom::Fixed);
    // Before the sheet has come to rest the weights are unknown, and zero is the safe value.
    assert!(sheet.handle_weights().iter().all(|w| *w == Vec3::zeros()));
    let weight = sheet.total_mass() * 9.81;
    settle(&mut sheet, &poses);
    let carried = sheet.handle_weights();
    for carried in &carried {
        // The residual at equilibrium is a billionth of the forces, of which the tension of the strip is the largest
        // part.
        assert!((carried.z / -weight - 0.5).abs() < 1e-5, "{carried}");
        assert!(carried.x == 0.0 && carried.y == 0.0, "along gravity only");
    }

    // A support carries the other half of the weight.
    let mesh = grid(10, 4, LX, 0.04, Split::Right);
    let held = [handle(&mesh, Freedom::Fixed, |x| x.x > LX - 1e-9)];
    let mut sheet = Body::sheet(&mesh, &[rubber(0.3)], config, &held).unwrap();
    let left: Vec<u32> = (0..mesh.positions.len() as u32)
        .filter(|&v| mesh.positions[v as usize].x < 1e-9)
        .collect();
    sheet.add_support(&left, [true; 3]).unwrap();
    settle(&mut sheet, &[HandlePose::at(held[0].origin)]);
    let fraction = sheet.handle_weights()[0].z / -weight;
    assert!((fraction - 0.5).abs() < 1e-5, "{fraction}");
}

#[test]
fn at_rest_the_handles_carry_the_weight() {
    let config = BodyConfig {
        gravity: Vec3::new(0.0, 0.0, -9.81),
        bending: 1.0,
        ..tight()
    };
    let (mut sheet, targets) = held_strip(config, Freedom::Fixed);
    settle(&mut sheet, &targets, 0.1, 60).unwrap();
    let mut on_hands = Vec3::zeros();
    for i in 0..sheet.handle_count() {
        on_hands += sheet.handle_report(i).unwrap().wrench_on_hand.force;
    }
    let weight = Vec3::new(0.0, 0.0, -9.81 * sheet.total_mass());
    // The remaining motion is inertia that no hand carries. It is below 1e-9 of the weight.
    assert!(
        (on_hands - weight).norm() < 1e-9 * weight.norm(),
        "{on_hands:?} {weight:?}"
    );
}

#[test]
fn in_motion_the_momentum_account_closes_every_step() {
    let config = BodyConfig {
        gravity: Vec3::new(1.0, -2.0, -9.81),
        mass_damping: 3.0,
        stiffness_damping: 1e-3,
        bending: 1.0,
        ..tight()
    };
    let (mut sheet, rest) = held_strip(config, Freedom::Rigid);
    let push: Vec<Vec3> = (0..sheet.vertex_count())
        .map(|_| Vec3::new(0.0, 1e-3, 2e-3))
        .collect();
    sheet.set_external_forces(&push).unwrap();
    let h = 1e-3;
    for i in 0..300 {
        let t = f64::from(i) * h;
        let mut targets = rest.clone();
        targets[0].position.z += 0.01 * (40.0 * t).sin();
        targets[1].position.x += 0.02 * (1.0 - (25.0 * t).cos());
        targets[1].rotation =
            UnitQuaternion::from_scaled_axis(Vec3::new(0.5, 0.2, 0.3) * (20.0 * t).sin());
        let before = sheet.momentum();
        sheet.step(h, &targets).unwrap();
        let mut given = sheet.total_external_force() - sheet.momentum() * config.mass_damping;
        let mut scale = given.norm();
        for handle in 0..2 {
            let report = sheet.handle_report(handle).unwrap();
            let account =
                report.reaction.force + report.wrench_on_hand.force - report.inertia.force;
            // The three numbers are sums of the same terms.
            assert!(account.norm() <= 1e-12 * (1e-3 + report.reaction.force.norm()));
            given += report.reaction.force;
            scale += report.reaction.force.norm();
        }
        let change = (sheet.momentum() - before) / h;
        // The solver leaves 1e-13 of the first residual, on hundreds of nodes. A jerk makes that residual ten times as
        // large as the final forces.
        assert!(
            (given - change).norm() < 1e-9 * scale,
            "step {i}: {given:?} {change:?}"
        );
    }
}

#[test]
fn a_handle_moves_its_vertices_as_a_rigid_body() {
    let (mut sheet, rest) = held_strip(tight(), Freedom::Rigid);
    let before: Vec<Vec3> = sheet.positions().collect();
    let turn = UnitQuaternion::from_scaled_axis(Vec3::new(0.1, 0.2, -0.1));
    let mut targets = rest.clone();
    targets[1] = HandlePose {
        position: rest[1].position + Vec3::new(1e-3, 0.0, 0.0),
        rotation: turn,
    };
    let h = 0.01;
    sheet.step(h, &targets).unwrap();
    for (old, new) in before.iter().zip(sheet.positions()) {
        if old.x > LX - 1e-9 {
            let expected = targets[1].position + turn * (old - rest[1].position);
            // The coordinates are a tenth of a metre, and are rounded a few times.
            assert!((new - expected).norm() < 1e-16, "{new:?} {expected:?}");
        }
    }
    let report = sheet.handle_report(1).unwrap();
    // The error is the rounding of quotients by h.
    assert!((report.linear_velocity - Vec3::new(0.1, 0.0, 0.0)).norm() < 1e-13);
    assert!((report.angular_velocity - turn.scaled_axis() / h).norm() < 1e-13);
    assert_eq!(report.pose, targets[1]);
}

#[test]
fn the_sheet_stays_bounded_under_fast_jerks() {
    for (bending, poisson) in [(0.0, 0.3), (1.0, 0.45)] {
        let mesh = irregular(10, 6, LX, 0.06, 0.3, 41);
        let handles = [
            handle(&mesh, Freedom::Rigid, |x| x.x < 1e-9),
            handle(&mesh, Freedom::Rigid, |x| x.x > LX - 1e-9),
        ];
        let config = BodyConfig {
            mass_damping: 5.0,
            stiffness_damping: 1e-3,
            bending,
            max_iterations: 400,
            ..BodyConfig::default()
        };
        let mut sheet = Body::sheet(&mesh, &[rubber(poisson)], config, &handles).unwrap();
        let rest = rest_poses(&handles);
        let mut random = Random(43);
        for i in 0..1500 {
            let mut targets = rest.clone();
            if i < 500 {
                for target in &mut targets {
                    // The hands jump by up to 5 cm and half a radian, every millisecond or in bursts.
                    if i % 7 < 4 {
                        target.position += random.vector() * 0.05;
                        target.rotation = UnitQuaternion::from_scaled_axis(random.vector() * 0.5);
                    }
                }
            }
            sheet.step(1e-3, &targets).unwrap();
            // The sheet stays near the hands: two hands at a distance of 10 cm that shake by 5 cm hold a sheet of 10
            // cm.
            assert!(largest(sheet.positions()) < 1.0, "step {i}");
        }
        // The hands rest for a second, with damping. The remaining motion is the slow swing under gravity. It is at
        // most that of a fall by the length of the sheet.
        let fall = sheet.total_mass() * 9.81 * LX;
        assert!(
            sheet.kinetic_energy() < 0.1 * fall,
            "{} {fall}",
            sheet.kinetic_energy()
        );
        assert!(
            sheet.elastic_energy() < 10.0 * fall,
            "{} {fall}",
            sheet.elastic_energy()
        );
    }
}

#[test]
fn at_rest_there_is_nothing_to_solve() {
    let (mut sheet, targets) = held_strip(tight(), Freedom::Fixed);
    let report = sheet.step(1e-3, &targets).unwrap();
    assert!(report.converged);
    // At rest, the forces are the rounding of E t L = 100 N.
    assert!(report.initial_residual < 1e-12 * 100.0, "{report:?}");
    let mut none = report;
    none.initial_residual = 0.0;
    assert_eq!(none.relative_residual(), 0.0);
}

#[test]
fn the_budget_is_counted_in_iterations() {
    let (mut sheet, mut targets) = held_strip(tight(), Freedom::Fixed);
    targets[1].position.x += 1e-3;
    let budget = Budget {
        tolerance: 1e-13,
        absolute_tolerance: 0.0,
        max_iterations: 3,
    };
    sheet.set_budget(budget).unwrap();
    let report = sheet.step(1e-3, &targets).unwrap();
    assert_eq!((report.iterations, report.converged), (3, false));
    assert!(report.relative_residual() > 1e-13);
    assert!(
        sheet
            .set_budget(Budget {
                tolerance: -1.0,
                ..budget
            })
            .is_err()
    );
}

#[test]
fn a_refused_step_keeps_the_last_state() {
    let (mut sheet, rest) = held_strip(tight(), Freedom::Rigid);
    let mut targets = rest.clone();
    targets[1].position.z += 1e-3;
    sheet.step(1e-3, &targets).unwrap();
    let (x, v): (Vec<Vec3>, Vec<Vec3>) =
        (sheet.positions().collect(), sheet.velocities().collect());
    let report = *sheet.handle_report(1).unwrap();

    assert_eq!(sheet.solve(1e-3, &targets), Err(StepError::NotAssembled));
    assert_eq!(
        sheet.step(0.0, &targets),
        Err(StepError::StepLength { found: 0.0 })
    );
    assert!(matches!(
        sheet.step(f64::NAN, &targets),
        Err(StepError::StepLength { .. })
    ));
    assert_eq!(
        sheet.step(1e-3, &rest[..1]),
        Err(StepError::Targets {
            found: 1,
            expected: 2
        })
    );
    targets[0].position.y = f64::INFINITY;
    assert_eq!(
        sheet.step(1e-3, &targets),
        Err(StepError::Target { handle: 0 })
    );
    targets[0].position.y = 1e306;
    assert!(matches!(
        sheet.step(1e-3, &targets),
        Err(StepError::Diverged { .. })
    ));

    assert_eq!(sheet.positions().collect::<Vec<_>>(), x);
    assert_eq!(sheet.velocities().collect::<Vec<_>>(), v);
    assert_eq!(*sheet.handle_report(1).unwrap(), report);
    assert!(sheet.step(1e-3, &rest).is_ok());
}

#[test]
fn a_velocity_beyond_all_numbers_is_refused() {
    let mut sheet = Body::sheet(
        &grid(1, 1, 1.0, 1.0, Split::Right),
        &[rubber(0.3)],
        tight(),
        &[],
    )
    .unwrap();
    let support = sheet.add_support(&[0, 1, 2, 3], [true; 3]).unwrap();
    // The displacement is finite. The speed is not.
    sheet.set_support(support, Vec3::x() * 1e306).unwrap();
    let before: Vec<Vec3> = sheet.positions().collect();
    assert_eq!(
        sheet.step(1e-4, &[]),
        Err(StepError::Diverged { iterations: 0 })
    );
    assert_eq!(sheet.positions().collect::<Vec<_>>(), before);
    assert!(sheet.velocities().all(|v| v == Vec3::zeros()));
}

#[test]
fn two_runs_give_the_same_bytes() {
    let run = || {
        let config = BodyConfig {
            bending: 1.0,
            ..BodyConfig::default()
        };
        let (mut sheet, rest) = held_strip(config, Freedom::Rigid);
        for i in 0..50 {
            let mut targets = rest.clone();
            targets[1].position.x += 1e-3 * f64::from(i);
            sheet.step(1e-3, &targets).unwrap();
        }
        sheet
            .positions()
            .flat_map(|x| [x.x, x.y, x.z])
            .map(f64::to_bits)
            .collect::<Vec<_>>()
    };
    assert_eq!(run(), run());
}
