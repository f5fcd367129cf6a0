//! Meshes of lines: a generated thread has its length, and an error names each fault.

use physics::Vec3;
use physics::mesh::check::Location;
use physics::mesh::generate_thread::{StraightError, straight_thread};
use physics::mesh::{Field, Group, LineMesh, Mesh, MeshError, ThreadError};

fn place(x: f64, y: f64) -> Vec3 {
    Vec3::new(x, y, 0.0)
}

/// A bent line over four vertices.
fn bent() -> LineMesh {
    let positions = vec![
        place(0.0, 0.0),
        place(3.0, 0.0),
        place(3.0, 4.0),
        place(0.0, 4.0),
    ];
    LineMesh::new(positions, vec![[0, 1], [1, 2], [2, 3]]).expect("a mesh")
}

#[test]
fn a_straight_thread_has_its_length_its_ends_and_equal_segments() {
    let mesh = straight_thread(0.3, 7).expect("a thread");
    assert_eq!(mesh.validate(), Ok(()));
    assert_eq!((mesh.positions.len(), mesh.lines.len()), (8, 7));
    for (line, ends) in mesh.lines.iter().enumerate() {
        let [a, b] = ends.map(|vertex| mesh.positions[vertex as usize]);
        let length = (b - a).norm();
        assert!((length - 0.3 / 7.0).abs() < 1e-16, "line {line}: {length}");
    }
    assert_eq!(mesh.positions[0], -mesh.positions[7]);
    let ends = ["left", "right"].map(|name| mesh.group(name).expect("a group").members.clone());
    assert_eq!(ends, [[0], [7]]);
}

#[test]
fn a_thread_that_cannot_be_made_is_refused() {
    for found in [0.0, -1.0, f64::INFINITY] {
        assert_eq!(
            straight_thread(found, 3),
            Err(StraightError::Length { found })
        );
    }
    assert!(matches!(
        straight_thread(f64::NAN, 3),
        Err(StraightError::Length { .. })
    ));
    assert_eq!(straight_thread(1.0, 0), Err(StraightError::NoSegments));
    assert_eq!(
        straight_thread(1.0, u32::MAX),
        Err(StraightError::TooMany {
            segments: u32::MAX,
            vertices: 1 << 32
        })
    );
    // The length is far beyond the allowed coordinates.
    let error = straight_thread(1e10, 2).expect_err("too long");
    assert!(
        matches!(
            error,
            StraightError::Mesh(ThreadError::Common(MeshError::Coordinate { .. }))
        ),
        "{error}"
    );
}

#[test]
fn lines_may_branch_and_come_in_pieces() {
    let star = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)];
    let positions = star.map(|(x, y)| place(x, y)).to_vec();
    assert!(LineMesh::new(positions.clone(), vec![[0, 1], [0, 2], [0, 3]]).is_ok());
    assert!(LineMesh::new(positions, vec![[0, 1], [2, 3]]).is_ok());
}

#[test]
fn every_fault_is_named_with_its_place() {
    let good = bent();
    let with = |change: &dyn Fn(&mut LineMesh)| {
        let mut mesh = good.clone();
        change(&mut mesh);
        let error = mesh.validate().expect_err("a fault");
        let text = error.to_string();
        assert!(!text.contains('\n'), "{text}");
        error
    };
    let error = with(&|mesh| mesh.lines.clear());
    assert_eq!(
        (error.location(), error),
        (Location::Mesh, ThreadError::Empty)
    );
    let error = with(&|mesh| mesh.lines[1][1] = 9);
    let index = ThreadError::Index {
        line: 1,
        found: 9,
        vertices: 4,
    };
    assert_eq!((error.location(), error), (Location::Cell(1), index));
    let error = with(&|mesh| mesh.lines[2] = [3, 3]);
    assert_eq!(error, ThreadError::RepeatedVertex { line: 2, vertex: 3 });
    let error = with(&|mesh| mesh.positions[1] = mesh.positions[0]);
    assert!(
        matches!(error, ThreadError::Short { line: 0, found, .. } if found == 0.0),
        "{error}"
    );
    let error = with(&|mesh| mesh.positions[1] = place(1e-12, 0.0));
    assert!(
        matches!(error, ThreadError::Short { line: 0, .. }),
        "{error}"
    );
    let error = with(&|mesh| mesh.lines.push([1, 0]));
    assert_eq!(error, ThreadError::Duplicate { line: 3, first: 0 });
    let error = with(&|mesh| mesh.positions.push(place(9.0, 9.0)));
    assert_eq!(
        (error.location(), error),
        (Location::Vertex(4), ThreadError::Unused { vertex: 4 })
    );
    let error = with(&|mesh| mesh.positions[2].y = f64::NAN);
    assert_eq!(error.location(), Location::Vertex(2));
    let group = |members: Vec<u32>| Group {
        name: "g".to_owned(),
        members,
    };
    let error = with(&|mesh| mesh.vertex_groups.push(group(vec![4])));
    assert!(matches!(
        error,
        ThreadError::Common(MeshError::GroupMember { count: 4, .. })
    ));
    let error = with(&|mesh| mesh.line_groups.push(group(vec![3])));
    assert!(matches!(
        error,
        ThreadError::Common(MeshError::GroupMember { count: 3, .. })
    ));
    let error = with(&|mesh| {
        mesh.line_fields.push(Field {
            name: "area".to_owned(),
            values: vec![1.0; 4],
        });
    });
    assert!(matches!(
        error,
        ThreadError::Common(MeshError::FieldLength { count: 3, .. })
    ));
}

#[test]
fn a_mesh_of_any_kind_reports_its_contents() {
    let mut thread = bent();
    thread.line_fields.push(Field {
        name: "area".to_owned(),
        values: vec![1e-6, 2e-6, 3e-6],
    });
    let mesh = Mesh::Thread(thread);
    assert_eq!((mesh.positions().len(), mesh.element_count()), (4, 3));
    assert_eq!(mesh.fields().len(), 1);
    assert!(mesh.vertex_groups().is_empty());
}
