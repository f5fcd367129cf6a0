//! One tag of a VTU or VTP file: its attributes, each checked by itself.

use super::document::{Appended, Data, DataArray, Encoding, Piece, Role};
use crate::error::{FilePosition, MeshFileError};
use crate::text::quoted;
use crate::vtk_array::Scalar;
use quick_xml::escape::unescape;
use quick_xml::events::BytesStart;

/// The names of the supported types of numbers. A mesh needs no arrays of other types.
const TYPES: [(&str, Scalar); 10] = [
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

/// A tag with its position.
pub(super) struct Tag<'a, 'e> {
    pub(super) line: usize,
    pub(super) start: &'e BytesStart<'a>,
}

impl<'a> Tag<'a, '_> {
    /// The value of an attribute, if the tag has the attribute.
    fn attribute(&self, name: &str) -> Result<Option<String>, MeshFileError> {
        // Repetitions are not checked, because the check takes a time quadratic in the number of attributes.
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

    /// An attribute as one of several words; the first word if the attribute is missing and `optional`.
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

    /// A required attribute as a count.
    fn count(&self, name: &str) -> Result<usize, MeshFileError> {
        let number = self.number(name)?;
        let number = number.ok_or_else(|| self.wrong(name, "none".to_owned()))?;
        Ok(usize::try_from(number).unwrap_or(usize::MAX))
    }

    fn wrong(&self, expected: &str, found: String) -> MeshFileError {
        MeshFileError::syntax(FilePosition::Line(self.line), expected, found)
    }

    /// `VTKFile`: whether the file holds a grid, and the encoding of its arrays.
    pub(super) fn root(&self) -> Result<(bool, Encoding<'a>), MeshFileError> {
        let is_grid = match self.attribute("type")?.as_deref() {
            Some("UnstructuredGrid") => true,
            Some("PolyData") => false,
            other => {
                let expected = match other {
                    Some(
                        "PUnstructuredGrid" | "PPolyData" | "vtkMultiBlockDataSet" | "Collection",
                    ) => {
                        "type to be UnstructuredGrid or PolyData (this file names the files of a mesh's parts: name \
                         one of them, or merge them first)"
                    }
                    _ => {
                        "type to be UnstructuredGrid or PolyData (make one of them first, as ParaView's filters \
                         Extract Surface and Tetrahedralize do)"
                    }
                };
                let found = other.map_or_else(|| "none".to_owned(), quoted);
                return Err(self.wrong(expected, found));
            }
        };
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
                Some("vtkZLibDataCompressor") => true,
                Some(other) => {
                    let expected = "compressor to be vtkZLibDataCompressor (save the file with ZLib or without \
                                    compression)";
                    return Err(self.wrong(expected, quoted(other)));
                }
            },
            appended: None,
        };
        Ok((is_grid, encoding))
    }

    /// `Piece`: the numbers of points and cells.
    pub(super) fn piece(&self) -> Result<Piece<'a>, MeshFileError> {
        let cells = match self.number("NumberOfCells")? {
            Some(cells) => usize::try_from(cells).unwrap_or(usize::MAX),
            None => self.count("NumberOfPolys")?,
        };
        Ok(Piece {
            line: self.line,
            points: self.count("NumberOfPoints")?,
            cells,
            strips: self.number("NumberOfStrips")?.map_or(0, |n| n as usize),
            others: self.others()?,
            arrays: Vec::new(),
            cell_data: Vec::new(),
        })
    }

    /// The number of points and lines of a `Piece` of polygons. They come first in the cell data.
    fn others(&self) -> Result<usize, MeshFileError> {
        let mut others = 0_usize;
        for name in ["NumberOfVerts", "NumberOfLines"] {
            let number = self.number(name)?.unwrap_or(0);
            others = others.saturating_add(usize::try_from(number).unwrap_or(usize::MAX));
        }
        Ok(others)
    }

    /// The name of a `DataArray`, if the array has a name and holds one number for each cell.
    pub(super) fn name_of_scalars(&self) -> Result<Option<String>, MeshFileError> {
        let kind = self.attribute("type")?;
        let is_known = TYPES.iter().any(|(name, _)| kind.as_deref() == Some(name));
        let components = self.number("NumberOfComponents")?.unwrap_or(1);
        let Some(name) = self
            .attribute("Name")?
            .filter(|_| is_known && components == 1)
        else {
            return Ok(None);
        };
        let name = unescape(&name)
            .map_err(|error| self.wrong("a well-formed name", quoted(&error.to_string())))?;
        Ok(Some(name.into_owned()))
    }

    /// The role of a `DataArray` within `parent`, if the mesh needs the array.
    pub(super) fn role(&self, parent: &str, is_grid: bool) -> Result<Option<Role>, MeshFileError> {
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
    pub(super) fn array(
        &self,
        of_points: bool,
        file: &'a [u8],
        at: usize,
    ) -> Result<DataArray<'a>, MeshFileError> {
        let scalar = self.choice("type", false, &TYPES)?;
        if of_points && self.number("NumberOfComponents")?.is_some_and(|n| n != 3) {
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
            line: self.line,
            scalar,
            data,
        })
    }

    /// `AppendedData`, whose tag ends at byte `at` of the file.
    pub(super) fn appended(
        &self,
        file: &'a [u8],
        at: usize,
    ) -> Result<Appended<'a>, MeshFileError> {
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
