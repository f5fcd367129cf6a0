//! The tags of a VTU or VTP file: which arrays there are, and where. No number of an array is read here.

use crate::mesh::file::{MeshFileError, Place};
use crate::mesh::text::{line_of, newlines, quoted};
use crate::mesh::vtk_array::Scalar;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

/// Deepest nesting of tags; VTK's own go to six.
const MAX_DEPTH: usize = 32;
/// Most arrays of use in a file: the four that a mesh needs, and as many again that repeat them.
const MAX_ARRAYS: usize = 8;

/// What a file's tags say.
pub(super) struct Document<'a> {
    /// An unstructured grid, otherwise polygons.
    pub(super) is_grid: bool,
    pub(super) encoding: Encoding<'a>,
    pub(super) piece: Piece<'a>,
}

/// How arrays are written.
#[derive(Default)]
pub(super) struct Encoding<'a> {
    pub(super) big_endian: bool,
    /// Whether lengths take eight bytes rather than four.
    pub(super) long_lengths: bool,
    pub(super) compressed: bool,
    /// What follows the underscore of `AppendedData`.
    pub(super) appended: Option<Appended<'a>>,
}

/// Data after all tags.
pub(super) struct Appended<'a> {
    pub(super) bytes: &'a [u8],
    /// Where it begins in the file.
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
    pub(super) arrays: Vec<DataArray<'a>>,
}

/// One array of use.
pub(super) struct DataArray<'a> {
    pub(super) role: Role,
    pub(super) line: usize,
    pub(super) scalar: Scalar,
    pub(super) data: Data<'a>,
}

/// Where an array's numbers are.
pub(super) enum Data<'a> {
    /// In the file, as text, from this byte on.
    Ascii { text: &'a [u8], offset: usize },
    /// In the file, in base64.
    Base64(&'a [u8]),
    /// That many bytes after the start of the appended data.
    Appended(u64),
}

/// What an array is for.
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

/// A tag with its place.
struct Tag<'a, 'e> {
    line: usize,
    start: &'e BytesStart<'a>,
}

/// Reads a file's tags.
pub(super) fn read(file: &[u8]) -> Result<Document<'_>, MeshFileError> {
    let mut reader = Reader::from_reader(file);
    let config = reader.config_mut();
    config.expand_empty_elements = true;
    // Lines are counted as reading goes on.
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
        let place = Place::Line(line);
        let wrong = |expected: &str, found: String| MeshFileError::syntax(place, expected, found);
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
                let place = usize::try_from(reader.error_position()).unwrap_or(usize::MAX);
                let place = Place::Line(line_of(file, place));
                let found = quoted(&error.to_string());
                return Err(MeshFileError::syntax(place, "well-formed XML", found));
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
                    let array = tag.array(role, file, at)?;
                    if piece.arrays.len() >= MAX_ARRAYS
                        || piece.arrays.iter().any(|other| other.role == role)
                    {
                        let expected = format!("one DataArray of {}", role.name());
                        return Err(wrong(&expected, "another".to_owned()));
                    }
                    piece.arrays.push(array);
                }
            }
            ("AppendedData", Some((_, encoding)), _) => {
                encoding.appended = Some(tag.appended(file, at)?);
                // What follows may be raw bytes, which are no XML.
                break;
            }
            (_, Some(_), _) => {}
            (name, None, _) => {
                return Err(wrong("a VTKFile", format!("a tag {}", quoted(name))));
            }
        }
        path.push(start.local_name().as_ref().to_owned());
    }
    let missing = |what| MeshFileError::syntax(Place::Line(line), what, "the end of the tags");
    let (is_grid, encoding) = root.ok_or_else(|| missing("a VTKFile"))?;
    let piece = piece.ok_or_else(|| missing("a Piece"))?;
    Ok(Document {
        is_grid,
        encoding,
        piece,
    })
}

impl<'a> Tag<'a, '_> {
    /// An attribute's value, if it is there.
    fn attribute(&self, name: &str) -> Result<Option<String>, MeshFileError> {
        // Without checks for repetition, which take time in the square of the number of attributes.
        let mut attributes = self.start.attributes();
        for attribute in attributes.with_checks(false) {
            let attribute = attribute.map_err(|error| {
                let found = quoted(&error.to_string());
                self.wrong("well-formed attributes", found)
            })?;
            if attribute.key.as_ref() == name {
                return Ok(Some(attribute.value.into_owned()));
            }
        }
        Ok(None)
    }

    /// An attribute as one of several words; the first if it is left out and `optional`.
    fn choice<T: Copy>(
        &self,
        name: &str,
        optional: bool,
        choices: &[(&str, T)],
    ) -> Result<T, MeshFileError> {
        let value = self.attribute(name)?;
        let chosen = match &value {
            Some(value) => choices.iter().find(|(word, _)| word == value),
            None => choices.first().filter(|_| optional),
        };
        chosen.map(|(_, choice)| *choice).ok_or_else(|| {
            let words: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
            let found = value.map_or_else(|| "none".to_owned(), |value| quoted(&value));
            self.wrong(&format!("{name} to be {}", words.join(" or ")), found)
        })
    }

    /// An attribute as a number.
    fn number(&self, name: &str) -> Result<Option<u64>, MeshFileError> {
        let Some(value) = self.attribute(name)? else {
            return Ok(None);
        };
        let number = value.trim().parse().map_err(|_| {
            let expected = format!("{name} to be a whole number");
            self.wrong(&expected, quoted(&value))
        })?;
        Ok(Some(number))
    }

    /// An attribute as a count that has to be there.
    fn count(&self, name: &str) -> Result<usize, MeshFileError> {
        let number = self.number(name)?;
        let number = number.ok_or_else(|| self.wrong(name, "none".to_owned()))?;
        Ok(usize::try_from(number).unwrap_or(usize::MAX))
    }

    fn wrong(&self, expected: &str, found: String) -> MeshFileError {
        MeshFileError::syntax(Place::Line(self.line), expected, found)
    }

    /// `VTKFile`: whether it is a grid, and how arrays are written.
    fn root(&self) -> Result<(bool, Encoding<'a>), MeshFileError> {
        let kinds = [("UnstructuredGrid", true), ("PolyData", false)];
        let is_grid = self.choice("type", false, &kinds)?;
        let orders = [("LittleEndian", false), ("BigEndian", true)];
        let encoding = Encoding {
            big_endian: self.choice("byte_order", true, &orders)?,
            long_lengths: self.choice(
                "header_type",
                true,
                &[("UInt32", false), ("UInt64", true)],
            )?,
            compressed: match self.attribute("compressor")?.as_deref() {
                None | Some("") => false,
                Some(_) => self.choice("compressor", true, &[("vtkZLibDataCompressor", true)])?,
            },
            appended: None,
        };
        Ok((is_grid, encoding))
    }

    /// `Piece`: how many points and cells there are.
    fn piece(&self) -> Result<Piece<'a>, MeshFileError> {
        let cells = match self.number("NumberOfCells")? {
            Some(cells) => usize::try_from(cells).unwrap_or(usize::MAX),
            None => self.count("NumberOfPolys")?,
        };
        Ok(Piece {
            line: self.line,
            points: self.count("NumberOfPoints")?,
            cells,
            strips: self.number("NumberOfStrips")?.map_or(0, |n| n as usize),
            arrays: Vec::new(),
        })
    }

    /// What a `DataArray` within `parent` is for, if a mesh needs it.
    fn role(&self, parent: &str, is_grid: bool) -> Result<Option<Role>, MeshFileError> {
        if parent == "Points" {
            return Ok(Some(Role::Points));
        }
        if parent != if is_grid { "Cells" } else { "Polys" } {
            return Ok(None);
        }
        Ok(match self.attribute("Name")?.as_deref() {
            Some("connectivity") => Some(Role::Connectivity),
            Some("offsets") => Some(Role::Offsets),
            Some("types") => Some(Role::Types),
            _ => None,
        })
    }

    /// A `DataArray` whose tag ends at byte `at` of the file.
    fn array(&self, role: Role, file: &'a [u8], at: usize) -> Result<DataArray<'a>, MeshFileError> {
        let types = [
            ("Int8", Scalar::I8),
            ("UInt8", Scalar::U8),
            ("Int16", Scalar::I16),
            ("UInt16", Scalar::U16),
            ("Int32", Scalar::I32),
            ("UInt32", Scalar::U32),
            ("Int64", Scalar::I64),
            ("UInt64", Scalar::U64),
            ("Float32", Scalar::F32),
            ("Float64", Scalar::F64),
        ];
        let scalar = self.choice("type", false, &types)?;
        if role == Role::Points && self.number("NumberOfComponents")?.is_some_and(|n| n != 3) {
            return Err(self.wrong(
                "NumberOfComponents to be 3 for Points",
                "another".to_owned(),
            ));
        }
        let content = file.get(at..).unwrap_or_default();
        let end = content.iter().position(|&byte| byte == b'<');
        let content = content
            .get(..end.unwrap_or(content.len()))
            .unwrap_or_default();
        let formats = [("ascii", 0), ("binary", 1), ("appended", 2)];
        let data = match self.choice("format", true, &formats)? {
            0 => Data::Ascii {
                text: content,
                offset: at,
            },
            1 => Data::Base64(content),
            _ => {
                let offset = self.number("offset")?;
                Data::Appended(offset.ok_or_else(|| self.wrong("an offset", "none".to_owned()))?)
            }
        };
        Ok(DataArray {
            role,
            line: self.line,
            scalar,
            data,
        })
    }

    /// `AppendedData`, whose tag ends at byte `at` of the file.
    fn appended(&self, file: &'a [u8], at: usize) -> Result<Appended<'a>, MeshFileError> {
        let base64 = self.choice("encoding", false, &[("raw", false), ("base64", true)])?;
        let content = file.get(at..).unwrap_or_default();
        let blank = content.len() - content.trim_ascii_start().len();
        let bytes = content
            .get(blank..)
            .and_then(|content| content.strip_prefix(b"_"))
            .ok_or_else(|| self.wrong("an underscore before the data", "none".to_owned()))?;
        Ok(Appended {
            bytes,
            offset: at + blank + 1,
            base64,
        })
    }
}
