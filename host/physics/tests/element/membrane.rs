//! The membrane compared with the theory of elasticity: patch tests, rotations, strips, energy and tangents.

use common::*;
use nalgebra::{Rotation3, SMatrix};
use physics::element::triangle::membrane::Membrane;
use physics::mesh::TriMesh;
use physics::{Body, Border, Elements, Freedom, HandlePose, Tangent, Vec3};
use proptest::prelude::*;

fn free_sheet(mesh: &TriMesh, poisson: f64) -> Body {
    Body::sheet(mesh, &[rubber(poisson)], tight(), &[]).unwrap()
}

fn membrane(mesh: &TriMesh, poisson: f64) -> Membrane {
    Membrane::new(mesh, &[rubber(poisson)]).unwrap()
}

/// The forces at the vertices of the mesh when the vertices are at `x`.
fn forces(sheet: &mut Body, x: &[Vec3]) -> Vec<Vec3> {
    sheet.set_positions(x).unwrap();
    sheet.assemble();
    sheet.internal_forces().collect()
}

#[test]
fn an_affine_map_strains_every_triangle_alike_and_leaves_the_inside_in_balance() {
    let (lx, ly) = (0.1, 0.08);
    let mesh = irregular(8, 6, lx, ly, 0.3, 7);
    let mut sheet = free_sheet(&mesh, 0.3);
    let membrane = membrane(&mesh, 0.3);
    for map in [
        in_plane(1.001, 0.0005, -0.0002, 0.9995),
        in_plane(1.4, 0.3, -0.1, 0.8),
    ] {
        let tilt = Rotation3::from_euler_angles(0.3, -0.8, 1.1).into_inner();
        let x: Vec<Vec3> = mesh.positions.iter().map(|x| tilt * map * x).collect();
        let f = forces(&mut sheet, &x);
        // The principal stretches of a 2 x 2 map follow from sum^2 = |A|^2 + 2 det A and difference^2 = |A|^2 - 2 det
        // A.
        let square = map.fixed_view::<2, 2>(0, 0).norm_squared();
        let det = map.determinant();
        let (sum, difference) = ((square + 2.0 * det).sqrt(), (square - 2.0 * det).sqrt());
        let expected = [0.5 * (sum + difference), 0.5 * (sum - difference)];
        for triangle in 0..sheet.element_count() {
            let stretch = membrane.principal_stretches(triangle, &x);
            // The strains are of order 1. The coordinates have 16 digits, and the triangles are a tenth as wide as the
            // body and at worst a few times thinner than long. The tolerance 1e-12 leaves a factor of a thousand.
            assert!(
                (stretch[0] - expected[0]).abs() < 1e-12,
                "{stretch:?} {expected:?}"
            );
            assert!(
                (stretch[1] - expected[1]).abs() < 1e-12,
                "{stretch:?} {expected:?}"
            );
        }
        // The tolerance has the same digits, times the scale of a force, E t L.
        let scale = 1e6 * 1e-3 * lx;
        for (x, f) in mesh.positions.iter().zip(&f) {
            assert!(on_border(x, lx, ly) || f.norm() < 1e-12 * scale, "{f:?}");
        }
    }
}

#[test]
fn the_inside_returns_to_the_affine_map_of_its_border() {
    let (lx, ly) = (0.1, 0.08);
    let mesh = irregular(8, 6, lx, ly, 0.3, 11);
    // The sheet is stretched along both axes, so that every direction is in tension and the solution is unique. Every
    // border vertex is a handle of its own, because a handle is rigid.
    let map = in_plane(1.2, 0.05, -0.02, 1.1);
    let border: Vec<u32> = (0..mesh.positions.len() as u32)
        .filter(|&vertex| on_border(&mesh.positions[vertex as usize], lx, ly))
        .collect();
    let handles: Vec<_> = border
        .iter()
        .map(|&vertex| physics::HandleSpec {
            vertices: vec![vertex],
            origin: mesh.positions[vertex as usize],
            freedom: Freedom::Fixed,
            border: Border::Hinged,
        })
        .collect();
    let mut sheet = Body::sheet(&mesh, &[rubber(0.3)], tight(), &handles).unwrap();
    let targets: Vec<_> = handles
        .iter()
        .map(|handle| HandlePose::at(map * handle.origin))
        .collect();
    let mut random = Random(3);
    let start: Vec<Vec3> = mesh
        .positions
        .iter()
        .map(|x| map * x + random.vector() * 1e-3)
        .collect();
    sheet.set_positions(&start).unwrap();
    settle(&mut sheet, &targets, 100.0, 30).unwrap();
    let error = largest(
        sheet
            .positions()
            .zip(&mesh.positions)
            .map(|(x, rest)| x - map * rest),
    );
    // Newton's method converges to the solver's 1e-13 of the size of the body. The tolerance has a margin for the
    // condition number.
    assert!(error < 1e-12 * lx, "{error:e}");
}

#[test]
fn a_free_strip_pulls_with_young_modulus_times_section_times_strain() {
    // The reference is E w t (l - 1) = 8.0000 N for 1 MPa, 4 cm, 1 mm and a stretch of 1.2.
    for poisson in [0.0, 0.3, 0.45] {
        let (lx, ly) = (0.1, 0.04);
        let mesh = irregular(10, 4, lx, ly, 0.25, 5);
        let mut sheet = free_sheet(&mesh, poisson);
        let map = in_plane(1.2, 0.0, 0.0, 1.0 - poisson * 0.2);
        let x: Vec<Vec3> = mesh.positions.iter().map(|x| map * x).collect();
        let f = forces(&mut sheet, &x);
        let mut pull = Vec3::zeros();
        for (x, f) in mesh.positions.iter().zip(&f) {
            if x.x > lx - 1e-9 {
                pull -= f;
            } else if x.x > 1e-9 {
                // Inside and on the free sides, the forces are the rounding of E t L = 100 N.
                assert!(f.norm() < 1e-12 * 100.0, "{f:?}");
            }
        }
        // The pull is a sum of a few exact forces, so its only error is rounding.
        assert!((pull - Vec3::new(8.0, 0.0, 0.0)).norm() < 1e-11, "{pull:?}");
    }
}

/// The pull of a strip of 10 x 4 grid cells with clamped ends at a stretch of 1.2.
fn clamped_pull(split: Split, lx: f64, poisson: f64) -> f64 {
    let mesh = grid(10, 4, lx, 0.04, split);
    let handles = [
        handle(&mesh, Freedom::Fixed, |x| x.x < 1e-9),
        handle(&mesh, Freedom::Translation, |x| x.x > lx - 1e-9),
    ];
    let mut sheet = Body::sheet(&mesh, &[rubber(poisson)], tight(), &handles).unwrap();
    let mut targets = rest_poses(&handles);
    targets[1].position.x += 0.2 * lx;
    settle(&mut sheet, &targets, 100.0, 12).unwrap();
    -sheet.handle_report(1).unwrap().wrench_on_hand.force.x
}

#[test]
fn a_clamped_strip_pulls_with_the_force_of_the_reference() {
    // The reference is 8.13805 N, given to that many digits, for a length of 10 cm and Poisson's ratio 0.3.
    let right = clamped_pull(Split::Right, 0.1, 0.3);
    assert!((right - 8.13805).abs() < 5e-6, "{right}");
    // The mirrored mesh is the same strip. Both solutions have an error of about 1e-12.
    let left = clamped_pull(Split::Left, 0.1, 0.3);
    assert!((right - left).abs() < 1e-9, "{right} {left}");
}

/// A triangle of about a metre, stretched by 0.3 to 2.5 and turned by a random rotation. The nodes are the vertices.
fn deformed_triangle(seed: u64) -> (Membrane, Vec<Vec3>) {
    let mut random = Random(seed);
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
        let membrane = membrane(&mesh, 0.9 * random.signed().abs().min(0.5));
        let x: Vec<Vec3> = (0..3).map(|_| random.vector()).collect();
        let [large, small] = membrane.principal_stretches(0, &x);
        if small > 0.3 && large < 2.5 {
            return (membrane, x);
        }
    }
}

fn dense(membrane: &Membrane, x: &[Vec3], tangent: Tangent) -> SMatrix<f64, 9, 9> {
    let stiffness = membrane.element(0, x, tangent).stiffness;
    SMatrix::from_fn(|i, j| stiffness[i / 3][j / 3][(i % 3, j % 3)])
}

fn stiffness_scale(membrane: &Membrane, x: &[Vec3]) -> f64 {
    dense(membrane, x, Tangent::Clipped).norm()
}

fn smallest_eigenvalue(matrix: &SMatrix<f64, 9, 9>) -> f64 {
    matrix.symmetric_eigenvalues().min()
}

#[test]
fn a_collapsed_triangle_has_a_finite_force_and_a_definite_tangent() {
    let mesh = TriMesh {
        positions: vec![Vec3::zeros(), Vec3::x(), Vec3::y()],
        triangles: vec![[0, 1, 2]],
        ..TriMesh::default()
    };
    let membrane = &membrane(&mesh, 0.45);
    let far = Vec3::new(1.0, -2.0, 0.5);
    let states = [
        // The triangle is collapsed to a point, to lines (stretched and not stretched), turned over, and collapsed
        // nearly to a line.
        vec![far; 3],
        vec![far, far + Vec3::x(), far],
        vec![far, far, far + Vec3::y() * 3.0],
        vec![
            far,
            far + Vec3::new(1.0, 1.0, 1.0),
            far + Vec3::new(2.0, 2.0, 2.0),
        ],
        vec![far, far - Vec3::x(), far + Vec3::y()],
        vec![far, far + Vec3::x() * 5.0, far + Vec3::new(2.0, 1e-15, 0.0)],
        vec![far, far + Vec3::x() * 1e-160, far + Vec3::y() * 1e-160],
    ];
    for x in states {
        let element = membrane.element(0, &x, Tangent::Clipped);
        assert!(
            element
                .force
                .iter()
                .flat_map(|f| f.iter())
                .all(|f| f.is_finite()),
            "{x:?}"
        );
        // E t is 1000 N/m, and the strains here are of order one to five.
        assert!(largest(element.force.into_iter()) < 1e4, "{x:?}");
        let clipped = dense(membrane, &x, Tangent::Clipped);
        assert!(clipped.iter().all(|k| k.is_finite()), "{x:?}");
        // The tolerance is the rounding of a 9 x 9 eigenvalue problem.
        assert!(
            smallest_eigenvalue(&clipped) > -1e-13 * clipped.norm(),
            "{x:?}"
        );
        assert!(
            dense(membrane, &x, Tangent::Exact)
                .iter()
                .all(|k| k.is_finite()),
            "{x:?}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn a_rigid_motion_gives_no_force(
        angles in prop::array::uniform3(-3.2_f64..3.2),
        shift in prop::array::uniform3(-1.0_f64..1.0),
    ) {
        let mesh = irregular(6, 5, 0.1, 0.08, 0.3, 9);
        let mut sheet = free_sheet(&mesh, 0.4);
        let turn = Rotation3::from_euler_angles(angles[0], angles[1], angles[2]);
        let x: Vec<Vec3> = mesh.positions.iter().map(|x| turn * x + Vec3::from(shift)).collect();
        let force = largest(forces(&mut sheet, &x).into_iter());
        // The required accuracy is 1e-10 of E t L. A shift of a metre costs a body of 0.1 m one digit, and its grid
        // cells another digit.
        prop_assert!(force < 1e-10 * 1e6 * 1e-3 * 0.1, "{force:e}");
    }

    #[test]
    fn force_is_minus_the_gradient_of_energy_and_tangent_that_of_force(seed in any::<u64>()) {
        let (membrane, x) = deformed_triangle(seed);
        let element = membrane.element(0, &x, Tangent::Exact);
        let scale = stiffness_scale(&membrane, &x);
        // Central differences over a length of 1 m have a truncation error of step^2 = 1e-10 and a rounding error of
        // 1e-16 / step = 1e-11.
        let step = 1e-5;
        for b in 0..3 {
            for axis in 0..3 {
                let moved = |by: f64| {
                    let mut x = x.clone();
                    x[b][axis] += by;
                    x
                };
                let slope = (membrane.energy(&moved(step)) - membrane.energy(&moved(-step))) / (2.0 * step);
                prop_assert!((slope + element.force[b][axis]).abs() < 1e-7 * scale, "force");
                let plus = membrane.element(0, &moved(step), Tangent::Exact).force;
                let minus = membrane.element(0, &moved(-step), Tangent::Exact).force;
                for a in 0..3 {
                    let slope = (minus[a] - plus[a]) / (2.0 * step);
                    let column = element.stiffness[a][b].column(axis);
                    // The required accuracy is 1e-6.
                    prop_assert!((slope - column).norm() < 1e-6 * scale, "{slope} {column}");
                }
            }
        }
    }

    #[test]
    fn the_clipped_tangent_is_positive_semidefinite_and_above_the_exact(seed in any::<u64>()) {
        let (membrane, x) = deformed_triangle(seed);
        let scale = stiffness_scale(&membrane, &x);
        let clipped = dense(&membrane, &x, Tangent::Clipped);
        let exact = dense(&membrane, &x, Tangent::Exact);
        // The tolerance is the rounding of a 9 x 9 eigenvalue problem.
        prop_assert!((clipped - clipped.transpose()).norm() < 1e-13 * scale);
        prop_assert!(smallest_eigenvalue(&clipped) > -1e-13 * scale);
        prop_assert!(smallest_eigenvalue(&(clipped - exact)) > -1e-13 * scale);
    }
}
