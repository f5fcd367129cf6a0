//! The guard, the bound on the energy at the end of a step. The guard acts only if a step would create energy.

use common::{Random, Split, block, cube, grid, handle, rest_poses};
use physics::{
    Body, BodyConfig, Freedom, Integrator, IntegratorOptions, Material, SolidLaw, SolidMaterial,
    Stepper, StepperOptions, TimeScheme, Vec3,
};

const BENT: [SolidLaw; 3] = [
    SolidLaw::Corotational,
    SolidLaw::StVenantKirchhoff,
    SolidLaw::StableNeoHookean,
];

fn quiet() -> BodyConfig {
    BodyConfig {
        gravity: Vec3::zeros(),
        ..BodyConfig::default()
    }
}

fn jelly(poisson: f64) -> SolidMaterial {
    SolidMaterial {
        young: 1e5,
        poisson,
        density: 1000.0,
    }
}

fn membrane(young: f64) -> Material {
    Material {
        young,
        poisson: 0.3,
        thickness: 0.01,
        density: 1000.0,
    }
}

fn tr_bdf2(body: &Body) -> Integrator {
    let options = IntegratorOptions {
        scheme: TimeScheme::TrBdf2,
        ..IntegratorOptions::default()
    };
    Integrator::new(body, options).unwrap()
}

fn energy(body: &Body) -> f64 {
    body.kinetic_energy() + body.elastic_energy()
}

/// A random velocity of up to `speed` for each vertex.
fn kick(body: &mut Body, speed: f64) {
    let mut random = Random(11);
    let v: Vec<Vec3> = (0..body.vertex_count())
        .map(|_| random.vector() * speed)
        .collect();
    body.set_velocities(&v).unwrap();
}

#[test]
fn tr_bdf2_is_replaced_where_it_would_create_energy() {
    let mesh = cube(2, 0.2, false);
    for law in BENT {
        let mut body = Body::solid(&mesh, &[jelly(0.499)], law, quiet(), &[]).unwrap();
        // At the speed of sound, a vertex crosses the whole body in a step of 0.1 s.
        kick(&mut body, 10.0);
        let start = energy(&body);
        let mut integrator = tr_bdf2(&body);
        let mut damped = 0;
        for _ in 0..50 {
            damped += integrator.step(&mut body, 0.1, &[]).unwrap().damped;
            // The bound lets the energy of a second-order scheme oscillate by half a percent.
            assert!(energy(&body) <= 1.005 * start, "{law:?}: {}", energy(&body));
        }
        // If no step were replaced, this test would show nothing. (Without the bound, the energy is 3.2 to 3.8 times
        // the initial energy.)
        assert!(damped > 0, "{law:?}");
    }
}

#[test]
fn a_linearized_step_withholds_motion_that_would_create_energy_and_keeps_momentum() {
    let mesh = grid(6, 6, 1.0, 1.0, Split::Alternating);
    for bending in [0.0, 1.0] {
        // The momentum is as exact as the solve. Here the forces of the guess are (c h / cell)^2 = 4e5 times those that
        // move the body.
        let config = BodyConfig {
            bending,
            tolerance: 1e-14,
            ..quiet()
        };
        let mut body = Body::sheet(&mesh, &[membrane(1e9)], config, &[]).unwrap();
        kick(&mut body, 1000.0);
        let (start, momentum) = (energy(&body), body.momentum());
        let scale = body.total_mass() * 1000.0;
        let mut held_back = 0.0_f64;
        for _ in 0..50 {
            held_back = held_back.max(body.step(0.1, &[]).unwrap().held_back);
            assert!(energy(&body) <= 1.005 * start, "{}", energy(&body));
            let off = (body.momentum() - momentum).norm();
            // The error is 1e-14 of 4e5, in each of fifty steps.
            assert!(off < 2e-7 * scale, "{:e}", off / scale);
        }
        assert!(held_back > 0.5, "{held_back}");
    }
}

#[test]
fn the_work_of_a_hand_does_not_count_as_created_energy() {
    let mesh = grid(8, 4, 1.0, 0.5, Split::Right);
    let handles = [
        handle(&mesh, Freedom::Rigid, |x| x.x < 1e-9),
        handle(&mesh, Freedom::Rigid, |x| x.x > 1.0 - 1e-9),
    ];
    let mut body = Body::sheet(&mesh, &[membrane(1e5)], quiet(), &handles).unwrap();
    let mut poses = rest_poses(&handles);
    for step in 0..100 {
        // The hand moves along an ellipse, up to twice the length of the sheet away.
        let angle = 0.1 * f64::from(step);
        poses[1].position =
            handles[1].origin + Vec3::new(1.0 - angle.cos(), 0.4 * angle.sin(), 0.0);
        let report = body.step(0.02, &poses).unwrap();
        assert_eq!(report.held_back, 0.0, "step {step}");
    }

    let mesh = block([4, 2, 2], 0.1, false);
    let side = |far: bool| -> Vec<u32> {
        let chosen = |x: &Vec3| {
            if far { x.x > 1.0 - 1e-9 } else { x.x < 1e-9 }
        };
        let numbered = (0_u32..).zip(&mesh.positions);
        numbered
            .filter(|(_, x)| chosen(x))
            .map(|(v, _)| v)
            .collect()
    };
    for law in BENT {
        let mut body = Body::solid(&mesh, &[jelly(0.3)], law, quiet(), &[]).unwrap();
        body.add_support(&side(false), [true; 3]).unwrap();
        let pulled = body.add_support(&side(true), [true; 3]).unwrap();
        let mut integrator = tr_bdf2(&body);
        for step in 1..=50 {
            let angle = 0.1 * f64::from(step);
            let displacement = Vec3::new(1.0 - angle.cos(), 0.2 * angle.sin(), 0.0) * 0.4;
            body.set_support(pulled, displacement).unwrap();
            let report = integrator.step(&mut body, 0.01, &[]).unwrap();
            assert_eq!(report.damped, 0, "{law:?}, step {step}");
        }
    }
}

#[test]
fn hands_that_move_far_in_a_step_add_no_more_than_their_work() {
    let mesh = grid(8, 8, 0.1, 0.1, Split::Right);
    // Two vertices of the upper border for each hand, so that the sheet between the hands turns.
    let held = |first: f64| {
        handle(&mesh, Freedom::Translation, move |x| {
            x.y > 0.1 - 1e-9 && x.x > first - 1e-9 && x.x < first + 0.0125 + 1e-9
        })
    };
    let handles = [held(0.025), held(0.0625)];
    let paper = Material {
        young: 4e7,
        poisson: 0.3,
        thickness: 1.5e-4,
        density: 1000.0,
    };
    let config = BodyConfig {
        mass_damping: 0.6,
        stiffness_damping: 4e-4,
        ..quiet()
    };
    let mut body = Body::sheet(&mesh, &[paper], config, &handles).unwrap();
    let options = StepperOptions {
        max_iterations: 1000,
        ..StepperOptions::default()
    };
    let mut stepper = Stepper::<f64>::new(&body, options).unwrap();
    stepper.keep_ledger(true);
    let mut poses = rest_poses(&handles);
    let (mut supplied, mut guarded) = (0.0, 0.0);
    for step in 0..20 {
        for pose in &mut poses {
            // Out of the plane by almost half an edge in a step. The linearized sheet does not resist this motion.
            pose.position.z += 5e-3;
        }
        stepper.step(&mut body, 8e-3, &poses, || false).unwrap();
        let ledger = stepper.ledger().unwrap();
        // The work is that of the forces at the end if the guard acted.
        supplied += ledger.supplied;
        guarded += ledger.guard.abs();
        let found = energy(&body);
        assert!(found <= supplied, "step {step}: {found} J of {supplied} J");
        // Rounding.
        let missing = ledger.missing().abs();
        assert!(missing < 1e-12 * ledger.turnover(), "{ledger:?}");
    }
    // If no step were solved again, this test would show nothing.
    assert!(guarded > 0.0);
}

#[test]
fn ordinary_motion_is_left_alone() {
    let solid = cube(2, 0.2, false);
    for law in BENT {
        let mut body = Body::solid(&solid, &[jelly(0.3)], law, quiet(), &[]).unwrap();
        // The strains are a few hundredths. A step is a hundredth of the time in which sound crosses the body.
        kick(&mut body, 0.5);
        let mut integrator = tr_bdf2(&body);
        for step in 0..200 {
            let report = integrator.step(&mut body, 1e-3, &[]).unwrap();
            assert_eq!(report.damped, 0, "{law:?}, step {step}");
        }
    }
    let mesh = grid(6, 6, 1.0, 1.0, Split::Alternating);
    let mut body = Body::sheet(&mesh, &[membrane(1e5)], quiet(), &[]).unwrap();
    kick(&mut body, 0.5);
    for step in 0..200 {
        let report = body.step(1e-3, &[]).unwrap();
        assert_eq!(report.held_back, 0.0, "step {step}");
    }
}
