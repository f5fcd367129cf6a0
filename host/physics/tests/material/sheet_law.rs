//! Laws of sheets compared with the theory of elasticity: derivatives, rotations, off-axis moduli, the limit of
//! stability, and extreme gradients.

use common::Random;
use nalgebra::{Matrix3, Rotation3, SMatrix, Vector3};
use physics::material::sheet_law::{
    CorotationalSheet, PlaneStiffness, SheetLaw, SheetModulus, StVenantKirchhoffSheet,
};
use physics::{Tangent, Vec3};
use proptest::prelude::*;

// A cloth similar to cotton: its warp is stiff, its weft softer, and it hardly resists shear (Pa). It is half a
// millimetre thick.
const E1: f64 = 40e6;
const E2: f64 = 12e6;
const NU: f64 = 0.4;
const G: f64 = 1e6;
const THICKNESS: f64 = 5e-4;

fn cloth() -> PlaneStiffness {
    PlaneStiffness::orthotropic(E1, E2, NU, G, THICKNESS).unwrap()
}

/// A random positive definite stiffness of order 1 N/m, in a frame whose axes are not those of the stiffness.
fn some_stiffness(random: &mut Random) -> PlaneStiffness {
    let mut between = |low: f64, high: f64| low + (high - low) * 0.5 * (random.signed() + 1.0);
    let (warp, weft) = (between(0.5, 2.0), between(0.1, 1.0));
    let poisson = 0.8 * (warp / weft).sqrt() * between(-1.0, 1.0);
    PlaneStiffness::orthotropic(warp, weft, poisson, between(0.02, 0.8), 1.0)
        .unwrap()
        .rotated(between(-3.0, 3.0))
}

/// The largest and the smallest stretch of `f`.
fn stretches(f: &[Vec3; 2]) -> [f64; 2] {
    let values = SMatrix::<f64, 3, 2>::from_columns(f).singular_values();
    [values.max(), values.min()]
}

/// A random gradient with stretches between 0.3 and 2.5, in tension and compression, with a random rotation.
fn some_gradient(random: &mut Random) -> [Vec3; 2] {
    loop {
        let f = [random.vector() * 2.0, random.vector() * 2.0];
        let [large, small] = stretches(&f);
        if small > 0.3 && large < 2.5 {
            return f;
        }
    }
}

/// The modulus as a matrix over (column of F, entry).
fn dense(modulus: &SheetModulus) -> SMatrix<f64, 6, 6> {
    SMatrix::from_fn(|a, b| modulus[a / 3][b / 3][(a % 3, b % 3)])
}

fn smallest_eigenvalue<const N: usize>(matrix: &SMatrix<f64, N, N>) -> f64
where
    nalgebra::Const<N>: nalgebra::DimSub<nalgebra::U1>,
    nalgebra::DefaultAllocator:
        nalgebra::allocator::Allocator<nalgebra::DimDiff<nalgebra::Const<N>, nalgebra::U1>>,
{
    matrix.symmetric_eigenvalues().min()
}

fn stress_is_the_gradient_of_energy_and_the_modulus_that_of_stress<L: SheetLaw>(seed: u64) {
    let (law, mut random) = (L::default(), Random(seed));
    let d = some_stiffness(&mut random);
    let f = some_gradient(&mut random);
    let response = law.respond(&d, &f, Tangent::Exact);
    assert_eq!(response.stress, law.stress(&d, &f));
    let exact = dense(&response.modulus);
    let scale = exact.norm();
    assert!((exact - exact.transpose()).norm() < 1e-14 * scale);
    // The numbers are of order one. The truncation error of central differences is step^2 = 1e-10 times third
    // derivatives (up to about 1 / 0.3^2), and the rounding error is 1e-16 / step = 1e-11.
    let step = 1e-5;
    for l in 0..2 {
        for k in 0..3 {
            let moved = |by: f64| {
                let mut f = f;
                f[l][k] += by;
                f
            };
            let (plus, minus) = (moved(step), moved(-step));
            let slope = (law.energy(&d, &plus) - law.energy(&d, &minus)) / (2.0 * step);
            assert!((slope - response.stress[l][k]).abs() < 1e-7 * scale);
            let (plus, minus) = (law.stress(&d, &plus), law.stress(&d, &minus));
            for j in 0..2 {
                let slope = (plus[j] - minus[j]) / (2.0 * step);
                let column = response.modulus[j][l].column(k).into_owned();
                assert!((slope - column).norm() < 1e-7 * scale, "{slope} {column}");
            }
        }
    }
}

/// Whether the exact modulus was positive semidefinite.
fn the_clipped_modulus_is_the_positive_part<L: SheetLaw>(seed: u64) -> bool {
    let (law, mut random) = (L::default(), Random(seed));
    let d = some_stiffness(&mut random);
    let f = some_gradient(&mut random);
    let exact = dense(&law.respond(&d, &f, Tangent::Exact).modulus);
    let clipped = dense(&law.respond(&d, &f, Tangent::Clipped).modulus);
    let eigen = exact.symmetric_eigen();
    let positive = eigen.eigenvalues.map(|value| value.max(0.0));
    let part =
        eigen.eigenvectors * SMatrix::from_diagonal(&positive) * eigen.eigenvectors.transpose();
    // The eigenvalue problem rounds, and so do the terms under U^-1, up to 1 / 0.3.
    let rounding = 1e-13 * exact.norm();
    assert!((clipped - part).norm() < rounding, "{clipped} {part}");
    assert!((clipped - clipped.transpose()).norm() < rounding);
    assert!(smallest_eigenvalue(&clipped) > -rounding);
    eigen.eigenvalues.min() >= 0.0
}

fn turning_the_body_turns_the_stress<L: SheetLaw>(seed: u64) {
    let (law, mut random) = (L::default(), Random(seed));
    let d = some_stiffness(&mut random);
    let f = some_gradient(&mut random);
    let turn = Rotation3::new(random.vector() * 3.0).into_inner();
    let turned = f.map(|column| turn * column);
    let (energy, scale) = (
        law.energy(&d, &f),
        dense(&law.respond(&d, &f, Tangent::Exact).modulus).norm(),
    );
    // The error is the rounding of products of numbers up to 2.5^3.
    assert!((law.energy(&d, &turned) - energy).abs() < 1e-13 * scale);
    for tangent in [Tangent::Exact, Tangent::Clipped] {
        let (here, there) = (
            law.respond(&d, &f, tangent),
            law.respond(&d, &turned, tangent),
        );
        for j in 0..2 {
            assert!((turn * here.stress[j] - there.stress[j]).norm() < 1e-13 * scale);
            for l in 0..2 {
                let expected = turn * here.modulus[j][l] * turn.transpose();
                assert!((expected - there.modulus[j][l]).norm() < 1e-13 * scale);
            }
        }
    }
    // The other frame describes the same cloth along axes that are turned in the plane.
    let angle = 3.0 * random.signed();
    let (s, c) = angle.sin_cos();
    let seen = [f[0] * c + f[1] * s, f[1] * c - f[0] * s];
    assert!((law.energy(&d.rotated(angle), &seen) - energy).abs() < 1e-13 * scale);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn stress_and_modulus_are_derivatives(seed in any::<u64>()) {
        stress_is_the_gradient_of_energy_and_the_modulus_that_of_stress::<CorotationalSheet>(seed);
        stress_is_the_gradient_of_energy_and_the_modulus_that_of_stress::<StVenantKirchhoffSheet>(seed);
    }

    #[test]
    fn laws_are_objective(seed in any::<u64>()) {
        turning_the_body_turns_the_stress::<CorotationalSheet>(seed);
        turning_the_body_turns_the_stress::<StVenantKirchhoffSheet>(seed);
    }
}

#[test]
fn clipping_leaves_the_positive_part() {
    let count = |check: fn(u64) -> bool| (0..500).filter(|&seed| check(seed)).count();
    // The test is valid only if both kinds of state occur.
    for definite in [
        count(the_clipped_modulus_is_the_positive_part::<CorotationalSheet>),
        count(the_clipped_modulus_is_the_positive_part::<StVenantKirchhoffSheet>),
    ] {
        assert!((20..480).contains(&definite), "{definite}");
    }
}

/// The strain along the pull, per stress resultant, of a cloth that is pulled at `angle` to its warp, computed by
/// Newton's method on the law alone.
fn compliance<L: SheetLaw>(d: &PlaneStiffness, angle: f64, pull: f64) -> f64 {
    let law = L::default();
    let (s, c) = angle.sin_cos();
    let pulled = [c * c * pull, s * s * pull, s * c * pull];
    // F is symmetric in the plane, with the entries 11, 22 and 12. P is then symmetric up to the square of the strain.
    let gradient = |u: &Vector3<f64>| {
        [
            Vec3::new(1.0 + u[0], u[2], 0.0),
            Vec3::new(u[2], 1.0 + u[1], 0.0),
        ]
    };
    let mut u = Vector3::zeros();
    for _ in 0..8 {
        let response = law.respond(d, &gradient(&u), Tangent::Exact);
        let (p, m) = (response.stress, response.modulus);
        let residual = Vector3::new(
            p[0].x - pulled[0],
            p[1].y - pulled[1],
            0.5 * (p[0].y + p[1].x) - pulled[2],
        );
        // The rows are P_11, P_22 and the mean of P_21 and P_12. The columns are u_11, u_22, and u_12 = u_21.
        let row = |j: usize, i: usize| {
            Vector3::new(
                m[j][0][(i, 0)],
                m[j][1][(i, 1)],
                m[j][0][(i, 1)] + m[j][1][(i, 0)],
            )
        };
        let shear = (row(0, 1) + row(1, 0)) * 0.5;
        let tangent = Matrix3::from_rows(&[
            row(0, 0).transpose(),
            row(1, 1).transpose(),
            shear.transpose(),
        ]);
        u -= tangent.lu().solve(&residual).unwrap();
    }
    (c * c * u[0] + s * s * u[1] + 2.0 * s * c * u[2]) / pull
}

#[test]
fn the_modulus_off_axis_is_that_of_the_textbook() {
    // Jones, section 2.6: 1/E = cos^4/E1 + sin^4/E2 + (1/G - 2 nu12/E1) sin^2 cos^2.
    let d = cloth();
    // The strains are 1e-7, so large strains cause errors of that order, and rounding causes errors of 1e-9.
    let pull = 1e-7 * G * THICKNESS;
    for degrees in 0..=18 {
        let angle = f64::from(5 * degrees).to_radians();
        let (s, c) = angle.sin_cos();
        let expected =
            c.powi(4) / E1 + s.powi(4) / E2 + (1.0 / G - 2.0 * NU / E1) * (s * c).powi(2);
        for found in [
            compliance::<CorotationalSheet>(&d, angle, pull),
            compliance::<StVenantKirchhoffSheet>(&d, angle, pull),
            // The third case pulls along the first axis of a frame that is turned instead.
            compliance::<CorotationalSheet>(&d.rotated(angle), 0.0, pull),
        ] {
            let error = found * THICKNESS / expected - 1.0;
            // The required accuracy is 1e-5.
            assert!(error.abs() < 1e-6, "{degrees}: {error:e}");
        }
    }
}

/// The smallest eigenvalue at one stretch along the warp and one across it, in units of that in shear.
fn smallest<L: SheetLaw>(d: &PlaneStiffness, along: f64, across: f64) -> f64 {
    let f = [Vec3::x() * along, Vec3::y() * across];
    let response = L::default().respond(d, &f, Tangent::Exact);
    smallest_eigenvalue(&dense(&response.modulus)) / d.matrix()[2][2]
}

#[test]
fn under_tension_only_the_corotational_cloth_loses_its_stability_at_the_stated_strain() {
    let d = cloth();
    // The cloth is pulled along the warp and free across it. No force then resists a slope out of the plane across the
    // pull, so that one eigenvalue is 0, up to the rounding of E / G = 40.
    let corotational =
        |strain: f64| smallest::<CorotationalSheet>(&d, 1.0 + strain, 1.0 - NU * strain);
    let critical = 4.0 * G / (E1 - 4.0 * G);
    assert!(corotational(0.999 * critical) > -1e-12);
    assert!(corotational(1.001 * critical) < -1e-5);
    for strain in [0.01, 0.1, 0.3] {
        // The cloth contracts less than a free cloth would, so it is taut in both directions.
        let across = (1.0 - 0.9 * NU * strain * (2.0 + strain)).sqrt();
        assert!(smallest::<StVenantKirchhoffSheet>(&d, 1.0 + strain, across) > 1e-6);
    }
}

fn any_gradient_gives_numbers<L: SheetLaw>() {
    let law = L::default();
    let (x, y) = (Vec3::x(), Vec3::y());
    let d = cloth().rotated(0.4);
    let diagonal = Vec3::new(1.0, 1.0, 1.0);
    let mut states = vec![
        // The gradient is collapsed to a point, collapsed to lines (stretched and not stretched), turned over, skewed,
        // and collapsed nearly to a line.
        [Vec3::zeros(); 2],
        [x, Vec3::zeros()],
        [Vec3::zeros(), y * 3.0],
        [diagonal, diagonal],
        [diagonal, -2.0 * diagonal],
        [-x, y],
        [x, y * 20.0 + x],
        [x * 5.0, x * 5.0 + y * 1e-15],
        [x, x + y * 1e-9],
        [x * 0.011, y * 0.009],
    ];
    let mut random = Random(31);
    for _ in 0..200 {
        let size = |random: &mut Random| 10.0_f64.powf(300.0 * random.signed());
        let (a, b) = (size(&mut random), size(&mut random));
        states.push([random.vector() * a, random.vector() * b]);
        let line = random.vector() * a.min(1e150);
        states.push([line, line * random.signed()]);
    }
    for exponent in [-320, -300, -160, -100, -99, -60, -8, 8, 60, 100, 160, 300] {
        let size = 10.0_f64.powi(exponent);
        states.push([x * size, y * size]);
        states.push([diagonal * size, y * size]);
        states.push([diagonal * size, diagonal * size]);
    }
    states.push([Vec3::repeat(f64::MAX), Vec3::new(f64::MAX, -f64::MAX, 0.0)]);
    for f in states {
        assert!(law.energy(&d, &f).is_finite(), "{f:?}");
        assert!(law.energy(&d, &f) >= 0.0, "{f:?}");
        assert!(law.stress(&d, &f).iter().all(finite), "{f:?}");
        for tangent in [Tangent::Exact, Tangent::Clipped] {
            let response = law.respond(&d, &f, tangent);
            assert!(response.stress.iter().all(finite), "{f:?}");
            let modulus = dense(&response.modulus);
            assert!(modulus.iter().all(|k| k.is_finite()), "{f:?}");
            // The matrix is scaled first, because the eigenvalue routine squares its entries. The tolerance is the
            // rounding of that routine. A St. Venant-Kirchhoff sheet that is collapsed to a point has no stiffness left
            // after clipping.
            let modulus = modulus / modulus.amax().max(f64::MIN_POSITIVE);
            assert!((modulus - modulus.transpose()).amax() < 1e-13, "{f:?}");
            if tangent == Tangent::Clipped {
                assert!(smallest_eigenvalue(&modulus) > -1e-13, "{f:?} {modulus}");
            }
        }
    }
}

fn finite(v: &Vec3) -> bool {
    v.iter().all(|x| x.is_finite())
}

#[test]
fn every_gradient_gives_finite_numbers() {
    any_gradient_gives_numbers::<CorotationalSheet>();
    any_gradient_gives_numbers::<StVenantKirchhoffSheet>();
}

#[test]
fn a_crushed_corotational_sheet_is_no_stiffer_than_its_floor_allows() {
    // The floor allows a division to add at most 1 / 0.01 to moduli of order one.
    let d = PlaneStiffness::orthotropic(1.0, 1.0, 0.3, 0.5 / 1.3, 1.0).unwrap();
    let mut random = Random(2);
    for _ in 0..1000 {
        let f = [random.vector() * 1e-3, random.vector() * 1e-3];
        let exact = dense(&CorotationalSheet.respond(&d, &f, Tangent::Exact).modulus);
        assert!(exact.norm() < 1e3, "{exact}");
    }
}
