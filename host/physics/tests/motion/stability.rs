//! Extreme motions of hands and extreme meshes of solids: every number stays finite, and no energy is created. This is
//! the quick part of the stress suite.

use common::{Random, block, cube};
use physics::mesh::TetMesh;
use physics::{
    Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Integrator, IntegratorOptions,
    NewtonOptions, SolidLaw, SolidMaterial, TimeScheme, Vec3,
};

const LAWS: [SolidLaw; 4] = [
    SolidLaw::Linear,
    SolidLaw::Corotational,
    SolidLaw::StVenantKirchhoff,
    SolidLaw::StableNeoHookean,
];

fn config(stiffness_damping: f64) -> BodyConfig {
    BodyConfig {
        gravity: Vec3::zeros(),
        stiffness_damping,
        ..BodyConfig::default()
    }
}

fn material(young: f64, poisson: f64) -> SolidMaterial {
    SolidMaterial {
        young,
        poisson,
        density: 1000.0,
    }
}

/// Takes `steps` steps. Each must succeed or leave the state unchanged, and the energy of a free body must not exceed
/// `1 + growth` times its initial energy. Returns the number of steps that succeeded and the ratio of the largest
/// energy to the initial energy.
fn run(
    body: &mut Body,
    scheme: TimeScheme,
    h: f64,
    steps: usize,
    targets: impl Fn(usize) -> Vec<HandlePose>,
) -> (usize, f64) {
    let options = IntegratorOptions {
        scheme,
        newton: NewtonOptions {
            tolerance: 1e-8,
            max_iterations: 60,
        },
        max_halvings: 6,
        refuse_inversion: false,
    };
    let mut integrator = Integrator::new(body, options).unwrap();
    let energy = |body: &Body| body.kinetic_energy() + body.elastic_energy();
    let start = energy(body);
    let (mut good, mut worst) = (0, 0.0_f64);
    for step in 0..steps {
        let before: Vec<Vec3> = body.positions().chain(body.velocities()).collect();
        let result = integrator.step(body, h, &targets(step));
        let after: Vec<Vec3> = body.positions().chain(body.velocities()).collect();
        assert!(after.iter().flat_map(|v| v.iter()).all(|c| c.is_finite()));
        if result.is_ok() {
            good += 1;
        } else {
            assert_eq!(before, after, "{result:?}");
        }
        worst = worst.max(energy(body) / start);
    }
    (good, worst)
}

fn kick(mesh: &TetMesh, speed: f64) -> Vec<Vec3> {
    let mut random = Random(11);
    mesh.positions
        .iter()
        .map(|_| random.vector() * speed)
        .collect()
}

#[test]
fn free_bodies_of_any_stiffness_and_step_gain_no_energy() {
    let mesh = cube(2, 0.2, false);
    for law in LAWS {
        for scheme in [TimeScheme::ImplicitEuler, TimeScheme::TrBdf2] {
            for young in [1.0, 1e4, 1e9] {
                for poisson in [0.0, 0.45, 0.499] {
                    for h in [1e-4, 1e-2, 1e-1] {
                        let material = material(young, poisson);
                        let mut body =
                            Body::solid(&mesh, &[material], law, config(0.0), &[]).unwrap();
                        // At a hundredth of the speed of sound, the strains are a few hundredths.
                        body.set_velocities(&kick(&mesh, 0.01 * (young / 1000.0).sqrt()))
                            .unwrap();
                        let (good, worst) = run(&mut body, scheme, h, 20, |_| Vec::new());
                        let case = format!("{law:?} {scheme:?} E {young} nu {poisson} h {h}");
                        assert_eq!(good, 20, "{case}");
                        // The bound of 1 % is for laws that are not linear. The energy of a linear body never grows, up
                        // to rounding. A velocity is a difference of positions over the step. At worst it is known here
                        // to 1e-16 / (1e-4 s 3e-4 m/s) = 3e-9 in each of the steps, and to ten times that if TR-BDF2
                        // extrapolates.
                        let linear = law == SolidLaw::Linear;
                        let bound = if linear { 1.0 + 1e-6 } else { 1.01 };
                        assert!(worst <= bound, "{case}: {worst}");
                    }
                }
            }
        }
    }
}

#[test]
fn contrasts_and_mass_ratios_of_a_million_are_solved() {
    let mesh = cube(3, 0.2, false);
    let count = mesh.cells.len();
    for law in LAWS {
        for (contrast, ratio) in [(1e6, 1.0), (1.0, 1e6), (1e6, 1e6)] {
            let materials: Vec<SolidMaterial> = (0..count)
                .map(|cell| SolidMaterial {
                    young: if cell % 2 == 0 { 1e3 } else { 1e3 * contrast },
                    poisson: 0.3,
                    density: if cell % 3 == 0 { 1e-2 * ratio } else { 1e-2 },
                })
                .collect();
            let mut body = Body::solid(&mesh, &materials, law, config(0.001), &[]).unwrap();
            body.set_velocities(&kick(&mesh, 0.01)).unwrap();
            let (good, worst) = run(&mut body, TimeScheme::ImplicitEuler, 1e-3, 20, |_| {
                Vec::new()
            });
            assert!(
                good == 20 && worst <= 1.01,
                "{law:?} {contrast} {ratio}: {good} {worst}"
            );
        }
    }
}

#[test]
fn slivers_are_solved() {
    for law in LAWS {
        let mut mesh = block([4, 4, 2], 0.0, false);
        for x in &mut mesh.positions {
            x.z *= 5e-5;
        }
        let mut body = Body::solid(&mesh, &[material(1e5, 0.3)], law, config(0.001), &[]).unwrap();
        let v: Vec<Vec3> = kick(&mesh, 1e-4)
            .iter()
            .map(|v| Vec3::new(v.x, v.y, 1e-4 * v.z))
            .collect();
        body.set_velocities(&v).unwrap();
        let (good, worst) = run(&mut body, TimeScheme::ImplicitEuler, 1e-3, 20, |_| {
            Vec::new()
        });
        assert!(good == 20 && worst <= 1.01, "{law:?}: {good} {worst}");
    }
}

#[test]
fn a_handle_jerked_by_ten_body_lengths_leaves_a_body_that_can_be_stepped() {
    let mesh = cube(2, 0.0, false);
    let face = |at: f64| -> Vec<u32> {
        let numbered = (0_u32..).zip(&mesh.positions);
        numbered
            .filter(|(_, x)| (x.z - at).abs() < 1e-9)
            .map(|(vertex, _)| vertex)
            .collect()
    };
    let handles = [0.0, 1.0].map(|at| HandleSpec {
        vertices: face(at),
        origin: Vec3::new(0.5, 0.5, at),
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    });
    for law in LAWS {
        let mut body =
            Body::solid(&mesh, &[material(1e4, 0.45)], law, config(0.01), &handles).unwrap();
        let targets = |step: usize| {
            let out = if step == 0 {
                Vec3::new(7.0, 3.0, -6.0)
            } else {
                Vec3::zeros()
            };
            handles
                .clone()
                .map(|handle| {
                    let moved = if handle.origin.z > 0.5 {
                        out
                    } else {
                        Vec3::zeros()
                    };
                    HandlePose::at(handle.origin + moved)
                })
                .to_vec()
        };
        let mut largest = 0.0_f64;
        let mut integrator = Integrator::new(&body, IntegratorOptions::default()).unwrap();
        for step in 0..300 {
            // A step may be refused. The state must be finite.
            let _ = integrator.step(&mut body, 1e-2, &targets(step));
            assert!(body.positions().all(|x| x.iter().all(|c| c.is_finite())));
            largest = largest.max(body.elastic_energy());
        }
        println!(
            "{law:?}: {} inverted, {:.2e} J left",
            body.inverted_count(),
            body.elastic_energy()
        );
        if matches!(law, SolidLaw::StableNeoHookean | SolidLaw::Linear) {
            assert_eq!(body.inverted_count(), 0, "{law:?}");
            // The damping of the body needs three seconds for that.
            let left = body.elastic_energy() / largest;
            assert!(left < 1e-4, "{law:?} {left}");
        }
    }
}

#[test]
fn ten_thousand_steps_at_rest_move_nothing() {
    let mesh = cube(1, 0.0, false);
    for law in LAWS {
        let mut body = Body::solid(&mesh, &[material(1e4, 0.3)], law, config(0.0), &[]).unwrap();
        let mut integrator = Integrator::new(&body, IntegratorOptions::default()).unwrap();
        for _ in 0..10_000 {
            integrator.step(&mut body, 1e-3, &[]).unwrap();
        }
        for (x, rest) in body.positions().zip(&mesh.positions) {
            assert!((x - rest).norm() < 1e-12, "{law:?}");
        }
        assert!(body.kinetic_energy() + body.elastic_energy() < 1e-24);
    }
}
