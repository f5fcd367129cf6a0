//! Loads per length as forces on vertices: totals, moments, and stress in balance with itself.

use common::irregular;
use physics::body::load::{Spread, edge_traction, spread_on_solid, traction};
use physics::mesh::generate_plate::{HoledPlate, Rays, plate_with_hole};
use physics::mesh::{Cells, MeshError, TetMesh};
use physics::{Mat3, Vec3};

#[test]
fn an_edge_receives_the_exact_force_and_moment_of_a_quadratic_load() {
    let mesh = irregular(7, 4, 0.1, 0.04, 0.2, 3);
    let end: Vec<u32> = (0_u32..)
        .zip(&mesh.positions)
        .filter(|(_, x)| x.x > 0.1 - 1e-9)
        .map(|(vertex, _)| vertex)
        .collect();
    let load = |at: &Vec3, normal: &Vec3| {
        assert!((normal - Vec3::x()).norm() < 1e-12);
        Vec3::new(3.0 * at.y * at.y, 2.0, at.y)
    };
    let (forces, length) = edge_traction(&mesh, &end, load).unwrap();
    // The tolerance is a few roundings.
    assert!((length - 0.04).abs() < 1e-15);
    let total: Vec3 = forces.iter().sum();
    assert!((total - Vec3::new(0.04_f64.powi(3), 0.08, 0.0008)).norm() < 1e-15);
    let moment: Vec3 = forces
        .iter()
        .zip(&mesh.positions)
        .map(|(f, x)| x.cross(f))
        .sum();
    // The moment about z is x f_y less the integral of y 3 y^2.
    assert!((moment.z - (0.1 * 0.08 - 0.75 * 0.04_f64.powi(4))).abs() < 1e-15);
    let on_end = |vertex: u32| end.contains(&vertex);
    assert!(
        (0_u32..)
            .zip(&forces)
            .all(|(v, f)| on_end(v) || *f == Vec3::zeros())
    );
}

/// A quadratic tetrahedron with three square corners at the origin. With `bulge` one, the middles of the fourth face lie on
/// the sphere around the origin through its corners; with zero, its edges are straight.
fn cap(size: f64, bulge: f64) -> TetMesh {
    let corners = [
        Vec3::zeros(),
        Vec3::x() * size,
        Vec3::y() * size,
        Vec3::z() * size,
    ];
    let mut positions = corners.to_vec();
    for (a, b) in [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)] {
        let middle: Vec3 = 0.5 * (corners[a] + corners[b]);
        let outer = if a == 0 {
            middle
        } else {
            middle.normalize() * size
        };
        positions.push(middle + (outer - middle) * bulge);
    }
    let cells = Cells::Quadratic(vec![[0, 1, 2, 3, 4, 5, 6, 7, 8, 9]]);
    TetMesh::new(positions, cells).unwrap()
}

#[test]
fn a_traction_acts_on_the_curved_face() {
    // The plane faces are those of their corners and curved edges: a quadratic edge bulges by 2/3 of the height of its
    // middle over its length. The curved one has an area of 0.0143946 m^2 (integrated by NumPy).
    let mesh = cap(0.1, 1.0);
    let outer: Vec<u32> = vec![1, 2, 3, 5, 8, 9];
    let Spread { fractions, area } = spread_on_solid(&mesh, &outer);
    assert!((area - 0.014_394_6).abs() < 1e-7, "{area}");
    assert!((fractions.iter().sum::<f64>() - 1.0).abs() < 1e-14);
    // A face that is symmetric in its corners carries alike on each, and on each middle.
    for [first, second, third] in [[1, 2, 3], [5, 8, 9]] {
        let [a, b, c] = [first, second, third].map(|vertex: usize| fractions[vertex]);
        // The rule is folded to one corner, and has six digits.
        assert!((a - b).abs() < 1e-6 && (b - c).abs() < 1e-6 && a.abs() > 1e-3);
    }
    // The resultant of a uniform pressure on the plane x = 0 is its area; the face has the edges of the other three.
    let all: Vec<u32> = (0..10).collect();
    let (forces, all_area) = traction(&mesh, &all, Vec3::x());
    let total: Vec3 = forces.iter().sum();
    assert!((total.x - all_area).abs() < 1e-15);

    // Many curved faces approach a sphere: one that is divided less bulges more, and is larger than its corners' triangle.
    let flat = cap(0.1, 0.0);
    let Spread {
        area: plane,
        fractions,
    } = spread_on_solid(&flat, &outer);
    assert!((plane - 0.5 * 3.0_f64.sqrt() * 0.01).abs() < 1e-15);
    // The corners of a straight face carry nothing, to the last bit.
    assert_eq!([1, 2, 3].map(|vertex: usize| fractions[vertex]), [0.0; 3]);
    // A face that bulges by almost nothing is integrated, and agrees.
    let almost = spread_on_solid(&cap(0.1, 1e-6), &outer);
    assert!((almost.area - plane).abs() < 1e-6 * plane);
    for (a, b) in almost.fractions.iter().zip(&fractions) {
        assert!((a - b).abs() < 1e-5);
    }
}

#[test]
fn a_uniform_stress_on_a_plate_with_a_hole_has_no_resultant() {
    let plate = HoledPlate {
        width: 0.3,
        height: 0.2,
        radius: 0.05,
        around: 7,
        outward: 4,
        growth: 1.15,
        rays: Rays::Equal,
    };
    let mesh = plate_with_hole(&plate).unwrap();
    let all: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    let stress = Mat3::new(3.0, -0.5, 0.0, -0.5, 1.0, 0.0, 0.0, 0.0, 0.0);
    let (forces, _) = edge_traction(&mesh, &all, |_, normal| stress * normal).unwrap();
    let total: Vec3 = forces.iter().sum();
    let moment: Vec3 = forces
        .iter()
        .zip(&mesh.positions)
        .map(|(f, x)| x.cross(f))
        .sum();
    // The sums have some fifty terms of 0.1, which round.
    assert!(
        total.norm() < 1e-14 && moment.norm() < 1e-14,
        "{total} {moment}"
    );
    // The forces point outward everywhere. The virial of a uniform pressure is minus twice the area.
    let (forces, _) = edge_traction(&mesh, &all, |_, normal| -*normal).unwrap();
    let virial: f64 = forces
        .iter()
        .zip(&mesh.positions)
        .map(|(f, x)| x.dot(f))
        .sum();
    assert!((virial + 2.0 * mesh.area()).abs() < 1e-14, "{virial}");
}

#[test]
fn vertices_that_do_not_exist_carry_nothing_and_three_triangles_have_no_border() {
    let mut mesh = irregular(3, 2, 0.1, 0.04, 0.0, 3);
    let (forces, length) = edge_traction(&mesh, &[900, 901], |_, _| Vec3::x()).unwrap();
    assert!(length == 0.0 && forces.iter().all(|f| *f == Vec3::zeros()));
    mesh.positions.push(Vec3::z());
    mesh.triangles.push([0, 5, 12]);
    let crowded = edge_traction(&mesh, &[], |_, _| Vec3::x());
    assert!(matches!(crowded, Err(MeshError::CrowdedEdge { .. })));
}
