//! The checks of tetrahedral meshes, each with an input that the check refuses.

use physics::mesh::check::MAX_COORDINATE;
use physics::mesh::check_solid::MIN_VOLUME_RATIO;
use physics::mesh::generate_box::solid_box;
use physics::mesh::tet::MIDSIDE_ENDS;
use physics::mesh::{Cells, Field, Group, MeshError, SolidError, TetMesh};
use physics::{Body, BodyConfig, SolidLaw, SolidMaterial, Vec3};

/// Two tetrahedra on either side of the face 1-2-3.
fn two() -> TetMesh {
    let positions = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 1.0, 1.0],
    ];
    let cells = Cells::Linear(vec![[0, 1, 2, 3], [4, 1, 3, 2]]);
    TetMesh::new(positions.map(Vec3::from).to_vec(), cells).unwrap()
}

/// The two cells after a change to positions and cells.
fn linear(change: impl FnOnce(&mut Vec<Vec3>, &mut Vec<[u32; 4]>)) -> Result<(), SolidError> {
    let mut mesh = two();
    let Cells::Linear(cells) = &mut mesh.cells else {
        panic!()
    };
    change(&mut mesh.positions, cells);
    mesh.validate()
}

/// The same as [`linear`], with quadratic cells.
fn quadratic(change: impl FnOnce(&mut Vec<Vec3>, &mut Vec<[u32; 10]>)) -> Result<(), SolidError> {
    let mut mesh = two().quadratic();
    mesh.validate().unwrap();
    let Cells::Quadratic(cells) = &mut mesh.cells else {
        panic!()
    };
    change(&mut mesh.positions, cells);
    mesh.validate()
}

#[test]
fn generated_solids_pass() {
    let mesh = solid_box([0.3, 0.2, 0.1], [3, 2, 2]).unwrap();
    assert_eq!(mesh.validate(), Ok(()));
    assert_eq!(mesh.quadratic().validate(), Ok(()));
    for size in [1e-90, 1e-6, 1e8] {
        let mesh = solid_box([size; 3], [2; 3]).unwrap();
        assert_eq!(mesh.validate(), Ok(()), "{size}");
    }
    // The mesh is so small that volumes are zero in double precision.
    let mesh = solid_box([1e-150; 3], [2; 3]).unwrap();
    assert!(matches!(mesh.validate(), Err(SolidError::Flat { .. })));
}

#[test]
fn the_checks_of_sheets_hold_for_solids() {
    for found in [f64::NAN, f64::INFINITY, 1.001 * MAX_COORDINATE] {
        let error = linear(|positions, _| positions[2].y = found).unwrap_err();
        let is_coordinate = matches!(
            error,
            SolidError::Common(MeshError::Coordinate {
                vertex: 2,
                axis: "y",
                ..
            })
        );
        assert!(is_coordinate, "{error}");
    }
    let mut mesh = two();
    mesh.cell_groups.push(Group {
        name: "both".to_owned(),
        members: vec![0, 2],
    });
    assert_eq!(
        mesh.validate().unwrap_err().to_string(),
        "group \"both\": member number 1 is 2; members must ascend and be below 2"
    );
    mesh.cell_groups.clear();
    let field = |name: &str, values: &[f64]| Field {
        name: name.to_owned(),
        values: values.to_vec(),
    };
    for (fields, expected) in [
        (
            vec![field("a", &[1.0])],
            "field \"a\" has 1 values; 2 values are needed",
        ),
        (
            vec![field("a", &[1.0, f64::NAN])],
            "field \"a\": value number 1 is NaN; every value must be finite",
        ),
        (
            vec![field("a", &[1.0; 2]), field("a", &[2.0; 2])],
            "field \"a\": two fields have this name; each field needs its own name",
        ),
    ] {
        mesh.cell_fields = fields;
        assert_eq!(mesh.validate().unwrap_err().to_string(), expected);
    }
}

#[test]
fn cells_must_name_different_vertices_that_exist() {
    assert_eq!(
        linear(|_, cells| cells.clear()).unwrap_err(),
        SolidError::Empty
    );
    assert_eq!(
        linear(|_, cells| cells[1][3] = 5).unwrap_err().to_string(),
        "cell 1: vertex 5 does not exist; the mesh has 5 vertices, counted from 0"
    );
    assert_eq!(
        linear(|_, cells| cells[1][3] = 1).unwrap_err(),
        SolidError::RepeatedVertex { cell: 1, vertex: 1 }
    );
    assert_eq!(
        quadratic(|_, cells| cells[1][9] = cells[1][4]).unwrap_err(),
        SolidError::RepeatedVertex {
            cell: 1,
            vertex: 11
        }
    );
    assert_eq!(
        linear(|positions, _| positions.push(Vec3::repeat(2.0))).unwrap_err(),
        SolidError::Unused { vertex: 5 }
    );
}

#[test]
fn cells_must_have_a_positive_volume_at_any_scale() {
    assert_eq!(
        linear(|_, cells| cells[0].swap(1, 2))
            .unwrap_err()
            .to_string(),
        "cell 0: its volume is -1.667e-1 m^3 and must be positive; exchange two corners, and the midsides \
         with these corners"
    );
    for scale in [1e-6, 1.0, 1e6] {
        let squashed = |height: f64| {
            linear(|positions, _| {
                // The longest edge is an edge of the face, sqrt(2). The area of the face is sqrt(3) / 2, and 6 V is the
                // height times twice that area.
                let height = height * 8_f64.sqrt() / 3_f64.sqrt();
                positions[0] = Vec3::repeat(1.0 / 3.0) - Vec3::repeat(height / 3_f64.sqrt());
                for x in positions {
                    *x *= scale;
                }
            })
        };
        let flat = squashed(0.99 * MIN_VOLUME_RATIO).unwrap_err();
        assert!(matches!(flat, SolidError::Flat { cell: 0, .. }), "{flat}");
        assert_eq!(squashed(1.01 * MIN_VOLUME_RATIO), Ok(()));
        assert!(matches!(
            squashed(0.0).unwrap_err(),
            SolidError::Flat { cell: 0, .. }
        ));
    }
    let tiny = linear(|positions, cells| {
        for k in 0..4 {
            positions.push(positions[k] * 1e-10 + Vec3::repeat(-3.0));
        }
        cells.push([5, 6, 7, 8]);
    });
    let tiny = tiny.unwrap_err();
    assert!(matches!(tiny, SolidError::Tiny { cell: 2, .. }), "{tiny}");
}

#[test]
fn a_mesh_that_passes_can_be_simulated() {
    // The cell is just above the limit: once straight, and once with midsides that nearly fold it.
    let material = SolidMaterial {
        young: 1e4,
        poisson: 0.3,
        density: 1e3,
    };
    let body = |mesh: &TetMesh| {
        Body::solid(
            mesh,
            &[material],
            SolidLaw::Linear,
            BodyConfig::default(),
            &[],
        )
        .map(drop)
    };
    let mut mesh = two();
    mesh.positions[0] = Vec3::repeat(1.0 / 3.0 - 2.0 * MIN_VOLUME_RATIO);
    assert_eq!(mesh.validate(), Ok(()));
    assert!(body(&mesh).is_ok());

    let (mut last_good, mut refused) = (0.0, false);
    for step in 0..200 {
        let mut mesh = two().quadratic();
        let Cells::Quadratic(cells) = &mesh.cells else {
            panic!()
        };
        // The middle of the edge 0-1 is moved towards vertex 0 and beyond it.
        let middle = cells[0][4] as usize;
        let by = 0.01 * f64::from(step);
        mesh.positions[middle].x -= by;
        match mesh.validate() {
            Ok(()) => {
                assert!(body(&mesh).is_ok(), "{by}");
                last_good = by;
            }
            Err(error) => {
                assert!(
                    matches!(error, SolidError::Folded { cell: 0, .. }),
                    "{error}"
                );
                assert!(body(&mesh).is_err(), "{by}");
                refused = true;
            }
        }
    }
    // The Jacobian at corner 0 vanishes at a quarter of the edge. The points of quadrature lie further inside.
    assert!(refused && last_good > 0.25, "{last_good}");
}

#[test]
fn midsides_in_another_programs_order_fold_the_cell() {
    let error = quadratic(|_, cells| {
        for cell in cells {
            cell.swap(8, 9);
        }
    });
    assert!(matches!(
        error.unwrap_err(),
        SolidError::Folded { cell: 0, .. }
    ));
}

#[test]
fn two_cells_may_not_lie_on_one_side_of_a_face() {
    // The same cell occurs again. Its corners are counted from another corner, by an even permutation.
    assert_eq!(
        linear(|_, cells| cells.push([1, 2, 0, 3])).unwrap_err(),
        SolidError::Overlap {
            cell: 2,
            first: 0,
            face: [0, 1, 2]
        }
    );
    // A third cell lies on the face 1-2-3.
    let third = linear(|positions, cells| {
        positions.push(Vec3::repeat(0.8));
        cells.push([5, 1, 3, 2]);
    });
    assert_eq!(
        third.unwrap_err().to_string(),
        "cell 2 overlaps cell 1: both cells lie on one side of the face 1-2-3"
    );
}

#[test]
fn an_edge_has_one_middle_and_a_middle_one_edge() {
    // The edge 1-2 belongs to both cells. In the second cell it gets a middle of its own, close to the first middle.
    let at = |cell: &[u32; 10], ends: [u32; 2]| {
        let slot = MIDSIDE_ENDS
            .into_iter()
            .position(|[a, b]| [cell[a].min(cell[b]), cell[a].max(cell[b])] == ends);
        4 + slot.unwrap()
    };
    let error = quadratic(|positions, cells| {
        let slot = at(&cells[1], [1, 2]);
        let middle = positions[cells[1][slot] as usize];
        positions.push(middle + Vec3::repeat(0.01));
        cells[1][slot] = positions.len() as u32 - 1;
    });
    assert_eq!(
        error.unwrap_err().to_string(),
        "cell 1: the edge 1-2 has its middle at vertex 14, but at vertex 6 in cell 0, so the mesh is not \
         connected there"
    );
    // Two separate cells, one just beside the other, have one vertex as the middle of both edges 0-1.
    let mut pair = two();
    pair.cells = Cells::Linear(vec![[0, 1, 2, 3]]);
    pair.positions.truncate(4);
    let mut pair = pair.quadratic();
    let beside: Vec<Vec3> = pair.positions.iter().map(|x| x.add_scalar(0.01)).collect();
    pair.positions.extend(beside);
    let Cells::Quadratic(cells) = &mut pair.cells else {
        panic!()
    };
    cells.push(cells[0].map(|vertex| vertex + 10));
    pair.validate().unwrap();
    let Cells::Quadratic(cells) = &mut pair.cells else {
        panic!()
    };
    // The middle without a cell is removed, and the numbers of the later vertices decrease.
    let (kept, left) = (cells[0][4], cells[1][4]);
    pair.positions.remove(left as usize);
    for vertex in &mut cells[1] {
        *vertex -= u32::from(*vertex > left);
    }
    cells[1][4] = kept;
    assert_eq!(
        pair.validate().unwrap_err().to_string(),
        "cell 1: vertex 4 is the middle of the edge 10-11, and of another edge in cell 0"
    );
    // A corner of a third cell is the middle of an edge.
    let mut mesh = two().quadratic();
    let Cells::Quadratic(cells) = &mut mesh.cells else {
        panic!()
    };
    let middle = cells[0][4];
    let start = mesh.positions.len() as u32;
    let corners = [middle, start, start + 1, start + 2];
    let below = mesh.positions[middle as usize] - Vec3::repeat(1.0);
    for offset in [Vec3::y(), Vec3::x(), Vec3::z()] {
        mesh.positions.push(below - offset);
    }
    let mut cell = [0; 10];
    cell[..4].copy_from_slice(&corners);
    for (slot, [a, b]) in cell[4..].iter_mut().zip(MIDSIDE_ENDS) {
        let [a, b] = [a, b].map(|k| mesh.positions[corners[k] as usize]);
        mesh.positions.push((a + b) / 2.0);
        *slot = mesh.positions.len() as u32 - 1;
    }
    cells.push(cell);
    let error = mesh.validate().unwrap_err();
    assert_eq!(
        error,
        SolidError::MiddleIsCorner {
            cell: 0,
            vertex: middle,
            corner_of: 2
        },
        "{error}"
    );
}
