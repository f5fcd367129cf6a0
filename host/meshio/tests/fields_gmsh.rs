//! Fields from `$ElementData` of an MSH file: by the tags of elements, one value for each cell.

mod support;

use meshio::error::MAX_FIELDS;
use meshio::read_mesh;
use physics::mesh::{Field, Mesh};
use support::read;

/// Two triangles with tags out of order and a line.
const SHEET: &str = "$MeshFormat
4.1 0 8
$EndMeshFormat
$Nodes
1 4 1 4
2 1 0 4
1
2
3
4
0 0 0
1 0 0
1 1 0
0 1 0
$EndNodes
$Elements
2 3 1 900
1 1 1 1
3 1 2
2 1 2 2
900 1 2 3
7 1 3 4
$EndElements
";

/// A section of values, each a line.
fn data(name: &str, components: usize, values: &[&str]) -> String {
    format!(
        "$ElementData\n2\n\"{name}\"\n\"interpolation\"\n1\n0.5\n4\n0\n{components}\n{}\n0\n{}\n$EndElementData\n",
        values.len(),
        values.join("\n")
    )
}

fn fields(text: &str) -> Vec<Field> {
    read("x.msh", text.as_bytes()).unwrap().triangle_fields
}

fn error(text: &str) -> String {
    read("x.msh", text.as_bytes()).unwrap_err().to_string()
}

fn field(name: &str, values: &[f64]) -> Field {
    Field {
        name: name.to_owned(),
        values: values.to_vec(),
    }
}

#[test]
fn values_follow_the_tags_of_the_triangles() {
    let first = data("a \"b\"", 1, &["7 -7", "900 9e-320", "3 5"]);
    let second = data("n", 1, &["900 1", "7 2"]);
    let expected = [field("a \"b\"", &[9e-320, -7.0]), field("n", &[1.0, 2.0])];
    assert_eq!(fields(&format!("{SHEET}{first}{second}")), expected);
    // Before the elements, too.
    let start = SHEET.find("$Nodes").unwrap();
    let early = [&SHEET[..start], &first, &second, &SHEET[start..]].concat();
    assert_eq!(fields(&early), expected);
}

#[test]
fn data_of_other_elements_are_skipped() {
    for section in [
        data("of a line", 1, &["3 1"]),
        data("none", 1, &[]),
        data("three", 3, &["900 1 2 3", "7 4 5 6"]),
        data(" ", 1, &["900 1", "7 2"]),
        data("nine", 9, &["whatever"]),
        "$NodeData\n1\n\"a\"\n$EndNodeData\n".to_owned(),
        "$ElementData\n0\n0\n3\n0\n1\n1\n7 1\n$EndElementData\n".to_owned(),
    ] {
        assert_eq!(fields(&format!("{SHEET}{section}")), []);
    }
}

#[test]
fn only_data_of_tetrahedra_are_fields_of_a_solid() {
    let solid = SHEET
        .replace("0 1 0\n$End", "0 0 1\n$End")
        .replace("2 3 1 900", "3 4 1 900")
        .replace("$EndElements", "3 1 4 1\n5 1 2 3 4\n$EndElements")
        + &data("E", 1, &["5 0.25", "7 1"])
        + &data("of triangles", 1, &["900 1"]);
    let Ok(Mesh::Solid(mesh)) = read_mesh("x.msh", solid.as_bytes()) else {
        panic!()
    };
    assert_eq!(mesh.cell_fields, [field("E", &[0.25])]);
}

#[test]
fn wrong_data_is_refused_with_its_line() {
    // The first line of the section is the 24th, its name the 26th, its values begin in line 35.
    assert_eq!(SHEET.lines().count(), 23);
    let good = data("a", 1, &["900 1", "7 2"]);
    let wrong = |from: &str, to: &str| {
        assert!(good.contains(from), "{from:?}");
        error(&format!("{SHEET}{}", good.replacen(from, to, 1)))
    };
    for (from, to, expected) in [
        (
            "7 2",
            "7",
            "line 36: expected a value of an element, found the end of the line",
        ),
        (
            "7 2",
            "7 2 2",
            "line 36: expected the end of the line, found \"2\"",
        ),
        (
            "7 2",
            "-7 2",
            "line 36: expected an element's tag, found \"-7\"",
        ),
        (
            "7 2",
            "8 2",
            "line 36: expected the tag of an element in $Elements, found 8",
        ),
        (
            "7 2",
            "900 2",
            "line 36: expected element 900 in the field \"a\" once, found a second one; the first is in line 35",
        ),
        (
            "7 2",
            "3 2",
            "line 26: expected values for all 2 elements of the mesh, found 1, none for element 7",
        ),
        (
            "7 2\n",
            "",
            "line 33: expected 2 values, as this line says, found 1",
        ),
        (
            "7 2\n",
            "7 2\n3 2\n",
            "line 37: expected $EndElementData after 2 values, found \"3 2\"",
        ),
        (
            "\n2\n0\n900",
            "\n18446744073709551615\n0\n900",
            "line 33: expected 18446744073709551615 values, as this line says, found 2",
        ),
        (
            "\n2\n0\n900",
            "\n-2\n0\n900",
            "line 33: expected a number of values, found \"-2\"",
        ),
        (
            "\"a\"",
            "a",
            "line 26: expected a string tag in double quotes, found \"a\"",
        ),
        (
            "\n4\n0\n1\n",
            "\n2\n0\n1\n",
            "line 30: expected at least 3 integer tags: a time step, a number of components, a number of values, found 2",
        ),
        (
            "$EndElementData",
            "",
            "line 37: expected $EndElementData after 2 values, found the end of the file",
        ),
    ] {
        assert_eq!(wrong(from, to), expected, "{to:?}");
    }
    // A field with a value that is not finite is skipped.
    for value in ["7 nan", "7 -inf"] {
        assert_eq!(
            fields(&format!("{SHEET}{}", good.replace("7 2", value))),
            []
        );
    }
    assert_eq!(
        error(&format!("{SHEET}{good}{good}")),
        "line 40: expected the field \"a\" once, found a second one; the first is in line 26"
    );
    assert_eq!(
        error(&format!("{}{good}", SHEET.replace("7 1 3 4", "3 1 3 4"))),
        "line 22: expected element tag 3 once, found a second one; the first is in line 19"
    );
    // Without a field, tags of elements do not matter.
    assert_eq!(fields(&SHEET.replace("7 1 3 4", "3 1 3 4")), []);
}

#[test]
fn the_number_of_fields_is_bounded() {
    let sections = |count: usize| {
        (0..count)
            .map(|k| data(&k.to_string(), 1, &["900 1", "7 2"]))
            .collect::<String>()
    };
    let most = format!("{SHEET}{}", sections(MAX_FIELDS));
    assert_eq!(fields(&most).len(), MAX_FIELDS);
    let more = format!("{SHEET}{}", sections(MAX_FIELDS + 1));
    assert!(
        error(&more).ends_with("expected at most 256 fields, found \"\\\"256\\\"\""),
        "{}",
        error(&more)
    );
}
