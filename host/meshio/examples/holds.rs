//! Prints what mesh files hold, a line for each: `cargo run --release -p palpate-meshio --example holds FILE...`.
//!
//! The columns are those of `tests/writers/holds.tsv`, to compare any number of files with their writers: file, kind,
//! vertices, elements, volume, area or length (of straight elements), then groups as name=vertices,elements.

use physics::mesh::{Group, LineMesh, Mesh, TetMesh};
use std::collections::BTreeMap;

fn main() {
    for name in std::env::args().skip(1) {
        let read = std::fs::read(&name).map_err(|error| error.to_string());
        let mesh = read
            .and_then(|bytes| meshio::read_mesh(&name, &bytes).map_err(|error| error.to_string()));
        match mesh {
            Ok(mesh) => println!("{name}\t{}", line(&mesh)),
            Err(error) => println!("{name}\terror\t{error}"),
        }
    }
}

fn line(mesh: &Mesh) -> String {
    let (kind, size, of_vertices, of_elements) = match mesh {
        Mesh::Solid(m) => ("solid", volume(m), &m.vertex_groups, &m.cell_groups),
        Mesh::Sheet(m) => ("sheet", m.area(), &m.vertex_groups, &m.triangle_groups),
        Mesh::Thread(m) => ("thread", length(m), &m.vertex_groups, &m.line_groups),
    };
    let mut sizes: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for (place, groups) in [of_vertices, of_elements].into_iter().enumerate() {
        for Group { name, members } in groups {
            sizes.entry(name).or_default()[place] = members.len();
        }
    }
    let mut words = vec![
        kind.to_owned(),
        mesh.positions().len().to_string(),
        mesh.element_count().to_string(),
        format!("{size:?}"),
    ];
    words.extend(sizes.iter().map(|(name, [v, e])| format!("{name}={v},{e}")));
    words.join("\t")
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
