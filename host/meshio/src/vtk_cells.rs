//! Converts VTK's cells to lines, triangles or tetrahedra, for legacy and XML files alike.
//!
//! Source: "VTK File Formats" in the VTK documentation, and `vtkCellType.h` for the numbers of the types.

use crate::error::{FilePosition, InvalidMesh, MeshFileError};
use crate::soup::{Fault, Soup};
use crate::vtk_array::Array;
use physics::Vec3;
use physics::mesh::check::Location;
use physics::mesh::{Cells as Tetrahedra, Mesh};

/// The type of the cells of a `POLYDATA` file's polygons.
pub(crate) const POLYGON: i64 = 7;
const LINE: i64 = 3;
const POLY_LINE: i64 = 4;
const TRIANGLE: i64 = 5;
const TETRAHEDRON: i64 = 10;
const QUADRATIC_EDGE: i64 = 21;
const QUADRATIC_TRIANGLE: i64 = 22;
const QUADRATIC_TETRAHEDRON: i64 = 24;
/// The curve, the triangle and the tetrahedron of any order. With the points of first or second order they are the cells
/// above, their points in the same order.
const LAGRANGE: [i64; 3] = [68, 69, 71];

/// Lines, triangles or tetrahedra read so far, with where they stand.
pub(crate) struct Cells<'a> {
    points: Array<'a>,
    positions: Vec<Vec3>,
    /// Up to the first triangle or tetrahedron; lines are then skipped.
    lines: Vec<[u32; 2]>,
    triangles: Vec<[u32; 3]>,
    /// `Some` from the first tetrahedron on. Triangles are skipped from then on.
    tetrahedra: Option<Tetrahedra>,
    /// Position and name of the first line or triangle of second order, which is an error in a sheet.
    second_order: Option<(FilePosition, &'static str)>,
    /// Where the first line of other than two points stands, and how many it has: an error in a thread.
    odd_line: Option<(FilePosition, usize)>,
    /// For each line, triangle or tetrahedron, where its first point stands in the array of points' numbers.
    starts: Vec<u32>,
    /// For each triangle or tetrahedron, its number among all cells of the file.
    kept: Vec<u32>,
    /// The number of cells so far, with the skipped ones. A hostile file may give any number.
    count: usize,
}

/// The kinds of cells that are kept.
enum Kept {
    Line,
    Triangle,
    Tetrahedron,
    QuadraticTetrahedron,
    Nothing,
}

impl<'a> Cells<'a> {
    /// An empty set of cells over these points, which have three coordinates each. `before` cells were skipped already.
    pub(crate) fn new(points: Array<'a>, before: usize) -> Result<Self, MeshFileError> {
        let mut positions = Vec::with_capacity(points.len() / 3);
        let mut reals = points.reals("a finite coordinate");
        while let (Some(x), Some(y), Some(z)) = (reals.next(), reals.next(), reals.next()) {
            positions.push(Vec3::new(x?, y?, z?));
        }
        drop(reals);
        Ok(Self {
            points,
            positions,
            lines: Vec::new(),
            triangles: Vec::new(),
            tetrahedra: None,
            second_order: None,
            odd_line: None,
            starts: Vec::new(),
            kept: Vec::new(),
            count: before,
        })
    }

    /// Adds cells of these types. `numbers` holds the points' numbers of one cell after the other, and `ends` holds the
    /// end of each cell in that array.
    pub(crate) fn add(
        &mut self,
        types: impl Iterator<Item = Result<i64, MeshFileError>>,
        ends: impl Iterator<Item = Result<i64, MeshFileError>>,
        end_position: impl Fn(usize) -> FilePosition,
        numbers: &Array,
    ) -> Result<(), MeshFileError> {
        let mut nodes = Nodes::new(numbers);
        for (cell, (code, end)) in types.zip(ends).enumerate() {
            let end = end?;
            let size = usize::try_from(end)
                .ok()
                .filter(|&end| end <= numbers.len())
                .and_then(|end| end.checked_sub(nodes.at))
                .ok_or_else(|| {
                    let expected =
                        format!("the end of a cell, from {} to {}", nodes.at, numbers.len());
                    MeshFileError::syntax(end_position(cell), expected, end.to_string())
                })?;
            self.cell(code?, size, &mut nodes)?;
        }
        nodes.finish()
    }

    /// Adds cells of these types. In `numbers`, the number of a cell's points precedes the points' numbers.
    pub(crate) fn add_counted(
        &mut self,
        types: impl Iterator<Item = Result<i64, MeshFileError>>,
        numbers: &Array,
    ) -> Result<(), MeshFileError> {
        let mut nodes = Nodes::new(numbers);
        for code in types {
            let at = nodes.at;
            let size = nodes.next()?;
            let left = numbers.len() - nodes.at;
            let size = usize::try_from(size)
                .ok()
                .filter(|&size| size <= left)
                .ok_or_else(|| {
                    let expected = format!("the number of a cell's points, from 0 to {left}");
                    MeshFileError::syntax(numbers.position(at), expected, size.to_string())
                })?;
            self.cell(code?, size, &mut nodes)?;
        }
        nodes.finish()
    }

    fn cell(
        &mut self,
        code: i64,
        size: usize,
        nodes: &mut Nodes<'_, impl Iterator<Item = Result<i64, MeshFileError>>>,
    ) -> Result<(), MeshFileError> {
        let start = nodes.at;
        let kept = self.judge(code, size, || nodes.numbers.position(start))?;
        let mut vertices = [0; 10];
        for k in 0..size {
            let vertex = self.vertex(nodes)?;
            if let Some(slot) = vertices.get_mut(k) {
                *slot = vertex;
            }
        }
        let [a, b, c, d, ..] = vertices;
        match (kept, &mut self.tetrahedra) {
            (Kept::Line, None) => self.lines.push([a, b]),
            (Kept::Triangle, None) => self.triangles.push([a, b, c]),
            (Kept::Tetrahedron, Some(Tetrahedra::Linear(cells))) => cells.push([a, b, c, d]),
            (Kept::QuadraticTetrahedron, Some(Tetrahedra::Quadratic(cells))) => {
                cells.push(vertices);
            }
            _ => {
                self.count = self.count.saturating_add(1);
                return Ok(());
            }
        }
        self.starts.push(start as u32);
        self.kept.push(self.count as u32);
        self.count = self.count.saturating_add(1);
        Ok(())
    }

    /// Whether a cell is kept or skipped, or else an error at `position`. With the first triangle, what was kept of lines
    /// is dropped; with the first tetrahedron, what was kept of either.
    fn judge(
        &mut self,
        code: i64,
        size: usize,
        position: impl Fn() -> FilePosition,
    ) -> Result<Kept, MeshFileError> {
        let code = of_order(code, size);
        match (code, size) {
            (TRIANGLE | POLYGON, 3) => {
                if self.only_lines() {
                    self.drop_kept();
                }
                return Ok(Kept::Triangle);
            }
            (LINE | POLY_LINE, _) if self.only_lines() => {
                if size == 2 {
                    return Ok(Kept::Line);
                }
                if self.odd_line.is_none() {
                    self.odd_line = Some((position(), size));
                }
                return Ok(Kept::Nothing);
            }
            (QUADRATIC_EDGE, 3) | (QUADRATIC_TRIANGLE, 6) => {
                let name = if size == 3 { LINE_2 } else { TRIANGLE_2 };
                if self.second_order.is_none() && self.tetrahedra.is_none() {
                    self.second_order = Some((position(), name));
                }
                return Ok(Kept::Nothing);
            }
            (TETRAHEDRON, 4) | (QUADRATIC_TETRAHEDRON, 10) => {}
            _ => {
                return match refused(code, size) {
                    None => Ok(Kept::Nothing),
                    Some(found) => Err(not_kept(position(), found)),
                };
            }
        }
        let is_linear = size == 4;
        match &self.tetrahedra {
            None => {
                self.tetrahedra = Some(if is_linear {
                    Tetrahedra::Linear(Vec::new())
                } else {
                    Tetrahedra::Quadratic(Vec::new())
                });
                self.drop_kept();
            }
            Some(others) => {
                if matches!(others, Tetrahedra::Linear(_)) != is_linear {
                    let (expected, found) = if is_linear {
                        ("second", "first")
                    } else {
                        ("first", "second")
                    };
                    return Err(MeshFileError::syntax(
                        position(),
                        format!("a tetrahedron of {expected} order, as those before"),
                        format!("one of {found} order"),
                    ));
                }
            }
        }
        Ok(if is_linear {
            Kept::Tetrahedron
        } else {
            Kept::QuadraticTetrahedron
        })
    }

    /// Whether no cell was kept that has more dimensions than a line.
    fn only_lines(&self) -> bool {
        self.triangles.is_empty() && self.tetrahedra.is_none()
    }

    /// Drops the lines and triangles that were kept.
    fn drop_kept(&mut self) {
        self.lines = Vec::new();
        self.triangles = Vec::new();
        self.starts = Vec::new();
        self.kept = Vec::new();
    }

    fn vertex(
        &self,
        nodes: &mut Nodes<'_, impl Iterator<Item = Result<i64, MeshFileError>>>,
    ) -> Result<u32, MeshFileError> {
        let at = nodes.at;
        let number = nodes.next()?;
        let points = self.positions.len();
        match u32::try_from(number) {
            Ok(vertex) if (vertex as usize) < points => Ok(vertex),
            _ => Err(MeshFileError::syntax(
                nodes.numbers.position(at),
                format!("the number of one of {points} points, counted from 0"),
                number.to_string(),
            )),
        }
    }

    /// The mesh of the cells, the number of cells in the file, and the number of each of the mesh's cells among them.
    /// `numbers` is the array of the points' numbers. With a distance, vertices within it are merged.
    pub(crate) fn finish(
        self,
        numbers: &Array,
        merge: Option<f64>,
    ) -> Result<(Mesh, usize, Vec<u32>), MeshFileError> {
        if let (None, Some((position, name))) = (&self.tetrahedra, self.second_order) {
            return Err(not_kept(position, name));
        }
        if let (true, Some((position, size))) = (!self.lines.is_empty(), self.odd_line) {
            return Err(MeshFileError::syntax(
                position,
                "a line of 2 points, as others of this file are (cut the rest to such lines first)",
                format!("a line of {size} points"),
            ));
        }
        let Self {
            points,
            positions,
            lines,
            triangles,
            tetrahedra,
            starts,
            kept,
            count,
            ..
        } = self;
        let position = |location| match location {
            Location::Vertex(vertex) => points.position(3 * vertex as usize),
            Location::Cell(cell) => {
                let start = starts.get(cell as usize);
                numbers.position(start.map_or(0, |&start| start as usize))
            }
            Location::Mesh => numbers.position(numbers.len()),
        };
        let refused = |Fault { source, location }| InvalidMesh {
            position: position(location),
            source,
        };
        let mesh = match tetrahedra {
            None if !lines.is_empty() => {
                let cells = lines;
                let soup = Soup { positions, cells };
                Mesh::Thread(soup.into_mesh(merge).map_err(refused)?.0)
            }
            None => {
                let cells = triangles;
                let soup = Soup { positions, cells };
                Mesh::Sheet(soup.into_mesh(merge).map_err(refused)?.0)
            }
            Some(cells) => {
                let soup = Soup { positions, cells };
                Mesh::Solid(soup.into_mesh(merge).map_err(refused)?.0)
            }
        };
        Ok((mesh, count, kept))
    }
}

fn not_kept(position: FilePosition, found: impl Into<String>) -> MeshFileError {
    let expected = "a triangle or a tetrahedron (cut to them first, as ParaView's filters Triangulate and \
                    Tetrahedralize do)";
    MeshFileError::syntax(position, expected, found)
}

/// An array of points' numbers, and the count of the numbers already read.
struct Nodes<'a, I> {
    numbers: &'a Array<'a>,
    rest: I,
    at: usize,
}

impl<'a> Nodes<'a, ()> {
    fn new(numbers: &'a Array<'a>) -> Nodes<'a, impl Iterator<Item = Result<i64, MeshFileError>>> {
        Nodes {
            numbers,
            rest: numbers.integers(),
            at: 0,
        }
    }
}

impl<I: Iterator<Item = Result<i64, MeshFileError>>> Nodes<'_, I> {
    fn next(&mut self) -> Result<i64, MeshFileError> {
        let number = self.rest.next().unwrap_or_else(|| {
            let found = format!("the end of {} numbers", self.numbers.len());
            let position = self.numbers.position(self.at);
            Err(MeshFileError::syntax(position, "the next cell", found))
        })?;
        self.at += 1;
        Ok(number)
    }

    /// Checks that all numbers were read.
    fn finish(&self) -> Result<(), MeshFileError> {
        let left = self.numbers.len() - self.at;
        if left == 0 {
            return Ok(());
        }
        let position = self.numbers.position(self.at);
        let found = format!("{left} more numbers");
        Err(MeshFileError::syntax(
            position,
            "the end of the cells",
            found,
        ))
    }
}

const LINE_2: &str = "a line of second order";
const TRIANGLE_2: &str = "a triangle of second order";

/// The type of a cell of any order, by the number of its points.
fn of_order(code: i64, size: usize) -> i64 {
    match (code, size) {
        (68, 2) => LINE,
        (68, 3) => QUADRATIC_EDGE,
        (69, 3) => TRIANGLE,
        (69, 6) => QUADRATIC_TRIANGLE,
        (71, 4) => TETRAHEDRON,
        (71, 10) => QUADRATIC_TETRAHEDRON,
        _ => code,
    }
}

/// The name of a cell that is an error; `None` for a cell that is skipped.
fn refused(code: i64, size: usize) -> Option<String> {
    let name = match code {
        // Empty cells, points and lines.
        0..=4 => return None,
        TRIANGLE => return Some(format!("a triangle of {size} points")),
        6 => "a strip of triangles",
        POLYGON => return Some(format!("a polygon of {size} points")),
        8 => "a pixel",
        9 => "a quadrangle",
        TETRAHEDRON => return Some(format!("a tetrahedron of {size} points")),
        11 => "a voxel",
        12 => "a hexahedron",
        13 => "a wedge",
        14 => "a pyramid",
        QUADRATIC_EDGE => LINE_2,
        QUADRATIC_TRIANGLE => TRIANGLE_2,
        QUADRATIC_TETRAHEDRON => {
            return Some(format!("a tetrahedron of second order of {size} points"));
        }
        _ if LAGRANGE.contains(&code) => {
            return Some(format!(
                "a Lagrange cell of {size} points (write the mesh with order 1 or 2)"
            ));
        }
        _ => return Some(format!("a cell of type {code}")),
    };
    Some(name.to_owned())
}
