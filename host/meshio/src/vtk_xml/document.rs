//! Reads the tags of a VTU or VTP file: the arrays and their places. The numbers of the arrays are not read here.

use super::tag::Tag;
use crate::error::{FilePosition, MeshFileError};
use crate::text::{line_of, newlines, quoted};
use crate::vtk_array::Scalar;
use crate::vtk_fields::check_name;
use quick_xml::Reader;
use quick_xml::events::Event;

/// Deepest nesting of tags. VTK's own files nest six deep.
const MAX_DEPTH: usize = 32;
/// The content of a file's tags.
pub(super) struct Document<'a> {
    /// Whether the file holds an unstructured grid; otherwise it holds polygons.
    pub(super) is_grid: bool,
    pub(super) encoding: Encoding<'a>,
    pub(super) piece: Piece<'a>,
}

/// The encoding of the arrays.
#[derive(Default)]
pub(super) struct Encoding<'a> {
    pub(super) big_endian: bool,
    /// Whether lengths have eight bytes rather than four.
    pub(super) long_lengths: bool,
    pub(super) compressed: bool,
    /// The data after the underscore of `AppendedData`.
    pub(super) appended: Option<Appended<'a>>,
}

/// Data after all tags.
pub(super) struct Appended<'a> {
    pub(super) bytes: &'a [u8],
    /// The byte of the file at which the data begin.
    pub(super) offset: usize,
    pub(super) base64: bool,
}

/// The mesh of a file.
#[derive(Default)]
pub(super) struct Piece<'a> {
    pub(super) line: usize,
    pub(super) points: usize,
    pub(super) cells: usize,
    pub(super) strips: usize,
    /// The number of points and lines, in addition to the polygons.
    pub(super) others: usize,
    pub(super) arrays: Vec<(Role, DataArray<'a>)>,
    /// The arrays of cell data with one component.
    pub(super) cell_data: Vec<NamedArray<'a>>,
}

/// An array of cell data.
pub(super) struct NamedArray<'a> {
    pub(super) name: String,
    pub(super) array: DataArray<'a>,
}

/// An array that the mesh needs.
pub(super) struct DataArray<'a> {
    pub(super) line: usize,
    pub(super) scalar: Scalar,
    pub(super) data: Data<'a>,
}

/// The position of an array's numbers.
pub(super) enum Data<'a> {
    /// In the file as text, from this byte on.
    Ascii { text: &'a [u8], offset: usize },
    /// In the file in base64.
    Base64(&'a [u8]),
    /// At this offset from the start of the appended data (bytes).
    Appended(u64),
}

/// The role of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Points,
    Connectivity,
    Offsets,
    Types,
}

impl Role {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Points => "Points",
            Self::Connectivity => "connectivity",
            Self::Offsets => "offsets",
            Self::Types => "types",
        }
    }
}

/// Reads a file's tags.
pub(super) fn read(file: &[u8]) -> Result<Document<'_>, MeshFileError> {
    let mut reader = Reader::from_reader(file);
    let config = reader.config_mut();
    config.expand_empty_elements = true;
    // Lines are counted incrementally.
    let (mut line, mut counted) = (1, 0);
    let mut root: Option<(bool, Encoding)> = None;
    let mut piece: Option<Piece> = None;
    let mut path: Vec<String> = Vec::new();
    loop {
        let event = reader.read_event();
        let at = usize::try_from(reader.buffer_position())
            .unwrap_or(usize::MAX)
            .min(file.len());
        let passed = file.get(counted..at).unwrap_or_default();
        line += newlines(passed);
        counted = at;
        let position = FilePosition::Line(line);
        let wrong =
            |expected: &str, found: String| MeshFileError::syntax(position, expected, found);
        let start = match event {
            Ok(Event::Start(start)) => start,
            Ok(Event::End(_)) => {
                path.pop();
                continue;
            }
            Ok(Event::Eof) => break,
            Ok(Event::DocType(_)) => {
                return Err(wrong("a VTKFile", "a document type".to_owned()));
            }
            Ok(_) => continue,
            Err(error) => {
                let position = usize::try_from(reader.error_position()).unwrap_or(usize::MAX);
                let position = FilePosition::Line(line_of(file, position));
                let found = quoted(&error.to_string());
                return Err(MeshFileError::syntax(position, "well-formed XML", found));
            }
        };
        if path.len() >= MAX_DEPTH {
            return Err(wrong(
                "tags nested less deeply",
                format!("{MAX_DEPTH} within each other"),
            ));
        }
        let tag = Tag {
            line,
            start: &start,
        };
        let parent = path.last().map_or("", String::as_str);
        match (start.local_name().as_ref(), &mut root, &mut piece) {
            ("VTKFile", None, _) if path.is_empty() => root = Some(tag.root()?),
            ("Piece", Some(_), None) => piece = Some(tag.piece()?),
            ("Piece", Some(_), Some(_)) => {
                return Err(wrong(
                    "one Piece (merge them first)",
                    "a second one".to_owned(),
                ));
            }
            ("DataArray", Some((is_grid, _)), Some(piece)) => {
                if let Some(role) = tag.role(parent, *is_grid)? {
                    let array = tag.array(role == Role::Points, file, at)?;
                    if piece.arrays.iter().any(|(other, _)| *other == role) {
                        let expected = format!("one DataArray of {}", role.name());
                        return Err(wrong(&expected, "another".to_owned()));
                    }
                    piece.arrays.push((role, array));
                } else if parent == "CellData"
                    && let Some(name) = tag.name_of_scalars()?
                {
                    let names = piece.cell_data.iter().map(|array| &array.name[..]);
                    check_name(names, position, &name)?;
                    let array = tag.array(false, file, at)?;
                    piece.cell_data.push(NamedArray { name, array });
                }
            }
            ("AppendedData", Some((_, encoding)), _) => {
                encoding.appended = Some(tag.appended(file, at)?);
                // Raw bytes, which are no XML, may follow.
                break;
            }
            (_, Some(_), _) => {}
            (name, None, _) => {
                return Err(wrong("a VTKFile", format!("a tag {}", quoted(name))));
            }
        }
        path.push(start.local_name().as_ref().to_owned());
    }
    let missing =
        |name| MeshFileError::syntax(FilePosition::Line(line), name, "the end of the tags");
    let (is_grid, encoding) = root.ok_or_else(|| missing("a VTKFile"))?;
    let piece = piece.ok_or_else(|| missing("a Piece"))?;
    Ok(Document {
        is_grid,
        encoding,
        piece,
    })
}
