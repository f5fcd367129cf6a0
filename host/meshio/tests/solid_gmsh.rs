//! Solids from Gmsh's files: a real one, a small one, and an error with its line for each way to be wrong.

mod support;

use meshio::{read_mesh, write_gmsh, write_vtk};
use physics::mesh::generate_box::solid_box;
use physics::mesh::tet::MIDSIDE_ENDS;
use physics::mesh::{Cells, TetMesh};
use physics::{Body, BodyConfig, Mat3, SolidLaw, SolidMaterial, Tangent, Vec3};
use std::collections::BTreeSet;
use support::{expect_solid, named};

/// Made by Gmsh from `solid.geo`: a box of two halves at order 2, with groups of every dimension, and
/// values in each tetrahedron.
const GOLDEN: &str = include_str!("solid.msh");

fn golden() -> TetMesh {
    expect_solid(read_mesh("x.msh", GOLDEN.as_bytes()).unwrap())
}

fn error(name: &str, bytes: impl AsRef<[u8]>) -> String {
    let result = read_mesh(name, bytes.as_ref());
    result.map_or_else(|error| error.to_string(), |_| "no error".to_owned())
}

/// Six times the volume of each cell.
fn volumes(mesh: &TetMesh) -> Vec<f64> {
    let of = |cell: &[u32]| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| mesh.positions[cell[k] as usize]);
        (b - a).cross(&(c - a)).dot(&(d - a))
    };
    mesh.cells.vertices().map(of).collect()
}

#[test]
fn a_solid_of_gmsh_is_read_whole() {
    let mesh = golden();
    assert_eq!((mesh.positions.len(), mesh.cells.len()), (113, 48));
    assert_eq!(mesh.validate(), Ok(()));
    // Coordinates of 0.02 m are written with 16 digits.
    let volume: f64 = volumes(&mesh).iter().sum();
    assert!((volume / 6.0 - 2e-6).abs() < 1e-19, "{volume}");
    let Cells::Quadratic(cells) = &mesh.cells else {
        panic!("linear");
    };
    for cell in cells {
        for (slot, [a, b]) in MIDSIDE_ENDS.into_iter().enumerate() {
            let [a, b, m] = [cell[a], cell[b], cell[4 + slot]].map(|v| mesh.positions[v as usize]);
            assert!(
                (m - (a + b) / 2.0).norm() < 1e-16,
                "{m} between {a} and {b}"
            );
        }
    }
    // Groups of faces and edges have their midsides.
    for (name, inside) in [
        ("left", &(|x: &Vec3| x.x == 0.0) as &dyn Fn(&Vec3) -> bool),
        ("right", &|x| x.x == 0.02),
        ("rim", &|x| {
            x.x == 0.02 && [x.y, x.z].iter().any(|c| *c == 0.0 || *c == 0.01)
        }),
        ("tip", &|x| x.norm() == 0.0),
    ] {
        let expected: Vec<u32> = (0..113)
            .filter(|&v| inside(&mesh.positions[v as usize]))
            .collect();
        assert_eq!(mesh.group(name).unwrap().members, expected, "{name}");
    }
    let names = |groups: &[physics::mesh::Group]| -> Vec<String> {
        groups.iter().map(|group| group.name.clone()).collect()
    };
    assert_eq!(names(&mesh.vertex_groups), ["tip", "rim", "left", "right"]);
    assert_eq!(names(&mesh.cell_groups), ["soft", "stiff", "body"]);
    let numbers = |range: std::ops::Range<u32>| range.collect::<Vec<u32>>();
    for (name, expected) in [("soft", 0..24), ("stiff", 24..48), ("body", 0..48)] {
        assert_eq!(
            named(&mesh.cell_groups, name).members,
            numbers(expected),
            "{name}"
        );
    }
    let middle = |cell: &[u32; 10]| {
        cell[..4]
            .iter()
            .map(|&v| mesh.positions[v as usize].x)
            .sum()
    };
    for (cell, vertices) in cells.iter().enumerate() {
        let x: f64 = middle(vertices);
        assert_eq!(x / 4.0 > 0.01, cell >= 24);
    }
    let quality = mesh
        .cell_fields
        .iter()
        .find(|field| field.name == "ICN 3D")
        .unwrap();
    assert_eq!(
        quality.values[..2],
        [0.857_142_857_142_857_1, 0.857_142_857_142_856_8]
    );
    assert_eq!(quality.values[47], 1.0);
    assert_eq!(mesh.cell_fields.len(), 1);
}

#[test]
fn a_linear_displacement_of_a_solid_of_gmsh_leaves_its_inside_in_balance() {
    const YOUNG: f64 = 2e4;
    let mesh = golden();
    let material = SolidMaterial {
        young: YOUNG,
        poisson: 0.3,
        density: 1000.0,
    };
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        ..BodyConfig::default()
    };
    let map = Mat3::new(1.02, 0.01, -0.02, 0.015, 0.97, 0.01, -0.01, 0.02, 1.01);
    let on_border = |x: &Vec3| {
        [(x.x, 0.02), (x.y, 0.01), (x.z, 0.01)]
            .iter()
            .any(|(x, end)| x.abs() < 1e-9 || (x - end).abs() < 1e-9)
    };
    for law in [
        SolidLaw::Linear,
        SolidLaw::Corotational,
        SolidLaw::StableNeoHookean,
    ] {
        let mut body = Body::solid(&mesh, &[material], law, config, &[]).unwrap();
        let x: Vec<Vec3> = mesh.positions.iter().map(|x| map * x).collect();
        body.set_positions(&x).unwrap();
        body.assemble_with(Tangent::Exact);
        let forces: Vec<Vec3> = body.internal_forces().collect();
        let largest = forces.iter().map(Vec3::norm).fold(0.0, f64::max);
        let mut inner = 0;
        for (x, f) in mesh.positions.iter().zip(&forces) {
            if !on_border(x) {
                inner += 1;
                // Sums of about ten terms, each of the size of the forces on the border.
                assert!(f.norm() < 1e-12 * largest, "{law:?} {}", f.norm() / largest);
            }
        }
        assert!(inner > 20, "{inner}");
        // Stresses of a few hundredths of E on areas of (5 mm)^2.
        assert!(largest > 1e-2 * YOUNG * 2.5e-5, "{largest}");
    }
}

/// Two tetrahedra on either side of the face 2-3-4, a third node out of use, a triangle, a line and a point.
const SMALL: &str = "$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
4
0 1 \"tip\"
2 1 \"face\"
3 1 \"all\"
3 2 \"upper\"
$EndPhysicalNames
$Entities
1 1 1 2
1 0 0 0 1 1
1 0 0 0 1 1 1 0 0
1 0 0 0 1 1 1 1 1 0
1 0 0 0 1 1 1 1 1 0
2 0 0 0 1 1 1 2 1 2 0
$EndEntities
$Nodes
1 6 10 60
3 1 0 6
10
60
20
30
40
50
0 0 0
7 7 7
1 0 0
0 1 0
0 0 1
1 1 1
$EndNodes
$Elements
5 5 1 900
0 1 15 1
7 10
1 1 1 1
8 10 60
2 1 2 1
9 20 30 40
3 1 4 1
900 10 20 30 40
3 2 4 1
1 50 20 30 40
$EndElements
";

/// The small file with one piece, which it has once, replaced.
fn with(piece: &str, instead: &str) -> String {
    assert_eq!(SMALL.matches(piece).count(), 1, "{piece:?}");
    SMALL.replace(piece, instead)
}

fn line_of(text: &str, line: &str) -> usize {
    1 + text.lines().position(|other| other == line).unwrap()
}

#[test]
fn a_negative_tetrahedron_is_turned_around() {
    let mesh = expect_solid(read_mesh("x", SMALL.as_bytes()).unwrap());
    // The second is negative in the file; the node that only a line uses is dropped.
    assert_eq!(mesh.cells, Cells::Linear(vec![[0, 1, 2, 3], [4, 2, 1, 3]]));
    assert_eq!(mesh.positions.len(), 5);
    assert!(volumes(&mesh).iter().all(|&v| v > 0.0));
    assert_eq!(mesh.group("tip").unwrap().members, [0]);
    assert_eq!(mesh.group("face").unwrap().members, [1, 2, 3]);
    assert_eq!(mesh.group("all"), None);
    assert_eq!(named(&mesh.cell_groups, "all").members, [0, 1]);
    assert_eq!(named(&mesh.cell_groups, "upper").members, [1]);

    // With its midsides: every cell of a quadratic solid written with two corners exchanged.
    let whole = solid_box([0.3, 0.2, 0.1], [2, 1, 2]).unwrap().quadratic();
    let mut turned = whole.clone();
    let Cells::Quadratic(cells) = &mut turned.cells else {
        panic!()
    };
    for cell in cells {
        // 0 and 3 exchanged: with them 01 and 13, and 02 and 23.
        cell.swap(0, 3);
        cell.swap(4, 8);
        cell.swap(6, 9);
    }
    for (name, text) in [
        ("x.msh", write_gmsh::write_solid(&turned)),
        ("x.vtk", write_vtk::write_solid(&turned)),
    ] {
        let back = expect_solid(read_mesh(name, text.as_bytes()).unwrap());
        assert_eq!(back.validate(), Ok(()));
        let corners = |mesh: &TetMesh| -> Vec<BTreeSet<u32>> {
            mesh.cells
                .vertices()
                .map(|cell| cell.iter().copied().collect())
                .collect()
        };
        assert_eq!(corners(&back), corners(&whole));
    }
}

#[test]
fn wrong_solids_are_refused_with_their_line() {
    let second = line_of(SMALL, "1 50 20 30 40");
    let node = line_of(SMALL, "1 1 1");
    for (piece, instead, expected) in [
        (
            "1 50 20 30 40",
            "1 20 20 30 40",
            format!(
                "line {second}: cell 1: vertex 1 is named twice; all vertices of a cell must differ"
            ),
        ),
        (
            "1 50 20 30 40",
            "1 50 20 30 41",
            format!("line {second}: expected the tag of a node in $Nodes, found 41"),
        ),
        (
            "1 50 20 30 40",
            "1 50 20 30",
            format!(
                "line {second}: expected the tag of an element's node, found the end of the line"
            ),
        ),
        (
            "1 50 20 30 40",
            "1 10 20 30 40",
            format!(
                "line {second}: cell 1 overlaps cell 0: both cells lie on one side of the face 0-1-2"
            ),
        ),
        (
            "\n1 1 1\n",
            "\n1 1 -1\n",
            format!(
                "line {second}: cell 1 is flat: six times its volume is 0.000e0 of its longest edge \
                 cubed; more than 1e-9 is needed"
            ),
        ),
        (
            "\n1 1 1\n",
            "\n1 1 2e9\n",
            format!(
                "line {node}: vertex 4: z is 2000000000.0 m; coordinates must be finite and within ±1e9 m"
            ),
        ),
        (
            "3 2 4 1\n1 50 20 30 40",
            "3 2 11 1\n1 50 20 30 40 1 2 3 4 5 6",
            format!(
                "line {}: found 10-node tetrahedra of second order, in line {} 4-node tetrahedra; mesh \
                 again with one Mesh.ElementOrder for all",
                second - 1,
                second - 3
            ),
        ),
        (
            "2 1 2 1\n9 20 30 40",
            "2 1 9 1\n9 20 30 40 10 10 10",
            format!(
                "line {}: found 6-node triangles of second order, in line {} 4-node tetrahedra; mesh again \
                 with one Mesh.ElementOrder for all",
                second - 5,
                second - 3
            ),
        ),
        (
            "3 2 4 1\n1 50 20 30 40",
            "3 2 5 1\n1 50 20 30 40 10 20 30 40",
            format!(
                "line {}: found elements of type 5 (8-node hexahedra), expected tetrahedra, triangles, \
                 lines or points, of first or second order; mesh again with tetrahedra: neither recombined \
                 nor in layers",
                second - 1
            ),
        ),
    ] {
        assert_eq!(error("x.msh", with(piece, instead)), expected);
    }
    // The second cell has a vertex of its own in place of one that it shares.
    let apart = with("1 50 20 30 40", "1 50 60 30 40").replace("7 7 7", "1 0 0");
    let node = line_of(&apart, "1 0 0") + 1;
    assert_eq!(
        error("x.msh", &apart),
        format!(
            "line {node}: vertices 1 and 2 lie at one place, where the mesh is not connected; merge the \
             two vertices, as mesh.merge of a scene does (a slit needs a gap)"
        )
    );
}

#[test]
fn a_sheet_has_no_elements_of_second_order() {
    let tetrahedra = SMALL.find("3 1 4 1").unwrap();
    let sheet = SMALL[..tetrahedra]
        .replace("5 5 1 900", "3 3 1 900")
        .replace("2 1 2 1\n9 20 30 40", "2 1 9 1\n9 20 30 40 10 50 60")
        + "$EndElements\n";
    let found = error("x.msh", &sheet);
    let expected = "found elements of type 9 (6-node triangles of second order), expected 3-node triangles, 2-node lines \
                    or points; set Mesh.ElementOrder = 1 and mesh again";
    assert!(found.ends_with(expected), "{found}");
}
