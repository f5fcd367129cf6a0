//! Time schemes: order, energy, momentum, recovery, and the state after a step that fails.

use common::{Random, cube};
use nalgebra::Rotation3;
use physics::{
    Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Integrator, IntegratorOptions,
    NewtonOptions, SolidLaw, SolidMaterial, StepError, TimeScheme, Vec3,
};

const RUBBER: SolidMaterial = SolidMaterial {
    young: 1e4,
    poisson: 0.3,
    density: 1000.0,
};

fn config(mass_damping: f64, stiffness_damping: f64) -> BodyConfig {
    BodyConfig {
        gravity: Vec3::zeros(),
        mass_damping,
        stiffness_damping,
        ..BodyConfig::default()
    }
}

fn options(scheme: TimeScheme) -> IntegratorOptions {
    IntegratorOptions {
        scheme,
        newton: NewtonOptions {
            tolerance: 1e-12,
            max_iterations: 50,
        },
        max_halvings: 0,
        refuse_inversion: false,
    }
}

/// A cube that hangs by one face and receives an impulse. It is stepped for a tenth of a second.
fn swing(law: SolidLaw, scheme: TimeScheme, steps: u32, config: BodyConfig) -> Vec<Vec3> {
    let mesh = cube(1, 0.0, true);
    let mut body = Body::solid(&mesh, &[RUBBER], law, config, &[]).unwrap();
    let held: Vec<u32> = (0_u32..)
        .zip(&mesh.positions)
        .filter(|(_, x)| x.z == 0.0)
        .map(|(vertex, _)| vertex)
        .collect();
    body.add_support(&held, [true; 3]).unwrap();
    let struck: Vec<Vec3> = mesh
        .positions
        .iter()
        .map(|x| Vec3::new(x.z, -0.5 * x.z, 0.3 * x.z * x.x))
        .collect();
    body.set_velocities(&struck).unwrap();
    let mut integrator = Integrator::new(&body, options(scheme)).unwrap();
    for _ in 0..steps {
        integrator
            .step(&mut body, 0.1 / f64::from(steps), &[])
            .unwrap();
    }
    body.positions().collect()
}

fn distance(a: &[Vec3], b: &[Vec3]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).norm_squared())
        .sum::<f64>()
        .sqrt()
}

#[test]
fn schemes_have_the_order_they_state() {
    for law in [SolidLaw::Linear, SolidLaw::StableNeoHookean] {
        for config in [config(0.0, 0.0), config(0.5, 0.005)] {
            let exact = swing(law, TimeScheme::TrBdf2, 3200, config);
            for (scheme, order, steps) in [
                (TimeScheme::ImplicitEuler, 1.0, 800),
                (TimeScheme::TrBdf2, 2.0, 100),
            ] {
                let error = |steps| distance(&swing(law, scheme, steps, config), &exact);
                let found = (error(steps) / error(2 * steps)).log2();
                println!("{law:?} {scheme:?}: order {found:.3}");
                // The next term of the error is of the order of the step over the fastest motion that is resolved.
                assert!(
                    (found - order).abs() < 0.1,
                    "{law:?} {scheme:?} {config:?}: {found}"
                );
            }
        }
    }
}

#[test]
fn the_energy_of_a_linear_body_never_grows() {
    for scheme in [TimeScheme::ImplicitEuler, TimeScheme::TrBdf2] {
        for damping in [0.0, 0.01] {
            for h in [1e-3, 1e-2, 1e-1] {
                let mesh = cube(2, 0.2, false);
                let config = config(0.0, damping);
                let mut body =
                    Body::solid(&mesh, &[RUBBER], SolidLaw::Linear, config, &[]).unwrap();
                let mut random = Random(4);
                let v: Vec<Vec3> = mesh.positions.iter().map(|_| random.vector()).collect();
                body.set_velocities(&v).unwrap();
                let mut integrator = Integrator::new(&body, options(scheme)).unwrap();
                let start = body.kinetic_energy() + body.elastic_energy();
                let mut last = start;
                for _ in 0..200 {
                    integrator.step(&mut body, h, &[]).unwrap();
                    let energy = body.kinetic_energy() + body.elastic_energy();
                    // The tolerance is the rounding of the sums plus the residual of the solver.
                    assert!(
                        energy <= last + 1e-11 * start,
                        "{scheme:?} {damping} {h}: {energy} > {last}"
                    );
                    last = energy;
                }
            }
        }
    }
}

#[test]
fn a_free_body_keeps_its_momentum() {
    for scheme in [TimeScheme::ImplicitEuler, TimeScheme::TrBdf2] {
        for law in [SolidLaw::Corotational, SolidLaw::StableNeoHookean] {
            let mesh = cube(2, 0.2, false);
            let mut body = Body::solid(&mesh, &[RUBBER], law, config(0.0, 0.01), &[]).unwrap();
            let spin = Vec3::new(1.0, 2.0, 3.0);
            let v: Vec<Vec3> = mesh
                .positions
                .iter()
                .map(|x| spin.cross(x) + Vec3::x())
                .collect();
            body.set_velocities(&v).unwrap();
            let start = body.momentum();
            let mut integrator = Integrator::new(&body, options(scheme)).unwrap();
            for _ in 0..100 {
                integrator.step(&mut body, 2e-3, &[]).unwrap();
            }
            assert!((body.momentum() - start).norm() < 1e-10 * start.norm());
        }
    }
}

#[test]
fn angular_momentum_drifts_with_the_order_of_the_scheme() {
    let drift = |scheme, steps: u32| {
        let mesh = cube(1, 0.0, false);
        let law = SolidLaw::StableNeoHookean;
        let mut body = Body::solid(&mesh, &[RUBBER], law, config(0.0, 0.0), &[]).unwrap();
        let spin = Vec3::new(1.0, 2.0, 3.0);
        let v: Vec<Vec3> = mesh.positions.iter().map(|x| spin.cross(x)).collect();
        body.set_velocities(&v).unwrap();
        let angular = |body: &Body| -> Vec3 {
            // There are no handles, so the nodes are the vertices.
            let masses = body.node_masses();
            body.positions()
                .zip(body.velocities())
                .zip(masses)
                .map(|((x, v), m)| x.cross(&v) * *m)
                .sum()
        };
        let start = angular(&body);
        let mut integrator = Integrator::new(&body, options(scheme)).unwrap();
        for _ in 0..steps {
            integrator
                .step(&mut body, 0.1 / f64::from(steps), &[])
                .unwrap();
        }
        (angular(&body) - start).norm() / start.norm()
    };
    for (scheme, order) in [(TimeScheme::ImplicitEuler, 1.0), (TimeScheme::TrBdf2, 2.0)] {
        let found = (drift(scheme, 200) / drift(scheme, 400)).log2();
        println!("{scheme:?}: drift of order {found:.3}");
        // The order is at least that of the scheme.
        assert!(found > order - 0.1, "{scheme:?} {found}");
    }
}

#[test]
fn an_inverted_cube_of_stable_neo_hookean_recovers() {
    let law = SolidLaw::StableNeoHookean;
    let mesh = cube(2, 0.0, false);
    let mut random = Random(8);
    let inverted: Vec<Vec3> = mesh
        .positions
        .iter()
        .map(|x| Vec3::new(x.x, x.y, -x.z))
        .collect();
    let scrambled: Vec<Vec3> = mesh.positions.iter().map(|_| random.vector()).collect();
    for start in [inverted, scrambled] {
        let mut body = Body::solid(&mesh, &[RUBBER], law, config(0.0, 0.02), &[]).unwrap();
        body.set_positions(&start).unwrap();
        let bound = body.elastic_energy();
        let options = IntegratorOptions::default();
        let mut integrator = Integrator::new(&body, options).unwrap();
        for _ in 0..400 {
            integrator.step(&mut body, 0.02, &[]).unwrap();
            let energy = body.kinetic_energy() + body.elastic_energy();
            assert!(energy <= bound * (1.0 + 1e-9), "{energy} {bound}");
        }
        println!(
            "left {:.3e} of {bound:.3e} J, {} inverted",
            body.elastic_energy(),
            body.inverted_count()
        );
        assert_eq!(body.inverted_count(), 0);
        assert!(body.elastic_energy() < 1e-6 * bound);
    }
}

#[test]
fn a_turned_cube_stays_at_rest() {
    let mesh = cube(2, 0.2, true);
    let law = SolidLaw::Corotational;
    let mut body = Body::solid(&mesh, &[RUBBER], law, config(0.0, 0.0), &[]).unwrap();
    let turn = Rotation3::from_euler_angles(1.0, 2.0, -0.5);
    let x: Vec<Vec3> = mesh.positions.iter().map(|x| turn * x).collect();
    body.set_positions(&x).unwrap();
    let mut integrator = Integrator::new(&body, options(TimeScheme::TrBdf2)).unwrap();
    for _ in 0..100 {
        integrator.step(&mut body, 0.01, &[]).unwrap();
    }
    for (now, x) in body.positions().zip(&x) {
        assert!((now - x).norm() < 1e-12);
    }
}

#[test]
fn a_step_that_fails_leaves_the_body_as_it_was() {
    let mesh = cube(1, 0.0, false);
    let law = SolidLaw::StVenantKirchhoff;
    let mut body = Body::solid(&mesh, &[RUBBER], law, config(0.0, 0.0), &[]).unwrap();
    let v: Vec<Vec3> = mesh
        .positions
        .iter()
        .map(|x| Vec3::z() * (-2.0 * x.z))
        .collect();
    body.set_velocities(&v).unwrap();
    let before: Vec<Vec3> = body.positions().chain(body.velocities()).collect();
    let none = IntegratorOptions {
        newton: NewtonOptions {
            tolerance: 1e-12,
            max_iterations: 1,
        },
        ..options(TimeScheme::TrBdf2)
    };
    let result = Integrator::new(&body, none)
        .unwrap()
        .step(&mut body, 0.1, &[]);
    assert!(
        matches!(result, Err(StepError::NotConverged { .. })),
        "{result:?}"
    );
    assert_eq!(
        body.positions()
            .chain(body.velocities())
            .collect::<Vec<_>>(),
        before
    );
    // The same step is taken in as many parts as it needs.
    let more = IntegratorOptions {
        newton: NewtonOptions {
            tolerance: 1e-9,
            max_iterations: 3,
        },
        refuse_inversion: true,
        max_halvings: 8,
        ..IntegratorOptions::default()
    };
    let report = Integrator::new(&body, more)
        .unwrap()
        .step(&mut body, 0.1, &[])
        .unwrap();
    assert!(
        report.substeps > 1 && body.inverted_count() == 0,
        "{report:?}"
    );
}

#[test]
fn a_refused_attempt_leaves_no_trace_at_the_handles() {
    let mesh = cube(2, 0.0, false);
    let handles = [0.0, 1.0].map(|at| HandleSpec {
        vertices: (0_u32..)
            .zip(&mesh.positions)
            .filter(|(_, x)| (x.z - at).abs() < 1e-9)
            .map(|(vertex, _)| vertex)
            .collect(),
        origin: Vec3::new(0.5, 0.5, at),
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    });
    let law = SolidLaw::StableNeoHookean;
    let mut body = Body::solid(&mesh, &[RUBBER], law, config(0.0, 0.0), &handles).unwrap();
    let careful = IntegratorOptions {
        scheme: TimeScheme::TrBdf2,
        max_halvings: 4,
        refuse_inversion: true,
        ..IntegratorOptions::default()
    };
    let mut integrator = Integrator::new(&body, careful).unwrap();
    let below = HandlePose::at(handles[0].origin);
    let to = |z: f64| [below, HandlePose::at(handles[1].origin + Vec3::z() * z)];

    // The cube is compressed to a tenth. The whole step inverts elements, and its halves do not.
    let report = integrator.step(&mut body, 1.0, &to(-0.9)).unwrap();
    assert!(report.refused > 0 && report.substeps > 1, "{report:?}");
    let before = *body.handle_report(1).unwrap();
    // The velocity is constant over the step. It is exact up to the rounding of a difference of positions.
    let off = (before.linear_velocity - Vec3::z() * -0.9).norm();
    assert!(off < 1e-14, "{off}");

    // The upper face is pulled through the other face. Every part of that step inverts elements.
    let result = integrator.step(&mut body, 0.01, &to(-2.0));
    assert!(
        matches!(result, Err(StepError::Inverted { .. })),
        "{result:?}"
    );
    assert_eq!(*body.handle_report(1).unwrap(), before);
}

/// A cube that is held below and at rest. Forces on its upper face grow with the square of time for a tenth of a
/// second. With `jumps`, the forces of the end of each step act during the whole step instead.
fn loaded(law: SolidLaw, scheme: TimeScheme, steps: u32, jumps: bool) -> Vec<Vec3> {
    let mesh = cube(1, 0.0, true);
    let mut body = Body::solid(&mesh, &[RUBBER], law, config(0.5, 0.005), &[]).unwrap();
    let held: Vec<u32> = (0_u32..)
        .zip(&mesh.positions)
        .filter(|(_, x)| x.z == 0.0)
        .map(|(vertex, _)| vertex)
        .collect();
    body.add_support(&held, [true; 3]).unwrap();
    let mut integrator = Integrator::new(&body, options(scheme)).unwrap();
    for step in 1..=steps {
        let fraction = f64::from(step) / f64::from(steps);
        let pull = |x: &Vec3| Vec3::new(20.0, -5.0, 10.0) * (x.z * fraction * fraction);
        let forces: Vec<Vec3> = mesh.positions.iter().map(pull).collect();
        let h = 0.1 / f64::from(steps);
        if jumps {
            body.set_external_forces(&forces).unwrap();
            integrator.step(&mut body, h, &[]).unwrap();
        } else {
            integrator.step_loaded(&mut body, h, &[], &forces).unwrap();
        }
    }
    body.positions().collect()
}

#[test]
fn schemes_keep_their_order_under_growing_loads() {
    for law in [SolidLaw::Linear, SolidLaw::StableNeoHookean] {
        let exact = loaded(law, TimeScheme::TrBdf2, 1600, false);
        for (scheme, jumps, order) in [
            (TimeScheme::TrBdf2, false, 2.0),
            (TimeScheme::ImplicitEuler, false, 1.0),
            // The third case shows the purpose of loads at the time of each stage.
            (TimeScheme::TrBdf2, true, 1.0),
        ] {
            let error = |steps| distance(&loaded(law, scheme, steps, jumps), &exact);
            let (coarse, fine) = (error(50), error(100));
            let found = (coarse / fine).log2();
            println!(
                "{law:?} {scheme:?} jumps {jumps}: errors {coarse:.2e}, {fine:.2e}, order {found:.3}"
            );
            // The next term of the error is of the order of the step: a few hundredths of the order of the scheme.
            assert!(
                (found - order).abs() < 0.15,
                "{law:?} {scheme:?} {jumps}: {found}"
            );
        }
    }
}

#[test]
fn a_step_that_fails_keeps_the_forces_too() {
    let mesh = cube(1, 0.0, false);
    let mut body = Body::solid(&mesh, &[RUBBER], SolidLaw::Linear, config(0.0, 0.0), &[]).unwrap();
    let mut integrator = Integrator::new(&body, options(TimeScheme::TrBdf2)).unwrap();
    let mut forces = vec![Vec3::x(); mesh.positions.len()];
    body.set_external_forces(&forces).unwrap();
    let before = body.total_external_force();
    assert!(
        integrator
            .step_loaded(&mut body, -1.0, &[], &vec![Vec3::y(); forces.len()])
            .is_err()
    );
    assert_eq!(body.total_external_force(), before);
    forces[1].y = f64::NAN;
    let error = integrator
        .step_loaded(&mut body, 0.01, &[], &forces)
        .unwrap_err();
    assert!(matches!(error, StepError::Forces(_)), "{error}");
    assert_eq!(body.total_external_force(), before);
    let error = integrator
        .step_loaded(&mut body, 0.01, &[], &forces[1..])
        .unwrap_err();
    assert!(matches!(error, StepError::Forces(_)), "{error}");
}
