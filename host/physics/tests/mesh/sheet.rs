//! The sheet generator: counts, groups, winding and errors.

use physics::mesh::generate::{MAX_VERTICES, Pattern, SheetError, sheet};
use physics::mesh::{Adjacency, MeshError, TriMesh};
use proptest::prelude::*;

fn members<'a>(mesh: &'a TriMesh, name: &str) -> &'a [u32] {
    &mesh.group(name).unwrap().members
}

#[test]
fn a_small_sheet_is_as_drawn() {
    let mesh = sheet(0.2, 0.1, 2, 1, Pattern::Alternating).unwrap();
    let x: Vec<f64> = mesh.positions.iter().map(|p| p.x).collect();
    let y: Vec<f64> = mesh.positions.iter().map(|p| p.y).collect();
    assert_eq!(x, [-0.1, 0.0, 0.1, -0.1, 0.0, 0.1]);
    assert_eq!(y, [-0.05, -0.05, -0.05, 0.05, 0.05, 0.05]);
    assert_eq!(mesh.triangles, [[0, 1, 4], [0, 4, 3], [1, 2, 4], [2, 5, 4]]);
    let regular = sheet(0.2, 0.1, 2, 1, Pattern::Regular).unwrap();
    assert_eq!(
        regular.triangles,
        [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]
    );
    let names: Vec<&str> = mesh.vertex_groups.iter().map(|g| g.name.as_str()).collect();
    assert_eq!(names, ["left", "right", "bottom", "top"]);
}

proptest! {
    #[test]
    fn any_sheet_is_a_mesh_of_the_right_size(
        length in 0.01..10.0_f64,
        width in 0.01..10.0_f64,
        nx in 1..30_u32,
        ny in 1..30_u32,
        regular: bool,
    ) {
        let pattern = if regular { Pattern::Regular } else { Pattern::Alternating };
        let mesh = sheet(length, width, nx, ny, pattern).unwrap();
        mesh.validate().unwrap();
        prop_assert_eq!(mesh.positions.len() as u32, (nx + 1) * (ny + 1));
        prop_assert_eq!(mesh.triangles.len() as u32, 2 * nx * ny);
        // The sum has up to 1800 areas, each exact to a few units in the last place.
        prop_assert!((mesh.area() / (length * width) - 1.0).abs() < 1e-12);

        // Each end lies exactly at its coordinate. Its group has the vertices of the end and no others.
        let ends = [("left", 0, -0.5 * length), ("right", 0, 0.5 * length),
                    ("bottom", 1, -0.5 * width), ("top", 1, 0.5 * width)];
        for (name, axis, at) in ends {
            let on: Vec<u32> = (0_u32..)
                .zip(&mesh.positions)
                .filter(|(_, p)| p[axis] == at)
                .map(|(v, _)| v)
                .collect();
            prop_assert_eq!(members(&mesh, name), &on[..]);
        }

        // Seen from +z, all triangles are wound counter-clockwise.
        for triangle in 0..mesh.triangles.len() as u32 {
            let [a, b, c] = mesh.corners(triangle).unwrap();
            prop_assert!((b - a).cross(&(c - a)).z > 0.0);
        }

        // Every edge occurs once: the edges of the border, and by Euler's formula V - E + F = 1 all others.
        let edges = Adjacency::new(&mesh.triangles).unwrap();
        prop_assert_eq!(edges.boundary.len() as u32, 2 * (nx + ny));
        let all = edges.boundary.len() + edges.interior.len();
        prop_assert_eq!(mesh.positions.len() + mesh.triangles.len(), all + 1);
    }

    #[test]
    fn nothing_makes_the_generator_panic(
        length: f64, width: f64,
        nx in prop_oneof![0..40_u32, any::<u32>()],
        ny in prop_oneof![0..40_u32, any::<u32>()],
    ) {
        if let Ok(mesh) = sheet(length, width, nx, ny, Pattern::Regular) {
            prop_assert_eq!(mesh.validate(), Ok(()));
        }
    }
}

#[test]
fn alternating_diagonals_meet_eight_triangles_at_every_second_vertex() {
    let mesh = sheet(1.0, 1.0, 4, 4, Pattern::Alternating).unwrap();
    let around = |vertex: u32| {
        mesh.triangles
            .iter()
            .flatten()
            .filter(|&&v| v == vertex)
            .count()
    };
    // Inner vertices of a 5 x 5 grid, row by row.
    let counts: Vec<usize> = [6, 7, 8, 11, 12, 13, 16, 17, 18]
        .into_iter()
        .map(around)
        .collect();
    assert_eq!(counts, [8, 4, 8, 4, 8, 4, 8, 4, 8]);
}

#[test]
fn sizes_and_counts_that_make_no_sheet_are_refused() {
    let refused =
        |length, width, nx, ny| sheet(length, width, nx, ny, Pattern::Regular).unwrap_err();
    for found in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        let error = refused(found, 0.1, 1, 1);
        assert!(
            matches!(
                error,
                SheetError::Size {
                    dimension: "length",
                    ..
                }
            ),
            "{error}"
        );
        let error = refused(0.1, found, 1, 1);
        assert!(
            matches!(
                error,
                SheetError::Size {
                    dimension: "width",
                    ..
                }
            ),
            "{error}"
        );
    }
    assert_eq!(
        refused(1.0, 1.0, 0, 1),
        SheetError::NoCells { along: "length" }
    );
    assert_eq!(
        refused(1.0, 1.0, 1, 0),
        SheetError::NoCells { along: "width" }
    );
    const { assert!(2236 * 2236 < MAX_VERTICES && 2237 * 2237 > MAX_VERTICES) };
    let error = refused(1.0, 1.0, 2236, 2236);
    assert_eq!(
        error,
        SheetError::TooMany {
            nx: 2236,
            ny: 2236,
            vertices: 2237 * 2237
        }
    );
    assert!(matches!(
        refused(1.0, 1.0, u32::MAX, u32::MAX),
        SheetError::TooMany { .. }
    ));
    assert!(matches!(
        refused(1.0, 1e-9, 1, 1),
        SheetError::Mesh(MeshError::Flat { .. })
    ));
    assert!(matches!(
        refused(1e10, 1e10, 1, 1),
        SheetError::Mesh(MeshError::Coordinate { .. })
    ));
}
