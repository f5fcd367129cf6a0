//! Files that become as much memory as their format allows, for their length.

use physics::mesh::generate_box::solid_box;
use std::fmt::Write as _;

/// A file of polygons whose arrays are compressed, each in one block.
fn packed(points: usize, cells: usize, arrays: [(&str, &str, Vec<u8>); 3]) -> Vec<u8> {
    packed_file("PolyData", "Polys", points, cells, arrays.into())
}

/// A file whose arrays are compressed, each in one block: those of points, of cells, and of cell data.
fn packed_file(
    kind: &str,
    section: &str,
    points: usize,
    cells: usize,
    arrays: Vec<(&str, &str, Vec<u8>)>,
) -> Vec<u8> {
    use flate2::{Compression, write::ZlibEncoder};
    use std::io::Write as _;
    let mut tags = [String::new(), String::new(), String::new()];
    let mut data = Vec::new();
    for (name, kind, bytes) in arrays {
        let place = match name {
            "Points" => 0,
            "connectivity" | "offsets" | "types" => 1,
            _ => 2,
        };
        let tag = format!("<DataArray Name=\"{name}\" type=\"{kind}\" format=\"appended\"");
        tags[place].extend([tag, format!(" offset=\"{}\"/>", data.len())]);
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&bytes).expect("memory takes all");
        let packed = encoder.finish().expect("memory takes all");
        for length in [1, bytes.len(), bytes.len(), packed.len()] {
            data.extend((length as u64).to_le_bytes());
        }
        data.extend(packed);
    }
    let [of_points, of_cells, cell_data] = tags;
    let mut file = format!(
        "<VTKFile type=\"{kind}\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\"><{kind}>\
         <Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\"><Points>{of_points}</Points>\
         <{section}>{of_cells}</{section}><CellData>{cell_data}</CellData></Piece></{kind}>\
         <AppendedData encoding=\"raw\">_"
    )
    .into_bytes();
    file.extend(data);
    file
}

/// Points that are packed a thousand times.
pub(crate) fn bomb(points: usize) -> Vec<u8> {
    let none = |name| (name, "Int32", Vec::new());
    packed(
        points,
        0,
        [
            ("Points", "Float32", vec![0; 12 * points]),
            none("connectivity"),
            none("offsets"),
        ],
    )
}

/// One triangle again and again, in as few bytes as the format allows.
pub(crate) fn packed_triangles(cells: usize) -> Vec<u8> {
    let corners = [[0_f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let points = corners
        .iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let numbers = [0, 1, 2].repeat(cells);
    let ends = (1..=cells)
        .flat_map(|cell| (3 * cell as u32).to_le_bytes())
        .collect();
    let arrays = [
        ("Points", "Float32", points),
        ("connectivity", "UInt8", numbers),
        ("offsets", "UInt32", ends),
    ];
    packed(3, cells, arrays)
}

/// One tetrahedron again and again, of the given type; noise after it keeps the file from being packed too
/// well to be read.
pub(crate) fn packed_tetrahedra(cells: usize, kind: u8) -> Vec<u8> {
    let each = if kind == 10 { 4 } else { 10 };
    let points: Vec<u8> = solid_box([1.0; 3], [1; 3])
        .expect("a box")
        .quadratic()
        .positions
        .iter()
        .flat_map(|x| [x.x, x.y, x.z])
        .flat_map(f64::to_le_bytes)
        .collect();
    let count = points.len() / 24;
    let numbers: Vec<u8> = [0, 1, 3, 7, 8, 9, 10, 11, 12, 13][..each].repeat(cells);
    let ends = (1..=cells).flat_map(|cell| ((each * cell) as u32).to_le_bytes());
    let arrays = vec![
        ("Points", "Float64", points),
        ("connectivity", "UInt8", numbers),
        ("offsets", "UInt32", ends.collect()),
        ("types", "UInt8", vec![kind; cells]),
        ("noise", "String", noise(cells)),
    ];
    packed_file("UnstructuredGrid", "Cells", count, cells, arrays)
}

/// Bytes that no packing makes shorter: the high ones of a linear congruential generator (Knuth's constants).
fn noise(count: usize) -> Vec<u8> {
    let mut state = 1_u64;
    let next = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    std::iter::repeat_with(next).take(count).collect()
}

/// Tetrahedra of a box with fields of one byte a cell: as many values as cells, and as large as they get.
pub(crate) fn packed_fields(n: u32, fields: usize) -> Vec<u8> {
    let mesh = solid_box([1.0; 3], [n; 3]).expect("a box");
    let cells = mesh.cells.len();
    let points = mesh
        .positions
        .iter()
        .flat_map(|x| [x.x, x.y, x.z])
        .flat_map(f64::to_le_bytes);
    let numbers = mesh
        .cells
        .vertices()
        .flatten()
        .flat_map(|v| v.to_le_bytes());
    let ends = (1..=cells).flat_map(|cell| (4 * cell as u32).to_le_bytes());
    let names: Vec<String> = (0..fields).map(|k| k.to_string()).collect();
    let mut arrays = vec![
        ("Points", "Float64", points.collect()),
        ("connectivity", "UInt32", numbers.collect()),
        ("offsets", "UInt32", ends.collect()),
        ("types", "UInt8", vec![10; cells]),
    ];
    arrays.extend(
        names
            .iter()
            .map(|name| (&name[..], "UInt8", vec![1; cells])),
    );
    packed_file(
        "UnstructuredGrid",
        "Cells",
        mesh.positions.len(),
        cells,
        arrays,
    )
}

/// An MSH file of one tetrahedron again and again, or of a box, with values; each cell is in 16 groups.
pub(crate) fn dense_msh(elements: &[String], nodes: &[String], code: u8, fields: usize) -> Vec<u8> {
    let names = concat((1..=16).map(|k| format!("3 {k} \"{k}\"\n")));
    let (n, m) = (nodes.len(), elements.len());
    let tags = concat((1..=n).map(|k| format!("{k}\n")));
    let values = concat((1..=m).map(|k| format!("{k} 1\n")));
    let data =
        concat((0..fields).map(|k| {
            format!("$ElementData\n1\n\"{k}\"\n0\n3\n0\n1\n{m}\n{values}$EndElementData\n")
        }));
    format!(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n16\n{names}$EndPhysicalNames\n\
         $Entities\n0 0 0 1\n1 0 0 0 1 1 1 16 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 0\n$EndEntities\n\
         $Nodes\n1 {n} 1 {n}\n3 1 0 {n}\n{tags}{}\n$EndNodes\n\
         $Elements\n1 {m} 1 {m}\n3 1 {code} {m}\n{}\n$EndElements\n{data}",
        nodes.join("\n"),
        elements.join("\n")
    )
    .into_bytes()
}

fn concat(lines: impl Iterator<Item = String>) -> String {
    lines.collect::<Vec<_>>().concat()
}

/// A box of `n`^3 cells as [`dense_msh`].
pub(crate) fn dense_box(n: u32, quadratic: bool, fields: usize) -> Vec<u8> {
    let mut mesh = solid_box([1.0; 3], [n; 3]).expect("a box");
    if quadratic {
        mesh = mesh.quadratic();
    }
    // As few digits as there may be.
    let nodes: Vec<String> = mesh
        .positions
        .iter()
        .map(|x| x.map(|x| (x * f64::from(2 * n)).round()))
        .map(|x| format!("{} {} {}", x.x, x.y, x.z))
        .collect();
    let elements: Vec<String> = (1..)
        .zip(mesh.cells.vertices())
        .map(|(tag, cell)| {
            let mut cell: Vec<String> = cell.iter().map(|v| (v + 1).to_string()).collect();
            if quadratic {
                cell.swap(8, 9);
            }
            format!("{tag} {}", cell.join(" "))
        })
        .collect();
    dense_msh(&elements, &nodes, if quadratic { 11 } else { 4 }, fields)
}

/// A flat grid of `n` by `n` cells, each cut into two. With `groups`,
/// each triangle is in ten.
pub(crate) fn dense_obj(n: usize, groups: bool) -> Vec<u8> {
    let mut text = String::new();
    if groups {
        text += "g a b c d e f g h\no i\nusemtl j\n";
    }
    for i in 0..=n {
        for j in 0..=n {
            writeln!(text, "v {i} {j} 0").expect("memory takes all");
        }
    }
    for i in 0..n {
        for j in 0..n {
            let a = i * (n + 1) + j + 1;
            let (b, c, d) = (a + 1, a + n + 2, a + n + 1);
            writeln!(text, "f {a} {b} {c}\nf {a} {c} {d}").expect("memory takes all");
        }
    }
    text.into_bytes()
}
