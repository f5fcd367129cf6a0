//! Meshes from files of every format: what other programs write is read, what is wrong is refused with
//! its place.

mod support;

use meshio::{InvalidMesh, MeshFault, MeshFileError};
use physics::mesh::{Mesh, MeshError, TriMesh};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::{fs, io};
use support::{read, read_with_pattern};

type Outcome = Result<(), Box<dyn Error>>;

/// Valid files: most of them written by VTK 9.7, two cells by one, cut into four triangles.
const SEEDS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fuzz/seeds");

fn seeds(target: &str) -> io::Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for entry in fs::read_dir(Path::new(SEEDS).join(target))? {
        paths.push(entry?.path());
    }
    paths.sort();
    Ok(paths)
}

fn error(name: &str, bytes: &[u8]) -> String {
    read(name, bytes).map_or_else(|error| error.to_string(), |_| "no error".to_owned())
}

/// A square of 1 m in the xy-plane.
fn is_square(mesh: &TriMesh) -> bool {
    mesh.positions.len() == 4 && mesh.triangles == [[0, 1, 2], [0, 2, 3]] && mesh.area() == 1.0
}

#[test]
fn every_variant_that_vtk_writes_gives_the_same_mesh() -> Outcome {
    let mut count = 0;
    let obj = read("vtk.obj", &fs::read(Path::new(SEEDS).join("obj/vtk.obj"))?)?;
    for path in ["vtk_xml", "vtk_legacy"].into_iter().map(seeds) {
        for path in path? {
            let name = path.display().to_string();
            let mesh = read(&name, &fs::read(&path)?).map_err(|e| format!("{name}: {e}"))?;
            assert_eq!(mesh.triangles, obj.triangles, "{name}");
            // Text has fewer digits than float numbers.
            for (found, expected) in mesh.positions.iter().zip(&obj.positions) {
                assert!((found - expected).norm() < 1e-7, "{name}: {found}");
            }
            assert_eq!(mesh.positions.len(), 6, "{name}");
            count += 1;
        }
    }
    assert!(count >= 40, "only {count} files");
    Ok(())
}

#[test]
fn the_format_follows_from_the_name_or_else_from_the_beginning() -> Outcome {
    for target in ["vtk_xml", "vtk_legacy", "gmsh"] {
        for path in seeds(target)? {
            let bytes = fs::read(&path)?;
            read("mesh", &bytes).map_err(|e| format!("{}: {e}", path.display()))?;
        }
    }
    assert_eq!(
        error("mesh.ply", b"solid x\n"),
        "expected a mesh file whose name ends in .obj, .stl, .vtk, .vtu, .vtp or .msh, found another name and a \
         file that begins with \"solid x\\n\""
    );
    assert_eq!(
        error("mesh.ply", b"ply\nformat ascii 1.0\n"),
        "expected a mesh file whose name ends in .obj, .stl, .vtk, .vtu, .vtp or .msh, found another name and a PLY \
         file; convert the file with `meshio convert FILE mesh.vtu`"
    );
    assert_eq!(
        error("mesh", b""),
        "expected a mesh file whose name ends in .obj, .stl, .vtk, .vtu, .vtp or .msh, found another name and an \
         empty file"
    );
    Ok(())
}

#[test]
fn an_obj_file_gives_vertices_triangles_and_groups() -> Outcome {
    let text = "# a square\nmtllib x.mtl\no sheet of cloth\n\
        v 9 9 9\nv 0 0 0\nv 1 0 0 1 0.5 0.5 0.5\nv 1 1 0\nvt 0 0\nvn 0 0 1\n\
        g left lower\nusemtl red\nf 2/1/1 3//1 4/1\n\
        v 0 1 0\ng left\nf -4 -2 -1 # the last\ng empty\ns off\nl 1 2\n";
    let mesh = read("SQUARE.OBJ", text.as_bytes())?;
    assert!(is_square(&mesh), "the unused vertex is dropped: {mesh:?}");
    let groups: Vec<(&str, &[u32], &[u32])> = mesh
        .triangle_groups
        .iter()
        .zip(&mesh.vertex_groups)
        .map(|(t, v)| (t.name.as_str(), &t.members[..], &v.members[..]))
        .collect();
    assert_eq!(
        groups,
        [
            ("sheet of cloth", &[0, 1][..], &[0, 1, 2, 3][..]),
            ("left", &[0, 1], &[0, 1, 2, 3]),
            ("lower", &[0], &[0, 1, 2]),
            ("red", &[0, 1], &[0, 1, 2, 3]),
        ]
    );
    mesh.validate()?;
    Ok(())
}

#[test]
fn a_statement_continues_after_a_backslash() -> Outcome {
    let text = "v 0 \\\n0 0\nv 1 0 0\r\nv 0 1 \\\r\n 0\nf 1 \\\n2 \\\n3\n";
    let mesh = read("x.obj", text.as_bytes())?;
    assert_eq!((mesh.positions.len(), mesh.area()), (3, 0.5));
    // The lines keep their numbers.
    let wrong = format!("{text}f 1 2 4\n");
    assert_eq!(
        error("x.obj", wrong.as_bytes()),
        "line 9: expected a vertex from 1 to 3, found 4"
    );
    // Nothing continues the last statement.
    let open = format!("{text}f 1 2 \\");
    assert_eq!(
        error("x.obj", open.as_bytes()),
        "line 9: expected three vertices of a face, found the end of the line"
    );
    Ok(())
}

#[test]
fn what_arcsim_adds_is_skipped() -> Outcome {
    let text = "v 0 0 0\nny 0 0 0\nnv 0 0 0\nv 1 0 0\nny 1 0 0\nv 0 1 0\nms 0 0 1\ne 1 2\nea 0\nf 1 2 3\nnl 1\n";
    assert_eq!(read("x.obj", text.as_bytes())?.triangles.len(), 1);
    Ok(())
}

/// An STL file of these triangles, as text or binary.
fn stl(triangles: &[[[f32; 3]; 3]], binary: bool) -> Vec<u8> {
    let mut file = if binary {
        let mut file = b"solid: many binary files begin so".to_vec();
        file.resize(80, b' ');
        file.extend(u32::try_from(triangles.len()).unwrap_or(0).to_le_bytes());
        file
    } else {
        b"solid a part\n".to_vec()
    };
    for corners in triangles {
        if binary {
            file.extend([0; 12]);
            file.extend(corners.iter().flatten().flat_map(|x| x.to_le_bytes()));
            file.extend([0; 2]);
            continue;
        }
        file.extend(b"facet normal 0 0 0\nouter loop\n");
        for [x, y, z] in corners {
            file.extend(format!("vertex {x} {y} {z}\n").bytes());
        }
        file.extend(b"endloop\nendfacet\n");
    }
    if !binary {
        file.extend(b"endsolid a part\n");
    }
    file
}

#[test]
fn corners_of_an_stl_file_at_one_place_are_one_vertex() -> Outcome {
    let square = [
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]],
        [[-0.0, 0.0, -0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
    ];
    for binary in [true, false] {
        let mesh = read("x.stl", &stl(&square, binary))?;
        assert!(is_square(&mesh), "{mesh:?}");
        let names: Vec<_> = mesh.triangle_groups.iter().map(|g| &g.name[..]).collect();
        assert_eq!(names.len(), usize::from(!binary));
        assert!(names.iter().all(|name| *name == "a part"));
    }
    let mut flat = square;
    flat[1][2] = [0.5, 0.5, 0.0];
    assert!(error("x.stl", &stl(&flat, true)).starts_with("byte 134: triangle 1 is flat"));
    assert!(error("x.stl", &stl(&flat, false)).starts_with("line 9: triangle 1 is flat"));
    flat[1][2] = [f32::NAN, 0.5, 0.0];
    assert_eq!(
        error("x.stl", &stl(&flat, true)),
        "byte 134: expected a triangle with finite coordinates, found another number"
    );
    assert_eq!(
        error("x.stl", &stl(&flat, false)),
        "line 13: expected a finite coordinate, found \"NaN\""
    );
    // A binary file that is cut is text that is none.
    let mut cut = stl(&square, true);
    cut.pop();
    assert!(
        error("x.stl", &cut).contains("expected"),
        "{}",
        error("x.stl", &cut)
    );
    Ok(())
}

#[test]
fn vertices_within_the_distance_are_merged_on_request() -> Outcome {
    let doubled =
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 0 0.0003\nv 1 1 0.0004\nv 0 1 0\nf 1 2 3\nf 4 5 6\n";
    let merged = |distance: f64| {
        let choices = meshio::Choices {
            merge: Some(distance),
            texture_unit: None,
        };
        meshio::read_mesh_as("x.obj", doubled.as_bytes(), choices)
    };
    let Mesh::Sheet(mesh) = merged(5e-4)? else {
        return Err("no sheet".into());
    };
    assert!(is_square(&mesh), "{mesh:?}");
    // Too small a distance merges one pair of the two; the edges of the grid's cells lie elsewhere.
    assert_eq!(merged(3.5e-4)?.positions().len(), 5);
    assert_eq!(merged(1e-4)?.positions().len(), 6);
    // A distance above the size of a triangle is an error of the mesh.
    assert!(merged(1.2).is_err());
    Ok(())
}

/// Cases of a file and the error that follows; `\n` stands between lines.
fn check(name: &str, cases: &[(&str, &str)]) {
    let mut wrong = Vec::new();
    for (text, expected) in cases {
        let found = error(name, text.as_bytes());
        if found != *expected {
            wrong.push(format!("{text:?}\n  is  {found}\n  not {expected}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A sleeve of three sides, cut out of a rectangle. The vertices on the seam have two points of the texture each.
const SLEEVE: &str = "v 0 0 0\nv 1 0 0\nv 0.5 0 1\nv 0 2 0\nv 1 2 0\nv 0.5 2 1\n\
    vt 0 0\nvt 100 0\nvt 200 0\nvt 300 0\nvt 0 200\nvt 100 200 7\nvt 200 200\nvt 300 200\n\
    f 1/1 2/2 5/6\nf 1/1/1 5/6/1 4/5/1\nf 2/2 3/3 6/7\nf 2/2 6/7 5/6\nf 3/3 1/4 4/8\nf 3/3 4/-1 6/-2\n";

#[test]
fn texture_coordinates_are_a_flat_pattern_where_they_are_wanted() -> Outcome {
    let mesh = read_with_pattern("sleeve.obj", SLEEVE.as_bytes(), 0.01)?;
    let pattern = mesh.flat_pattern.as_ref().ok_or("a pattern")?;
    assert_eq!(pattern.corners[1], [[0.0, 0.0], [1.0, 2.0], [0.0, 2.0]]);
    assert_eq!(pattern.corners[4], [[2.0, 0.0], [3.0, 0.0], [3.0, 2.0]]);
    assert_eq!(pattern.corners[5], [[2.0, 0.0], [3.0, 2.0], [2.0, 2.0]]);
    assert!((mesh.area() - 6.0).abs() < 1e-12);
    // They are skipped if they are not: the same file is a sheet at rest.
    let plain = read("sleeve.obj", SLEEVE.as_bytes())?;
    assert_eq!(plain.flat_pattern, None);
    assert_eq!(
        (plain.positions, plain.triangles),
        (mesh.positions, mesh.triangles)
    );
    Ok(())
}

#[test]
fn wrong_flat_patterns_are_refused_with_their_line() {
    let refused = |name: &str, text: &str| match read_with_pattern(name, text.as_bytes(), 0.01) {
        Ok(_) => panic!("{text:?} has no pattern"),
        Err(error) => error.to_string(),
    };
    let sleeve = |from: &str, to: &str| {
        assert!(SLEEVE.contains(from));
        refused("x.obj", &SLEEVE.replacen(from, to, 1))
    };
    let wanted =
        "a vertex with texture coordinates, such as 1/1, because they are the flat pattern";
    for (from, to, expected) in [
        (
            "f 2/2 3/3 6/7",
            "f 2/2 3 6/7",
            format!("line 17: expected {wanted}, found \"3 6/7\""),
        ),
        (
            "f 2/2 3/3 6/7",
            "f 2/2 3//3 6/7",
            format!("line 17: expected {wanted}, found \"3//3 6/7\""),
        ),
        (
            "f 2/2 3/3 6/7",
            "f 2/2 3/0 6/7",
            format!("line 17: expected {wanted}, found \"3/0 6/7\""),
        ),
        (
            "f 2/2 3/3 6/7",
            "f 2/2 3/9 6/7",
            "line 17: expected texture coordinates from 1 to 8, found 9".to_owned(),
        ),
        (
            "vt 100 200 7",
            "vt 100",
            "line 12: expected a finite texture coordinate, found the end of the line".to_owned(),
        ),
        (
            "vt 100 200 7",
            "vt 100 inf",
            "line 12: expected a finite texture coordinate, found \"inf\"".to_owned(),
        ),
        (
            "f 3/3 1/4 4/8",
            "f 3/3 1/3 4/8",
            "line 19: triangle 4 has no area in the flat pattern: its height is 0.000e0 of its longest edge; at \
             least 1e-6 is needed"
                .to_owned(),
        ),
        (
            "vt 100 200 7",
            "vt 100 -200",
            "line 16: triangle 1 is mirrored in the flat pattern and lies on triangle 0; unfold the pattern there, \
             or, if a seam joins the two triangles, move their panels apart in the pattern"
                .to_owned(),
        ),
    ] {
        assert_eq!(sleeve(from, to), expected);
    }
    assert_eq!(
        refused("x.vtk", "# vtk DataFile Version 3.0\n"),
        "a flat pattern is read from texture coordinates, which only OBJ files have; export the mesh as .obj with texture coordinates"
    );
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

#[test]
fn wrong_obj_files_are_refused_with_their_line() {
    let with = |text: &str| format!("{TRIANGLE}{text}");
    let cases = [
        (
            String::new(),
            "line 1: the mesh has no triangles; at least one is needed",
        ),
        (
            with("f 1 2 NaN"),
            "line 4: expected the number of a vertex, such as 1, -1 or 1/2/3, found \"NaN\"",
        ),
        (
            with("f 1 2 4"),
            "line 4: expected a vertex from 1 to 3, found 4",
        ),
        (
            with("f 1 2 0"),
            "line 4: expected the number of a vertex, such as 1, -1 or 1/2/3, found \"0\"",
        ),
        (
            with("f 1 2 -4"),
            "line 4: expected the number of a vertex, such as 1, -1 or 1/2/3, found \"-4\"",
        ),
        (
            with("f 1 2 99999999999999999999"),
            "line 4: expected the number of a vertex, such as 1, -1 or 1/2/3, found \"99999999999999999999\"",
        ),
        (
            with("f 1 2 3/1/1/1"),
            "line 4: expected the number of a vertex, such as 1, -1 or 1/2/3, found \"3/1/1/1\"",
        ),
        (
            with("f 1 2"),
            "line 4: expected three vertices of a face, found the end of the line",
        ),
        (
            with("v 1 1 0\nf 1 2 3 4"),
            "line 5: expected a triangle (export the mesh with triangulated faces), found a face of 4 vertices",
        ),
        (
            "v 0 0 nan".to_owned(),
            "line 1: expected a finite coordinate, found \"nan\"",
        ),
        (
            "v 0 0 inf".to_owned(),
            "line 1: expected a finite coordinate, found \"inf\"",
        ),
        (
            "v 0 0".to_owned(),
            "line 1: expected a finite coordinate, found the end of the line",
        ),
        (
            "v 0 0 0\nv 2e9 0 0\nv 0 1 0\nf 1 2 3".to_owned(),
            "line 2: vertex 1: x is 2000000000.0 m; coordinates must be finite and within ±1e9 m",
        ),
        (
            with("f 1 2 2"),
            "line 4: triangle 0: vertex 1 is named twice; the three vertices must differ",
        ),
        (
            "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3".to_owned(),
            "line 4: triangle 0 is flat: its height is 0.000e0 of its longest edge; at least 1e-6 is needed",
        ),
        (
            with("v 0 0 1\nv 0 0 -1\nv 1 1 1\nf 1 2 3\nf 1 2 4\nf 1 2 5"),
            "line 9: edge 0-1: triangles 0, 1 and 2 meet there; at most two triangles may share an edge",
        ),
        (
            with("f 1 2 3\nf 2 3 1"),
            "line 5: triangle 1 has the same three vertices as triangle 0",
        ),
        (
            with("v 7 7 7\nv 0 0 1\nv -0 -0 0\nf 1 2 3\nf 5 6 2"),
            "line 6: vertices 0 and 4 lie at one place, where the mesh is not connected; merge the two vertices, as mesh.merge of a scene does (a slit needs a gap)",
        ),
        (
            "vertex 1 2 3".to_owned(),
            "line 1: expected a statement of OBJ, such as v or f, found \"vertex 1 2 3\"",
        ),
        (
            "curv 0 1 1 2".to_owned(),
            "line 1: expected a statement of OBJ, such as v or f, found \"curv 0 1 1 2\"",
        ),
        (
            "g a b c d e f g h i".to_owned(),
            "line 1: expected at most 8 groups at a time, found \"a b c d e f g h i\"",
        ),
    ];
    let cases: Vec<(&str, &str)> = cases.iter().map(|(t, e)| (t.as_str(), *e)).collect();
    check("x.obj", &cases);
    assert_eq!(
        error("x.obj", b"v 0 0 0\n# caf\xe9\n"),
        "line 2: expected OBJ text in UTF-8, found bytes that are no text"
    );
}

#[test]
fn wrong_legacy_files_are_refused_with_their_line() {
    const HEAD: &str = "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET POLYDATA\n";
    const POINTS: &str = "POINTS 4 float\n0 0 0 1 0 0\n1 1 0 0 1 0\n";
    let cases = [
        (
            String::new(),
            "line 1: expected # vtk DataFile Version 2.0 to 5.1, found the end of the file",
        ),
        (
            "# vtk DataFile Version 9.0\n".to_owned(),
            "line 1: expected # vtk DataFile Version 2.0 to 5.1, found \"# vtk DataFile Version 9.0\"",
        ),
        (
            HEAD.replace("POLYDATA", "STRUCTURED_GRID"),
            "line 4: expected DATASET POLYDATA or DATASET UNSTRUCTURED_GRID (make one of them first, as ParaView's filters Extract Surface and Tetrahedralize do), found DATASET \"STRUCTURED_GRID\"",
        ),
        (
            HEAD.to_owned(),
            "line 5: expected POINTS, found the end of the data set",
        ),
        (
            format!("{HEAD}{POINTS}"),
            "line 8: expected POLYGONS, found the end of the data set",
        ),
        (
            format!("{HEAD}POINTS 1000000000 float\n0 0 0\n"),
            "line 5: expected 3000000000 numbers after this line, as it says, found 3 up to the end of the file",
        ),
        (
            format!("{HEAD}POINTS 18446744073709551615 float\n0 0 0\n"),
            "line 5: expected too many numbers after this line, as it says, found 3 up to the end of the file",
        ),
        (
            format!("{HEAD}POINTS -1 float\n0 0 0\n"),
            "line 5: expected a number of points, found \"-1 float\"",
        ),
        (
            format!("{HEAD}POINTS 1 quaternion\n0 0 0\n"),
            "line 5: expected a type of numbers, such as float or int, found \"quaternion\"",
        ),
        (
            format!("{HEAD}POINTS 1 float\n0 0 nan\n"),
            "line 7: expected POLYGONS, found the end of the data set",
        ),
        (
            format!(
                "{HEAD}{}POLYGONS 1 4\n3 0 1 2\n",
                POINTS.replace("1 1 0", "1\nnan 0")
            ),
            "line 8: expected a finite coordinate, found NaN",
        ),
        (
            format!("{HEAD}{POINTS}POLYGONS 1 4\n3 0 1\n\n4\n"),
            "line 11: expected the number of one of 4 points, counted from 0, found 4",
        ),
        (
            format!("{HEAD}{POINTS}POLYGONS 1 4\n3 0 1 -2\n"),
            "line 9: expected the number of one of 4 points, counted from 0, found -2",
        ),
        (
            format!("{HEAD}{POINTS}POLYGONS 1 4\n3 0 1 2.5\n"),
            "line 9: expected a whole number, found \"2.5\"",
        ),
        (
            format!("{HEAD}{POINTS}POLYGONS 1 5\n4 0 1 2 3\n"),
            "line 9: expected a triangle or a tetrahedron (cut to them first, as ParaView's filters Triangulate and Tetrahedralize do), found a polygon of 4 points",
        ),
        (
            format!("{HEAD}{POINTS}POLYGONS 1 4\n1000000000 0 1 2\n"),
            "line 9: expected the number of a cell's points, from 0 to 3, found 1000000000",
        ),
        (
            format!("{HEAD}{POINTS}POLYGONS 1 8\n3 0 1 2 3 0 2 3\n"),
            "line 9: expected the end of the cells, found 4 more numbers",
        ),
        (
            format!("{HEAD}{POINTS}POLYGONS 1000000000 4\n3 0 1 2\n"),
            "line 9: expected the next cell, found the end of 4 numbers",
        ),
        (
            format!("{HEAD}{POINTS}{POINTS}"),
            "line 8: expected POINTS once, found \"POINTS 4 float\"",
        ),
        (
            format!("{HEAD}{POINTS}POLYGONS 2 8\n3 0 1 2\n3 0 1 0\n"),
            "line 10: triangle 1: vertex 0 is named twice; the three vertices must differ",
        ),
        (
            format!("{HEAD}{POINTS}TRIANGLE_STRIPS 1 4\n3 0 1 2\n"),
            "line 8: expected POLYGONS (cut strips to triangles first, as ParaView's filter Triangulate does), found \"TRIANGLE_STRIPS 1 4\"",
        ),
    ];
    let cases: Vec<(&str, &str)> = cases.iter().map(|(t, e)| (t.as_str(), *e)).collect();
    check("x.vtk", &cases);
}

const GRID: &str = r#"<?xml version="1.0"?>
<VTKFile type="UnstructuredGrid" byte_order="LittleEndian">
<UnstructuredGrid><Piece NumberOfPoints="4" NumberOfCells="2">
<PointData><DataArray type="Float32" Name="p" format="ascii">0 0 0 0</DataArray></PointData>
<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">
0 0 0 1 0 0
1 1 0 0 1 0
</DataArray></Points>
<Cells>
<DataArray type="Int32" Name="connectivity">0 1 2
0 2 3</DataArray>
<DataArray type="Int32" Name="offsets" format="ascii">3 6</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">5 5</DataArray>
</Cells></Piece></UnstructuredGrid></VTKFile>
"#;

#[test]
fn wrong_xml_files_are_refused_with_their_line() -> Outcome {
    assert!(is_square(&read("x.vtu", GRID.as_bytes())?));
    // A piece of the file, its replacement, and the resulting error.
    let cases = [
        (
            "1 1 0 0 1 0",
            "1 1 0 0 nan 0",
            "line 7: expected a finite coordinate, found NaN",
        ),
        (
            "1 1 0 0 1 0",
            "1 1 0 0 1",
            "line 3: expected 12 coordinates, as this Piece says, found 11 in the DataArray",
        ),
        (
            "Points=\"4\"",
            "Points=\"1000000000\"",
            "line 3: expected 3000000000 coordinates, as this Piece says, found 12 in the DataArray",
        ),
        (
            "Points=\"4\"",
            "Points=\"18446744073709551615\"",
            "line 3: expected too many coordinates, as this Piece says, found 12 in the DataArray",
        ),
        (
            "Points=\"4\"",
            "Points=\"-4\"",
            "line 3: expected NumberOfPoints to be a whole number, found \"-4\"",
        ),
        (
            "0 2 3<",
            "0 2 4<",
            "line 11: expected the number of one of 4 points, counted from 0, found 4",
        ),
        (
            "0 2 3<",
            "0 2 0<",
            "line 11: triangle 1: vertex 0 is named twice; the three vertices must differ",
        ),
        (
            "3 6<",
            "3 7<",
            "line 12: expected the end of a cell, from 3 to 6, found 7",
        ),
        (
            "3 6<",
            "3 -1<",
            "line 12: expected the end of a cell, from 3 to 6, found -1",
        ),
        (
            "3 6<",
            "4 6<",
            "line 10: expected a triangle or a tetrahedron (cut to them first, as ParaView's filters Triangulate and Tetrahedralize do), found a triangle of 4 points",
        ),
        (
            "5 5<",
            "5 22<",
            "line 11: expected a triangle or a tetrahedron (cut to them first, as ParaView's filters Triangulate and Tetrahedralize do), found a triangle of second order",
        ),
        (
            "Float64",
            "Float128",
            "line 5: expected type to be Int8 or UInt8 or Int16 or UInt16 or Int32 or UInt32 or Int64 or UInt64 or Float32 or Float64, found \"Float128\"",
        ),
        (
            "LittleEndian\"",
            "LittleEndian\" compressor=\"vtkLZ4DataCompressor\"",
            "line 2: expected compressor to be vtkZLibDataCompressor (save the file with ZLib or without compression), found \"vtkLZ4DataCompressor\"",
        ),
        (
            "UnstructuredGrid\" ",
            "ImageData\" ",
            "line 2: expected type to be UnstructuredGrid or PolyData (make one of them first, as ParaView's filters Extract Surface and Tetrahedralize do), found \"ImageData\"",
        ),
        (
            "\"connectivity\"",
            "\"connectivity\" format=\"appended\" offset=\"0\"",
            "line 10: expected AppendedData in the file, found none",
        ),
        (
            "\"connectivity\"",
            "\"numbers\"",
            "line 3: expected a DataArray of connectivity, found none in this Piece",
        ),
        (
            "</Cells>",
            "",
            "line 14: expected well-formed XML, found \"ill-formed document: expected `</Cells>`\"...",
        ),
        (
            "<VTKFile",
            "<!DOCTYPE x [<!ENTITY a \"b\">]><VTKFile",
            "line 2: expected a VTKFile, found a document type",
        ),
        (
            "<VTKFile",
            "<html",
            "line 2: expected a VTKFile, found a tag \"html\"",
        ),
    ];
    for (piece, instead, expected) in cases {
        assert_eq!(GRID.matches(piece).count(), 1, "{piece:?}");
        assert_eq!(
            error("x.vtu", GRID.replace(piece, instead).as_bytes()),
            expected
        );
    }
    let deep = GRID.replace("<Cells>", &"<a>".repeat(100_000));
    assert!(error("x.vtu", deep.as_bytes()).contains("nested less deeply"));
    assert_eq!(
        error("x.vtu", b""),
        "line 1: expected a VTKFile, found the end of the tags"
    );
    Ok(())
}

#[test]
fn an_invalid_mesh_is_distinguished_from_invalid_text() {
    let flat = read("x.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    assert!(matches!(
        flat,
        Err(MeshFileError::Mesh(InvalidMesh {
            source: MeshFault::Sheet(MeshError::Flat { .. }),
            ..
        }))
    ));
}

#[test]
fn a_vertex_on_an_edge_is_named_with_both() -> Outcome {
    // A large triangle beside two small ones, which divide its longest side.
    let sheet = |middle: &str| {
        format!("v 0 0 0\nv 2 0 0\nv 0 -1 0\nv {middle}\nv 0 1 0\nf 1 3 2\nf 1 4 5\nf 4 2 5\n")
    };
    assert_eq!(
        error("x.obj", sheet("1 0 0").as_bytes()),
        "line 4: vertex 3 lies on edge 0-1, where the mesh is not connected; divide the edge at the vertex, or mesh \
         again (a slit needs a gap)"
    );
    assert_eq!(error("x.obj", sheet("1 1e-5 0").as_bytes()), "no error");
    // Divided there, the mesh is connected.
    let divided = sheet("1 0 0").replace("f 1 3 2\n", "f 1 3 4\nf 4 3 2\n");
    assert_eq!(read("x.obj", divided.as_bytes())?.triangles.len(), 4);

    // The same for tetrahedra: one on the large triangle's side, two on the other.
    let solid = |cells: &str| {
        let count = cells.lines().count();
        format!(
            "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 6 float\n0 0 0 2 0 0 0 -1 0\n\
             1 0 0 0 1 0 0 0 1\nCELLS {count} {}\n{cells}\nCELL_TYPES {count}\n{}",
            5 * count,
            "10\n".repeat(count)
        )
    };
    let fault = |cells: &str| {
        let read = meshio::read_mesh("x.vtk", solid(cells).as_bytes());
        read.map_or_else(|error| error.to_string(), |_| "no error".to_owned())
    };
    let found = fault("4 0 2 1 5\n4 0 3 4 5\n4 3 1 4 5");
    assert!(
        found.contains("vertex 3 lies on edge 0-1, where"),
        "{found}"
    );
    assert_eq!(
        fault("4 0 2 3 5\n4 3 2 1 5\n4 0 3 4 5\n4 3 1 4 5"),
        "no error"
    );
    Ok(())
}
