//! Reading a mesh takes memory in proportion to the file, whatever the file claims.
//!
//! A binary of its own, for its allocator counts every byte of the process; one test, for tests run beside
//! each other would be counted together.

mod support;

use alloc_count::peak::{self, Peak};
use meshio::read_mesh;
use meshio::vtk_xml::{MAX_RATIO, MIN_UNPACKED};
use physics::mesh::Mesh;
use support::dense::{
    bomb, dense_box, dense_msh, dense_obj, packed_fields, packed_tetrahedra, packed_triangles,
};

/// The most bytes that reading takes at once, over the file's length.
///
/// The densest file is one of short lines. A triangle of eight bytes (`f 1 2 3` and the line's end)
/// becomes 12 bytes of corners, 4 of line and 4 for each of its ten groups at most, up to three times as
/// much while a list grows, and 48 bytes of edges: some 27 bytes for each of the file. A tetrahedron of ten
/// bytes (`1 1 2 3 4`) becomes 48 bytes of tags and line, 16 of corners and 80 of faces: some 15 for each.
const MOST_PER_BYTE: usize = 32;
/// The same if arrays are compressed. They unpack to at most `MAX_RATIO` times the file; a triangle
/// takes at least 7 bytes there (three numbers of one byte, and its end of four, for smaller ones do not
/// count far), and grows as above, but has no groups: some 14 bytes for each that is unpacked. A tetrahedron
/// takes at least 9 and becomes 16 bytes of corners, 8 of places and 80 of faces; a value of a field takes
/// at least 1 and becomes 8.
const MOST_PER_PACKED_BYTE: usize = 16 * MAX_RATIO;
/// What reading takes in any case (bytes): zlib's window, a small file's arrays unpacked, messages.
const CONSTANT: usize = (64 << 10) + 16 * MIN_UNPACKED;

#[global_allocator]
static ALLOCATOR: Peak = Peak;

/// The most bytes taken at once while a file is read, and whether it is a mesh.
fn peak(name: &str, bytes: &[u8]) -> (usize, Result<Mesh, String>) {
    peak::peak(|| read_mesh(name, bytes).map_err(|error| error.to_string()))
}

const CLAIMS: [&str; 4] = [
    "1000000000",
    "4294967295",
    "9223372036854775807",
    "18446744073709551615",
];

/// Files that claim far more than they hold.
fn hostile() -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    let mut add = |name: &str, file: Vec<u8>| files.push((name.to_owned(), file));
    for n in CLAIMS {
        add(
            "x.obj",
            format!("v 0 0 0\nf 1 2 {n}\nf 1 2 -{n}\n").into_bytes(),
        );
        add(
            "x.msh",
            format!("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n{n} {n} 1 1\n2 1 0 {n}\n1\n")
                .into_bytes(),
        );
        add(
            "x.msh",
            format!(
                "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Elements\n{n} {n} 1 1\n2 1 2 {n}\n1 1 2 3\n"
            )
            .into_bytes(),
        );
        add(
            "x.msh",
            format!(
                "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Elements\n{n} {n} 1 1\n3 1 11 {n}\n1 1 2 3\n"
            )
            .into_bytes(),
        );
        add(
            "x.msh",
            format!(
                "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n\
                 $ElementData\n1\n\"a\"\n0\n3\n0\n1\n{n}\n1 1\n"
            )
            .into_bytes(),
        );
        for section in ["$Nodes", "$Elements"] {
            add(
                "x.msh",
                format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{section}\n{n}\n1 4 1 1 1\n")
                    .into_bytes(),
            );
            let number = n.parse::<u64>().unwrap_or(u64::MAX).to_le_bytes();
            let mut file = b"$MeshFormat\n4.1 1 8\n\x01\0\0\0\n$EndMeshFormat\n".to_vec();
            file.extend(section.bytes());
            file.extend(b"\n");
            file.extend([number; 4].as_flattened());
            file.extend([[2, 0, 0, 0], [1, 0, 0, 0], [2, 0, 0, 0]].as_flattened());
            file.extend(number);
            add("x.msh", file);
        }
        for kind in ["ASCII", "BINARY"] {
            let head =
                format!("# vtk DataFile Version 5.1\nt\n{kind}\nDATASET UNSTRUCTURED_GRID\n");
            add(
                "x.vtk",
                format!("{head}POINTS {n} double\n0 0 0\n").into_bytes(),
            );
            add(
                "x.vtk",
                format!("{head}POINTS 0 float\nCELLS {n} {n}\nOFFSETS vtktypeint64\n0 3\n")
                    .into_bytes(),
            );
            add(
                "x.vtk",
                format!("{head}FIELD f {n}\na {n} {n} double\n").into_bytes(),
            );
            add("x.vtk", format!("{head}CELL_TYPES {n}\n5\n").into_bytes());
            for data in [
                format!("CELL_DATA {n}\nSCALARS a int\nLOOKUP_TABLE b\n1\n"),
                format!("CELL_DATA {n}\nFIELD a {n}\nb 1 {n} int\n1\n"),
                format!("POINT_DATA {n}\nTENSORS a double\n1\n"),
                format!("CELL_DATA 1\nLOOKUP_TABLE a {n}\n1\n"),
            ] {
                add("x.vtk", format!("{head}{data}").into_bytes());
            }
        }
        // Lengths of appended and compressed arrays: {n} as the first bytes, and counts in the tags.
        let number = n.parse::<u64>().unwrap_or(u64::MAX).to_le_bytes();
        let lengths = [number, number, number].concat();
        for compressor in ["", "compressor=\"vtkZLibDataCompressor\""] {
            let mut file = format!(
                "<VTKFile type=\"PolyData\" header_type=\"UInt64\" {compressor}><PolyData>\
                 <Piece NumberOfPoints=\"{n}\" NumberOfPolys=\"{n}\"><Points><DataArray type=\"Float32\" \
                 format=\"appended\" offset=\"0\"/></Points></Piece></PolyData>\
                 <AppendedData encoding=\"raw\">_"
            )
            .into_bytes();
            file.extend(&lengths);
            add("x.vtp", file);
        }
    }
    files
}

#[test]
fn memory_is_bounded_by_the_length_of_the_file() {
    let mut files = hostile();
    for (name, line) in [
        ("f.obj", "f 1 1 1\n"),
        ("v.obj", "v 0 0 0\n"),
        ("g.obj", "g a b c d e f g h\nf 1 1 1\n"),
        ("n.vtk", "0\n"),
        ("a.vtu", "<a>"),
        ("b.vtu", "<DataArray/>"),
    ] {
        files.push((name.to_owned(), line.repeat(100_000).into_bytes()));
    }
    // The same triangle again and again: refused, but only once all are read.
    let copies = |head: &str, line: &str| (head.to_owned() + &line.repeat(200_000)).into_bytes();
    files.push((
        "f.obj".to_owned(),
        copies("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "f 1 2 3\n"),
    ));
    let grouped = copies(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\ng a b c d e f g h\no i\nusemtl j\n",
        "f 1 2 3\n",
    );
    files.push(("g.obj".to_owned(), grouped));
    files.push(("bomb.vtp".to_owned(), bomb(5_000_000)));
    // Small enough in all, and just below the greatest ratio.
    files.push(("small.vtp".to_owned(), packed_triangles(9_000)));
    files.push(("packed.vtp".to_owned(), packed_triangles(1_000_000)));
    // The same for tetrahedra, in as few bytes as each format allows.
    let nodes = ["0 0 0", "1 0 0", "0 1 0", "0 0 1"].map(str::to_owned);
    let same = vec!["1 1 2 3 4".to_owned(); 100_000];
    files.push(("t.msh".to_owned(), dense_msh(&same, &nodes, 4, 0)));
    // Flat triangles of as many different vertices as the file can hold.
    let mut stl = vec![b' '; 80];
    stl.extend(100_000_u32.to_le_bytes());
    for triangle in 0..100_000_usize {
        stl.extend([0; 12]);
        for corner in 0..3 {
            stl.extend(((3 * triangle + corner) as f32).to_le_bytes());
            stl.extend([0; 8]);
        }
        stl.extend([0; 2]);
    }
    files.push(("t.stl".to_owned(), stl));
    // Version 2 of the format: elements of as many groups as there are names, each repeated.
    let names: Vec<_> = (1..=256).map(|k| format!("0 {k} \"a{k}\"\n")).collect();
    let names = names.concat();
    let points: Vec<_> = (0..200_000)
        .map(|k| format!("1 15 1 {} {}\n", 1 + k % 256, 1 + k / 300))
        .collect();
    let points = points.concat();
    let text = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n256\n{names}$EndPhysicalNames\n$Nodes\n1\n1 0 0 0\n\
         $EndNodes\n$Elements\n200000\n{points}$EndElements\n"
    );
    files.push(("p.msh".to_owned(), text.into_bytes()));
    let text = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n\
         $Elements\n200000\n{}$EndElements\n",
        "1 4 0 1 2 3 4\n1 15 0 1\n".repeat(100_000)
    );
    files.push(("q.msh".to_owned(), text.into_bytes()));
    let head = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 int\n\
                0 0 0 1 0 0 0 1 0 0 0 1\n";
    let text = format!(
        "{head}CELLS 100000 500000\n{}CELL_TYPES 100000\n{}",
        "4 0 1 2 3\n".repeat(100_000),
        "10\n".repeat(100_000)
    );
    files.push(("t.vtk".to_owned(), text.clone().into_bytes()));
    // Many fields without values, and many values of fields that are refused.
    let none = format!(
        "{text}CELL_DATA 0\nFIELD f 100000\n{}",
        "a 1 0 int\n".repeat(100_000)
    );
    files.push(("n.vtk".to_owned(), none.into_bytes()));
    let attributes = "SCALARS a int\nLOOKUP_TABLE b\n".repeat(100_000);
    let attributes = format!("{text}CELL_DATA 0\n{attributes}");
    files.push(("s.vtk".to_owned(), attributes.into_bytes()));
    let arrays = "<DataArray type=\"Int8\" Name=\"\"/>".repeat(100_000);
    let arrays = format!(
        "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece NumberOfPoints=\"0\" \
         NumberOfCells=\"0\"><CellData>{arrays}"
    );
    files.push(("c.vtu".to_owned(), arrays.into_bytes()));
    files.push(("small.vtu".to_owned(), packed_tetrahedra(7_000, 10)));
    files.push(("linear.vtu".to_owned(), packed_tetrahedra(500_000, 10)));
    files.push(("quadratic.vtu".to_owned(), packed_tetrahedra(300_000, 24)));
    for (name, bytes) in files {
        let (peak, result) = peak(&name, &bytes);
        let compressed = bytes.windows(10).any(|piece| piece == b"compressor");
        let each = if compressed {
            MOST_PER_PACKED_BYTE
        } else {
            MOST_PER_BYTE
        };
        let most = each * bytes.len() + CONSTANT;
        println!(
            "{name}: {} bytes, peak {peak}, {:.1} a byte",
            bytes.len(),
            peak as f64 / bytes.len() as f64
        );
        assert!(peak <= most, "{name}: {peak} bytes for {}", bytes.len());
        let error = result.expect_err("none of these is a mesh");
        assert!(error.len() < 600 && !error.contains('\n'), "{error}");
    }

    for groups in [false, true] {
        let bytes = dense_obj(200, groups);
        let (peak, result) = peak("x.obj", &bytes);
        println!(
            "grid: {} bytes, peak {peak}, {:.1} a byte",
            bytes.len(),
            peak as f64 / bytes.len() as f64
        );
        assert!(
            peak <= MOST_PER_BYTE * bytes.len(),
            "{peak} bytes for {}",
            bytes.len()
        );
        let count = result.map(|mesh| match mesh {
            Mesh::Sheet(mesh) => mesh.triangles.len(),
            Mesh::Thread(_) | Mesh::Solid(_) => 0,
        });
        assert_eq!(count, Ok(80_000));
    }
    let solids = [
        ("x.msh", dense_box(20, false, 0), 0),
        ("x.msh", dense_box(12, true, 0), 0),
        ("x.msh", dense_box(12, false, 40), 40),
        ("x.vtu", packed_fields(20, 12), 12),
    ];
    for (name, bytes, fields) in solids {
        let (peak, result) = peak(name, &bytes);
        println!(
            "{name}: {} bytes, peak {peak}, {:.1} a byte",
            bytes.len(),
            peak as f64 / bytes.len() as f64
        );
        let each = if name == "x.vtu" {
            MOST_PER_PACKED_BYTE
        } else {
            MOST_PER_BYTE
        };
        assert!(
            peak <= each * bytes.len(),
            "{peak} bytes for {}",
            bytes.len()
        );
        let Ok(Mesh::Solid(mesh)) = result else {
            panic!("{name}: {result:?}")
        };
        assert_eq!(mesh.cell_fields.len(), fields, "{name}");
    }

    // As many lines as points.
    let thread = dense_lines(100_000);
    let (peak, result) = peak("x.vtk", &thread);
    println!("lines: {} bytes, peak {peak}", thread.len());
    assert!(
        peak <= MOST_PER_BYTE * thread.len(),
        "{peak} bytes for {}",
        thread.len()
    );
    let count = result.map(|mesh| matches!(mesh, Mesh::Thread(_)).then(|| mesh.element_count()));
    assert_eq!(count, Ok(Some(99_999)));
}

/// A legacy VTK file of lines from each of some points to the next.
fn dense_lines(points: usize) -> Vec<u8> {
    let lines = points - 1;
    let positions: Vec<_> = (0..points).map(|x| format!("{x} 0 0\n")).collect();
    let cells: Vec<_> = (0..lines).map(|a| format!("2 {a} {}\n", a + 1)).collect();
    format!(
        "# vtk DataFile Version 3.0\nmesh\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {points} double\n{}\
         CELLS {lines} {}\n{}CELL_TYPES {lines}\n{}",
        positions.concat(),
        3 * lines,
        cells.concat(),
        "3\n".repeat(lines)
    )
    .into_bytes()
}
