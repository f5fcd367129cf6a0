//! Triangles of woven sheets compared with the theory of elasticity: the isotropic membrane, derivatives, rigid
//! motions, strips, and materials that are refused.

use common::*;
use nalgebra::{Rotation3, SMatrix};
use physics::element::triangle::membrane::{Element, Membrane};
use physics::element::triangle::woven::Woven;
use physics::material::sheet_law::{CorotationalSheet, SheetLaw, StVenantKirchhoffSheet};
use physics::mesh::TriMesh;
use physics::{BodyError, Elements, Tangent, Vec3, Weave};

/// A cloth similar to cotton: its warp is stiff, its weft softer, and it hardly resists shear.
fn cloth() -> Weave {
    Weave {
        warp: Vec3::x(),
        young_warp: 40e6,
        young_weft: 12e6,
        poisson: 0.4,
        shear: 1e6,
        thickness: 5e-4,
        density: 400.0,
        rigidity: physics::Rigidity::default(),
    }
}

/// The rubber of the tests of the membrane, written as a weave.
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
        rigidity: physics::Rigidity::default(),
    }
}

/// The sheet of `mesh`, with one material everywhere.
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
    for element in 0..sheet.count() {
        let at = sheet.element(element, x, Tangent::Exact).force;
        for (&node, f) in sheet.nodes(element).iter().zip(at) {
            force[node as usize] += f;
        }
    }
    force
}

fn dense_element(element: &Element) -> SMatrix<f64, 9, 9> {
    SMatrix::from_fn(|i, j| element.stiffness[i / 3][j / 3][(i % 3, j % 3)])
}

/// A triangle of about a metre at rest, and a deformation with stretches between 0.3 and 2.5.
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
        // The squares of the sum and of the difference of the principal stretches.
        let [f1, f2] = sheet.gradient(0, &x);
        let (square, area) = (f1.norm_squared() + f2.norm_squared(), f1.cross(&f2).norm());
        let (sum, difference) = ((square + 2.0 * area).sqrt(), (square - 2.0 * area).sqrt());
        if sum - difference > 0.6 && sum + difference < 5.0 {
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
        let membrane = Membrane::new(&mesh, &[rubber(poisson)]).unwrap();
        // The direction of the warp has no effect on an isotropic sheet.
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
                // The sizes are about a metre, so one scale serves for both.
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
        let scale = dense_element(&element).norm();
        // The truncation error is step^2 = 1e-10 times third derivatives, which are larger in thin triangles. The
        // rounding error is 1e-11.
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
                let [plus, minus] =
                    [plus, minus].map(|x| sheet.element(0, &x, Tangent::Exact).force);
                for a in 0..3 {
                    let slope = (minus[a] - plus[a]) / (2.0 * step);
                    let column = element.stiffness[a][b].column(axis).into_owned();
                    assert!((slope - column).norm() < 1e-6 * scale, "{slope} {column}");
                }
            }
        }
        let clipped = dense_element(&sheet.element(0, &x, Tangent::Clipped));
        // The tolerance is the rounding of a 9 x 9 eigenvalue problem.
        assert!((clipped - clipped.transpose()).norm() < 1e-13 * scale);
        assert!(clipped.symmetric_eigenvalues().min() > -1e-13 * scale);
        // A common rotation of rest shape and warp changes nothing.
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
        for (a, b) in element
            .force
            .iter()
            .zip(again.element(0, &x, Tangent::Exact).force)
        {
            assert!((a - b).norm() < 1e-12 * scale);
        }
    }
}

#[test]
fn the_elements_of_woven_sheets_have_exact_derivatives() {
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
        // The rounding is 1e-16 m at a shift of a metre, over grid cells of a hundredth, times E t w = 40e6 * 5e-4 *
        // 0.01 of a cell. That is 2e-12 of the force, and the tolerance has a margin.
        assert!(force < 1e-10 * 200.0, "{force:e}");
    }
}

#[test]
fn rigid_motions_of_a_woven_sheet_give_no_force() {
    a_rigid_motion_gives_no_force::<CorotationalSheet>();
    a_rigid_motion_gives_no_force::<StVenantKirchhoffSheet>();
}

/// The pull (N) of a free strip of `cloth` at the stretch `l` along the warp and the stretch `across` along the weft.
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
            // Inside and on the free sides, the forces are the rounding of E t L = 2000 N.
            assert!(f.norm() < 1e-12 * 2000.0, "{f:?}");
        }
    }
    assert!(pull.y.abs() + pull.z.abs() < 1e-9, "{pull:?}");
    pull.x
}

#[test]
fn a_free_strip_pulls_with_the_force_of_its_law() {
    let Weave {
        young_warp: e,
        poisson,
        thickness: t,
        ..
    } = cloth();
    let section = e * t * 0.04;
    for l in [0.9, 1.05, 1.2, 1.5] {
        // The sides are free at the contraction nu of the strain of each law. The pull is a sum of a few exact forces
        // of up to E t w = 800 N, so its only error is rounding.
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

#[test]
fn bad_weaves_are_refused_by_name() {
    let corners = [Vec3::zeros(), Vec3::x(), Vec3::y()];
    let refusal = |weave: &Weave, corners: &[Vec3; 3]| {
        let [a, b, c] = corners;
        let mut sheet = Woven::<CorotationalSheet>::with_capacity(2);
        sheet
            .push([0, 1, 2], [&corners[0], &corners[1], &corners[2]], &cloth())
            .ok();
        let before = sheet.count();
        let error = sheet.push([0, 1, 2], [a, b, c], weave).unwrap_err();
        assert_eq!(sheet.count(), before);
        error
    };
    let bad = |change: fn(&mut Weave)| {
        let mut weave = cloth();
        change(&mut weave);
        match refusal(&weave, &corners) {
            BodyError::Material {
                element: 1, field, ..
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
    // The limit is sqrt(40 / 12) = 1.8257.
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
            BodyError::Warp {
                triangle: 1,
                fraction,
            } => assert_eq!(fraction.is_finite(), known),
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
        BodyError::Degenerate { .. }
    ));
}
