//! What is written reads back: every number bit for bit, groups if the format has them.

mod support;

use meshio::write_vtu::UnstructuredGrid;
use meshio::{read_mesh, write_gmsh, write_vtk};
use physics::mesh::generate::{Pattern, sheet};
use physics::mesh::generate_box::solid_box;
use physics::mesh::generate_thread::straight_thread;
use physics::mesh::{Field, Group, LineMesh, Mesh, TetMesh, TriMesh};
use proptest::prelude::*;
use support::{expect_solid, fields, finite, groups, read, solid};

/// Equal as bits: minus zero is not zero.
fn same_bits(a: &[Field], b: &[Field]) -> bool {
    let bits = |fields: &[Field]| -> Vec<(String, Vec<u64>)> {
        let of = |field: &Field| field.values.iter().map(|x| x.to_bits()).collect();
        fields
            .iter()
            .map(|field| (field.name.clone(), of(field)))
            .collect()
    };
    bits(a) == bits(b)
}

/// The groups of vertices that a file is read back with: those of `vertex_groups` whose name no group of elements has,
/// then for each group of elements the group of their vertices.
fn with_vertices_of<const N: usize>(
    element_groups: &[Group],
    elements: &[[u32; N]],
    mut vertex_groups: Vec<Group>,
) -> Vec<Group> {
    vertex_groups.retain(|group| !element_groups.iter().any(|other| other.name == group.name));
    vertex_groups.extend(element_groups.iter().map(|group| {
        let corners = group.members.iter().map(|&e| elements[e as usize]);
        let mut members: Vec<u32> = corners.flatten().collect();
        members.sort_unstable();
        members.dedup();
        Group {
            name: group.name.clone(),
            members,
        }
    }));
    vertex_groups
}

/// Small sheets with groups and fields. As when a file is read, each group of triangles has a group of their
/// vertices; those come last.
fn any_sheet() -> impl Strategy<Value = TriMesh> {
    (1_u32..4, 1_u32..4, finite())
        .prop_flat_map(|(nx, ny, z)| {
            let mut mesh = sheet(0.3, 0.2, nx, ny, Pattern::Alternating).unwrap();
            for x in &mut mesh.positions {
                x.z = z.clamp(-1e9, 1e9);
            }
            let (vertices, triangles) = (mesh.positions.len(), mesh.triangles.len());
            (
                Just(mesh),
                groups(vertices as u32),
                groups(triangles as u32),
                fields(triangles),
            )
        })
        .prop_map(|(mut mesh, vertex_groups, triangle_groups, fields)| {
            mesh.vertex_groups = with_vertices_of(&triangle_groups, &mesh.triangles, vertex_groups);
            mesh.triangle_groups = triangle_groups;
            mesh.triangle_fields = fields;
            mesh
        })
}

/// Short threads with groups and fields. As when a file is read, each group of lines has a group of their ends; those
/// come last.
fn any_thread() -> impl Strategy<Value = LineMesh> {
    (1_u32..6, finite())
        .prop_flat_map(|(segments, z)| {
            let mut mesh = straight_thread(0.3, segments).unwrap();
            for x in &mut mesh.positions {
                x.z = z.clamp(-1e9, 1e9);
            }
            // Out of their order, and a branch.
            mesh.lines.reverse();
            if segments > 2 {
                mesh.lines[0] = [segments, 0];
            }
            let (vertices, lines) = (mesh.positions.len(), mesh.lines.len());
            (
                Just(mesh),
                groups(vertices as u32),
                groups(lines as u32),
                fields(lines),
            )
        })
        .prop_map(|(mut mesh, vertex_groups, line_groups, fields)| {
            mesh.vertex_groups = with_vertices_of(&line_groups, &mesh.lines, vertex_groups);
            mesh.line_groups = line_groups;
            mesh.line_fields = fields;
            mesh
        })
}

fn expect_thread(mesh: Mesh) -> LineMesh {
    match mesh {
        Mesh::Thread(mesh) => mesh,
        other => panic!("no thread: {other:?}"),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn solids_read_back(mesh in solid()) {
        prop_assert_eq!(mesh.validate(), Ok(()));
        let whole = Mesh::Solid(mesh.clone());
        let text = write_gmsh::write(&whole);
        let back = expect_solid(read_mesh("x.msh", text.as_bytes()).unwrap());
        prop_assert!(same_bits(&back.cell_fields, &mesh.cell_fields));
        prop_assert_eq!(back, mesh.clone());

        let mut plain = TetMesh { vertex_groups: Vec::new(), cell_groups: Vec::new(), ..mesh };
        let text = write_vtk::write(&whole);
        let back = expect_solid(read_mesh("x.vtk", text.as_bytes()).unwrap());
        prop_assert!(same_bits(&back.cell_fields, &plain.cell_fields));
        prop_assert_eq!(&back, &plain);

        let text = UnstructuredGrid::of_solid(&plain).vtu();
        let back = expect_solid(read_mesh("x.vtu", text.as_bytes()).unwrap());
        prop_assert!(same_bits(&back.cell_fields, &plain.cell_fields));
        plain.cell_fields = back.cell_fields.clone();
        prop_assert_eq!(&back, &plain);
    }

    #[test]
    fn threads_read_back(mesh in any_thread()) {
        prop_assert_eq!(mesh.validate(), Ok(()));
        let whole = Mesh::Thread(mesh.clone());
        let text = write_gmsh::write(&whole);
        let back = expect_thread(read_mesh("x.msh", text.as_bytes()).unwrap());
        prop_assert!(same_bits(&back.line_fields, &mesh.line_fields));
        prop_assert_eq!(&back, &mesh);

        let plain = LineMesh { vertex_groups: Vec::new(), line_groups: Vec::new(), ..mesh };
        for (name, text) in [
            ("x.vtk", write_vtk::write(&whole)),
            ("x.vtu", UnstructuredGrid::of_thread(&plain).vtu()),
        ] {
            let back = expect_thread(read_mesh(name, text.as_bytes()).unwrap());
            prop_assert!(same_bits(&back.line_fields, &plain.line_fields));
            prop_assert_eq!(&back, &plain);
        }
    }

    #[test]
    fn sheets_read_back(mesh in any_sheet()) {
        prop_assert_eq!(mesh.validate(), Ok(()));
        let whole = Mesh::Sheet(mesh.clone());
        let text = write_gmsh::write(&whole);
        let back = read("x.msh", text.as_bytes()).unwrap();
        prop_assert!(same_bits(&back.triangle_fields, &mesh.triangle_fields));
        prop_assert_eq!(&back, &mesh);

        let plain =
            TriMesh { vertex_groups: Vec::new(), triangle_groups: Vec::new(), ..mesh };
        for (name, text) in [
            ("x.vtk", write_vtk::write(&whole)),
            ("x.vtu", UnstructuredGrid::of_sheet(&plain).vtu()),
        ] {
            let back = read(name, text.as_bytes()).unwrap();
            prop_assert!(same_bits(&back.triangle_fields, &plain.triangle_fields));
            prop_assert_eq!(&back, &plain);
        }
    }
}

#[test]
fn a_group_of_vertices_keeps_the_vertices_beyond_a_group_of_triangles_of_its_name() {
    let mut mesh = sheet(1.0, 1.0, 1, 1, Pattern::Alternating).unwrap();
    let group = |members: &[u32]| {
        vec![Group {
            name: "one".to_owned(),
            members: members.to_vec(),
        }]
    };
    mesh.triangle_groups = group(&[0]);
    mesh.vertex_groups = group(&[0, 1, 2, 3]);
    let back = read("x.msh", write_gmsh::write_sheet(&mesh).as_bytes()).unwrap();
    assert_eq!(back, mesh);
}

#[test]
fn groups_of_vertices_and_of_cells_of_one_name_keep_the_order_of_both_lists() {
    let mut mesh = solid_box([1.0; 3], [1; 3]).unwrap();
    let groups = |names: &[&str]| -> Vec<Group> {
        let named = |name: &&str| Group {
            name: (*name).to_owned(),
            members: vec![0],
        };
        names.iter().map(named).collect()
    };
    mesh.vertex_groups = groups(&["d", "c", "a"]);
    mesh.cell_groups = groups(&["e", "c", "b", "a", "f"]);
    let text = write_gmsh::write_solid(&mesh);
    let back = expect_solid(read_mesh("x.msh", text.as_bytes()).unwrap());
    assert_eq!(back, mesh);
}

#[test]
fn data_that_a_format_cannot_represent_are_omitted() {
    let mut mesh = sheet(1.0, 1.0, 1, 1, Pattern::Alternating).unwrap();
    let group = |name: &str, members: &[u32]| Group {
        name: name.to_owned(),
        members: members.to_vec(),
    };
    mesh.vertex_groups = vec![
        group("none", &[]),
        group("  ", &[1]),
        group("a \"b\"\n$EndNodes", &[2]),
    ];
    let field = |name: &str| Field {
        name: name.to_owned(),
        values: vec![1.0; mesh.triangles.len()],
    };
    mesh.triangle_fields = vec![field(""), field("\n")];
    let back = read("x.msh", write_gmsh::write_sheet(&mesh).as_bytes()).unwrap();
    assert_eq!(back.vertex_groups, [group("a 'b' $EndNodes", &[2])]);
    assert_eq!(back.triangle_fields, []);
    let back = read("x.vtk", write_vtk::write_sheet(&mesh).as_bytes()).unwrap();
    assert_eq!(back.triangle_fields, []);
    assert_eq!(
        (back.positions, back.triangles),
        (mesh.positions, mesh.triangles)
    );
}

#[test]
fn a_written_field_has_a_value_for_every_element_of_the_file() {
    // Other programs refuse a field that lacks the points of the groups of vertices.
    let mut mesh = solid_box([1.0; 3], [1; 3]).unwrap();
    let values: Vec<f64> = (0..6).map(f64::from).collect();
    mesh.cell_fields = vec![Field {
        name: "young".to_owned(),
        values,
    }];
    let text = write_gmsh::write_solid(&mesh);
    let after = |marker: &str, lines: usize| {
        let mut rest = text.lines().skip_while(|line| *line != marker);
        rest.nth(lines).unwrap().to_owned()
    };
    let points: usize = mesh.vertex_groups.iter().map(|g| g.members.len()).sum();
    let elements = 6 + points;
    assert!(points > 0);
    assert_eq!(
        after("$Elements", 1).split(' ').nth(1),
        Some(&elements.to_string()[..])
    );
    assert_eq!(after("$ElementData", 8), elements.to_string());
    assert_eq!(
        after("$ElementData", 8 + elements),
        format!("{elements} 0.0")
    );
    assert_eq!(read_mesh("x.msh", text.as_bytes()), Ok(Mesh::Solid(mesh)));
}
