//! Sheets in equilibrium: strips of every law, and the off-axis modulus of a woven one.

use common::{Split, grid, irregular};
use physics::mesh::TriMesh;
use physics::{Body, BodyConfig, Equilibrium, EquilibriumOptions, SheetLawName, Vec3, Weave};

const LENGTH: f64 = 0.1;
const WIDTH: f64 = 0.04;

fn config() -> BodyConfig {
    BodyConfig {
        gravity: Vec3::zeros(),
        ..BodyConfig::default()
    }
}

/// The strip of the reference figures: 1 MPa, 1 mm, written as a weave that is the same in all directions.
fn plain(poisson: f64) -> Weave {
    Weave {
        warp: Vec3::new(1.0, 0.4, 0.0),
        young_warp: 1e6,
        young_weft: 1e6,
        poisson,
        shear: 0.5e6 / (1.0 + poisson),
        thickness: 1e-3,
        density: 1000.0,
        rigidity: physics::Rigidity::default(),
    }
}

/// The force that stretches a strip along x, and the body. The sides may slide and contract.
fn pulled(mesh: &TriMesh, weave: Weave, law: SheetLawName, stretch: f64) -> f64 {
    let mut body = Body::woven(mesh, &[weave], law, config(), &[]).unwrap();
    let at = |chosen: &dyn Fn(&Vec3) -> bool| -> Vec<u32> {
        let numbered = (0_u32..).zip(&mesh.positions);
        numbered
            .filter(|(_, x)| chosen(x))
            .map(|(vertex, _)| vertex)
            .collect()
    };
    body.add_support(&at(&|x| x.x < 1e-9), [true, false, false])
        .unwrap();
    body.add_support(&at(&|x| x.norm() < 1e-9), [true, true, false])
        .unwrap();
    body.add_support(&at(&|_| true), [false, false, true])
        .unwrap();
    let end = body
        .add_support(&at(&|x| x.x > LENGTH - 1e-9), [true, false, false])
        .unwrap();
    body.set_support(end, Vec3::x() * (LENGTH * (stretch - 1.0)))
        .unwrap();
    let options = EquilibriumOptions::default();
    Equilibrium::new(&body, options)
        .unwrap()
        .solve(&mut body, &[], 1.0)
        .unwrap();
    body.support_reaction(end).unwrap().x
}

#[test]
fn a_strip_with_free_sides_pulls_with_the_force_of_its_law() {
    let mesh = irregular(10, 4, LENGTH, WIDTH, 0.2, 5);
    for poisson in [0.0, 0.3] {
        // The forces are E w t (l - 1) and E w t l (l^2 - 1) / 2: 8.0000 N and 10.5600 N. The residual is 1e-9 of the
        // forces.
        let found = pulled(&mesh, plain(poisson), SheetLawName::Corotational, 1.2);
        assert!((found - 8.0).abs() < 1e-7, "{found}");
        let found = pulled(&mesh, plain(poisson), SheetLawName::StVenantKirchhoff, 1.2);
        assert!((found - 10.56).abs() < 1e-7, "{found}");
    }
}

#[test]
fn a_woven_strip_has_the_off_axis_modulus() {
    let (e1, e2, nu, g) = (2e6, 0.5e6, 0.2, 0.1e6);
    let mesh = grid(10, 4, LENGTH, WIDTH, Split::Alternating);
    let strain = 1e-7;
    for law in [SheetLawName::Corotational, SheetLawName::StVenantKirchhoff] {
        for degrees in [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0_f64] {
            let (s, c) = degrees.to_radians().sin_cos();
            let weave = Weave {
                warp: Vec3::new(c, s, 0.0),
                young_warp: e1,
                young_weft: e2,
                poisson: nu,
                shear: g,
                ..plain(0.0)
            };
            let force = pulled(&mesh, weave, law, 1.0 + strain);
            let found = force / (strain * WIDTH * 1e-3);
            // The reference is Jones, "Mechanics of composite materials", equation 2.97. The ends may slide, so the
            // stress is uniform.
            let compliance =
                c.powi(4) / e1 + s.powi(4) / e2 + (1.0 / g - 2.0 * nu / e1) * (s * c).powi(2);
            println!(
                "{law:?} {degrees}: {found:.6e} Pa, {:.6e}",
                1.0 / compliance
            );
            // The tolerance is the strain, times a factor for the shear. The forces are exact to 1e-9 and their
            // rounding.
            assert!(
                (found * compliance - 1.0).abs() < 1e-5,
                "{law:?} {degrees} {found}"
            );
        }
    }
}
