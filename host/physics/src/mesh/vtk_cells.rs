//! From VTK's cells to triangles, alike for its legacy and its XML files.
//!
//! Source: "VTK File Formats" in the VTK documentation, and `vtkCellType.h` for the numbers of the types.

use super::TriMesh;
use super::check::Culprit;
use super::file::{MeshFileError, Place};
use super::soup::{Fault, Soup};
use super::vtk_array::Array;
use crate::Vec3;

/// The type of the cells of a `POLYDATA` file's polygons.
pub(super) const POLYGON: i64 = 7;
const TRIANGLE: i64 = 5;

/// Triangles read so far, with where they stand.
pub(super) struct Cells<'a> {
    soup: Soup,
    points: Array<'a>,
    /// For each triangle, where its first point stands in the array of points' numbers.
    starts: Vec<u32>,
}

impl<'a> Cells<'a> {
    /// No cells yet over these points, three coordinates each.
    pub(super) fn new(points: Array<'a>) -> Result<Self, MeshFileError> {
        let mut positions = Vec::with_capacity(points.len() / 3);
        let mut reals = points.reals();
        while let (Some(x), Some(y), Some(z)) = (reals.next(), reals.next(), reals.next()) {
            positions.push(Vec3::new(x?, y?, z?));
        }
        drop(reals);
        let soup = Soup {
            positions,
            ..Soup::default()
        };
        let starts = Vec::new();
        Ok(Self {
            soup,
            points,
            starts,
        })
    }

    /// Adds cells of these types whose points' numbers stand one cell after the other; `ends` says where
    /// each ends.
    pub(super) fn add(
        &mut self,
        types: impl Iterator<Item = Result<i64, MeshFileError>>,
        ends: impl Iterator<Item = Result<i64, MeshFileError>>,
        end_place: impl Fn(usize) -> Place,
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
                    MeshFileError::syntax(end_place(cell), expected, end.to_string())
                })?;
            self.cell(code?, size, &mut nodes)?;
        }
        nodes.finish()
    }

    /// Adds as many cells as there are types; before the points' numbers of each stands how many they are.
    pub(super) fn add_counted(
        &mut self,
        types: impl Iterator<Item = Result<i64, MeshFileError>>,
        numbers: &Array,
    ) -> Result<(), MeshFileError> {
        let mut nodes = Nodes::new(numbers);
        for code in types {
            let place = nodes.at;
            let size = nodes.next()?;
            let left = numbers.len() - nodes.at;
            let size = usize::try_from(size)
                .ok()
                .filter(|&size| size <= left)
                .ok_or_else(|| {
                    let expected = format!("the number of a cell's points, from 0 to {left}");
                    MeshFileError::syntax(numbers.place(place), expected, size.to_string())
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
        let is_triangle = size == 3 && matches!(code, TRIANGLE | POLYGON);
        if !is_triangle && let Some(found) = refused(code, size) {
            return Err(MeshFileError::syntax(
                nodes.numbers.place(start),
                "a triangle (cut to triangles first, as ParaView's filter Triangulate does)",
                found,
            ));
        }
        let mut corners = [0; 3];
        for k in 0..size {
            let vertex = self.vertex(nodes)?;
            if let Some(corner) = corners.get_mut(k) {
                *corner = vertex;
            }
        }
        if is_triangle {
            self.soup.triangles.push(corners);
            self.starts.push(start as u32);
        }
        Ok(())
    }

    fn vertex(
        &self,
        nodes: &mut Nodes<'_, impl Iterator<Item = Result<i64, MeshFileError>>>,
    ) -> Result<u32, MeshFileError> {
        let place = nodes.at;
        let number = nodes.next()?;
        let points = self.soup.positions.len();
        match u32::try_from(number) {
            Ok(vertex) if (vertex as usize) < points => Ok(vertex),
            _ => Err(MeshFileError::syntax(
                nodes.numbers.place(place),
                format!("the number of one of {points} points, counted from 0"),
                number.to_string(),
            )),
        }
    }

    /// The mesh of the cells; `numbers` is the array that held their points' numbers.
    pub(super) fn finish(self, numbers: &Array) -> Result<TriMesh, MeshFileError> {
        let Self {
            soup,
            points,
            starts,
        } = self;
        soup.into_mesh().map_err(|Fault { source, culprit }| {
            let place = match culprit {
                Culprit::Vertex(vertex) => points.place(3 * vertex as usize),
                Culprit::Triangle(triangle) => {
                    let start = starts.get(triangle as usize);
                    numbers.place(start.map_or(0, |&start| start as usize))
                }
                Culprit::Mesh => numbers.place(numbers.len()),
            };
            MeshFileError::Mesh { place, source }
        })
    }
}

/// An array of points' numbers, and how many of them are read.
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
            let place = self.numbers.place(self.at);
            Err(MeshFileError::syntax(place, "the next cell", found))
        })?;
        self.at += 1;
        Ok(number)
    }

    /// Checks that none is left over.
    fn finish(&self) -> Result<(), MeshFileError> {
        let left = self.numbers.len() - self.at;
        if left == 0 {
            return Ok(());
        }
        let place = self.numbers.place(self.at);
        let found = format!("{left} more numbers");
        Err(MeshFileError::syntax(place, "the end of the cells", found))
    }
}

/// What a cell is called, if it is neither a triangle nor one that may be passed over.
fn refused(code: i64, size: usize) -> Option<String> {
    let name = match code {
        // Nothing, points and lines.
        0..=4 => return None,
        TRIANGLE => return Some(format!("a triangle of {size} points")),
        6 => "a strip of triangles",
        POLYGON => return Some(format!("a polygon of {size} points")),
        8 => "a pixel",
        9 => "a quadrangle",
        10 => "a tetrahedron",
        11 => "a voxel",
        12 => "a hexahedron",
        13 => "a wedge",
        14 => "a pyramid",
        21 => "a line of second order",
        22 => "a triangle of second order",
        _ => return Some(format!("a cell of type {code}")),
    };
    Some(name.to_owned())
}
