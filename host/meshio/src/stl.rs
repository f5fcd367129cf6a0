//! Reads sheets in the STL format, text or binary, from the bytes of a file.
//!
//! Source: 3D Systems, "StereoLithography Interface Specification" (1988). The format has no units: coordinates are
//! taken as metres. It lists the corners of each triangle. Corners with equal coordinates become one vertex. Normals,
//! colours and attributes are skipped. The names after `solid` become groups of triangles and of their vertices.
//!
//! Many binary files begin with the word `solid`, so the length of the file tells which of the two it is.

use crate::error::{FilePosition, InvalidMesh, MAX_GROUPS, MeshFileError};
use crate::lines::Lines;
use crate::merge;
use crate::soup::{Fault, Soup, set_groups};
use crate::text::line_of;
use physics::Vec3;
use physics::mesh::check::Location;
use physics::mesh::{Group, TriMesh};

/// Length of a binary file's title and number of triangles (bytes).
const HEAD: usize = 84;
/// Length of a triangle in a binary file (bytes): a normal, three corners and an attribute.
const TRIANGLE: usize = 50;

/// The corners of all triangles, one triangle after the other.
#[derive(Default)]
struct Facets {
    corners: Vec<Vec3>,
    groups: Vec<Group>,
}

/// Whether these bytes are an STL file.
pub(crate) fn is_stl(bytes: &[u8]) -> bool {
    is_binary(bytes) || (is_word(bytes, b"solid") && contains(bytes, b"facet"))
}

fn is_word(bytes: &[u8], word: &[u8]) -> bool {
    let start = bytes.trim_ascii_start();
    let rest = start.get(word.len()..).unwrap_or_default();
    start
        .get(..word.len())
        .is_some_and(|start| start.eq_ignore_ascii_case(word))
        && rest.first().is_none_or(u8::is_ascii_whitespace)
}

/// Whether a word stands near the beginning of a file, after the name of a solid.
fn contains(bytes: &[u8], word: &[u8]) -> bool {
    let start = bytes.get(..1024).unwrap_or(bytes);
    start
        .windows(word.len())
        .any(|part| part.eq_ignore_ascii_case(word))
}

/// Whether the length of a file is that of a binary file with its number of triangles.
fn is_binary(bytes: &[u8]) -> bool {
    let count = bytes.get(HEAD - 4..).and_then(<[u8]>::first_chunk::<4>);
    count.is_some_and(|&count| {
        let triangles = u64::from(u32::from_le_bytes(count));
        HEAD as u64 + TRIANGLE as u64 * triangles == bytes.len() as u64
    })
}

/// Reads a sheet from the bytes of an STL file. Coordinates are taken as metres. With a distance, vertices within it are
/// merged, too.
///
/// # Errors
/// The first [`MeshFileError`] found.
pub(crate) fn parse(bytes: &[u8], distance: Option<f64>) -> Result<TriMesh, MeshFileError> {
    let binary = is_binary(bytes);
    let (facets, lines) = if binary {
        (binary_facets(bytes)?, Vec::new())
    } else {
        text_facets(bytes)?
    };
    let firsts = merge::firsts(&facets.corners, 0.0);
    let triangles = firsts.as_chunks::<3>().0.to_vec();
    let position = |triangle: u32| {
        if binary {
            return FilePosition::Byte(HEAD + TRIANGLE * triangle as usize);
        }
        let line = lines.get(triangle as usize);
        FilePosition::Line(line.map_or(1, |&line| line as usize))
    };
    let soup = Soup {
        positions: facets.corners,
        cells: triangles,
    };
    let (mut mesh, _) = soup
        .into_mesh(distance)
        .map_err(|Fault { source, location }| InvalidMesh {
            position: match location {
                Location::Vertex(vertex) => position(vertex / 3),
                Location::Cell(triangle) => position(triangle),
                Location::Mesh => position(0),
            },
            source,
        })?;
    set_groups(&mut mesh, facets.groups);
    Ok(mesh)
}

fn binary_facets(bytes: &[u8]) -> Result<Facets, MeshFileError> {
    let triangles = bytes.get(HEAD..).unwrap_or_default().chunks_exact(TRIANGLE);
    let mut facets = Facets::default();
    facets.corners.reserve_exact(3 * triangles.len());
    for (number, triangle) in triangles.enumerate() {
        let numbers = triangle.get(12..48).unwrap_or_default();
        for corner in numbers.as_chunks::<12>().0 {
            let mut position = Vec3::zeros();
            for (coordinate, &bytes) in position.iter_mut().zip(corner.as_chunks::<4>().0) {
                *coordinate = f64::from(f32::from_le_bytes(bytes));
            }
            if !position.iter().all(|x| x.is_finite()) {
                let position = FilePosition::Byte(HEAD + TRIANGLE * number);
                return Err(MeshFileError::syntax(
                    position,
                    "a triangle with finite coordinates",
                    "another number",
                ));
            }
            facets.corners.push(position);
        }
    }
    Ok(facets)
}

/// The corners in a text file, and the line of each triangle.
fn text_facets(bytes: &[u8]) -> Result<(Facets, Vec<u32>), MeshFileError> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let position = FilePosition::Line(line_of(bytes, error.valid_up_to()));
        MeshFileError::syntax(
            position,
            "STL text in UTF-8, or a binary file of 84 bytes and 50 for each triangle",
            "bytes that are no text",
        )
    })?;
    let mut lines = Lines::new(text);
    let (mut facets, mut places) = (Facets::default(), Vec::new());
    // The group of the next triangles.
    let mut current = None;
    while let Some(mut fields) = lines.next() {
        let whole = fields;
        match fields.word("a statement")?.to_ascii_lowercase().as_str() {
            "solid" => current = group(&mut facets.groups, fields.rest(), &whole)?,
            "endsolid" => current = None,
            "facet" => {
                let number = places.len() as u32;
                places.push(fields.at as u32);
                facet(&mut lines, &mut facets.corners)?;
                if let Some(group) = current.and_then(|group: usize| facets.groups.get_mut(group)) {
                    group.members.push(number);
                }
            }
            _ => return Err(whole.unexpected("solid, facet or endsolid").into()),
        }
    }
    facets.groups.retain(|group| !group.members.is_empty());
    Ok((facets, places))
}

/// The group of this name, new or known; none for a solid without a name.
fn group(
    groups: &mut Vec<Group>,
    name: &str,
    line: &crate::lines::Fields,
) -> Result<Option<usize>, MeshFileError> {
    if name.is_empty() {
        return Ok(None);
    }
    let known = groups.iter().position(|group| group.name == name);
    if known.is_some() {
        return Ok(known);
    }
    if groups.len() == MAX_GROUPS {
        return Err(line
            .unexpected(&format!("at most {MAX_GROUPS} names of solids"))
            .into());
    }
    groups.push(Group {
        name: name.to_owned(),
        members: Vec::new(),
    });
    Ok(Some(groups.len() - 1))
}

/// Reads the lines of a triangle after its first.
fn facet(lines: &mut Lines, corners: &mut Vec<Vec3>) -> Result<(), MeshFileError> {
    let mut keyword = |words: &[&str]| {
        let all = words.join(" ");
        let mut fields = lines.expect(&all)?;
        let whole = fields;
        for word in words {
            if !fields.word(&all)?.eq_ignore_ascii_case(word) {
                return Err(whole.unexpected(&all));
            }
        }
        Ok(fields)
    };
    keyword(&["outer", "loop"])?.end()?;
    for _ in 0..3 {
        let mut fields = keyword(&["vertex"])?;
        let mut position = Vec3::zeros();
        for coordinate in position.iter_mut() {
            *coordinate = fields.finite("a finite coordinate")?;
        }
        fields.end()?;
        corners.push(position);
    }
    keyword(&["endloop"])?.end()?;
    keyword(&["endfacet"])?.end()?;
    Ok(())
}
