//! Equilibria compared with reference forces and analytic solutions.

use common::cube;
use physics::mesh::{TetMesh, TriMesh};
use physics::{
    Body, BodyConfig, Border, Equilibrium, EquilibriumOptions, EquilibriumReport, Freedom,
    HandlePose, HandleSpec, Material, NewtonOptions, SolidLaw, SolidMaterial, StepError, Vec3,
};

const EDGE: f64 = 0.1;
const YOUNG: f64 = 2e4;

fn gelatine(poisson: f64) -> SolidMaterial {
    SolidMaterial {
        young: YOUNG,
        poisson,
        density: 1000.0,
    }
}

fn weightless() -> BodyConfig {
    BodyConfig {
        gravity: Vec3::zeros(),
        ..BodyConfig::default()
    }
}

/// The cube of the reference figures: 10 cm, in n^3 grid cells.
fn small_cube(n: usize, quadratic: bool) -> TetMesh {
    let mut mesh = cube(n, 0.0, quadratic);
    for x in &mut mesh.positions {
        *x *= EDGE;
    }
    mesh
}

fn face(mesh: &TetMesh, axis: usize, at: f64) -> Vec<u32> {
    (0_u32..)
        .zip(&mesh.positions)
        .filter(|(_, x)| (x[axis] - at).abs() < 1e-9)
        .map(|(vertex, _)| vertex)
        .collect()
}

fn solve(body: &mut Body, targets: &[HandlePose]) -> Result<EquilibriumReport, StepError> {
    let mut equilibrium = Equilibrium::new(body, EquilibriumOptions::default()).unwrap();
    equilibrium.solve(body, targets, 1.0)
}

/// The force (N) that compresses the bonded cube by 10 %.
fn bonded(n: usize, law: SolidLaw) -> f64 {
    let mesh = small_cube(n, false);
    let handles = [0.0, EDGE].map(|at| HandleSpec {
        vertices: face(&mesh, 2, at),
        origin: Vec3::new(0.0, 0.0, at),
        freedom: Freedom::Translation,
        border: Border::Hinged,
    });
    let mut body = Body::solid(&mesh, &[gelatine(0.3)], law, weightless(), &handles).unwrap();
    let targets = [0.0, 0.9 * EDGE].map(|z| HandlePose::at(Vec3::new(0.0, 0.0, z)));
    let report = solve(&mut body, &targets).unwrap();
    assert!(report.last.converged);
    let [below, above] = [0, 1].map(|i| body.handle_report(i).unwrap().reaction.force);
    // The forces on the two plates balance, up to the residual.
    assert!(
        (below + above).norm() < 1e-7 * above.norm(),
        "{below} {above}"
    );
    -above.z
}

#[test]
fn a_bonded_cube_has_the_force_of_an_independent_program() {
    // These forces are those of an independent program on the same meshes, to its four decimals.
    for (n, linear, corotational) in [
        (6, 21.8183, 21.6604),
        (8, 21.6490, 21.4799),
        (10, 21.5551, 21.3776),
    ] {
        for (law, expected) in [
            (SolidLaw::Linear, linear),
            (SolidLaw::Corotational, corotational),
        ] {
            let found = bonded(n, law);
            println!("n {n} {law:?}: {found:.6} N, reference {expected}");
            // The tolerance is half of the last decimal that is given. The residual of the solver is below that.
            assert!((found - expected).abs() < 0.6e-4, "n {n} {law:?}: {found}");
        }
    }
}

/// Stretches a cube with sliding faces by `stretch` along z. Returns the force on the upper face, and the body.
fn sliding(law: SolidLaw, quadratic: bool, poisson: f64, stretch: f64) -> (f64, Body) {
    let mesh = small_cube(3, quadratic);
    let mut body = Body::solid(&mesh, &[gelatine(poisson)], law, weightless(), &[]).unwrap();
    let only = |axis: usize| core::array::from_fn(|i| i == axis);
    for axis in 0..3 {
        body.add_support(&face(&mesh, axis, 0.0), only(axis))
            .unwrap();
    }
    let top = body.add_support(&face(&mesh, 2, EDGE), only(2)).unwrap();
    body.set_support(top, Vec3::z() * (stretch - 1.0) * EDGE)
        .unwrap();
    solve(&mut body, &[]).unwrap();
    (body.support_reaction(top).unwrap().z, body)
}

#[test]
fn a_cube_between_sliding_faces_presses_back_exactly() {
    for quadratic in [false, true] {
        for poisson in [0.0, 0.3, 0.499] {
            for law in [SolidLaw::Linear, SolidLaw::Corotational] {
                let (force, _) = sliding(law, quadratic, poisson, 0.9);
                // The force is E A times the strain: 20 N. The residual is 1e-9 of the forces that balance.
                assert!((force + 20.0).abs() < 1e-7, "{law:?} {poisson} {force}");
            }
            // Under the St. Venant-Kirchhoff law with free sides, the force is E A l (l^2 - 1) / 2.
            for stretch in [0.9, 1.2] {
                let (force, _) = sliding(SolidLaw::StVenantKirchhoff, quadratic, poisson, stretch);
                let area = EDGE * EDGE;
                let expected = 0.5 * YOUNG * area * stretch * (stretch * stretch - 1.0);
                assert!(
                    (force - expected).abs() < 1e-7,
                    "{poisson} {force} {expected}"
                );
            }
        }
    }
}

#[test]
fn newton_ends_quadratically_on_the_exact_tangent() {
    // Each iteration squares the relative error, so a handful of iterations reduce a strain of 0.2 to 1e-9.
    for law in [
        SolidLaw::Corotational,
        SolidLaw::StVenantKirchhoff,
        SolidLaw::StableNeoHookean,
    ] {
        let mesh = small_cube(3, true);
        let handles = [0.0, EDGE].map(|at| HandleSpec {
            vertices: face(&mesh, 2, at),
            origin: Vec3::new(0.0, 0.0, at),
            freedom: Freedom::Translation,
            border: Border::Hinged,
        });
        let mut body = Body::solid(&mesh, &[gelatine(0.4)], law, weightless(), &handles).unwrap();
        let targets = [0.0, 1.2 * EDGE].map(|z| HandlePose::at(Vec3::new(0.0, 0.0, z)));
        let report = solve(&mut body, &targets).unwrap();
        assert!(
            report.load_steps == 1 && report.iterations <= 7,
            "{law:?} {report:?}"
        );
    }
}

#[test]
fn handles_and_supports_carry_the_weight() {
    for quadratic in [false, true] {
        let mesh = small_cube(2, quadratic);
        let handles = [HandleSpec {
            vertices: face(&mesh, 2, 0.0),
            origin: Vec3::zeros(),
            freedom: Freedom::Rigid,
            border: Border::Hinged,
        }];
        let law = SolidLaw::StableNeoHookean;
        let mut body = Body::solid(
            &mesh,
            &[gelatine(0.3)],
            law,
            BodyConfig::default(),
            &handles,
        )
        .unwrap();
        body.set_load_factor(0.0).unwrap();
        solve(&mut body, &[HandlePose::at(Vec3::zeros())]).unwrap();
        let report = body.handle_report(0).unwrap();
        // The mass is 1 kg. The tolerance is the residual.
        assert!(
            (report.reaction.force - Vec3::z() * 9.81).norm() < 1e-7 * 9.81,
            "{report:?}"
        );
    }
}

#[test]
fn a_free_body_under_its_weight_is_reported_to_have_no_equilibrium() {
    let mesh = small_cube(2, false);
    let law = SolidLaw::Corotational;
    let mut body = Body::solid(&mesh, &[gelatine(0.3)], law, BodyConfig::default(), &[]).unwrap();
    let before: Vec<Vec3> = body.positions().collect();
    let options = EquilibriumOptions {
        newton: NewtonOptions {
            max_iterations: 10,
            ..NewtonOptions::default()
        },
        ..EquilibriumOptions::default()
    };
    let error = Equilibrium::new(&body, options)
        .unwrap()
        .solve(&mut body, &[], 1.0);
    assert!(error.is_err(), "{error:?}");
    assert_eq!(
        body.positions().collect::<Vec<_>>(),
        before,
        "the last state is kept"
    );
}

/// Loads that grow after the weight lead to the equilibrium to which weight and loads lead together; and a solve that
/// fails keeps the loads of before.
#[test]
fn loads_by_vertex_grow_after_the_weight() {
    let mesh = small_cube(3, false);
    let top = HandleSpec {
        vertices: face(&mesh, 2, EDGE),
        origin: Vec3::new(0.0, 0.0, EDGE),
        freedom: Freedom::Translation,
        border: Border::Hinged,
    };
    let cube = || {
        let law = SolidLaw::StableNeoHookean;
        let config = BodyConfig::default();
        Body::solid(
            &mesh,
            &[gelatine(0.3)],
            law,
            config,
            std::slice::from_ref(&top),
        )
        .unwrap()
    };
    let mut forces = vec![Vec3::zeros(); mesh.positions.len()];
    for vertex in face(&mesh, 2, 0.0) {
        forces[vertex as usize] = Vec3::new(0.5, 0.0, -1.0);
    }
    let rest = [HandlePose::at(top.origin)];
    let mut together = cube();
    together.set_external_forces(&forces).unwrap();
    together.set_load_factor(0.0).unwrap();
    solve(&mut together, &rest).unwrap();

    let mut staged = cube();
    let options = EquilibriumOptions {
        load_steps: 3,
        ..EquilibriumOptions::default()
    };
    let mut equilibrium = Equilibrium::new(&staged, options).unwrap();
    staged.set_load_factor(0.0).unwrap();
    equilibrium.solve(&mut staged, &rest, 1.0).unwrap();
    let settled = staged.total_external_force();
    let report = equilibrium
        .solve_loaded(&mut staged, &rest, &forces)
        .unwrap();
    assert_eq!(report.load_steps, 3);
    assert_eq!(
        staged.total_external_force(),
        together.total_external_force()
    );
    assert!(staged.total_external_force().z < settled.z - 15.0);
    let apart = staged.positions().zip(together.positions());
    let apart = apart.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    // Both end at 1e-8 of the forces.
    assert!(apart < 1e-7, "{apart}");

    let before: Vec<_> = staged.positions().collect();
    let absurd: Vec<_> = forces.iter().map(|force| force * 1e9).collect();
    assert!(
        equilibrium
            .solve_loaded(&mut staged, &rest, &absurd)
            .is_err()
    );
    assert!(staged.positions().eq(before));
    assert_eq!(
        staged.total_external_force(),
        together.total_external_force()
    );
}

/// A search that cannot go to its end stays at its last load step, with the handle and the loads of that step: going there
/// on purpose gives the same state.
#[test]
fn a_search_that_ends_early_stays_where_it_came() {
    let mesh = small_cube(2, false);
    let handles = [0.0, EDGE].map(|at| HandleSpec {
        vertices: face(&mesh, 2, at),
        origin: Vec3::z() * at,
        freedom: Freedom::Translation,
        border: Border::Hinged,
    });
    let cube = || {
        let law = SolidLaw::StVenantKirchhoff;
        let config = BodyConfig::default();
        Body::solid(&mesh, &[gelatine(0.3)], law, config, &handles).unwrap()
    };
    let (mut stopped, mut sent) = (cube(), cube());
    // This law collapses under compression.
    let lid = |part: f64| HandlePose::at(Vec3::z() * (EDGE * (1.0 - 0.9 * part)));
    let floor = HandlePose::at(Vec3::zeros());
    let forces = vec![Vec3::x() * 0.01; mesh.positions.len()];
    let mut equilibrium = Equilibrium::new(&stopped, EquilibriumOptions::default()).unwrap();
    let error = equilibrium.solve_loaded(&mut stopped, &[floor, lid(1.0)], &forces);
    assert!(error.is_err(), "{error:?}");
    let reached = equilibrium.report().reached;
    assert!(reached > 0.1 && reached < 1.0, "{reached}");
    let forces: Vec<_> = forces.iter().map(|force| force * reached).collect();
    sent.set_external_forces(&forces).unwrap();
    solve(&mut sent, &[floor, lid(reached)]).unwrap();
    let apart = stopped.positions().zip(sent.positions());
    let apart = apart.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    // Both end at 1e-9 of the forces, near a limit where the body is soft.
    assert!(apart < 1e-5 * EDGE, "{apart}");
    assert_eq!(stopped.total_external_force(), sent.total_external_force());
    let [a, b] = [&stopped, &sent].map(|body| *body.handle_report(1).unwrap());
    assert!((a.pose.position - b.pose.position).norm() < 1e-12 * EDGE);
    let force = (a.reaction.force - b.reaction.force).norm();
    assert!(force < 1e-5 * b.reaction.force.norm(), "{a:?} {b:?}");
}

#[test]
fn a_free_body_without_loads_stays_where_it_is() {
    let mesh = small_cube(2, false);
    let law = SolidLaw::Corotational;
    let mut body = Body::solid(&mesh, &[gelatine(0.3)], law, weightless(), &[]).unwrap();
    solve(&mut body, &[]).unwrap();
    for (x, rest) in body.positions().zip(&mesh.positions) {
        assert!((x - rest).norm() < 1e-12 * EDGE);
    }
}

#[test]
fn a_body_without_free_nodes_refuses_numbers_that_are_not_finite() {
    let mesh = small_cube(1, false);
    let handles = [0.0, EDGE].map(|at| HandleSpec {
        vertices: face(&mesh, 2, at),
        origin: Vec3::zeros(),
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    });
    let law = SolidLaw::StVenantKirchhoff;
    let config = BodyConfig::default();
    let mut body = Body::solid(&mesh, &[gelatine(0.3)], law, config, &handles).unwrap();
    let before: Vec<Vec3> = body.positions().collect();
    let report = *body.handle_report(0).unwrap();
    let mut equilibrium = Equilibrium::new(&body, EquilibriumOptions::default()).unwrap();
    // No node is free, so no residual reveals either number.
    let here = HandlePose::at(Vec3::zeros());
    let error = equilibrium.solve(&mut body, &[here; 2], f64::INFINITY);
    assert_eq!(
        error.unwrap_err(),
        StepError::Load {
            found: f64::INFINITY
        }
    );
    // The stress grows with the cube of the stretch.
    let far = HandlePose::at(Vec3::z() * 1e200);
    let error = equilibrium.solve(&mut body, &[here, far], 1.0);
    assert!(
        matches!(error, Err(StepError::Diverged { .. })),
        "{error:?}"
    );
    assert_eq!(body.positions().collect::<Vec<_>>(), before);
    assert_eq!(*body.handle_report(0).unwrap(), report);
}

/// A shallow roof of two membranes whose ridge is pushed down: a von Mises truss of unit width. Its limit load is
/// `2 E t h^3 / (3 sqrt(3) L^3)`, with the height `h` of the ridge and half the span `L`, up to `(h / L)^2`.
#[test]
fn a_roof_that_is_pushed_through_has_snapped() {
    const HEIGHT: f64 = 0.1;
    let positions: Vec<Vec3> = [0.0, 1.0]
        .into_iter()
        .flat_map(|y| [(-1.0, 0.0), (0.0, HEIGHT), (1.0, 0.0)].map(|(x, z)| Vec3::new(x, y, z)))
        .collect();
    let mesh = TriMesh {
        positions,
        triangles: vec![[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]],
        ..TriMesh::default()
    };
    let material = Material {
        young: 1e6,
        poisson: 0.0,
        thickness: 1e-3,
        density: 1.0,
    };
    let config = BodyConfig {
        bending: 0.0,
        ..weightless()
    };
    let limit = 2e3 * HEIGHT.powi(3) / (3.0 * 3.0_f64.sqrt());
    for (load, snaps) in [(0.8 * limit, false), (1.2 * limit, true)] {
        for load_steps in [1, 4] {
            let mut body = Body::sheet(&mesh, &[material], config, &[]).unwrap();
            body.add_support(&[0, 2, 3, 5], [true; 3]).unwrap();
            body.add_support(&[1, 4], [true, true, false]).unwrap();
            let mut forces = vec![Vec3::zeros(); 6];
            for ridge in [1, 4] {
                forces[ridge] = Vec3::z() * (-0.5 * load);
            }
            let options = EquilibriumOptions {
                load_steps,
                find_snaps: true,
                ..EquilibriumOptions::default()
            };
            let mut equilibrium = Equilibrium::new(&body, options).unwrap();
            let report = equilibrium.solve_loaded(&mut body, &[], &forces).unwrap();
            let ridge = body.positions().nth(1).unwrap().z;
            assert_eq!(ridge < 0.0, snaps, "{ridge}");
            assert_eq!(
                report.snapped,
                snaps.then_some(1.0),
                "{load_steps}: {report:?}"
            );
            // The search for snaps leaves the balance and its loads as they are.
            let found = body.support_reaction(0).unwrap().z;
            assert!((found - load).abs() < 1e-6 * load, "{found} {load}");
        }
    }
}
