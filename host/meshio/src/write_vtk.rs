//! Writes meshes as text in VTK's legacy format, with their fields.
//!
//! Source: "VTK File Formats" in the VTK documentation, section "Simple Legacy Formats". The version is 3.0, which
//! every program with support for the format reads. [`read_mesh`](crate::read_mesh) reads the same mesh back, with
//! equal bits, but without groups, which the format does not have. The caller writes the file.

use core::fmt::Write as _;
use physics::Vec3;
use physics::mesh::{Cells, Field, LineMesh, Mesh, TetMesh, TriMesh};

/// The text of a file.
pub fn write(mesh: &Mesh) -> String {
    match mesh {
        Mesh::Thread(mesh) => write_thread(mesh),
        Mesh::Sheet(mesh) => write_sheet(mesh),
        Mesh::Solid(mesh) => write_solid(mesh),
    }
}

/// The text of a thread's file.
pub fn write_thread(mesh: &LineMesh) -> String {
    let cells = mesh.lines.iter().map(<[u32; 2]>::as_slice);
    text(&mesh.positions, cells, (3, 2), &mesh.line_fields)
}

/// The text of a sheet's file.
pub fn write_sheet(mesh: &TriMesh) -> String {
    let cells = mesh.triangles.iter().map(<[u32; 3]>::as_slice);
    text(&mesh.positions, cells, (5, 3), &mesh.triangle_fields)
}

/// The text of a solid's file.
pub fn write_solid(mesh: &TetMesh) -> String {
    let kind = match mesh.cells {
        Cells::Linear(_) => (10, 4),
        Cells::Quadratic(_) => (24, 10),
    };
    let cells = mesh.cells.vertices();
    text(&mesh.positions, cells, kind, &mesh.cell_fields)
}

/// The file of cells of one type, with a fixed number of vertices each.
fn text<'a>(
    positions: &[Vec3],
    cells: impl Iterator<Item = &'a [u32]>,
    (kind, each): (u8, usize),
    fields: &[Field],
) -> String {
    let mut out =
        String::from("# vtk DataFile Version 3.0\nmesh\nASCII\nDATASET UNSTRUCTURED_GRID\n");
    let _ = writeln!(out, "POINTS {} double", positions.len());
    // `{:?}` gives the shortest text that reads back to the same number.
    for at in positions {
        let _ = writeln!(out, "{:?} {:?} {:?}", at.x, at.y, at.z);
    }
    let mut count = 0;
    let mut lines = String::new();
    for cell in cells {
        count += 1;
        let _ = write!(lines, "{each}");
        for vertex in cell {
            let _ = write!(lines, " {vertex}");
        }
        lines.push('\n');
    }
    let _ = write!(out, "CELLS {count} {}\n{lines}", count * (each + 1));
    let _ = writeln!(out, "CELL_TYPES {count}");
    for _ in 0..count {
        let _ = writeln!(out, "{kind}");
    }
    // An empty name would not be a word.
    let named = || fields.iter().filter(|field| !field.name.is_empty());
    if named().next().is_some() {
        let _ = writeln!(out, "CELL_DATA {count}\nFIELD cells {}", named().count());
    }
    for Field { name, values } in named() {
        let _ = writeln!(out, "{} 1 {} double", encoded(name), values.len());
        for value in values {
            let _ = writeln!(out, "{value:?}");
        }
    }
    out
}

/// A name as one word. Characters other than letters, digits and common signs become `%` and two digits, as in
/// `vtkDataWriter::EncodeString`.
fn encoded(name: &str) -> String {
    let mut word = String::new();
    for byte in name.bytes() {
        match byte {
            b'!'..=b'~' if byte != b'"' && byte != b'%' => word.push(char::from(byte)),
            _ => {
                let _ = write!(word, "%{byte:02X}");
            }
        }
    }
    word
}
