//! Files by other programs' writers hold what the same programs say: see `writers/make.py`.

use meshio::read_mesh;
use physics::mesh::{Group, LineMesh, Mesh, TetMesh};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The largest relative error of a volume or area. Coordinates have up to 16 digits, those of STL files 7.
const TOLERANCE: f64 = 1e-6;

fn file(name: &str) -> Vec<u8> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/writers");
    std::fs::read(folder.join(name)).unwrap()
}

/// The members of each group: of vertices, then of cells.
fn sizes(of_vertices: &[Group], of_cells: &[Group]) -> BTreeMap<String, [usize; 2]> {
    let mut sizes: BTreeMap<String, [usize; 2]> = BTreeMap::new();
    for (place, groups) in [of_vertices, of_cells].into_iter().enumerate() {
        for group in groups {
            sizes.entry(group.name.clone()).or_default()[place] = group.members.len();
        }
    }
    sizes
}

/// The length of all lines.
fn length(mesh: &LineMesh) -> f64 {
    let at = |vertex: u32| mesh.positions[vertex as usize];
    let lines = mesh.lines.iter();
    lines.map(|&[a, b]| (at(b) - at(a)).norm()).sum()
}

/// The volume of cells with straight edges.
fn volume(mesh: &TetMesh) -> f64 {
    let of_cell = |cell: &[u32]| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|corner| mesh.positions[cell[corner] as usize]);
        (b - a).cross(&(c - a)).dot(&(d - a)) / 6.0
    };
    mesh.cells.vertices().map(of_cell).sum()
}

#[test]
fn a_file_holds_what_its_writer_says() {
    let table = String::from_utf8(file("holds.tsv")).unwrap();
    for line in table.lines() {
        let words: Vec<&str> = line.split('\t').collect();
        let (name, kind) = (words[0], words[1]);
        let mesh = read_mesh(name, &file(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        let (found, size, groups) = match &mesh {
            Mesh::Solid(solid) => (
                "solid",
                volume(solid),
                sizes(&solid.vertex_groups, &solid.cell_groups),
            ),
            Mesh::Sheet(sheet) => (
                "sheet",
                sheet.area(),
                sizes(&sheet.vertex_groups, &sheet.triangle_groups),
            ),
            Mesh::Thread(thread) => (
                "thread",
                length(thread),
                sizes(&thread.vertex_groups, &thread.line_groups),
            ),
        };
        assert_eq!(found, kind, "{name}");
        let counts = [mesh.positions().len(), mesh.element_count()].map(|count| count.to_string());
        assert_eq!(counts[..], words[2..4], "{name}");
        let expected: f64 = words[4].parse().unwrap();
        assert!(
            (size - expected).abs() <= TOLERANCE * expected,
            "{name}: {size}, not {expected}"
        );
        let group =
            |(name, sizes): (&String, &[usize; 2])| format!("{name}={},{}", sizes[0], sizes[1]);
        let groups: Vec<String> = groups.iter().map(group).collect();
        assert_eq!(groups, words[5..], "{name}");
    }
}

#[test]
fn a_field_of_elements_has_the_values_of_its_writer() {
    for version in ["2.2", "4.1"] {
        for form in ["text", "binary"] {
            for order in [1, 2] {
                let name = format!("gmsh{version}_order{order}_{form}.msh");
                let Ok(Mesh::Solid(solid)) = read_mesh(&name, &file(&name)) else {
                    panic!("{name}")
                };
                let expected: Vec<f64> = (0..solid.cells.len()).map(|cell| cell as f64).collect();
                let fields: Vec<_> = solid
                    .cell_fields
                    .iter()
                    .map(|field| &field.name[..])
                    .collect();
                assert_eq!(fields, ["number"], "{name}");
                assert_eq!(solid.cell_fields[0].values, expected, "{name}");
            }
        }
    }
}

#[test]
fn arrays_that_hold_no_values_are_skipped() {
    let table = String::from_utf8(file("holds.tsv")).unwrap();
    let names = table.lines().filter_map(|line| line.split('\t').next());
    let expected: Vec<f64> = (0..6).map(|cell| 1000.0 + f64::from(cell)).collect();
    let mut count = 0;
    let solids = |name: &&str| {
        !["sheet", "vtp", "blocks"]
            .iter()
            .any(|part| name.contains(part))
    };
    for name in names.filter(|name| name.starts_with("vtk")).filter(solids) {
        let mesh = read_mesh(name, &file(name)).unwrap();
        let fields: Vec<_> = mesh.fields().iter().map(|field| &field.name[..]).collect();
        // Texts, bits and values that are not finite stand beside it.
        assert_eq!(fields, ["young"], "{name}");
        assert_eq!(mesh.fields()[0].values, expected, "{name}");
        count += 1;
    }
    assert_eq!(count, 30);
}

#[test]
fn a_file_is_read_by_its_beginning_whatever_its_name() {
    let table = String::from_utf8(file("holds.tsv")).unwrap();
    for name in table.lines().filter_map(|line| line.split('\t').next()) {
        // OBJ files have no beginning of their own.
        if Path::new(name).extension().is_some_and(|end| end == "obj") {
            continue;
        }
        let expected = read_mesh(name, &file(name)).unwrap();
        for other in ["x.obj", "x.msh", "x.vtk", "x.vtu", "x.stl", "x"] {
            assert_eq!(
                read_mesh(other, &file(name)).as_ref(),
                Ok(&expected),
                "{name} as {other}"
            );
        }
    }
}

#[test]
fn the_versions_of_a_format_hold_one_mesh() {
    for order in [1, 2] {
        let read = |version: &str, form: &str| {
            let name = format!("gmsh{version}_order{order}_{form}.msh");
            read_mesh(&name, &file(&name)).unwrap()
        };
        // Text has 16 digits, which do not give back every bit.
        assert_eq!(read("2.2", "binary"), read("4.1", "binary"));
        assert_eq!(read("2.2", "text"), read("4.1", "text"));
    }
}

#[test]
fn a_binary_file_of_the_other_byte_order_is_the_same() {
    let name = "gmsh2.2_order1_binary.msh";
    let bytes = file(name);
    let turned = big_endian(&bytes);
    assert_ne!(bytes, turned);
    assert_eq!(read_mesh(name, &turned), read_mesh(name, &bytes));
}

/// The binary file of version 2.2 with every number turned around.
fn big_endian(bytes: &[u8]) -> Vec<u8> {
    let mut out = bytes.to_vec();
    let find = |text: &str| {
        let place = bytes.windows(text.len()).position(|w| w == text.as_bytes());
        place.unwrap() + text.len()
    };
    let line_after = |start: usize| {
        let length = bytes[start..].iter().position(|&b| b == b'\n').unwrap();
        let count = std::str::from_utf8(&bytes[start..start + length]).unwrap();
        (start + length + 1, count.parse::<usize>().unwrap())
    };
    let mut turn = |at: &mut usize, size: usize| {
        out[*at..*at + size].reverse();
        *at += size;
    };
    let int = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    turn(&mut find("2.2 1 8\n"), 4);
    let (mut at, nodes) = line_after(find("$Nodes\n"));
    for _ in 0..nodes {
        for size in [4, 8, 8, 8] {
            turn(&mut at, size);
        }
    }
    let (mut at, elements) = line_after(find("$Elements\n"));
    let mut read = 0;
    while read < elements {
        let [code, count, tags] = [0, 4, 8].map(|k| int(at + k));
        let nodes = [0, 2, 3, 0, 4].get(code).copied().unwrap_or(1);
        let numbers = 3 + count * (1 + tags + nodes);
        for _ in 0..numbers {
            turn(&mut at, 4);
        }
        read += count;
    }
    // The data's head ends with the number of values, and zero for no partition.
    let mut at = find("\n1\n48\n0\n");
    for _ in 0..48 {
        turn(&mut at, 4);
        turn(&mut at, 8);
    }
    out
}

#[test]
fn a_truncated_or_damaged_file_is_an_error_or_a_mesh() {
    let names = String::from_utf8(file("holds.tsv")).unwrap();
    for name in names.lines().filter_map(|line| line.split('\t').next()) {
        let bytes = file(name);
        for end in (0..bytes.len()).step_by(7) {
            judge(name, &bytes[..end]);
        }
        // Every byte of the first kilobytes, where the counts are, set to values that numbers do not have.
        for at in (0..bytes.len()).step_by(3) {
            for value in [0, 1, 0x7F, 0xFF] {
                let mut bytes = bytes.clone();
                bytes[at] = value;
                judge(name, &bytes);
            }
        }
    }
}

/// Checks what must hold of any bytes.
fn judge(name: &str, bytes: &[u8]) {
    match read_mesh(name, bytes) {
        Ok(Mesh::Solid(mesh)) => mesh.validate().unwrap(),
        Ok(Mesh::Sheet(mesh)) => mesh.validate().unwrap(),
        Ok(Mesh::Thread(mesh)) => mesh.validate().unwrap(),
        Err(error) => {
            let message = error.to_string();
            assert!(!message.contains('\n') && message.len() < 400, "{message}");
        }
    }
}
