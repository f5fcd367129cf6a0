//! Solids compared with solutions of beams. `palpate bench accuracy` has more such comparisons, by mesh and order, and
//! its study has its own tests.

use common::{block, cube};
use physics::body::load::traction;
use physics::mesh::{Cells, TetMesh};
use physics::{Body, BodyConfig, Equilibrium, EquilibriumOptions, SolidLaw, SolidMaterial, Vec3};

fn weightless() -> BodyConfig {
    BodyConfig {
        gravity: Vec3::zeros(),
        ..BodyConfig::default()
    }
}

fn vertices(mesh: &TetMesh, chosen: impl Fn(&Vec3) -> bool) -> Vec<u32> {
    let numbered = (0_u32..).zip(&mesh.positions);
    numbered
        .filter(|(_, x)| chosen(x))
        .map(|(vertex, _)| vertex)
        .collect()
}

/// The displacements at equilibrium under `forces`. The vertices `fixed` are held.
fn displaced(
    mesh: &TetMesh,
    law: SolidLaw,
    material: SolidMaterial,
    fixed: &[u32],
    forces: &[Vec3],
    load_steps: u32,
) -> Vec<Vec3> {
    let mut body = Body::solid(mesh, &[material], law, weightless(), &[]).unwrap();
    body.add_support(fixed, [true; 3]).unwrap();
    body.set_external_forces(forces).unwrap();
    body.set_load_factor(0.0).unwrap();
    let options = EquilibriumOptions {
        load_steps,
        ..EquilibriumOptions::default()
    };
    Equilibrium::new(&body, options)
        .unwrap()
        .solve(&mut body, &[], 1.0)
        .unwrap();
    body.positions()
        .zip(&mesh.positions)
        .map(|(x, rest)| x - rest)
        .collect()
}

/// A beam along x, 1 m long, with a square section of edge `thick`. One end is held, and `force` pulls the other end
/// down. The function returns the mean displacement of the free end.
fn cantilever(law: SolidLaw, thick: f64, poisson: f64, force: f64, cells: [usize; 3]) -> Vec3 {
    let mut mesh = block(cells, 0.0, true);
    for x in &mut mesh.positions {
        x.y *= thick;
        x.z *= thick;
    }
    let material = SolidMaterial {
        young: 1e6,
        poisson,
        density: 1000.0,
    };
    let end = vertices(&mesh, |x| x.x > 1.0 - 1e-9);
    let fixed = vertices(&mesh, |x| x.x < 1e-9);
    let (forces, area) = traction(&mesh, &end, Vec3::z() * (-force / (thick * thick)));
    assert!((area - thick * thick).abs() < 1e-12);
    let u = displaced(&mesh, law, material, &fixed, &forces, 4);
    end.iter().map(|&v| u[v as usize]).sum::<Vec3>() / end.len() as f64
}

#[test]
fn a_cantilever_bends_as_timoshenko_s_beam() {
    let (thick, force) = (0.1, 1e-3);
    let inertia = f64::powi(thick, 4) / 12.0;
    for poisson in [0.0, 0.3] {
        let shear = 1e6 / (2.0 * (1.0 + poisson));
        // This is Cowper's coefficient for a rectangle.
        let kappa = 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson);
        let expected = force / (3.0 * 1e6 * inertia) + force / (kappa * shear * thick * thick);
        let found = -cantilever(SolidLaw::Linear, thick, poisson, force, [20, 2, 2]).z;
        println!("nu {poisson}: {found:.6e} m, Timoshenko {expected:.6e} m");
        // The held end may not contract sideways, which the theory of beams ignores. The effect is of the order of nu^2
        // times the thickness over the length.
        let tolerance = 0.003 + 0.1 * poisson * poisson;
        assert!(
            (found / expected - 1.0).abs() < tolerance,
            "{found} {expected}"
        );
    }
}

#[test]
fn a_cantilever_under_large_loads_bends_as_the_elastica() {
    // Mattiasson, "Numerical results from large deflection beam and frame problems analysed by means of elliptic
    // integrals", 1981, lists deflection and shortening at P L^2 / (E I) = 1, 2, 5.
    let thick: f64 = 0.02;
    let inertia = thick.powi(4) / 12.0;
    for (load, down, back) in [
        (1.0, 0.30172, 0.05643),
        (2.0, 0.49346, 0.16064),
        (5.0, 0.71379, 0.38763),
    ] {
        for law in [SolidLaw::Corotational, SolidLaw::StVenantKirchhoff] {
            let u = cantilever(law, thick, 0.0, load * 1e6 * inertia, [40, 1, 1]);
            println!(
                "{law:?} {load}: {:.5} {:.5}, elastica {down} {back}",
                -u.z, -u.x
            );
            // The elastica neither shears nor stretches, an error of the order of the slenderness squared, 4e-4.
            // Elements with straight edges bend through 2 degrees each.
            assert!((-u.z - down).abs() < 2e-3, "{law:?} {load} {u}");
            assert!((-u.x - back).abs() < 2e-3, "{law:?} {load} {u}");
        }
    }
}

#[test]
fn a_generated_cube_has_cells_of_the_requested_order() {
    assert!(matches!(cube(1, 0.0, false).cells, Cells::Linear(cells) if cells.len() == 6));
    assert!(matches!(cube(1, 0.0, true).cells, Cells::Quadratic(cells) if cells.len() == 6));
}
