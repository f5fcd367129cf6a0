//! Tetrahedra compared with the theory of elasticity: laws, patch tests, rigid motions, tangents, momentum.

use common::{Random, cube};
use nalgebra::Rotation3;
use physics::material::law::{
    Corotational, Lame, Law, Linear, StVenantKirchhoff, StableNeoHookean,
};
use physics::mesh::TetMesh;
use physics::polar::svd::svd;
use physics::{Body, BodyConfig, Mat3, SolidLaw, SolidMaterial, Tangent, Vec3};

const LAWS: [SolidLaw; 4] = [
    SolidLaw::Linear,
    SolidLaw::Corotational,
    SolidLaw::StVenantKirchhoff,
    SolidLaw::StableNeoHookean,
];
const YOUNG: f64 = 2e4;

fn body(mesh: &TetMesh, law: SolidLaw, poisson: f64) -> Body {
    let material = SolidMaterial {
        young: YOUNG,
        poisson,
        density: 1000.0,
    };
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        ..BodyConfig::default()
    };
    Body::solid(mesh, &[material], law, config, &[]).unwrap()
}

fn forces(body: &mut Body, x: &[Vec3], tangent: Tangent) -> Vec<Vec3> {
    body.set_positions(x).unwrap();
    body.assemble_with(tangent);
    body.internal_forces().collect()
}

fn largest(forces: &[Vec3]) -> f64 {
    forces.iter().map(Vec3::norm).fold(0.0, f64::max)
}

fn random_matrix(random: &mut Random) -> Mat3 {
    Mat3::from_fn(|_, _| random.signed())
}

#[test]
fn a_signed_decomposition_gives_back_its_matrix_and_turns_properly() {
    let mut random = Random(1);
    let mut cases: Vec<Mat3> = (0..2000).map(|_| random_matrix(&mut random)).collect();
    let (u, v) = (random.vector(), random.vector());
    cases.extend([
        Mat3::zeros(),
        Mat3::identity(),
        -Mat3::identity(),
        u * v.transpose(),
        u * v.transpose() + v * u.transpose(),
        Mat3::from_diagonal(&Vec3::new(1.0, 1e-9, 1e-18)),
        random_matrix(&mut random) * 1e150,
        random_matrix(&mut random) * 1e-150,
        Mat3::repeat(1.0),
    ]);
    for f in cases {
        let d = svd(&f);
        let scale = f.amax();
        // The tolerance is a dozen roundings of entries of order one.
        let back = d.u * Mat3::from_diagonal(&d.s) * d.v.transpose();
        assert!((back - f).amax() <= 1e-14 * scale, "{f} {d:?}");
        for r in [d.u, d.v] {
            assert!(
                (r * r.transpose() - Mat3::identity()).amax() < 1e-14,
                "{f} {r}"
            );
            assert!(r.determinant() > 0.0);
        }
        assert!(
            d.s.x >= d.s.y && d.s.y >= d.s.z.abs() - 1e-15 * scale,
            "{:?}",
            d.s
        );
    }
}

/// The modulus as a 9 x 9 matrix over (column, row) of the gradient.
fn flat(law: &impl Law, lame: Lame, f: &Mat3, tangent: Tangent) -> nalgebra::SMatrix<f64, 9, 9> {
    let modulus = law.respond(lame, f, tangent).modulus;
    nalgebra::SMatrix::from_fn(|r, c| modulus[r / 3][c / 3][(r % 3, c % 3)])
}

fn check_law<L: Law>(law: L, turns: bool) {
    let mut random = Random(5);
    for poisson in [0.0, 0.3, 0.45, 0.499] {
        let lame = Lame::new(1.0, poisson);
        let scale = lame.lambda + 2.0 * lame.mu;
        // At rest there is no stress and no energy, and the modulus is that of linear elasticity, up to rounding.
        let rest = Mat3::identity();
        assert!(law.stress(lame, &rest).amax() < 1e-15 * scale);
        assert!(law.energy(lame, &rest).abs() < 1e-15 * scale);
        let linear = flat(&Linear, lame, &rest, Tangent::Exact);
        assert!((flat(&law, lame, &rest, Tangent::Exact) - linear).amax() < 1e-14 * scale);

        for trial in 0..200 {
            let mut f = rest + random_matrix(&mut random) * [0.01, 0.3, 0.8, 1.5][trial % 4];
            if trial % 8 == 7 {
                f.column_mut(0).neg_mut();
            }
            // The floor under the coefficient of the corotational turn changes the tangent there, as its documentation
            // states.
            let s = svd(&f).s;
            if s.y + s.z < 0.1 {
                continue;
            }
            let stress = law.stress(lame, &f);
            let response = law.respond(lame, &f, Tangent::Exact);
            let size = scale * (1.0 + f.norm().powi(3));
            assert!((response.stress - stress).amax() < 1e-13 * size);
            let exact = flat(&law, lame, &f, Tangent::Exact);
            assert!((exact - exact.transpose()).amax() < 1e-12 * exact.amax());
            // The error of central differences is h^2 plus rounding / h, about 1e-10 at h = 1e-5. The curvature of a
            // turn grows with the square of one over the sum of the stretches, here 100.
            let h = 1e-5;
            for c in 0..9 {
                let mut step = Mat3::zeros();
                step[(c % 3, c / 3)] = h;
                let (more, less) = (f + step, f - step);
                let slope = (law.energy(lame, &more) - law.energy(lame, &less)) / (2.0 * h);
                assert!((slope - stress[(c % 3, c / 3)]).abs() < 1e-7 * size, "{f}");
                let change = (law.stress(lame, &more) - law.stress(lame, &less)) / (2.0 * h);
                for r in 0..9 {
                    let difference = change[(r % 3, r / 3)] - exact[(r, c)];
                    assert!(difference.abs() < 1e-6 * size, "{f} {difference}");
                }
            }
            let clipped = flat(&law, lame, &f, Tangent::Clipped);
            let eigenvalues = clipped.symmetric_eigenvalues();
            // The tolerance is the rounding of a 9 x 9 eigenvalue problem.
            assert!(eigenvalues.min() > -1e-13 * eigenvalues.max().max(scale));
            if exact.symmetric_eigenvalues().min() > 0.0 {
                assert!((clipped - exact).amax() < 1e-12 * exact.amax());
            }
            if turns {
                let r = Rotation3::from_euler_angles(random.signed(), 1.0, 2.0).into_inner();
                let turned = law.stress(lame, &(r * f));
                assert!((turned - r * stress).amax() < 1e-13 * size);
                assert!(law.stress(lame, &r).amax() < 1e-14 * scale);
            }
        }
        for f in [
            Mat3::zeros(),
            -rest,
            rest * 1e8,
            Mat3::repeat(1.0),
            Mat3::from_diagonal(&Vec3::new(1.0, 1.0, -1.0)),
            Mat3::from_diagonal(&Vec3::new(1.0, 0.0, 0.0)),
        ] {
            for tangent in [Tangent::Exact, Tangent::Clipped] {
                let response = law.respond(lame, &f, tangent);
                assert!(response.stress.iter().all(|p| p.is_finite()), "{f}");
                assert!(
                    flat(&law, lame, &f, tangent).iter().all(|p| p.is_finite()),
                    "{f}"
                );
            }
        }
    }
}

#[test]
fn linear_law_has_the_derivatives_it_states() {
    check_law(Linear, false);
}

#[test]
fn corotational_law_has_the_derivatives_it_states() {
    check_law(Corotational, true);
}

#[test]
fn st_venant_kirchhoff_law_has_the_derivatives_it_states() {
    check_law(StVenantKirchhoff, true);
}

#[test]
fn stable_neo_hookean_law_has_the_derivatives_it_states() {
    check_law(StableNeoHookean, true);
}

#[test]
fn constant_strain_leaves_the_inside_in_balance() {
    let map = Mat3::new(1.02, 0.01, -0.02, 0.015, 0.97, 0.01, -0.01, 0.02, 1.01);
    for quadratic in [false, true] {
        let mesh = cube(3, 0.2, quadratic);
        let border = |x: &Vec3| x.iter().any(|c| c.abs() < 1e-9 || (c - 1.0).abs() < 1e-9);
        for law in LAWS {
            let mut body = body(&mesh, law, 0.3);
            let x: Vec<Vec3> = mesh.positions.iter().map(|x| map * x).collect();
            let f = forces(&mut body, &x, Tangent::Exact);
            // The stresses are E times strains of a few hundredths, and act on faces of order one.
            for (x, f) in mesh.positions.iter().zip(&f) {
                assert!(
                    border(x) || f.norm() < 1e-12 * YOUNG,
                    "{law:?} {quadratic} {f:?}"
                );
            }
            assert!(largest(&f) > 1e-4 * YOUNG, "the border pulls");
            let stress = body.elements()[0].stress(0, body.node_positions());
            for element in 1..body.element_count() {
                let other = body.elements()[0].stress(element, body.node_positions());
                assert!((stress - other).amax() < 1e-12 * YOUNG);
            }
        }
    }
}

#[test]
fn rigid_motions_give_no_force() {
    let turn = Rotation3::from_euler_angles(0.7, -1.2, 2.5).into_inner();
    let shift = Vec3::new(3.0, -1.0, 2.0);
    for quadratic in [false, true] {
        let mesh = cube(2, 0.2, quadratic);
        for law in LAWS {
            let mut body = body(&mesh, law, 0.45);
            let turn = if law == SolidLaw::Linear {
                Mat3::identity()
            } else {
                turn
            };
            let x: Vec<Vec3> = mesh.positions.iter().map(|x| turn * x + shift).collect();
            let f = forces(&mut body, &x, Tangent::Exact);
            // The tolerance is E times the rounding of coordinates of order four, over grid cells of a half, times the
            // faces of the cells.
            assert!(
                largest(&f) < 1e-13 * YOUNG * 10.0,
                "{law:?} {}",
                largest(&f)
            );
        }
    }
}

#[test]
fn the_assembled_tangent_is_the_derivative_of_the_forces() {
    for quadratic in [false, true] {
        let mesh = cube(2, 0.2, quadratic);
        let mut random = Random(9);
        let x: Vec<Vec3> = mesh
            .positions
            .iter()
            .map(|x| x + random.vector() * 0.03)
            .collect();
        let d: Vec<Vec3> = x.iter().map(|_| random.vector()).collect();
        for law in LAWS {
            let mut body = body(&mesh, law, 0.4);
            let moved =
                |h: f64| -> Vec<Vec3> { x.iter().zip(&d).map(|(x, d)| x + d * h).collect() };
            let h = 1e-6;
            let more = forces(&mut body, &moved(h), Tangent::Exact);
            let less = forces(&mut body, &moved(-h), Tangent::Exact);
            forces(&mut body, &x, Tangent::Exact);
            // There are no handles, so the nodes are the vertices.
            let mut product = vec![Vec3::zeros(); x.len()];
            body.stiffness().product(&d, &mut product);
            let size = largest(&product);
            for ((more, less), product) in more.iter().zip(&less).zip(&product) {
                let slope = (less - more) / (2.0 * h);
                assert!(
                    (slope - product).norm() < 1e-6 * size,
                    "{law:?} {quadratic}"
                );
            }
            let total: Vec3 = body.internal_forces().sum();
            assert!(
                total.norm() < 1e-14 * YOUNG,
                "internal forces have no resultant"
            );
        }
    }
}

#[test]
fn masses_add_up_and_are_positive() {
    for quadratic in [false, true] {
        let body = body(&cube(2, 0.2, quadratic), SolidLaw::Corotational, 0.3);
        assert!((body.total_mass() - 1000.0).abs() < 1e-10);
        assert!(body.node_masses().iter().all(|&mass| mass > 0.0));
    }
}
