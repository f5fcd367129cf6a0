//! The checks of triangle meshes, each with an input that the check refuses, and the queries of a mesh.

use physics::Vec3;
use physics::mesh::check::{MAX_COORDINATE, MIN_HEIGHT_RATIO};
use physics::mesh::{Adjacency, Group, MeshError, TriMesh};

/// Two triangles that make the unit square, their shared edge 0-2.
fn square() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let positions = corners.map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec();
    (positions, vec![[0, 1, 2], [0, 2, 3]])
}

/// The square after `change`, or the error that describes why it is no valid mesh.
fn changed(change: impl FnOnce(&mut Vec<Vec3>, &mut Vec<[u32; 3]>)) -> Result<TriMesh, MeshError> {
    let (mut positions, mut triangles) = square();
    change(&mut positions, &mut triangles);
    TriMesh::new(positions, triangles)
}

#[test]
fn a_square_is_a_mesh_and_answers_for_itself() {
    let mut mesh = changed(|_, _| {}).unwrap();
    // Halves of ones are exact.
    assert_eq!(mesh.area(), 1.0);
    assert_eq!(mesh.triangle_area(1), Some(0.5));
    assert_eq!(mesh.triangle_area(2), None);
    let bounds = mesh.bounds().unwrap();
    assert_eq!(
        (bounds.min, bounds.max),
        (Vec3::zeros(), Vec3::new(1.0, 1.0, 0.0))
    );
    assert_eq!(TriMesh::default().bounds(), None);

    mesh.vertex_groups.push(Group {
        name: "low".to_owned(),
        members: vec![0, 1],
    });
    mesh.triangle_groups.push(Group {
        name: "all".to_owned(),
        members: vec![0, 1],
    });
    assert_eq!(mesh.validate(), Ok(()));
    assert_eq!(mesh.group("low").unwrap().members, [0, 1]);
    assert_eq!(mesh.group("all"), None);
}

#[test]
fn coordinates_must_be_finite_and_bounded() {
    for found in [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        1.001 * MAX_COORDINATE,
    ] {
        let error = changed(|positions, _| positions[2].y = found).unwrap_err();
        assert!(
            matches!(
                error,
                MeshError::Coordinate {
                    vertex: 2,
                    axis: "y",
                    ..
                }
            ),
            "{found}: {error}"
        );
    }
}

#[test]
fn triangles_must_name_three_existing_vertices() {
    let error = changed(|_, triangles| triangles[1] = [0, 2, 4]).unwrap_err();
    assert_eq!(
        error,
        MeshError::Index {
            triangle: 1,
            found: 4,
            vertices: 4
        }
    );
    assert_eq!(
        error.to_string(),
        "triangle 1: vertex 4 does not exist; the mesh has 4 vertices, counted from 0"
    );
    for (corners, vertex) in [([2, 2, 3], 2), ([3, 0, 3], 3), ([0, 3, 3], 3)] {
        let error = changed(|_, triangles| triangles[1] = corners).unwrap_err();
        assert_eq!(
            error,
            MeshError::RepeatedVertex {
                triangle: 1,
                vertex
            }
        );
    }
}

#[test]
fn triangles_must_have_area_at_any_scale() {
    let squashed = |scale: f64, height: f64| {
        changed(|positions, _| {
            // The diagonal 0-2 is the longest edge of triangle 1. Vertex 3 is moved to a place just beside it.
            let beside = Vec3::new(-1.0, 1.0, 0.0).normalize() * (height * 2.0_f64.sqrt());
            positions[3] = Vec3::new(0.5, 0.5, 0.0) + beside;
            for p in positions {
                *p *= scale;
            }
        })
    };
    for scale in [1e-6, 1.0, 1e6] {
        // Rounding of coordinates near 1 moves a height by about 1e-16, far less than 1 % of the limit.
        assert!(
            squashed(scale, 1.01 * MIN_HEIGHT_RATIO).is_ok(),
            "scale {scale}"
        );
        let error = squashed(scale, 0.99 * MIN_HEIGHT_RATIO).unwrap_err();
        assert!(
            matches!(error, MeshError::Flat { triangle: 1, .. }),
            "scale {scale}: {error}"
        );
    }
    let error = changed(|positions, _| positions[3] = positions[0]).unwrap_err();
    assert!(
        matches!(error, MeshError::Flat { triangle: 1, .. }),
        "{error}"
    );
    let error = changed(|positions, _| positions.fill(Vec3::zeros())).unwrap_err();
    assert_eq!(
        error,
        MeshError::Flat {
            triangle: 0,
            found: 0.0
        }
    );
}

#[test]
fn triangles_must_be_resolved_by_the_coordinates() {
    let with_speck = |size: f64| {
        changed(|positions, triangles| {
            let first = positions.len() as u32;
            let corners = [[0.0, 0.0], [size, 0.0], [0.0, size]];
            positions.extend(corners.map(|[x, y]| Vec3::new(x, y, 0.0)));
            triangles.push([first, first + 1, first + 2]);
        })
    };
    // The diagonal of the square is sqrt(2), and so is the longest edge of the small triangle over its size. The limit
    // therefore lies at a size of MIN_EDGE_RATIO = 1e-9.
    assert!(with_speck(1.01e-9).is_ok());
    let error = with_speck(0.99e-9).unwrap_err();
    assert!(
        matches!(error, MeshError::Tiny { triangle: 2, .. }),
        "{error}"
    );
}

#[test]
fn at_most_two_triangles_may_meet_at_an_edge() {
    let error = changed(|positions, triangles| {
        positions.push(Vec3::new(0.5, 0.5, 1.0));
        triangles.push([2, 0, 4]);
    })
    .unwrap_err();
    assert_eq!(
        error,
        MeshError::CrowdedEdge {
            a: 0,
            b: 2,
            triangles: [0, 1, 2]
        }
    );
    assert_eq!(
        error.to_string(),
        "edge 0-2: triangles 0, 1 and 2 meet there; at most two triangles may share an edge"
    );
}

#[test]
fn no_triangle_may_occur_twice_and_no_vertex_may_be_unused() {
    let (positions, _) = square();
    let twice = TriMesh::new(positions[..3].to_vec(), vec![[0, 1, 2], [2, 1, 0]]);
    assert_eq!(
        twice,
        Err(MeshError::Duplicate {
            triangle: 1,
            first: 0
        })
    );
    let alone = TriMesh::new(positions.clone(), vec![[0, 1, 2]]);
    assert_eq!(alone, Err(MeshError::Unused { vertex: 3 }));
    assert_eq!(TriMesh::new(positions, Vec::new()), Err(MeshError::Empty));
    assert_eq!(TriMesh::new(Vec::new(), Vec::new()), Err(MeshError::Empty));
}

#[test]
fn groups_must_ascend_exist_and_have_their_own_names() {
    let mesh = changed(|_, _| {}).unwrap();
    let group = |members: &[u32]| Group {
        name: "g".to_owned(),
        members: members.to_vec(),
    };
    let fault = |vertices: Vec<Group>, triangles: Vec<Group>| {
        let groups = TriMesh {
            vertex_groups: vertices,
            triangle_groups: triangles,
            ..mesh.clone()
        };
        groups.validate()
    };
    let refused = |position, found, count| {
        Err(MeshError::GroupMember {
            name: "g".to_owned(),
            position,
            found,
            count,
        })
    };
    assert_eq!(fault(vec![group(&[0, 2, 3])], vec![group(&[0, 1])]), Ok(()));
    assert_eq!(fault(vec![group(&[0, 4])], Vec::new()), refused(1, 4, 4));
    assert_eq!(fault(vec![group(&[2, 1])], Vec::new()), refused(1, 1, 4));
    assert_eq!(fault(vec![group(&[2, 2])], Vec::new()), refused(1, 2, 4));
    assert_eq!(fault(Vec::new(), vec![group(&[2])]), refused(0, 2, 2));
    let twice = fault(vec![group(&[0]), group(&[1])], Vec::new());
    assert_eq!(
        twice,
        Err(MeshError::GroupName {
            name: "g".to_owned()
        })
    );
}

#[test]
fn edges_are_found_in_order_whatever_the_order_of_triangles() {
    let (_, triangles) = square();
    let one = Adjacency::new(&triangles).unwrap();
    let interior = &one.interior[0];
    assert_eq!(one.interior.len(), 1);
    assert_eq!(
        (interior.vertices, interior.triangles, interior.opposite),
        ([0, 2], [0, 1], [1, 3])
    );
    let boundary: Vec<_> = one
        .boundary
        .iter()
        .map(|e| (e.vertices, e.triangle, e.opposite))
        .collect();
    assert_eq!(
        boundary,
        [
            ([0, 1], 0, 2),
            ([0, 3], 1, 2),
            ([1, 2], 0, 0),
            ([2, 3], 1, 0)
        ]
    );

    let swapped = Adjacency::new(&[[3, 0, 2], [2, 1, 0]]).unwrap();
    let edges = |a: &Adjacency| a.boundary.iter().map(|e| e.vertices).collect::<Vec<_>>();
    assert_eq!(edges(&one), edges(&swapped));
    assert_eq!(swapped.interior[0].opposite, [3, 1]);
    assert_eq!(Adjacency::new(&[]), Ok(Adjacency::default()));
}
