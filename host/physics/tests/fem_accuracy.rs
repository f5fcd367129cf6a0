//! Solids against solutions of elasticity: manufactured, of beams, and near incompressibility.

mod fem_support;

use core::f64::consts::PI;
use fem_support::{block, cube};
use physics::fem::law::Lame;
use physics::fem::load::traction;
use physics::fem::shape::{Shape, Tet4, Tet10};
use physics::fem::{Body, BodyConfig, Equilibrium, EquilibriumOptions, SolidLaw, SolidMaterial};
use physics::mesh::{Cells, TetMesh};
use physics::{Mat3, Vec3};

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

/// Displacements at equilibrium under `forces`, with `fixed` vertices held.
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

/// The manufactured displacement (small, so that no cell turns over), zero on the cube's surface: `c sin(pi x) sin(pi y) sin(pi z)`.
const DIRECTION: Vec3 = Vec3::new(1e-3, -0.5e-3, 0.7e-3);

fn bump(at: &Vec3) -> f64 {
    at.iter().map(|c| (PI * c).sin()).product()
}

/// `-div sigma` of it: `-(lambda + mu) grad div u - mu laplacian u`.
fn body_force(lame: Lame, at: &Vec3) -> Vec3 {
    let (s, c) = (at.map(|c| (PI * c).sin()), at.map(|c| (PI * c).cos()));
    let second = Mat3::from_fn(|i, j| {
        if i == j {
            return -bump(at);
        }
        let k = 3 - i - j;
        c[i] * c[j] * s[k]
    }) * (PI * PI);
    -(second * DIRECTION * (lame.lambda + lame.mu) + DIRECTION * (lame.mu * second.trace()))
}

/// Points of a rule of degree 7 on the reference tetrahedron: Gauss-Legendre points of a cube, collapsed
/// (Duffy). Weights include the map.
fn fine_rule() -> Vec<(Vec3, f64)> {
    let (a, b) = (
        (3.0_f64 / 7.0 - 2.0 / 7.0 * (6.0_f64 / 5.0).sqrt()).sqrt(),
        (3.0_f64 / 7.0 + 2.0 / 7.0 * (6.0_f64 / 5.0).sqrt()).sqrt(),
    );
    let (wa, wb) = (
        (18.0 + 30.0_f64.sqrt()) / 36.0,
        (18.0 - 30.0_f64.sqrt()) / 36.0,
    );
    let line = [(-b, wb), (-a, wa), (a, wa), (b, wb)].map(|(x, w)| (0.5 * (x + 1.0), 0.5 * w));
    let mut rule = Vec::new();
    for (u, wu) in line {
        for (v, wv) in line {
            for (w, ww) in line {
                let at = Vec3::new(u, v * (1.0 - u), w * (1.0 - u) * (1.0 - v));
                rule.push((at, wu * wv * ww * (1.0 - u) * (1.0 - u) * (1.0 - v)));
            }
        }
    }
    rule
}

/// Error of the finite elements in the mean square over the cube.
fn manufactured<const N: usize, const Q: usize, S: Shape<N, Q>>(n: usize) -> f64 {
    let mesh = cube(n, 0.0, N == 10);
    let material = SolidMaterial {
        young: 1.0,
        poisson: 0.3,
        density: 1.0,
    };
    let lame = Lame::new(material.young, material.poisson);
    let rule = fine_rule();
    let cells: Vec<&[u32]> = mesh.cells.vertices().collect();
    let place = |cell: &[u32], at: &Vec3| -> (Vec3, [f64; N]) {
        let values = S::values(at);
        let x = cell
            .iter()
            .zip(values)
            .map(|(&v, w)| mesh.positions[v as usize] * w)
            .sum();
        (x, values)
    };
    // Every cell of the split has a sixth of a cube's cell: its Jacobian is 6 times that.
    let jacobian = (1.0 / n as f64).powi(3);
    let mut forces = vec![Vec3::zeros(); mesh.positions.len()];
    for cell in &cells {
        for (at, weight) in &rule {
            let (x, values) = place(cell, at);
            for (&vertex, value) in cell.iter().zip(values) {
                forces[vertex as usize] += body_force(lame, &x) * (value * weight * jacobian);
            }
        }
    }
    let fixed = vertices(&mesh, |x| x.iter().any(|c| *c < 1e-9 || *c > 1.0 - 1e-9));
    let u = displaced(&mesh, SolidLaw::Linear, material, &fixed, &forces, 1);
    let mut error = 0.0;
    for cell in &cells {
        for (at, weight) in &rule {
            let (x, values) = place(cell, at);
            let found: Vec3 = cell
                .iter()
                .zip(values)
                .map(|(&v, w)| u[v as usize] * w)
                .sum();
            error += (found - DIRECTION * bump(&x)).norm_squared() * weight * jacobian;
        }
    }
    error.sqrt()
}

#[test]
fn errors_fall_with_the_square_and_the_cube_of_the_element() {
    let linear = (manufactured::<4, 1, Tet4>(8) / manufactured::<4, 1, Tet4>(16)).log2();
    let quadratic = (manufactured::<10, 4, Tet10>(4) / manufactured::<10, 4, Tet10>(8)).log2();
    println!("slopes: linear {linear:.3}, quadratic {quadratic:.3}");
    assert!((linear - 2.0).abs() < 0.1, "{linear}");
    assert!((quadratic - 3.0).abs() < 0.1, "{quadratic}");
}

/// A beam along x, 1 m long with a square section of edge `thick`, one end held, its other end pulled down
/// by `force`: mean displacement of the free end.
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
        // Cowper's coefficient for a rectangle.
        let kappa = 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson);
        let expected = force / (3.0 * 1e6 * inertia) + force / (kappa * shear * thick * thick);
        let found = -cantilever(SolidLaw::Linear, thick, poisson, force, [20, 2, 2]).z;
        println!("nu {poisson}: {found:.6e} m, Timoshenko {expected:.6e} m");
        // The held end may not contract sideways, which the beam does not know: of the order of nu^2 times
        // the thickness over the length.
        let tolerance = 0.003 + 0.1 * poisson * poisson;
        assert!(
            (found / expected - 1.0).abs() < tolerance,
            "{found} {expected}"
        );
    }
}

#[test]
fn a_cantilever_under_large_loads_bends_as_the_elastica() {
    // Mattiasson, "Numerical results from large deflection beam and frame problems analysed by means of
    // elliptic integrals", 1981: deflection and shortening at P L^2 / (E I) = 1, 2, 5.
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
            // The elastica neither shears nor stretches: of the order of the slenderness squared, 4e-4; and
            // straight-edged elements bend through 2 degrees each.
            assert!((-u.z - down).abs() < 2e-3, "{law:?} {load} {u}");
            assert!((-u.x - back).abs() < 2e-3, "{law:?} {load} {u}");
        }
    }
}

#[test]
fn near_incompressibility_locks_linear_elements_and_not_quadratic_ones() {
    // The same beam, its end's deflection relative to nu = 0.3: Timoshenko's hardly changes.
    let (thick, force) = (0.1, 1e-3);
    let ratio = |quadratic: bool| {
        let deflection = |poisson: f64| {
            let mut mesh = block([20, 2, 2], 0.0, quadratic);
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
            let (forces, _) = traction(&mesh, &end, Vec3::z() * (-force / (thick * thick)));
            let u = displaced(&mesh, SolidLaw::Linear, material, &fixed, &forces, 1);
            end.iter().map(|&v| u[v as usize].z).sum::<f64>()
        };
        deflection(0.4999) / deflection(0.3)
    };
    let (linear, quadratic) = (ratio(false), ratio(true));
    println!(
        "deflection at nu 0.4999 over that at 0.3: linear {linear:.3}, quadratic {quadratic:.3}"
    );
    assert!(linear < 0.5, "linear tetrahedra lock: {linear}");
    // The held end, which may not contract, costs a share of the order of nu^2 times the slenderness.
    assert!(quadratic > 0.9, "quadratic ones do not: {quadratic}");
}

#[test]
fn cells_of_both_kinds_say_what_they_are() {
    assert!(matches!(cube(1, 0.0, false).cells, Cells::Linear(cells) if cells.len() == 6));
    assert!(matches!(cube(1, 0.0, true).cells, Cells::Quadratic(cells) if cells.len() == 6));
}
