//! The limits by rounding: bodies so stiff, loads so small or positions so far away that digits run out. A problem that
//! can be solved is solved. A problem that cannot be solved is reported as unsolved.

use common::{Split, cube, grid, handle, rest_poses};
use physics::{
    Body, BodyConfig, Equilibrium, EquilibriumOptions, EquilibriumReport, Freedom, Integrator,
    IntegratorOptions, Material, NewtonOptions, SolidLaw, SolidMaterial, StepError, TimeScheme,
    Vec3,
};

/// The edge of the block (m).
const EDGE: f64 = 0.1;
/// The distance by which a body may be moved (m).
const FAR: f64 = 1000.0;
const STEEL: SolidMaterial = SolidMaterial {
    young: 2.1e11,
    poisson: 0.3,
    density: 7850.0,
};

fn weightless() -> BodyConfig {
    BodyConfig {
        gravity: Vec3::zeros(),
        ..BodyConfig::default()
    }
}

/// A steel block whose lower face is fixed, moved by `off`. A force (N) along x is distributed over its upper face. The
/// function also returns the displacements of the vertices (m).
fn block(
    law: SolidLaw,
    off: f64,
    force: f64,
    tolerance: f64,
) -> Result<(Vec<Vec3>, EquilibriumReport), StepError> {
    let mut mesh = cube(4, 0.0, false);
    for x in &mut mesh.positions {
        *x *= EDGE;
    }
    let level = |at: f64| -> Vec<u32> {
        let numbered = (0_u32..).zip(&mesh.positions);
        let here = numbered.filter(|(_, x)| (x.z - at).abs() < 1e-9);
        here.map(|(vertex, _)| vertex).collect()
    };
    let (below, above) = (level(0.0), level(EDGE));
    for x in &mut mesh.positions {
        x.x += off;
    }
    let mut body = Body::solid(&mesh, &[STEEL], law, weightless(), &[]).unwrap();
    body.add_support(&below, [true; 3]).unwrap();
    let mut forces = vec![Vec3::zeros(); mesh.positions.len()];
    for &vertex in &above {
        forces[vertex as usize] = Vec3::x() * (force / above.len() as f64);
    }
    body.set_external_forces(&forces).unwrap();
    let options = EquilibriumOptions {
        newton: NewtonOptions {
            tolerance,
            ..NewtonOptions::default()
        },
        ..EquilibriumOptions::default()
    };
    let report = Equilibrium::new(&body, options)
        .unwrap()
        .solve(&mut body, &[], 1.0)?;
    let moved = body.positions().zip(&mesh.positions);
    Ok((moved.map(|(now, rest)| now - rest).collect(), report))
}

fn norm(moved: &[Vec3]) -> f64 {
    moved.iter().map(Vec3::norm_squared).sum::<f64>().sqrt()
}

fn distance(a: &[Vec3], b: &[Vec3]) -> f64 {
    let difference: Vec<Vec3> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    norm(&difference)
}

#[test]
fn a_steel_block_moves_under_a_tenth_of_a_millinewton() {
    // The displacement of a linear body is proportional to the force: 1 N has ten thousand times the digits of 1e-4 N.
    let (large, _) = block(SolidLaw::Linear, 0.0, 1.0, 1e-9).unwrap();
    for law in [
        SolidLaw::Linear,
        SolidLaw::Corotational,
        SolidLaw::StVenantKirchhoff,
        SolidLaw::StableNeoHookean,
    ] {
        for force in [1.0, 1e-2, 1e-4] {
            let (moved, report) = block(law, 0.0, force, 1e-9).unwrap();
            let expected: Vec<Vec3> = large.iter().map(|u| u * force).collect();
            let error = distance(&moved, &expected) / norm(&expected);
            println!(
                "{law:?} {force} N: moved {:.3e} m, error {error:.2e}, residual {:.2e}, rounded {}, open {:.1e} m",
                moved.iter().map(Vec3::norm).fold(0.0, f64::max),
                report.last.residual / report.last.reference,
                report.last.rounded,
                report.last.open,
            );
            // Strains are known to 1.1e-16 of one, and 1e-4 N strains the block by 1e-4 N / (E A) = 4.8e-14: an error
            // of 0.23 %. Positions of up to 0.1 m are known to 0.7e-17 m of 1.5e-14 m. The tolerance is three times
            // both errors.
            let digits = 1e-2 * (1e-4 / force);
            assert!(error < digits.max(1e-7), "{law:?} {force} N: {error:e}");
        }
    }
}

#[test]
fn a_load_below_rounding_is_not_reported_as_balanced() {
    for (off, force) in [(0.0, 1e-8), (FAR, 1e-4), (FAR, 1e-2)] {
        for law in [SolidLaw::Linear, SolidLaw::StableNeoHookean] {
            let error = block(law, off, force, 1e-9).unwrap_err();
            println!("{off} m, {force} N: {error}");
            assert!(matches!(error, StepError::Rounding { .. }), "{error}");
            let advice = if off > 0.0 {
                "nearer to the origin"
            } else {
                "larger loads"
            };
            assert!(error.to_string().contains(advice), "{error}");
        }
    }
    // At a distance of a kilometre, 1 MN moves the block by 1e-4 m, which has nine digits.
    let (near, _) = block(SolidLaw::Linear, 0.0, 1e6, 1e-9).unwrap();
    let (far, _) = block(SolidLaw::Linear, FAR, 1e6, 1e-9).unwrap();
    // The rest shape itself is rounded to 1e-13 m, with grid cells of 25 mm.
    assert!(distance(&near, &far) < 1e-9 * norm(&near));
}

#[test]
fn a_motion_without_digits_is_distinguished_from_a_gentle_start() {
    for (force, enough) in [(1.0, true), (1e-10, false)] {
        let mut mesh = cube(2, 0.0, false);
        for x in &mut mesh.positions {
            *x *= EDGE;
        }
        let law = SolidLaw::StableNeoHookean;
        let config = BodyConfig {
            stiffness_damping: 1e-5,
            ..weightless()
        };
        let mut body = Body::solid(&mesh, &[STEEL], law, config, &[]).unwrap();
        let numbered = (0_u32..).zip(&mesh.positions);
        let below: Vec<u32> = numbered
            .filter(|(_, x)| x.z == 0.0)
            .map(|(v, _)| v)
            .collect();
        body.add_support(&below, [true; 3]).unwrap();
        let options = IntegratorOptions {
            scheme: TimeScheme::TrBdf2,
            ..IntegratorOptions::default()
        };
        let mut integrator = Integrator::new(&body, options).unwrap();
        for step in 1..=50 {
            let fraction = (f64::from(step) / 50.0).powi(3);
            let forces: Vec<Vec3> = mesh
                .positions
                .iter()
                .map(|x| Vec3::x() * (x.z * force * fraction))
                .collect();
            integrator
                .step_loaded(&mut body, 1e-6, &[], &forces)
                .unwrap();
        }
        let found = integrator.check_digits(&body);
        println!("{force} N: {found:?}");
        assert_eq!(found.is_ok(), enough, "{found:?}");
    }
}

/// A strip of 0.2 m by 0.05 m. Its end is pulled by a tenth and turned sideways. The function returns positions less
/// `off`.
fn strip(off: f64, scheme: Option<TimeScheme>) -> Vec<Vec3> {
    let mut mesh = grid(8, 2, 0.2, 0.05, Split::Right);
    let ends = [
        handle(&mesh, Freedom::Rigid, |x| x.x < 1e-9),
        handle(&mesh, Freedom::Rigid, |x| x.x > 0.2 - 1e-9),
    ];
    let off = Vec3::new(off, -off, 0.0);
    for x in &mut mesh.positions {
        *x += off;
    }
    let ends = ends.map(|mut end| {
        end.origin += off;
        end
    });
    let rubber = Material {
        young: 1e6,
        poisson: 0.3,
        thickness: 1e-3,
        density: 1000.0,
    };
    let config = BodyConfig {
        bending: 1.0,
        ..BodyConfig::default()
    };
    let mut body = Body::sheet(&mesh, &[rubber], config, &ends).unwrap();
    let mut targets = rest_poses(&ends);
    let displacement = Vec3::new(0.02, 0.01, 0.0);
    if let Some(scheme) = scheme {
        let options = IntegratorOptions {
            scheme,
            ..IntegratorOptions::default()
        };
        let mut integrator = Integrator::new(&body, options).unwrap();
        for step in 1..=20 {
            targets[1].position = ends[1].origin + displacement * (f64::from(step) / 20.0);
            integrator.step(&mut body, 1e-3, &targets).unwrap();
        }
    } else {
        targets[1].position = ends[1].origin + displacement;
        let mut equilibrium = Equilibrium::new(&body, EquilibriumOptions::default()).unwrap();
        equilibrium.solve(&mut body, &targets, 1.0).unwrap();
    }
    body.positions().map(|x| x - off).collect()
}

#[test]
fn a_strip_a_kilometre_away_deforms_as_at_the_origin() {
    for scheme in [
        None,
        Some(TimeScheme::ImplicitEuler),
        Some(TimeScheme::TrBdf2),
    ] {
        let (near, far) = (strip(0.0, scheme), strip(FAR, scheme));
        let rest = grid(8, 2, 0.2, 0.05, Split::Right).positions;
        let error = distance(&near, &far) / distance(&near, &rest);
        println!("{scheme:?}: {error:.2e}");
        // The coordinates are kept to 1.1e-13 m / 2, and the strip moves by 0.02 m: 3e-12. The sheet bends a thousand
        // times as easily as it stretches, so that strains of rounding displace it sideways by as much again.
        assert!(error < 3e-9, "{scheme:?}: {error:e}");
    }
}

#[test]
fn tiny_steps_are_not_halved_for_rounding() {
    for beta in [0.0, 0.01] {
        for scheme in [TimeScheme::ImplicitEuler, TimeScheme::TrBdf2] {
            let config = BodyConfig {
                stiffness_damping: beta,
                ..BodyConfig::default()
            };
            let material = SolidMaterial {
                young: 1e4,
                poisson: 0.3,
                density: 1000.0,
            };
            let mesh = cube(2, 0.2, false);
            let mut body =
                Body::solid(&mesh, &[material], SolidLaw::StableNeoHookean, config, &[]).unwrap();
            let kick: Vec<Vec3> = mesh.positions.iter().map(|x| x * 0.1).collect();
            body.set_velocities(&kick).unwrap();
            let options = IntegratorOptions {
                scheme,
                newton: NewtonOptions {
                    tolerance: 1e-10,
                    ..NewtonOptions::default()
                },
                ..IntegratorOptions::default()
            };
            let mut integrator = Integrator::new(&body, options).unwrap();
            for h in [1e-3, 1e-5, 1e-7] {
                for _ in 0..20 {
                    let report = integrator.step(&mut body, h, &[]).unwrap();
                    assert_eq!(report.refused, 0, "beta {beta}, {scheme:?}, {h} s");
                }
            }
        }
    }
}
