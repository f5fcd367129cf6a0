//! Reading a mesh takes memory in proportion to the file, whatever the file claims.
//!
//! A binary of its own, for its allocator counts every byte of the process; one test, for tests run beside
//! each other would be counted together.
#![allow(unsafe_code)]

use physics::mesh::vtk_xml::{MAX_RATIO, MIN_UNPACKED};
use physics::mesh::{TriMesh, read};
use std::alloc::{GlobalAlloc, Layout, System};
use std::fmt::Write;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The most bytes that reading takes at once, over the file's length.
///
/// The densest file is one of short lines. A triangle of eight bytes (`f 1 2 3` and the line's end)
/// becomes 12 bytes of corners, 4 of line and 4 for each of its ten groups at most, up to three times as
/// much while a list grows, and 48 bytes of edges: some 27 bytes for each of the file.
const MOST_PER_BYTE: usize = 32;
/// The same where arrays are compressed. They unpack to at most `MAX_RATIO` times the file; a triangle
/// takes at least 7 bytes there (three numbers of one byte, and its end of four, for smaller ones do not
/// count far), and grows as above, but has no groups: some 14 bytes for each that is unpacked.
const MOST_PER_PACKED_BYTE: usize = 16 * MAX_RATIO;
/// What reading takes in any case (bytes): zlib's window, a small file's arrays unpacked, messages.
const CONSTANT: usize = (64 << 10) + 16 * MIN_UNPACKED;

/// Counts what is allocated, and the most at any time.
struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

fn more(size: usize) {
    let now = NOW.fetch_add(size, Ordering::Relaxed) + size;
    PEAK.fetch_max(now, Ordering::Relaxed);
}

// SAFETY: every call is handed on to the system's allocator unchanged; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        more(layout.size());
        // SAFETY: the caller's contract is the system allocator's.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Old and new may both be there for a moment.
        more(size);
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The most bytes taken at once while a file is read, and whether it is a mesh.
fn peak(name: &str, bytes: &[u8]) -> (usize, Result<TriMesh, String>) {
    let before = NOW.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let result = read(name, bytes).map_err(|error| error.to_string());
    (PEAK.load(Ordering::Relaxed) - before, result)
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

/// A file of polygons whose arrays are compressed, each in one block.
fn packed(points: usize, cells: usize, arrays: [(&str, &str, Vec<u8>); 3]) -> Vec<u8> {
    use flate2::{Compression, write::ZlibEncoder};
    use std::io::Write as _;
    let mut tags = Vec::new();
    let mut data = Vec::new();
    for (name, kind, bytes) in arrays {
        tags.push(format!(
            "<DataArray Name=\"{name}\" type=\"{kind}\" format=\"appended\" offset=\"{}\"/>",
            data.len()
        ));
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&bytes).expect("memory takes all");
        let packed = encoder.finish().expect("memory takes all");
        for length in [1, bytes.len(), bytes.len(), packed.len()] {
            data.extend((length as u64).to_le_bytes());
        }
        data.extend(packed);
    }
    let mut file = format!(
        "<VTKFile type=\"PolyData\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\"><PolyData>\
         <Piece NumberOfPoints=\"{points}\" NumberOfPolys=\"{cells}\"><Points>{}</Points>\
         <Polys>{}{}</Polys></Piece></PolyData><AppendedData encoding=\"raw\">_",
        tags[0], tags[1], tags[2]
    )
    .into_bytes();
    file.extend(data);
    file
}

/// Points that are packed a thousand times.
fn bomb(points: usize) -> Vec<u8> {
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
fn packed_triangles(cells: usize) -> Vec<u8> {
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

/// A flat grid of `n` by `n` cells, each cut into two. With `groups`,
/// each triangle is in ten.
fn dense_obj(n: usize, groups: bool) -> Vec<u8> {
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
        assert_eq!(result.map(|mesh| mesh.triangles.len()), Ok(80_000));
    }
}
