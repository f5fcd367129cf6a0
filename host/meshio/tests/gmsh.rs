//! Reading MSH 4.1: a real file, a small one with every feature, and an error for each way to be wrong.

mod support;

use meshio::FilePosition;
use meshio::gmsh::MAX_GROUPS;
use meshio::{GmshError, InvalidMesh, MeshFileError, read_mesh};
use physics::Vec3;
use physics::mesh::{Mesh, MeshError, TriMesh};
use std::f64::consts::PI;
use support::named;

/// Made by Gmsh; see `host/scenes/meshes/README.md`.
const CLOTH: &str = include_str!(concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../scenes/meshes/cloth_notched.msh"
));

/// Two triangles and a node that none uses, with sparse tags, parametric coordinates, an unknown section,
/// groups of every dimension, one of two surfaces, two with one name, and one without members.
const SMALL: &str = include_str!("small.msh");

fn parse_bytes(bytes: &[u8]) -> Result<TriMesh, GmshError> {
    match read_mesh("x.msh", bytes) {
        Ok(Mesh::Sheet(mesh)) => Ok(mesh),
        Err(MeshFileError::Gmsh(error)) => Err(error),
        other => panic!("no sheet: {other:?}"),
    }
}

fn parse(text: &str) -> Result<TriMesh, GmshError> {
    parse_bytes(text.as_bytes())
}

fn members<'a>(mesh: &'a TriMesh, name: &str) -> &'a [u32] {
    &mesh.group(name).unwrap().members
}

/// The small file with one line (from one) replaced.
fn with_line(number: usize, text: &str) -> String {
    let mut lines: Vec<&str> = SMALL.lines().collect();
    lines[number - 1] = text;
    lines.join("\n")
}

/// The line of the small file that follows `marker` by `after` lines.
fn line_of(marker: &str, after: usize) -> usize {
    SMALL.lines().position(|line| line == marker).unwrap() + 1 + after
}

/// The error for the small file with a line replaced, as text.
fn fault(number: usize, text: &str) -> String {
    parse(&with_line(number, text)).unwrap_err().to_string()
}

#[test]
fn the_notched_cloth_is_read_whole() {
    let mesh = parse(CLOTH).unwrap();
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (638, 1189));

    // The sheet less two notches, their ends being quarter circles of two equal chords each.
    let (radius, straight, chords) = (0.004_f64, 0.016, 2.0);
    let notch = 2.0 * radius * straight + chords * radius.powi(2) * (PI / (2.0 * chords)).sin();
    let expected = 0.20 * 0.12 - 2.0 * notch;
    // The boundary's nodes were placed by Gmsh to about 1e-12 m, and the boundary is 0.7 m long.
    assert!(
        (mesh.area() - expected).abs() < 1e-12,
        "{} {expected}",
        mesh.area()
    );

    let bounds = mesh.bounds().unwrap();
    assert_eq!(
        (bounds.min, bounds.max),
        (Vec3::new(-0.1, -0.06, 0.0), Vec3::new(0.1, 0.06, 0.0))
    );
    for (name, x) in [("left", -0.1), ("right", 0.1)] {
        let at = |vertex: &u32| mesh.positions[*vertex as usize].x == x;
        let end: Vec<u32> = (0..638).filter(at).collect();
        assert_eq!(members(&mesh, name), end);
        assert_eq!(end.len(), 13);
    }
    assert_eq!(members(&mesh, "cloth").len(), mesh.positions.len());
    assert_eq!(
        named(&mesh.triangle_groups, "cloth").members.len(),
        mesh.triangles.len()
    );
    assert_eq!(mesh.vertex_groups.len(), 3);
    assert_eq!(mesh.triangle_groups.len(), 1);
    for triangle in 0..mesh.triangles.len() as u32 {
        let [a, b, c] = mesh.corners(triangle).unwrap();
        assert!(
            (b - a).cross(&(c - a)).z > 0.0,
            "triangle {triangle} is wound the other way"
        );
    }
}

#[test]
fn the_small_file_is_read_with_all_its_groups() {
    let mesh = parse(SMALL).unwrap();
    let at = |x, y| Vec3::new(x, y, 0.0);
    // The unused node stood second in the file; the others keep their order.
    assert_eq!(
        mesh.positions,
        [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)]
    );
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(members(&mesh, "corner"), [0]);
    assert_eq!(members(&mesh, "low side"), [0, 1]);
    assert_eq!(members(&mesh, "one"), [0, 1, 2]);
    // "both" names the two surfaces and, as another group, the curve.
    assert_eq!(members(&mesh, "both"), [0, 1, 2, 3]);
    assert_eq!(mesh.group("nothing"), None);
    let names: Vec<&str> = mesh.vertex_groups.iter().map(|g| g.name.as_str()).collect();
    assert_eq!(names, ["corner", "low side", "both", "one"]);
    assert_eq!(named(&mesh.triangle_groups, "one").members, [0]);
    assert_eq!(named(&mesh.triangle_groups, "both").members, [0, 1]);
    assert_eq!(mesh.triangle_groups.len(), 2);
}

#[test]
fn line_ends_blank_lines_and_the_order_of_sections_do_not_matter() {
    let mesh = parse(SMALL).unwrap();
    assert_eq!(parse(&SMALL.replace('\n', "\r\n")), Ok(mesh.clone()));
    assert_eq!(parse(&SMALL.replace('\n', "\n\n  ")), Ok(mesh.clone()));
    let split = SMALL.find("$Elements").unwrap();
    let names = SMALL.find("$PhysicalNames").unwrap();
    let elements_first = [&SMALL[..names], &SMALL[split..], "\n", &SMALL[names..split]].concat();
    assert_eq!(parse(&elements_first), Ok(mesh));
}

#[test]
fn other_versions_are_named_with_the_command_that_converts_them() {
    for (header, found) in [
        ("2.3 0 8", "2.3 ASCII"),
        ("4 0 8", "4 ASCII"),
        ("4 1 8", "4 binary"),
        ("1 0 8", "1 ASCII"),
    ] {
        assert_eq!(
            fault(2, header),
            format!(
                "line 2: expected MSH 4.1 or 2.2, found MSH {found}; convert the file with \
                 `gmsh in.msh -save -o out.msh -format msh41`"
            )
        );
    }
    let first = parse("$NOD\n1\n1 0 0 0\n$ENDNOD\n").unwrap_err();
    assert!(matches!(first, GmshError::Version { line: 1, .. }));
    // The number one in binary tells the byte order.
    let binary = b"$MeshFormat\n4.1 1 8\n\x02\0\0\0\n$EndMeshFormat\n\xff\xfe";
    assert_eq!(
        parse_bytes(binary).unwrap_err().to_string(),
        "byte 20: expected the number 1 in four bytes, which tells the byte order, found 2"
    );
    let broken = b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n\xff\xfe";
    assert_eq!(parse_bytes(broken), Err(GmshError::NotText { line: 4 }));
    assert_eq!(
        fault(1, "ply"),
        "line 1: expected $MeshFormat, found \"ply\""
    );
    assert_eq!(
        parse("").unwrap_err().to_string(),
        "line 1: expected $MeshFormat, found the end of the file"
    );
}

#[test]
fn other_elements_are_named_with_a_remedy() {
    let block = line_of("$Elements", 6);
    assert_eq!(SMALL.lines().nth(block - 1), Some("2 1 2 1"));
    for (code, part) in [
        (3, "type 3 (4-node quadrangles)"),
        (99, "type 99 (another kind)"),
    ] {
        let error = fault(block, &format!("2 1 {code} 1"));
        let start = format!("line {block}: found elements of {part}, expected tetrahedra");
        assert!(error.starts_with(&start), "{error}");
    }
    let error = fault(block, "1 1 2 1");
    assert!(
        error.contains("expected dimension 2 for elements of type 2"),
        "{error}"
    );
}

#[test]
fn errors_name_the_line_and_quote_it() {
    let node = line_of("$Nodes", 8);
    assert_eq!(SMALL.lines().nth(node - 1), Some("1 0 0"));
    for (text, found) in [
        ("1 NaN 0", "\"NaN\""),
        ("1 inf 0", "\"inf\""),
        ("1 one 0", "\"one\""),
        ("1 1", "the end of the line"),
    ] {
        assert_eq!(
            fault(node, text),
            format!("line {node}: expected a finite coordinate of a node, found {found}")
        );
    }
    assert!(fault(node, "1 1 0 5").ends_with("expected the end of the line, found \"5\""));

    let element = line_of("$Elements", 7);
    assert_eq!(
        fault(element, "5 10 30 77"),
        format!("line {element}: expected the tag of a node in $Nodes, found 77")
    );
    let long = "x".repeat(1000);
    assert_eq!(
        fault(element, &long),
        format!(
            "line {element}: expected an element's tag, found \"{}\"...",
            "x".repeat(40)
        )
    );
}

#[test]
fn counts_are_compared_with_the_lines_that_follow() {
    let nodes = line_of("$Nodes", 1);
    assert_eq!(
        fault(nodes, "2 6 10 50"),
        format!("line {nodes}: expected 6 nodes, as this line says, found 5 in the blocks below")
    );
    // As many as there are numbers: had the file been believed, the memory for them would have been asked
    // for at once, and refused with a panic.
    let most = u64::MAX;
    let error = fault(nodes, &format!("2 {most} 10 50"));
    assert!(error.contains(&format!("expected {most} nodes")), "{error}");
    let error = fault(nodes + 1, &format!("2 1 0 {most}"));
    assert!(
        error.ends_with("expected the end of the line, found \"0 0\""),
        "{error}"
    );
    let elements = line_of("$Elements", 1);
    let error = fault(elements, &format!("4 {most} 1 5"));
    assert!(
        error.contains(&format!("expected {most} elements")),
        "{error}"
    );
    let error = fault(elements, &format!("{most} 4 1 5"));
    assert!(
        error.ends_with("expected a dimension from 0 to 3, found \"$EndElements\""),
        "{error}"
    );
    let last_block = line_of("$Elements", 8);
    let error = fault(last_block, &format!("2 2 2 {most}"));
    assert!(
        error.ends_with("expected an element's tag, found \"$EndElements\""),
        "{error}"
    );
    let entities = line_of("$Entities", 1);
    let error = fault(entities, &format!("{most} 1 2 0"));
    assert!(
        error.starts_with(&format!("line {}: expected", entities + 2)),
        "{error}"
    );
    let names = line_of("$PhysicalNames", 1);
    let error = fault(names, "1000");
    let expected =
        format!("line {names}: expected at most {MAX_GROUPS} physical names, found \"1000\"");
    assert_eq!(error, expected);
}

#[test]
fn a_section_that_occurs_once_may_not_repeat_or_be_missing() {
    let twice = format!("{SMALL}\n$Nodes\n0 0 0 0\n$EndNodes\n");
    let error = parse(&twice).unwrap_err();
    assert!(
        matches!(&error, GmshError::Repeated { item, .. } if item == "$Nodes"),
        "{error}"
    );
    assert!(
        parse(&SMALL.replace("\n20\n", "\n10\n"))
            .unwrap_err()
            .to_string()
            .contains("node tag 10")
    );
    let without = &SMALL[..SMALL.find("$Elements").unwrap()];
    assert_eq!(
        parse(without),
        Err(GmshError::Missing {
            position: FilePosition::Line(without.lines().count()),
            section: "$Elements"
        })
    );
    let unended = SMALL.replace("$EndComments", "");
    assert!(
        parse(&unended)
            .unwrap_err()
            .to_string()
            .contains("expected $EndComments")
    );
}

#[test]
fn a_mesh_at_fault_is_traced_to_its_line() {
    let second = line_of("$Elements", 9);
    assert_eq!(SMALL.lines().nth(second - 1), Some("5 10 30 50"));
    let error = parse(&with_line(second, "5 10 20 30")).unwrap_err();
    let source = MeshError::Duplicate {
        triangle: 1,
        first: 0,
    };
    assert_eq!(
        error,
        GmshError::Mesh(InvalidMesh {
            position: FilePosition::Line(second),
            source: source.into(),
        })
    );
    let error = parse(&with_line(second, "5 10 30 10")).unwrap_err();
    let source = MeshError::RepeatedVertex {
        triangle: 1,
        vertex: 0,
    };
    assert_eq!(
        error,
        GmshError::Mesh(InvalidMesh {
            position: FilePosition::Line(second),
            source: source.into(),
        })
    );
    let error = parse(&with_line(line_of("$Nodes", 8), "1e10 1 0")).unwrap_err();
    assert!(
        matches!(error, GmshError::Mesh(InvalidMesh { position, .. }) if position == FilePosition::Line(line_of("$Nodes", 8))),
        "{error}"
    );
}
