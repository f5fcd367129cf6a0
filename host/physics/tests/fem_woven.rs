//! Woven and St. Venant-Kirchhoff sheets against what elasticity says: derivatives, rotations, the
//! isotropic membrane, off-axis moduli, strips, and states that no cloth survives.

mod fem_support;

use fem_support::*;
use nalgebra::{Matrix3, Rotation3, SMatrix, Vector3};
use physics::Vec3;
use physics::fem::membrane::Element;
use physics::fem::sheet_law::{
    CorotationalSheet, PlaneStiffness, SheetLaw, SheetModulus, StVenantKirchhoffSheet,
};
use physics::fem::{Sheet, SheetError, Tangent, Weave, Woven};
use physics::mesh::TriMesh;
use proptest::prelude::*;

/// A cotton-like cloth: stiff warp, softer weft, and almost no resistance to shear.
fn cloth() -> Weave {
    Weave {
        warp: Vec3::x(),
        young_warp: 40e6,
        young_weft: 12e6,
        poisson: 0.4,
        shear: 1e6,
        thickness: 5e-4,
        density: 400.0,
    }
}

/// The rubber of the membrane's tests, written as a weave.
fn isotropic(poisson: f64, warp: Vec3) -> Weave {
    let rubber = rubber(poisson);
    Weave {
        warp,
        young_warp: rubber.young,
        young_weft: rubber.young,
        poisson,
        shear: rubber.shear(),
        thickness: rubber.thickness,
        density: rubber.density,
    }
}

/// Some positive definite stiffness of order 1 N/m, in a frame that is not its own.
fn some_stiffness(random: &mut Random) -> PlaneStiffness {
    let mut between = |low: f64, high: f64| low + (high - low) * 0.5 * (random.signed() + 1.0);
    let (warp, weft) = (between(0.5, 2.0), between(0.1, 1.0));
    let poisson = 0.8 * (warp / weft).sqrt() * between(-1.0, 1.0);
    PlaneStiffness::orthotropic(warp, weft, poisson, between(0.02, 0.8), 1.0)
        .unwrap()
        .rotated(between(-3.0, 3.0))
}

/// Largest and smallest stretch of `f`.
fn stretches(f: &[Vec3; 2]) -> [f64; 2] {
    let values = SMatrix::<f64, 3, 2>::from_columns(f).singular_values();
    [values.max(), values.min()]
}

/// Some gradient with stretches between 0.3 and 2.5, in tension and compression, turned somehow.
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
    // Central differences of numbers of order one: truncation is step^2 = 1e-10 times third derivatives
    // (up to about 1 / 0.3^2), rounding 1e-16 / step = 1e-11.
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
    // The eigenvalue problem's own rounding, and that of the terms under U^-1, up to 1 / 0.3.
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
    // Rounding of products of numbers up to 2.5^3.
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
    // The other frame: the same cloth, described along axes turned in the plane.
    let angle = 3.0 * random.signed();
    let (s, c) = angle.sin_cos();
    let seen = [f[0] * c + f[1] * s, f[1] * c - f[0] * s];
    assert!((law.energy(&d.rotated(angle), &seen) - energy).abs() < 1e-13 * scale);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn derivatives(seed in any::<u64>()) {
        stress_is_the_gradient_of_energy_and_the_modulus_that_of_stress::<CorotationalSheet>(seed);
        stress_is_the_gradient_of_energy_and_the_modulus_that_of_stress::<StVenantKirchhoffSheet>(seed);
    }

    #[test]
    fn objectivity(seed in any::<u64>()) {
        turning_the_body_turns_the_stress::<CorotationalSheet>(seed);
        turning_the_body_turns_the_stress::<StVenantKirchhoffSheet>(seed);
    }
}

#[test]
fn clipping_leaves_the_positive_part() {
    let count = |check: fn(u64) -> bool| (0..500).filter(|&seed| check(seed)).count();
    // Both kinds of state must occur for the test to say anything.
    for definite in [
        count(the_clipped_modulus_is_the_positive_part::<CorotationalSheet>),
        count(the_clipped_modulus_is_the_positive_part::<StVenantKirchhoffSheet>),
    ] {
        assert!((20..480).contains(&definite), "{definite}");
    }
}

/// The sheet of `mesh`, all of one material.
fn woven<L: SheetLaw>(mesh: &TriMesh, weave: &Weave) -> Woven<L> {
    let mut sheet = Woven::with_capacity(mesh.triangles.len());
    for triangle in &mesh.triangles {
        let corners = triangle.map(|vertex| &mesh.positions[vertex as usize]);
        sheet.push(*triangle, corners, weave).unwrap();
    }
    sheet
}

fn forces<L: SheetLaw>(sheet: &Woven<L>, x: &[Vec3]) -> Vec<Vec3> {
    let mut force = vec![Vec3::zeros(); x.len()];
    sheet.forces(x, &mut force);
    force
}

fn dense_element(element: &Element) -> SMatrix<f64, 9, 9> {
    SMatrix::from_fn(|i, j| element.stiffness[i / 3][j / 3][(i % 3, j % 3)])
}

/// A triangle of about a metre at rest, and a state of it with stretches between 0.3 and 2.5.
fn triangle(random: &mut Random) -> (TriMesh, Vec<Vec3>) {
    loop {
        let mesh = TriMesh {
            positions: (0..3).map(|_| random.vector()).collect(),
            triangles: vec![[0, 1, 2]],
            ..TriMesh::default()
        };
        let (e1, e2) = (
            mesh.positions[1] - mesh.positions[0],
            mesh.positions[2] - mesh.positions[0],
        );
        if e1.cross(&e2).norm() < 0.3 {
            continue;
        }
        let x: Vec<Vec3> = (0..3).map(|_| random.vector()).collect();
        let sheet = woven::<CorotationalSheet>(&mesh, &isotropic(0.3, Vec3::new(0.3, 0.5, 0.8)));
        let [large, small] = sheet.principal_stretches(0, &x);
        if small > 0.3 && large < 2.5 {
            return (mesh, x);
        }
    }
}

#[test]
fn an_isotropic_corotational_sheet_is_the_membrane() {
    let mut random = Random(17);
    for case in 0..300 {
        let (mesh, x) = triangle(&mut random);
        let poisson = 0.49 * random.signed();
        let sheet = Sheet::new(&mesh, &[rubber(poisson)], tight(), &[]).unwrap();
        let membrane = sheet.membrane();
        // Whatever the warp: an isotropic sheet has none.
        let woven = woven::<CorotationalSheet>(&mesh, &isotropic(poisson, random.vector()));
        let energy = membrane.energy(&x);
        assert!((woven.energy(&x) - energy).abs() < 1e-12 * energy, "{case}");
        for tangent in [Tangent::Exact, Tangent::Clipped] {
            let (a, b) = (
                membrane.element(0, &x, tangent),
                woven.element(0, &x, tangent),
            );
            let scale = dense_element(&a).norm();
            for v in 0..3 {
                // Sizes are about a metre, so one scale does for both.
                assert!((a.force[v] - b.force[v]).norm() < 1e-12 * scale, "{case}");
            }
            let error = (dense_element(&a) - dense_element(&b)).norm();
            assert!(error < 1e-12 * scale, "{case}: {:e}", error / scale);
        }
    }
}

fn the_element_is_the_derivative_of_its_energy<L: SheetLaw>() {
    let mut random = Random(23);
    for _ in 0..50 {
        let (mesh, x) = triangle(&mut random);
        let warp = random.vector();
        let sheet = woven::<L>(&mesh, &Weave { warp, ..cloth() });
        let element = sheet.element(0, &x, Tangent::Exact);
        assert_eq!(element.force, sheet.force(0, &x));
        let scale = dense_element(&element).norm();
        // Truncation step^2 = 1e-10 of third derivatives, which thin triangles raise; rounding 1e-11.
        let step = 1e-5;
        for b in 0..3 {
            for axis in 0..3 {
                let moved = |by: f64| {
                    let mut x = x.clone();
                    x[b][axis] += by;
                    x
                };
                let (plus, minus) = (moved(step), moved(-step));
                let slope = (sheet.energy(&plus) - sheet.energy(&minus)) / (2.0 * step);
                assert!((slope + element.force[b][axis]).abs() < 1e-7 * scale);
                let (plus, minus) = (sheet.force(0, &plus), sheet.force(0, &minus));
                for a in 0..3 {
                    let slope = (minus[a] - plus[a]) / (2.0 * step);
                    let column = element.stiffness[a][b].column(axis).into_owned();
                    assert!((slope - column).norm() < 1e-6 * scale, "{slope} {column}");
                }
            }
        }
        let clipped = dense_element(&sheet.element(0, &x, Tangent::Clipped));
        // Rounding of a 9 x 9 eigenvalue problem.
        assert!((clipped - clipped.transpose()).norm() < 1e-13 * scale);
        assert!(smallest_eigenvalue(&clipped) > -1e-13 * scale);
        // Turning the rest shape together with its warp changes nothing.
        let turn = Rotation3::new(random.vector() * 3.0);
        let turned = TriMesh {
            positions: mesh.positions.iter().map(|x| turn * x).collect(),
            ..mesh
        };
        let again = woven::<L>(
            &turned,
            &Weave {
                warp: turn * warp,
                ..cloth()
            },
        );
        for (a, b) in element.force.iter().zip(again.force(0, &x)) {
            assert!((a - b).norm() < 1e-12 * scale);
        }
    }
}

#[test]
fn elements() {
    the_element_is_the_derivative_of_its_energy::<CorotationalSheet>();
    the_element_is_the_derivative_of_its_energy::<StVenantKirchhoffSheet>();
}

fn a_rigid_motion_gives_no_force<L: SheetLaw>() {
    let mesh = irregular(6, 5, 0.1, 0.08, 0.3, 9);
    let warp = Vec3::new(1.0, 0.7, 0.2);
    let sheet = woven::<L>(&mesh, &Weave { warp, ..cloth() });
    let mut random = Random(5);
    for _ in 0..20 {
        let (turn, shift) = (Rotation3::new(random.vector() * 3.0), random.vector());
        let x: Vec<Vec3> = mesh.positions.iter().map(|x| turn * x + shift).collect();
        let force = largest(forces(&sheet, &x).into_iter());
        // Rounding 1e-16 m at a shift of a metre, over cells of a hundredth, on E t w = 40e6 * 5e-4 * 0.01
        // of a cell: 2e-12 of it, and a margin.
        assert!(force < 1e-10 * 200.0, "{force:e}");
    }
}

#[test]
fn rigid_motions() {
    a_rigid_motion_gives_no_force::<CorotationalSheet>();
    a_rigid_motion_gives_no_force::<StVenantKirchhoffSheet>();
}

/// Strain along the pull, per stress resultant, of a cloth pulled at `angle` to its warp, by Newton's method
/// on the law alone.
fn compliance<L: SheetLaw>(d: &PlaneStiffness, angle: f64, pull: f64) -> f64 {
    let law = L::default();
    let (s, c) = angle.sin_cos();
    let pulled = [c * c * pull, s * s * pull, s * c * pull];
    // F symmetric in the plane: entries 11, 22 and 12. Then P is symmetric up to the strain's square.
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
        // Rows: P_11, P_22 and the mean of P_21 and P_12; columns: u_11, u_22, and u_12 = u_21.
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
    let Weave {
        young_warp: e1,
        young_weft: e2,
        poisson,
        shear,
        thickness: t,
        ..
    } = cloth();
    let d = PlaneStiffness::orthotropic(e1, e2, poisson, shear, t).unwrap();
    // Strains of 1e-7: errors of that order from large strains, 1e-9 from rounding.
    let pull = 1e-7 * shear * t;
    for degrees in 0..=18 {
        let angle = f64::from(5 * degrees).to_radians();
        let (s, c) = angle.sin_cos();
        let expected =
            c.powi(4) / e1 + s.powi(4) / e2 + (1.0 / shear - 2.0 * poisson / e1) * (s * c).powi(2);
        for found in [
            compliance::<CorotationalSheet>(&d, angle, pull),
            compliance::<StVenantKirchhoffSheet>(&d, angle, pull),
            // Along the first axis of a frame that is turned instead.
            compliance::<CorotationalSheet>(&d.rotated(angle), 0.0, pull),
        ] {
            let error = found * t / expected - 1.0;
            // Asked: 1e-5.
            assert!(error.abs() < 1e-6, "{degrees}: {error:e}");
        }
    }
}

/// Pull (N) of a free strip of `cloth` at stretch `l` along the warp, and across it at `across`.
fn pull<L: SheetLaw>(l: f64, across: f64) -> f64 {
    let (lx, ly) = (0.1, 0.04);
    let mesh = irregular(10, 4, lx, ly, 0.25, 5);
    let sheet = woven::<L>(&mesh, &cloth());
    let map = in_plane(l, 0.0, 0.0, across);
    let x: Vec<Vec3> = mesh.positions.iter().map(|x| map * x).collect();
    let mut pull = Vec3::zeros();
    for (x, f) in mesh.positions.iter().zip(forces(&sheet, &x)) {
        if x.x > lx - 1e-9 {
            pull -= f;
        } else if x.x > 1e-9 {
            // Inside and on the free sides: rounding of E t L = 2000 N.
            assert!(f.norm() < 1e-12 * 2000.0, "{f:?}");
        }
    }
    assert!(pull.y.abs() + pull.z.abs() < 1e-9, "{pull:?}");
    pull.x
}

#[test]
fn a_free_strip_pulls_as_its_law_says() {
    let Weave {
        young_warp: e,
        poisson,
        thickness: t,
        ..
    } = cloth();
    let section = e * t * 0.04;
    for l in [0.9, 1.05, 1.2, 1.5] {
        // The sides are free at the contraction nu of each law's own strain. Sums of a few exact forces of
        // up to E t w = 800 N: rounding only.
        let corotational = pull::<CorotationalSheet>(l, 1.0 - poisson * (l - 1.0));
        assert!(
            (corotational - section * (l - 1.0)).abs() < 1e-10,
            "{l}: {corotational}"
        );
        let across = (1.0 - poisson * (l * l - 1.0)).sqrt();
        let stvk = pull::<StVenantKirchhoffSheet>(l, across);
        assert!(
            (stvk - 0.5 * section * l * (l * l - 1.0)).abs() < 1e-10,
            "{l}: {stvk}"
        );
    }
}

fn any_gradient_gives_numbers<L: SheetLaw>() {
    let law = L::default();
    let (x, y) = (Vec3::x(), Vec3::y());
    let d = PlaneStiffness::orthotropic(40e6, 12e6, 0.4, 1e6, 5e-4)
        .unwrap()
        .rotated(0.4);
    let diagonal = Vec3::new(1.0, 1.0, 1.0);
    let mut states = vec![
        // To a point; to lines, stretched and not; turned over; skewed; nearly to a line.
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
            // Scaled first, since the eigenvalue routine squares; its rounding. A St. Venant-Kirchhoff
            // sheet in a point has no stiffness left once it is clipped.
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
fn nothing_but_numbers() {
    any_gradient_gives_numbers::<CorotationalSheet>();
    any_gradient_gives_numbers::<StVenantKirchhoffSheet>();
}

#[test]
fn a_crushed_corotational_sheet_is_no_stiffer_than_its_floor_allows() {
    // 1 / 0.01 is the most that the floor lets a division add to moduli of order one.
    let d = PlaneStiffness::isotropic(1.0, 0.3, 1.0).unwrap();
    let mut random = Random(2);
    for _ in 0..1000 {
        let f = [random.vector() * 1e-3, random.vector() * 1e-3];
        let exact = dense(&CorotationalSheet.respond(&d, &f, Tangent::Exact).modulus);
        assert!(exact.norm() < 1e3, "{exact}");
    }
}

#[test]
fn bad_weaves_are_refused_by_name() {
    let corners = [Vec3::zeros(), Vec3::x(), Vec3::y()];
    let refusal = |weave: &Weave, corners: &[Vec3; 3]| {
        let [a, b, c] = corners;
        let mut sheet = Woven::<CorotationalSheet>::with_capacity(2);
        sheet
            .push([0, 1, 2], [&corners[0], &corners[1], &corners[2]], &cloth())
            .ok();
        let before = sheet.len();
        let error = sheet.push([0, 1, 2], [a, b, c], weave).unwrap_err();
        assert_eq!(sheet.len(), before);
        error
    };
    let bad = |change: fn(&mut Weave)| {
        let mut weave = cloth();
        change(&mut weave);
        match refusal(&weave, &corners) {
            SheetError::Material {
                triangle: 1, field, ..
            } => field,
            error => panic!("{error}"),
        }
    };
    assert_eq!(bad(|w| w.young_warp = 0.0), "young_warp");
    assert_eq!(bad(|w| w.young_weft = f64::INFINITY), "young_weft");
    assert_eq!(bad(|w| w.shear = -1.0), "shear");
    assert_eq!(bad(|w| w.thickness = f64::NAN), "thickness");
    assert_eq!(bad(|w| w.density = 0.0), "density");
    assert_eq!(bad(|w| w.poisson = f64::NAN), "poisson");
    // sqrt(40 / 12) = 1.8257.
    assert_eq!(bad(|w| w.poisson = 1.826), "poisson");
    assert_eq!(bad(|w| w.poisson = -1.826), "poisson");
    assert_eq!(
        bad(|w| (w.young_warp, w.thickness) = (1e300, 1e10)),
        "stiffness along the warp (N/m)"
    );
    Weave {
        poisson: 1.825,
        ..cloth()
    }
    .check(0)
    .unwrap();

    for (warp, known) in [
        (Vec3::z(), true),
        (Vec3::new(0.9e-6, 0.0, -1.0), true),
        (Vec3::zeros(), false),
        (Vec3::new(f64::NAN, 1.0, 0.0), false),
        (Vec3::new(f64::INFINITY, 1.0, 0.0), false),
    ] {
        match refusal(&Weave { warp, ..cloth() }, &corners) {
            SheetError::Warp { triangle: 1, share } => assert_eq!(share.is_finite(), known),
            error => panic!("{error}"),
        }
    }
    for warp in [
        Vec3::new(1.1e-6, 0.0, -1.0),
        Vec3::x() * 1e-300,
        Vec3::x() * 1e300,
    ] {
        let mut sheet = Woven::<StVenantKirchhoffSheet>::with_capacity(1);
        let [a, b, c] = &corners;
        let area = sheet
            .push([0, 1, 2], [a, b, c], &Weave { warp, ..cloth() })
            .unwrap();
        assert_eq!(area, 0.5);
        assert!((sheet.gradient(0, &corners)[0] - Vec3::x()).norm() < 1e-15);
    }
    let line = [Vec3::zeros(), Vec3::x(), Vec3::x() * 2.0];
    assert!(matches!(
        refusal(&cloth(), &line),
        SheetError::Degenerate { .. }
    ));
    let isotropic = PlaneStiffness::isotropic(1.0, 0.5, 1.0).unwrap_err();
    assert_eq!(isotropic.field, "poisson");
}
