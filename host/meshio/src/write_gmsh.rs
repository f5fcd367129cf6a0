//! Writes meshes as text in Gmsh's MSH format, version 4.1, ASCII, with their groups and fields.
//!
//! Source: the Gmsh reference manual, "MSH file format". [`read_mesh`](crate::read_mesh) reads the same mesh
//! back, with equal bits, within the limits of the format. Groups without members and blank names are omitted. In
//! names, control characters become blanks and double quotes become single quotes. The reader refuses a cell in more
//! than [`MAX_TAGS`](crate::gmsh::MAX_TAGS) groups. The caller writes the file.
//!
//! A physical group belongs to entities, so cells become as many entities as there are sets of groups that
//! some cell is in. A group of vertices becomes an entity of points, one at each of them. Of a thread or
//! a sheet, a group of lines or triangles stands for the group of their vertices of the same name, as it does when it is
//! read.

use crate::gmsh::assemble::to_or_from_vtk;
use core::fmt::Write as _;
use physics::Vec3;
use physics::mesh::{Bounds, Cells, Field, Group, LineMesh, Mesh, TetMesh, TriMesh};
use std::collections::{BTreeMap, BTreeSet};

/// A mesh of any kind, as the file sees it.
struct Contents<'a> {
    positions: &'a [Vec3],
    /// Vertices of each cell, in Gmsh's order.
    cells: Vec<Vec<u32>>,
    /// The dimension of the cells, and Gmsh's number for their kind.
    dim: u8,
    code: u8,
    /// Groups of vertices that do not follow from groups of cells.
    vertex_groups: Vec<&'a Group>,
    /// Names of the groups, in the order in which the reader returns the groups.
    names: Vec<&'a str>,
    cell_groups: &'a [Group],
    fields: &'a [Field],
}

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
    let groups = (&mesh.vertex_groups[..], &mesh.line_groups[..]);
    Contents {
        positions: &mesh.positions,
        cells: mesh.lines.iter().map(|line| line.to_vec()).collect(),
        dim: 1,
        code: 1,
        vertex_groups: not_implied(groups, &mesh.lines),
        names: names(groups.0, groups.1),
        cell_groups: groups.1,
        fields: &mesh.line_fields,
    }
    .text()
}

/// The groups of vertices that are not those of the vertices of the group of cells of the same name.
fn not_implied<'a, const N: usize>(
    (of_vertices, of_cells): (&'a [Group], &[Group]),
    cells: &[[u32; N]],
) -> Vec<&'a Group> {
    let implied = |group: &&Group| {
        let named = of_cells.iter().find(|cells| cells.name == group.name);
        let vertices = named.map(|named| {
            let members = named.members.iter();
            let corners = members.filter_map(|&cell| cells.get(cell as usize));
            corners.flatten().copied().collect::<BTreeSet<u32>>()
        });
        vertices.is_some_and(|vertices| vertices.iter().eq(&group.members))
    };
    of_vertices.iter().filter(|group| !implied(group)).collect()
}

/// The text of a sheet's file.
pub fn write_sheet(mesh: &TriMesh) -> String {
    Contents {
        positions: &mesh.positions,
        cells: mesh.triangles.iter().map(|t| t.to_vec()).collect(),
        dim: 2,
        code: 2,
        vertex_groups: not_implied(
            (&mesh.vertex_groups, &mesh.triangle_groups),
            &mesh.triangles,
        ),
        names: names(&mesh.vertex_groups, &mesh.triangle_groups),
        cell_groups: &mesh.triangle_groups,
        fields: &mesh.triangle_fields,
    }
    .text()
}

/// The text of a solid's file.
pub fn write_solid(mesh: &TetMesh) -> String {
    let (cells, code) = match &mesh.cells {
        Cells::Linear(cells) => (cells.iter().map(|cell| cell.to_vec()).collect(), 4),
        Cells::Quadratic(cells) => (
            cells
                .iter()
                .map(|&cell| to_or_from_vtk(cell).to_vec())
                .collect(),
            11,
        ),
    };
    Contents {
        positions: &mesh.positions,
        cells,
        dim: 3,
        code,
        vertex_groups: mesh.vertex_groups.iter().collect(),
        names: names(&mesh.vertex_groups, &mesh.cell_groups),
        cell_groups: &mesh.cell_groups,
        fields: &mesh.cell_fields,
    }
    .text()
}

/// The names of both lists, each once, in an order that is the order of each list. If the lists name the same groups
/// in different orders, the order is that of the groups of vertices.
fn names<'a>(vertices: &'a [Group], cells: &'a [Group]) -> Vec<&'a str> {
    let mut cells = cells.iter().map(|group| group.name.as_str()).peekable();
    let mut seen = BTreeSet::new();
    let mut names = Vec::new();
    let mut add = |name| {
        if seen.insert(name) {
            names.push(name);
        }
    };
    for group in vertices {
        let name = group.name.as_str();
        if cells.clone().any(|other| other == name) {
            while let Some(earlier) = cells.next_if(|other| *other != name) {
                add(earlier);
            }
        }
        add(name);
    }
    cells.for_each(add);
    names
}

/// The name without characters that would end the name or its line; `None` if the name is blank.
fn legible(name: &str) -> Option<String> {
    let legible = name.replace(char::is_control, " ").replace('"', "'");
    Some(legible).filter(|name| !name.trim().is_empty())
}

/// Consecutive cells in the same set of groups.
struct Run {
    entity: usize,
    cells: core::ops::Range<usize>,
}

impl Contents<'_> {
    fn text(&self) -> String {
        let mut out = String::from("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n");
        let (sets, runs) = self.runs();
        self.physical_names(&mut out);
        self.entities(&mut out, &sets);
        self.nodes(&mut out);
        self.elements(&mut out, &runs);
        for field in self.fields {
            self.element_data(&mut out, field);
        }
        out
    }

    /// The sets of groups of the cells, numbered from 1, and the runs of cells in the same set.
    fn runs(&self) -> (BTreeMap<Vec<usize>, usize>, Vec<Run>) {
        let mut groups_of = vec![Vec::new(); self.cells.len()];
        for (number, group) in self.cell_groups.iter().enumerate() {
            for &cell in &group.members {
                if let Some(groups) = groups_of.get_mut(cell as usize) {
                    groups.push(number);
                }
            }
        }
        let mut sets = BTreeMap::new();
        let mut runs: Vec<Run> = Vec::new();
        for (cell, groups) in groups_of.into_iter().enumerate() {
            let next = sets.len() + 1;
            let entity = *sets.entry(groups).or_insert(next);
            match runs.last_mut() {
                Some(run) if run.entity == entity => run.cells.end = cell + 1,
                _ => runs.push(Run {
                    entity,
                    cells: cell..cell + 1,
                }),
            }
        }
        (sets, runs)
    }

    /// Physical tags are the indices of the groups in their lists, from 1.
    fn physical_names(&self, out: &mut String) {
        let mut lines = Vec::new();
        for name in &self.names {
            let Some(legible) = legible(name) else {
                continue;
            };
            let of_vertices = self.vertex_groups.iter().position(|g| g.name == *name);
            let of_cells = self.cell_groups.iter().position(|g| g.name == *name);
            for (dim, place) in [(0, of_vertices), (self.dim, of_cells)] {
                if let Some(place) = place {
                    lines.push(format!("{dim} {} \"{legible}\"", place + 1));
                }
            }
        }
        if !lines.is_empty() {
            let count = lines.len();
            let lines = lines.join("\n");
            let _ = writeln!(out, "$PhysicalNames\n{count}\n{lines}\n$EndPhysicalNames");
        }
    }

    fn entities(&self, out: &mut String, sets: &BTreeMap<Vec<usize>, usize>) {
        let of_dimension = |dim: u8| if self.dim == dim { sets.len() } else { 0 };
        let [curves, surfaces, volumes] = [1, 2, 3].map(of_dimension);
        let points = self.vertex_groups.len();
        let _ = writeln!(out, "$Entities\n{points} {curves} {surfaces} {volumes}");
        for (number, group) in (1..).zip(&self.vertex_groups) {
            let first = group.members.first().copied().unwrap_or_default();
            let at = self
                .positions
                .get(first as usize)
                .copied()
                .unwrap_or_default();
            let _ = writeln!(out, "{number} {:?} {:?} {:?} 1 {number}", at.x, at.y, at.z);
        }
        let bounds = Bounds::of(self.positions);
        let (min, max) = bounds.map_or((Vec3::zeros(), Vec3::zeros()), |b| (b.min, b.max));
        let mut by_number: Vec<(usize, &Vec<usize>)> = sets
            .iter()
            .map(|(groups, number)| (*number, groups))
            .collect();
        by_number.sort_unstable();
        for (number, groups) in by_number {
            let _ = write!(
                out,
                "{number} {:?} {:?} {:?} {:?} {:?} {:?} {}",
                min.x,
                min.y,
                min.z,
                max.x,
                max.y,
                max.z,
                groups.len()
            );
            for group in groups {
                let _ = write!(out, " {}", group + 1);
            }
            out.push_str(" 0\n");
        }
        out.push_str("$EndEntities\n");
    }

    /// Nodes have the tags of their vertices, counted from 1.
    fn nodes(&self, out: &mut String) {
        let (dim, count) = (self.dim, self.positions.len());
        let _ = writeln!(out, "$Nodes\n1 {count} 1 {count}\n{dim} 1 0 {count}");
        for tag in 1..=count {
            let _ = writeln!(out, "{tag}");
        }
        // `{:?}` gives the shortest text that reads back to the same number.
        for at in self.positions {
            let _ = writeln!(out, "{:?} {:?} {:?}", at.x, at.y, at.z);
        }
        out.push_str("$EndNodes\n");
    }

    /// Cells have their own tags, counted from 1; points follow.
    fn elements(&self, out: &mut String, runs: &[Run]) {
        let points: usize = self.vertex_groups.iter().map(|g| g.members.len()).sum();
        let count = self.cells.len() + points;
        let groups = self.vertex_groups.iter().filter(|g| !g.members.is_empty());
        let blocks = runs.len() + groups.count();
        let _ = writeln!(out, "$Elements\n{blocks} {count} 1 {count}");
        let (dim, code) = (self.dim, self.code);
        for Run { entity, cells } in runs {
            let _ = writeln!(out, "{dim} {entity} {code} {}", cells.len());
            for (number, cell) in (cells.start + 1..).zip(&self.cells[cells.clone()]) {
                let _ = write!(out, "{number}");
                for vertex in cell {
                    let _ = write!(out, " {}", u64::from(*vertex) + 1);
                }
                out.push('\n');
            }
        }
        let mut next = self.cells.len();
        for (entity, group) in (1..).zip(&self.vertex_groups) {
            if group.members.is_empty() {
                continue;
            }
            let _ = writeln!(out, "0 {entity} 15 {}", group.members.len());
            for vertex in &group.members {
                next += 1;
                let _ = writeln!(out, "{next} {}", u64::from(*vertex) + 1);
            }
        }
        out.push_str("$EndElements\n");
    }

    /// Writes a field: its name, no time, one component for each cell. Points have the value zero, because other programs
    /// take a field for one of all elements.
    fn element_data(&self, out: &mut String, field: &Field) {
        let Some(name) = legible(&field.name) else {
            return;
        };
        let points: usize = self.vertex_groups.iter().map(|g| g.members.len()).sum();
        let count = field.values.len() + points;
        let _ = writeln!(out, "$ElementData\n1\n\"{name}\"\n1\n0.0\n3\n0\n1\n{count}");
        let values = field.values.iter().copied();
        for (tag, value) in (1..).zip(values.chain(std::iter::repeat_n(0.0, points))) {
            let _ = writeln!(out, "{tag} {value:?}");
        }
        out.push_str("$EndElementData\n");
    }
}
