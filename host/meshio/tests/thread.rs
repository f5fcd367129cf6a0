//! Threads: files whose lines are their cells of highest dimension. Lines beside triangles read as they did.

use meshio::read_mesh;
use physics::mesh::{LineMesh, Mesh};

/// Seeds of the fuzz target for files of any format: the same thread in each.
const SEEDS: [&str; 3] = ["thread.msh", "thread.vtk", "thread.vtu"];

fn seed(name: &str) -> Vec<u8> {
    let seeds = corpus::seeds("solid").expect("the seeds are in the repository");
    let seed = seeds.into_iter().find(|seed| seed.name == name);
    seed.expect("the seed is in the repository").bytes
}

fn text(name: &str) -> String {
    String::from_utf8(seed(name)).expect("text")
}

fn thread(name: &str, text: &str) -> LineMesh {
    match read_mesh(name, text.as_bytes()) {
        Ok(Mesh::Thread(mesh)) => mesh,
        other => panic!("{name}: no thread but {other:?}"),
    }
}

fn error(name: &str, text: &str) -> String {
    let result = read_mesh(name, text.as_bytes());
    result.map_or_else(|error| error.to_string(), |_| "no error".to_owned())
}

#[test]
fn every_format_gives_the_same_thread() {
    for name in SEEDS {
        let mesh = thread(name, &text(name));
        assert_eq!(mesh.lines, [[0, 1], [1, 2], [2, 3]], "{name}");
        // The fifth vertex of the file belongs to no line.
        assert_eq!(mesh.positions.len(), 4, "{name}");
        let [area] = &mesh.line_fields[..] else {
            panic!("{name}: no field");
        };
        assert_eq!(area.name, "area", "{name}");
        assert_eq!(area.values, [1e-8, 2e-8, 3e-8], "{name}");
    }
}

#[test]
fn a_gmsh_file_names_vertices_and_lines() {
    let mesh = thread("thread.msh", &text("thread.msh"));
    let members = |name: &str| mesh.group(name).map(|group| group.members.clone());
    assert_eq!(members("knot"), Some(vec![0]));
    assert_eq!(members("free end"), Some(vec![2, 3]));
    // The knot is a group of points.
    let [lines] = &mesh.line_groups[..] else {
        panic!("{:?}", mesh.line_groups);
    };
    assert_eq!(
        (lines.name.as_str(), &lines.members[..]),
        ("free end", &[2][..])
    );
}

#[test]
fn one_triangle_makes_a_sheet_with_lines_that_only_name_vertices() {
    let vtk = text("thread.vtk")
        .replace("CELLS 4 11", "CELLS 5 15")
        .replace("1 4\nCELL_TYPES 4\n", "1 4\n3 0 3 4\nCELL_TYPES 5\n")
        .replace("3\n1\nCELL_DATA 4", "3\n1\n5\nCELL_DATA 5")
        .replace("0.0\n", "0.0\n7.0\n")
        .replace("area 1 4", "area 1 5");
    match read_mesh("x.vtk", vtk.as_bytes()) {
        Ok(Mesh::Sheet(mesh)) => {
            assert_eq!(mesh.triangles, [[0, 1, 2]]);
            assert_eq!(mesh.triangle_fields[0].values, [7.0]);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn lines_of_other_than_two_points_are_refused_in_a_thread_alone() {
    let odd = text("thread.vtk")
        .replace("CELLS 4 11", "CELLS 4 12")
        .replace("2 2 3\n", "3 2 3 4\n")
        .replace("CELL_TYPES 4\n3\n3\n3\n", "CELL_TYPES 4\n3\n3\n4\n");
    let error = error("x.vtk", &odd);
    assert!(
        error.contains("expected a line of 2 points") && error.contains("found a line of 3 points"),
        "{error}"
    );
}

#[test]
fn a_fault_of_a_line_is_reported_with_its_place() {
    let msh = text("thread.msh");
    let twice = error("x.msh", &msh.replace("\n12 2 3\n", "\n12 2 2\n"));
    assert!(twice.contains("line 1: vertex 1 is named twice"), "{twice}");
    let place = msh
        .lines()
        .position(|line| line == "12 2 3")
        .expect("there")
        + 1;
    assert!(twice.starts_with(&format!("line {place}: ")), "{twice}");
    let unknown = error("x.msh", &msh.replace("\n12 2 3\n", "\n12 2 77\n"));
    assert!(unknown.contains("found 77"), "{unknown}");
    let doubled = error("x.vtk", &text("thread.vtk").replace("2 2 3\n", "2 1 0\n"));
    assert!(doubled.contains("has the same ends as line 0"), "{doubled}");
    let second_order = msh.replace("\n1 1 1 2\n", "\n1 1 8 2\n");
    let refused = error("x.msh", &second_order);
    assert!(!refused.contains("no error"), "{refused}");
}
