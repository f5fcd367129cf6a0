//! Random solids, groups and fields, and files as VTK writes them: what the tests of mesh files share.
#![allow(dead_code)]

pub(crate) mod dense;
pub(crate) mod vtk;

use meshio::{Choices, MeshFileError, read_mesh, read_mesh_as};
use physics::mesh::generate_box::solid_box;
use physics::mesh::{Field, Group, Mesh, TetMesh, TriMesh};
use proptest::prelude::*;

/// Any number that a field may hold.
pub(crate) fn finite() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<f64>().prop_filter("finite", |x| x.is_finite()),
        Just(-0.0),
        Just(f64::MIN_POSITIVE / 3.0),
        -1.0..1.0,
    ]
}

/// A name of a group or field.
fn name() -> impl Strategy<Value = String> {
    "[a-zA-Z0-9_ %'$#.äλ-]{0,12}[a-z]"
}

/// Up to four groups of the numbers below `count`, none empty, with different names.
pub(crate) fn groups(count: u32) -> impl Strategy<Value = Vec<Group>> {
    let members = prop::collection::btree_set(0..count, 1..8.min(count as usize + 1));
    prop::collection::btree_map(name(), members, 0..4).prop_map(|groups| {
        let group = |(name, members): (String, std::collections::BTreeSet<u32>)| Group {
            name,
            members: members.into_iter().collect(),
        };
        // Out of the order of their names.
        groups.into_iter().rev().map(group).collect()
    })
}

/// Up to three fields of `count` values, with different names.
pub(crate) fn fields(count: usize) -> impl Strategy<Value = Vec<Field>> {
    let values = prop::collection::vec(finite(), count);
    prop::collection::btree_map(name(), values, 0..3).prop_map(|fields| {
        let field = |(name, values)| Field { name, values };
        fields.into_iter().rev().map(field).collect()
    })
}

/// Small boxes, linear or quadratic, moved out of their grid, with groups and fields.
pub(crate) fn solid() -> impl Strategy<Value = TetMesh> {
    let cells = [1_u32..3, 1_u32..3, 1_u32..2];
    let moves = prop::collection::vec(-1e-3..1e-3, 300);
    (cells, any::<bool>(), 0.01..10.0, moves)
        .prop_flat_map(|(cells, quadratic, size, moves)| {
            let mut mesh = solid_box([size, 0.7 * size, 0.3 * size], cells).unwrap();
            if quadratic {
                mesh = mesh.quadratic();
            }
            for (x, by) in mesh.positions.iter_mut().zip(moves.chunks(3)) {
                for (x, by) in x.iter_mut().zip(by) {
                    *x += by * size;
                }
            }
            let (vertices, cells) = (mesh.positions.len() as u32, mesh.cells.len());
            (
                Just(mesh),
                groups(vertices),
                groups(cells as u32),
                fields(cells),
            )
        })
        .prop_map(|(mut mesh, vertex_groups, cell_groups, cell_fields)| {
            mesh.vertex_groups = vertex_groups;
            mesh.cell_groups = cell_groups;
            mesh.cell_fields = cell_fields;
            mesh
        })
}

/// The group of this name.
pub(crate) fn named<'a>(groups: &'a [Group], name: &str) -> &'a Group {
    let group = groups.iter().find(|group| group.name == name);
    group.unwrap_or_else(|| panic!("no group {name:?}"))
}

/// The sheet that a file is expected to hold.
pub(crate) fn read(name: &str, bytes: &[u8]) -> Result<TriMesh, MeshFileError> {
    read_mesh(name, bytes).map(expect_sheet)
}

/// The sheet with a flat pattern that a file is expected to hold.
pub(crate) fn read_with_pattern(
    name: &str,
    bytes: &[u8],
    texture_unit: f64,
) -> Result<TriMesh, MeshFileError> {
    let choices = Choices {
        merge: None,
        texture_unit: Some(texture_unit),
    };
    read_mesh_as(name, bytes, choices).map(expect_sheet)
}

fn expect_sheet(mesh: Mesh) -> TriMesh {
    match mesh {
        Mesh::Sheet(mesh) => mesh,
        Mesh::Thread(_) => panic!("a thread"),
        Mesh::Solid(_) => panic!("a solid"),
    }
}

/// The solid that a file is expected to hold.
pub(crate) fn expect_solid(mesh: Mesh) -> TetMesh {
    match mesh {
        Mesh::Solid(mesh) => mesh,
        Mesh::Thread(_) => panic!("a thread"),
        Mesh::Sheet(_) => panic!("a sheet"),
    }
}
