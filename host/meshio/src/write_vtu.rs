//! Writes results for ParaView: VTK XML, unstructured grid, as text.
//!
//! Text is larger than base64, but people can read it. Numbers are written so that they are read back exactly.
//! The caller writes the file.

use core::fmt::Write as _;
use physics::mesh::{Cells, Field, LineMesh, TetMesh, TriMesh};
use physics::{Mat3, Vec3};

/// Values by name, one per vertex or cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// One number each.
    Scalar(Vec<f64>),
    /// Three components each.
    Vector(Vec<Vec3>),
    /// Nine components each, row by row.
    Tensor(Vec<Mat3>),
}

/// An unstructured grid, in VTK's sense: a mesh in one state, with values at its vertices and in its cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UnstructuredGrid {
    /// Positions (m).
    pub positions: Vec<Vec3>,
    /// Vertices of each cell, and the cell's VTK type.
    pub cells: Vec<(Vec<u32>, u8)>,
    /// Values at vertices.
    pub at_vertices: Vec<(String, Values)>,
    /// Values in cells.
    pub in_cells: Vec<(String, Values)>,
}

impl UnstructuredGrid {
    /// A solid at rest, with its fields.
    pub fn of_solid(mesh: &TetMesh) -> Self {
        let kind = if matches!(mesh.cells, Cells::Linear(_)) {
            10
        } else {
            24
        };
        let field = |field: &Field| (field.name.clone(), Values::Scalar(field.values.clone()));
        Self {
            positions: mesh.positions.clone(),
            cells: mesh
                .cells
                .vertices()
                .map(|cell| (cell.to_vec(), kind))
                .collect(),
            at_vertices: Vec::new(),
            in_cells: mesh.cell_fields.iter().map(field).collect(),
        }
    }

    /// A thread at rest, with its fields.
    pub fn of_thread(mesh: &LineMesh) -> Self {
        let field = |field: &Field| (field.name.clone(), Values::Scalar(field.values.clone()));
        Self {
            positions: mesh.positions.clone(),
            cells: mesh.lines.iter().map(|line| (line.to_vec(), 3)).collect(),
            at_vertices: Vec::new(),
            in_cells: mesh.line_fields.iter().map(field).collect(),
        }
    }

    /// A sheet at rest, with its fields.
    pub fn of_sheet(mesh: &TriMesh) -> Self {
        let field = |field: &Field| (field.name.clone(), Values::Scalar(field.values.clone()));
        Self {
            positions: mesh.positions.clone(),
            cells: mesh
                .triangles
                .iter()
                .map(|triangle| (triangle.to_vec(), 5))
                .collect(),
            at_vertices: Vec::new(),
            in_cells: mesh.triangle_fields.iter().map(field).collect(),
        }
    }

    /// The text of the file.
    pub fn vtu(&self) -> String {
        let mut out = String::from(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" \
             byte_order=\"LittleEndian\">\n<UnstructuredGrid>\n",
        );
        let (points, cells) = (self.positions.len(), self.cells.len());
        let _ = writeln!(
            out,
            "<Piece NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\">"
        );
        out.push_str("<Points>\n");
        array(&mut out, "Points", &Values::Vector(self.positions.clone()));
        out.push_str("</Points>\n<Cells>\n");
        let integers =
            |out: &mut String, kind: &str, name: &str, values: &mut dyn Iterator<Item = usize>| {
                let _ = writeln!(
                    out,
                    "<DataArray type=\"{kind}\" Name=\"{name}\" format=\"ascii\">"
                );
                for value in values {
                    let _ = writeln!(out, "{value}");
                }
                out.push_str("</DataArray>\n");
            };
        let mut vertices = self
            .cells
            .iter()
            .flat_map(|(cell, _)| cell.iter().map(|&v| v as usize));
        integers(&mut out, "Int64", "connectivity", &mut vertices);
        let mut end = 0;
        let mut offsets = self.cells.iter().map(|(cell, _)| {
            end += cell.len();
            end
        });
        integers(&mut out, "Int64", "offsets", &mut offsets);
        let mut kinds = self.cells.iter().map(|(_, kind)| usize::from(*kind));
        integers(&mut out, "UInt8", "types", &mut kinds);
        out.push_str("</Cells>\n");
        for (section, all) in [
            ("PointData", &self.at_vertices),
            ("CellData", &self.in_cells),
        ] {
            let _ = writeln!(out, "<{section}>");
            for (name, values) in all {
                array(&mut out, name, values);
            }
            let _ = writeln!(out, "</{section}>");
        }
        out.push_str("</Piece>\n</UnstructuredGrid>\n</VTKFile>\n");
        out
    }
}

fn array(out: &mut String, name: &str, values: &Values) {
    // As VTK's own writer: programs take one component that is named for a column of vectors.
    let components = match values {
        Values::Scalar(_) => "",
        Values::Vector(_) => " NumberOfComponents=\"3\"",
        Values::Tensor(_) => " NumberOfComponents=\"9\"",
    };
    out.push_str("<DataArray type=\"Float64\" Name=\"");
    for c in name.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    let _ = writeln!(out, "\"{components} format=\"ascii\">");
    // `{:?}` gives the shortest text that reads back to the same number.
    match values {
        Values::Scalar(values) => values.iter().for_each(|v| {
            let _ = writeln!(out, "{v:?}");
        }),
        Values::Vector(values) => values.iter().for_each(|v| {
            let _ = writeln!(out, "{:?} {:?} {:?}", v.x, v.y, v.z);
        }),
        Values::Tensor(values) => {
            for value in values {
                for row in value.row_iter() {
                    let _ = write!(out, "{:?} {:?} {:?} ", row[0], row[1], row[2]);
                }
                out.push('\n');
            }
        }
    }
    out.push_str("</DataArray>\n");
}
