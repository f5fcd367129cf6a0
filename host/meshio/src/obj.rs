//! Reads meshes in Wavefront's OBJ format from the bytes of a file.
//!
//! Source: Wavefront Technologies, "Advanced Visualizer Manual", appendix B1, "Object files (.obj)". The
//! format has no units: coordinates are taken as metres.
//!
//! - `v` gives a vertex; a weight or a colour after its three coordinates is skipped.
//! - `f` gives a triangle, as `1 2 3`, `1/4 2/5 3/6`, `1//7 2//8 3//9` or `1/4/7 2/5/8 3/6/9`, where
//!   negative numbers count back from the last vertex. A face of more than three vertices is an error: the
//!   stiffness of the sheet depends on the diagonals by which the face is cut, so the user has to choose them.
//! - The names after `g`, `o` and `usemtl` become groups of the triangles that follow, and of their
//!   vertices. Groups of the same name are one group. A group without triangles is dropped.
//! - `vt` gives a point of the plane of the texture, and the second number of a corner of a face names one. If the caller
//!   asks for it, these points are the flat pattern of the mesh, as programs for garments write it. A vertex on a seam has
//!   several of them. Otherwise they are skipped.
//! - Normals, lines, points and materials are skipped, and so is what ARCSim adds to its sheets (velocities, labels,
//!   edges with their angles). Curved surfaces are an error.
//! - A backslash at the end of a line continues the statement on the next line.

use crate::error::{FilePosition, InvalidMesh, MAX_GROUPS, MeshFileError};
use crate::lines::{Fields, Lines};
use crate::soup::{Fault, Soup, set_groups};
use crate::text::line_of;
use physics::Vec3;
use physics::mesh::check::Location;
use physics::mesh::{FlatPattern, Group, MeshError, TriMesh};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Largest number of names after one `g`. This limit bounds the memory for groups by the memory for triangles.
pub(crate) const MAX_NAMES: usize = 8;

/// Statements that do not concern triangles.
const PASSED_OVER: [&str; 14] = [
    "vn",
    "vp",
    "s",
    "mg",
    "mtllib",
    "l",
    "p",
    "lod",
    "bevel",
    "c_interp",
    "d_interp",
    "shadow_obj",
    "trace_obj",
    "usemap",
];

/// What ARCSim adds, after the word of a statement in the file of a sheet: positions and velocities of its nodes, labels,
/// edges with their angles and damage, states of vertices and triangles (`save_obj` in ARCSim's `io.cpp`).
const ARCSIM: [&str; 13] = [
    "ny", "nv", "nl", "ms", "mn", "vv", "vu", "e", "ea", "ed", "el", "pe", "t",
];

/// The part of the file that has been read so far.
#[derive(Default)]
struct Reader {
    soup: Soup<Vec<[u32; 3]>>,
    /// Named sets of triangles, each in ascending order.
    groups: Vec<Group>,
    vertex_lines: Vec<u32>,
    triangle_lines: Vec<u32>,
    /// The index of each name among the groups.
    names: BTreeMap<String, usize>,
    /// The groups of the next triangles: those of `g`, of `o`, of `usemtl`.
    current: [Vec<usize>; 3],
    /// The texture, if it is a flat pattern.
    texture: Option<Texture>,
}

/// The texture coordinates that have been read so far.
#[derive(Default)]
struct Texture {
    points: Vec<[f64; 2]>,
    /// The point of each corner of each triangle.
    corners: Vec<[u32; 3]>,
}

/// Reads a mesh from the bytes of an OBJ file. Coordinates are taken as metres. With a distance, vertices within it are
/// merged. With a `texture_unit` (m), the texture coordinates are the flat pattern of the mesh, in that unit.
///
/// # Errors
/// The first [`MeshFileError`] found. A corner without texture coordinates is an error if they are the flat pattern.
pub fn parse(
    bytes: &[u8],
    texture_unit: Option<f64>,
    merge: Option<f64>,
) -> Result<TriMesh, MeshFileError> {
    let reader = Reader {
        texture: texture_unit.map(|_| Texture::default()),
        ..Reader::default()
    };
    let (mut mesh, extras) = read(bytes, reader, merge)?;
    let Some(unit) = texture_unit else {
        return Ok(mesh);
    };
    let point = |corner: u32| {
        let point = extras.texture.points.get(corner as usize).copied();
        point.unwrap_or_default().map(|c| c * unit)
    };
    let corners = extras.texture.corners.iter();
    mesh.flat_pattern = Some(FlatPattern {
        corners: corners.map(|corners| corners.map(point)).collect(),
    });
    mesh.check_pattern().map_err(|error| {
        let line = error
            .triangle()
            .and_then(|triangle| extras.triangle_lines.get(triangle as usize));
        InvalidMesh {
            position: FilePosition::Line(line.map_or(1, |&line| line as usize)),
            source: MeshError::from(error).into(),
        }
    })?;
    Ok(mesh)
}

/// The data of a file that are not in the mesh.
struct Extras {
    texture: Texture,
    triangle_lines: Vec<u32>,
}

fn read(
    bytes: &[u8],
    mut reader: Reader,
    merge: Option<f64>,
) -> Result<(TriMesh, Extras), MeshFileError> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let position = FilePosition::Line(line_of(bytes, error.valid_up_to()));
        MeshFileError::syntax(position, "OBJ text in UTF-8", "bytes that are no text")
    })?;
    let text = joined(text);
    let mut lines = Lines::new(&text);
    while let Some(fields) = lines.next() {
        reader.statement(fields)?;
    }
    reader.finish(lines.last().max(1), merge)
}

/// The text with each continued line joined to the next. Blank lines follow in their place, so that the lines keep their
/// numbers.
fn joined(text: &str) -> Cow<'_, str> {
    if !text.contains("\\\n") && !text.contains("\\\r\n") {
        return Cow::Borrowed(text);
    }
    let mut joined = String::with_capacity(text.len());
    let mut owed = 0;
    for line in text.lines() {
        if let Some(begun) = line.strip_suffix('\\') {
            joined.push_str(begun);
            joined.push(' ');
            owed += 1;
        } else {
            joined.push_str(line);
            joined.extend(std::iter::repeat_n('\n', 1 + owed));
            owed = 0;
        }
    }
    Cow::Owned(joined)
}

impl Reader {
    fn statement(&mut self, mut fields: Fields) -> Result<(), MeshFileError> {
        let whole = fields;
        match fields.word("a statement")? {
            "v" => self.vertex(fields),
            "vt" => self.point(fields),
            "f" => self.face(fields),
            "g" => self.groups(0, fields),
            "o" => self.groups(1, fields),
            "usemtl" => self.groups(2, fields),
            word if word.starts_with('#') => Ok(()),
            word if PASSED_OVER.contains(&word) || ARCSIM.contains(&word) => Ok(()),
            _ => Err(whole.unexpected("a statement of OBJ, such as v or f"))?,
        }
    }

    fn vertex(&mut self, mut fields: Fields) -> Result<(), MeshFileError> {
        let mut position = Vec3::zeros();
        for coordinate in position.iter_mut() {
            *coordinate = fields.finite("a finite coordinate")?;
        }
        self.soup.positions.push(position);
        self.vertex_lines.push(fields.at as u32);
        Ok(())
    }

    /// A point of the texture. Its third coordinate is skipped.
    fn point(&mut self, mut fields: Fields) -> Result<(), MeshFileError> {
        let Some(texture) = &mut self.texture else {
            return Ok(());
        };
        let mut point = [0.0; 2];
        for coordinate in &mut point {
            *coordinate = fields.finite("a finite texture coordinate")?;
        }
        texture.points.push(point);
        Ok(())
    }

    fn face(&mut self, mut fields: Fields) -> Result<(), MeshFileError> {
        let (mut corners, mut points) = ([0; 3], [0; 3]);
        for (corner, point) in corners.iter_mut().zip(&mut points) {
            let before = fields;
            let word = fields.word("three vertices of a face")?;
            *corner = self.corner(word).ok_or_else(|| {
                before.unexpected("the number of a vertex, such as 1, -1 or 1/2/3")
            })?;
            if let Some(texture) = &self.texture {
                let number = word.split('/').nth(1).unwrap_or_default();
                *point = named(number, texture.points.len()).ok_or_else(|| {
                    before.unexpected(
                        "a vertex with texture coordinates, such as 1/1, because they are the flat pattern",
                    )
                })?;
            }
        }
        let rest = fields.rest();
        if !rest.is_empty() && !rest.starts_with('#') {
            let count = 3 + rest.split_whitespace().count();
            return Err(MeshFileError::syntax(
                FilePosition::Line(fields.at),
                "a triangle (export the mesh with triangulated faces)",
                format!("a face of {count} vertices"),
            ));
        }
        let number = self.soup.cells.len() as u32;
        self.soup.cells.push(corners);
        if let Some(texture) = &mut self.texture {
            texture.corners.push(points);
        }
        self.triangle_lines.push(fields.at as u32);
        for &group in self.current.iter().flatten() {
            if let Some(Group { members, .. }) = self.groups.get_mut(group)
                && members.last() != Some(&number)
            {
                members.push(number);
            }
        }
        Ok(())
    }

    /// The vertex that a corner of a face names, counted from zero. The vertex may follow later in the file.
    fn corner(&self, word: &str) -> Option<u32> {
        let mut parts = word.split('/');
        let number = parts.next()?;
        let mut others = parts.by_ref().take(2);
        if !others.all(|part| part.is_empty() || part.parse::<i64>().is_ok())
            || parts.next().is_some()
        {
            return None;
        }
        named(number, self.soup.positions.len())
    }

    /// Puts the triangles that follow into the groups of these names.
    fn groups(&mut self, kind: usize, fields: Fields) -> Result<(), MeshFileError> {
        // The names of objects and materials may have blanks in them.
        let names: Vec<&str> = if kind == 0 {
            fields
                .rest()
                .split_whitespace()
                .take(MAX_NAMES + 1)
                .collect()
        } else {
            vec![fields.rest()]
        };
        if names.len() > MAX_NAMES {
            return Err(fields.unexpected(&format!("at most {MAX_NAMES} groups at a time")))?;
        }
        let mut current = Vec::new();
        for name in names.into_iter().filter(|name| !name.is_empty()) {
            let index = match self.names.get(name) {
                Some(&index) => index,
                None => self.new_group(name, fields)?,
            };
            current.push(index);
        }
        if let Some(of_kind) = self.current.get_mut(kind) {
            *of_kind = current;
        }
        Ok(())
    }

    fn new_group(&mut self, name: &str, fields: Fields) -> Result<usize, MeshFileError> {
        let index = self.groups.len();
        if index == MAX_GROUPS {
            return Err(fields.unexpected(&format!("at most {MAX_GROUPS} groups in all")))?;
        }
        self.names.insert(name.to_owned(), index);
        self.groups.push(Group {
            name: name.to_owned(),
            members: Vec::new(),
        });
        Ok(index)
    }

    fn finish(
        mut self,
        last_line: usize,
        merge: Option<f64>,
    ) -> Result<(TriMesh, Extras), MeshFileError> {
        let vertices = self.soup.positions.len();
        let line = |lines: &[u32], index: u32| {
            let line = lines.get(index as usize);
            FilePosition::Line(line.map_or(last_line, |&line| line as usize))
        };
        for (triangle, corners) in (0_u32..).zip(&self.soup.cells) {
            if let Some(corner) = corners.iter().find(|&&corner| corner as usize >= vertices) {
                return Err(MeshFileError::syntax(
                    line(&self.triangle_lines, triangle),
                    format!("a vertex from 1 to {vertices}"),
                    (u64::from(*corner) + 1).to_string(),
                ));
            }
        }
        let texture = self.texture.unwrap_or_default();
        let points = texture.points.len();
        for (triangle, corners) in (0_u32..).zip(&texture.corners) {
            if let Some(point) = corners.iter().find(|&&point| point as usize >= points) {
                return Err(MeshFileError::syntax(
                    line(&self.triangle_lines, triangle),
                    format!("texture coordinates from 1 to {points}"),
                    (u64::from(*point) + 1).to_string(),
                ));
            }
        }
        self.groups.retain(|group| !group.members.is_empty());
        let (mut mesh, _) = self
            .soup
            .into_mesh(merge)
            .map_err(|Fault { source, location }| {
                let position = match location {
                    Location::Vertex(vertex) => line(&self.vertex_lines, vertex),
                    Location::Cell(triangle) => line(&self.triangle_lines, triangle),
                    Location::Mesh => FilePosition::Line(last_line),
                };
                InvalidMesh { position, source }
            })?;
        set_groups(&mut mesh, self.groups);
        let extras = Extras {
            texture,
            triangle_lines: self.triangle_lines,
        };
        Ok((mesh, extras))
    }
}

/// The entry, counted from zero, that a `number` of a file names after `count` entries. Negative numbers count
/// back. The entry may follow later in the file.
fn named(number: &str, count: usize) -> Option<u32> {
    let number: i64 = number.parse().ok()?;
    let from_zero = if number > 0 {
        number - 1
    } else {
        // Zero is out of range, too.
        (count as i64).checked_add(number).filter(|_| number < 0)?
    };
    u32::try_from(from_zero).ok()
}
