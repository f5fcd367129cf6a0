//! The generator of plates with a hole: counts, groups, symmetry, area, and errors.

use core::f64::consts::PI;
use physics::Vec3;
use physics::mesh::generate_plate::{
    HoledPlate, PlateError, Rays, plate_with_hole, quarter_plate_with_hole,
};
use physics::mesh::{Adjacency, MeshError, TriMesh};
use proptest::prelude::*;

const PLATE: HoledPlate = HoledPlate {
    width: 0.3,
    height: 0.2,
    radius: 0.05,
    around: 6,
    outward: 4,
    growth: 1.15,
    rays: Rays::ThroughCorners,
};

fn members(mesh: &TriMesh, name: &str) -> Vec<Vec3> {
    let group = mesh.group(name).unwrap();
    let at = |&vertex: &u32| mesh.positions[vertex as usize];
    group.members.iter().map(at).collect()
}

#[test]
fn a_small_quarter_is_as_drawn() {
    let plate = HoledPlate {
        width: 4.0,
        height: 4.0,
        radius: 1.0,
        around: 2,
        outward: 2,
        growth: 2.0,
        rays: Rays::Equal,
    };
    let mesh = quarter_plate_with_hole(&plate).unwrap();
    // The cells grow by a factor of two: the first has a third of the length, the second two thirds. With an even
    // number of cells, a ray of a square's quarter meets the corner.
    let third = 0.5_f64.sqrt() * 2.0 / 3.0 + 2.0 / 3.0;
    let expected = [
        [1.0, 0.0],
        [4.0 / 3.0, 0.0],
        [2.0, 0.0],
        [0.5_f64.sqrt(); 2],
        [third; 2],
        [2.0, 2.0],
        [0.0, 1.0],
        [0.0, 4.0 / 3.0],
        [0.0, 2.0],
    ];
    assert_eq!(mesh.positions.len(), expected.len());
    for (x, [a, b]) in mesh.positions.iter().zip(expected) {
        // The tolerance is a few roundings of numbers near 1.
        assert!((x - Vec3::new(a, b, 0.0)).norm() < 1e-15, "{x}");
    }
    let triangles = [
        [0, 1, 4],
        [0, 4, 3],
        [1, 2, 4],
        [2, 5, 4],
        [3, 4, 6],
        [4, 7, 6],
        [4, 5, 8],
        [4, 8, 7],
    ];
    assert_eq!(mesh.triangles, triangles);
    for (name, expected) in [
        ("hole", [0, 3, 6].as_slice()),
        ("right", &[2, 5]),
        ("top", &[5, 8]),
        ("symmetry_x", &[6, 7, 8]),
        ("symmetry_y", &[0, 1, 2]),
    ] {
        assert_eq!(mesh.group(name).unwrap().members, expected, "{name}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn any_plate_is_a_mesh_of_the_right_size(
        width in 0.1..1.0_f64,
        height in 0.1..1.0_f64,
        hole in 0.05..0.95_f64,
        around in 2..20_u32,
        outward in 1..12_u32,
        growth in 0.8..1.4_f64,
        equal: bool,
    ) {
        let radius = hole * 0.5 * width.min(height);
        let rays = if equal { Rays::Equal } else { Rays::ThroughCorners };
        let plate = HoledPlate { width, height, radius, around, outward, growth, rays };
        let whole = plate_with_hole(&plate).unwrap();
        let quarter = quarter_plate_with_hole(&plate).unwrap();
        prop_assert_eq!(whole.triangles.len() as u32, 8 * around * outward);
        prop_assert_eq!(quarter.triangles.len() as u32, 2 * around * outward);
        prop_assert_eq!(whole.positions.len() as u32, 4 * around * (outward + 1));
        prop_assert_eq!(quarter.positions.len() as u32, (around + 1) * (outward + 1));
        // The area is a sum of some thousand areas.
        prop_assert!((whole.area() - 4.0 * quarter.area()).abs() < 1e-12 * whole.area());
        for mesh in [&whole, &quarter] {
            mesh.validate().unwrap();
            for triangle in 0..mesh.triangles.len() as u32 {
                let [a, b, c] = mesh.corners(triangle).unwrap();
                prop_assert!((b - a).cross(&(c - a)).z > 0.0);
            }
            for x in members(mesh, "hole") {
                prop_assert!((x.norm() - radius).abs() < 1e-15, "{}", x);
            }
            for x in &mesh.positions {
                prop_assert!(x.norm() > radius * (1.0 - 1e-15));
                prop_assert!(x.x.abs() <= 0.5 * width && x.y.abs() <= 0.5 * height);
            }
        }
        if rays == Rays::ThroughCorners {
            let hole = members(&whole, "hole");
            let next = hole.iter().cycle().skip(1);
            let polygon: f64 = hole.iter().zip(next).map(|(a, b)| 0.5 * a.cross(b).z).sum();
            let expected = width * height - polygon;
            prop_assert!((whole.area() - expected).abs() < 1e-12 * width * height);
        }
        // The plate is a ring, so Euler's formula is V - E + F = 0. A quarter is a disc.
        for (mesh, euler) in [(&whole, 0), (&quarter, 1)] {
            let edges = Adjacency::new(&mesh.triangles).unwrap();
            let all = edges.boundary.len() + edges.interior.len();
            prop_assert_eq!(mesh.positions.len() + mesh.triangles.len(), all + euler);
        }
    }

    #[test]
    fn nothing_makes_the_generator_panic(
        width: f64, height: f64, radius: f64, growth: f64,
        around in prop_oneof![0..20_u32, any::<u32>()],
        outward in prop_oneof![0..20_u32, any::<u32>()],
    ) {
        for rays in [Rays::Equal, Rays::ThroughCorners] {
            let plate = HoledPlate { width, height, radius, around, outward, growth, rays };
            for mesh in [plate_with_hole(&plate), quarter_plate_with_hole(&plate)].into_iter().flatten() {
                prop_assert_eq!(mesh.validate(), Ok(()));
            }
        }
    }
}

#[test]
fn the_area_converges_with_the_square_of_the_cells() {
    for rays in [Rays::ThroughCorners, Rays::Equal] {
        // With an even number of cells, both kinds of rays meet the corners of a square.
        let error = |around| {
            let plate = HoledPlate {
                width: 0.2,
                around,
                rays,
                ..PLATE
            };
            let area = plate_with_hole(&plate).unwrap().area();
            area - (0.04 - PI * 0.0025)
        };
        let slope = (error(16) / error(32)).log2();
        // The error of the polygon is a series in the square of the angle, here 0.05. Its second term is 1e-3 of the
        // first.
        assert!((slope - 2.0).abs() < 2e-3, "{slope}");
    }
    // With an odd number of cells, equal rays cut the corners. This reduces the area by an error of the same order.
    let cut = |around| {
        let plate = HoledPlate {
            width: 0.2,
            around,
            rays: Rays::Equal,
            ..PLATE
        };
        let kept = HoledPlate {
            rays: Rays::ThroughCorners,
            ..plate
        };
        let [cut, kept] = [plate, kept].map(|plate| plate_with_hole(&plate).unwrap().area());
        kept - cut
    };
    // The error falls with the square of the size: (7 / 15)^2 = 0.22.
    assert!(cut(15) > 0.0 && cut(15) < 0.3 * cut(7));
}

#[test]
fn the_whole_plate_is_symmetric_to_the_bit() {
    for around in [5, 6] {
        let mesh = plate_with_hole(&HoledPlate { around, ..PLATE }).unwrap();
        let key = |x: Vec3| [x.x + 0.0, x.y + 0.0].map(f64::to_bits);
        let triangles = |sign: Vec3| {
            let mut all: Vec<[[u64; 2]; 3]> = (0..mesh.triangles.len() as u32)
                .map(|triangle| {
                    let corners = mesh.corners(triangle).unwrap();
                    let mut keys = corners.map(|x| key(x.component_mul(&sign)));
                    keys.sort_unstable();
                    keys
                })
                .collect();
            all.sort_unstable();
            all
        };
        let itself = triangles(Vec3::new(1.0, 1.0, 1.0));
        assert_eq!(itself, triangles(Vec3::new(-1.0, 1.0, 1.0)));
        assert_eq!(itself, triangles(Vec3::new(1.0, -1.0, 1.0)));
    }
}

#[test]
fn borders_are_complete() {
    for plate in [
        PLATE,
        HoledPlate {
            width: 0.15,
            around: 7,
            ..PLATE
        },
    ] {
        let mesh = plate_with_hole(&plate).unwrap();
        let border = ["left", "right", "bottom", "top"].map(|name| members(&mesh, name));
        let on_border: usize = border.iter().map(Vec::len).sum();
        // A corner belongs to two groups.
        assert_eq!(on_border as u32, 4 * plate.around + 4);
        assert_eq!(members(&mesh, "hole").len() as u32, 4 * plate.around);
        let quarter = quarter_plate_with_hole(&plate).unwrap();
        for name in ["symmetry_x", "symmetry_y"] {
            assert_eq!(members(&quarter, name).len() as u32, plate.outward + 1);
        }
    }
}

#[test]
fn sizes_and_counts_that_make_no_plate_are_refused() {
    let refused = |plate: &HoledPlate| {
        assert!(quarter_plate_with_hole(plate).is_err());
        plate_with_hole(plate).unwrap_err()
    };
    for found in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        for (size, plate) in [
            (
                "width",
                HoledPlate {
                    width: found,
                    ..PLATE
                },
            ),
            (
                "height",
                HoledPlate {
                    height: found,
                    ..PLATE
                },
            ),
            (
                "radius",
                HoledPlate {
                    radius: found,
                    ..PLATE
                },
            ),
        ] {
            let error = refused(&plate);
            assert!(
                matches!(error, PlateError::Size { dimension: named, .. } if named == size),
                "{error}"
            );
        }
        let plate = HoledPlate {
            growth: found,
            ..PLATE
        };
        assert!(matches!(refused(&plate), PlateError::Growth { .. }));
    }
    let wide = HoledPlate {
        radius: 0.1,
        ..PLATE
    };
    assert_eq!(
        refused(&wide),
        PlateError::Hole {
            found: 0.1,
            limit: 0.1
        }
    );
    let one = HoledPlate { around: 1, ..PLATE };
    assert!(matches!(
        refused(&one),
        PlateError::Cells {
            found: 1,
            least: 2,
            ..
        }
    ));
    let none = HoledPlate {
        outward: 0,
        ..PLATE
    };
    assert!(matches!(
        refused(&none),
        PlateError::Cells {
            found: 0,
            least: 1,
            ..
        }
    ));
    let many = HoledPlate {
        around: u32::MAX,
        outward: u32::MAX,
        ..PLATE
    };
    assert!(matches!(refused(&many), PlateError::TooMany { .. }));
    let steep = HoledPlate {
        growth: 1e9,
        ..PLATE
    };
    assert!(matches!(
        refused(&steep),
        PlateError::Mesh(MeshError::Flat { .. } | MeshError::Tiny { .. })
    ));
}
