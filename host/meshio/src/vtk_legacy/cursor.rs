//! Reads a file that mixes lines of text and binary arrays.

use super::Items;
use crate::error::{FilePosition, MeshFileError};
use crate::lines::Fields;
use crate::text::{newlines, quoted_bytes};
use crate::vtk_array::{Array, Origin, Scalar, nth_word, words};
use std::borrow::Cow;

/// Longest line of text that is read (bytes). The line of a keyword is far shorter.
const LONGEST_LINE: usize = 1024;

/// The position in a file.
pub(super) struct Cursor<'a> {
    file: &'a [u8],
    at: usize,
    /// Whether arrays are binary rather than text.
    pub(super) binary: bool,
    /// The number of line ends before the byte `counted`. Lines are counted incrementally: a count from the start of
    /// the file for each position would take a time quadratic in the length of the file.
    lines: usize,
    counted: usize,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(file: &'a [u8]) -> Self {
        Self {
            file,
            at: 0,
            binary: false,
            lines: 0,
            counted: 0,
        }
    }

    fn rest(&self) -> &'a [u8] {
        self.file.get(self.at..).unwrap_or_default()
    }

    /// The present position: a line if the file is text, otherwise a byte.
    pub(super) fn position(&mut self) -> FilePosition {
        if self.binary {
            return FilePosition::Byte(self.at);
        }
        let passed = self.file.get(self.counted..self.at).unwrap_or_default();
        self.lines += newlines(passed);
        self.counted = self.at;
        FilePosition::Line(1 + self.lines)
    }

    /// The next line that is not blank, if any.
    pub(super) fn next(&mut self) -> Result<Option<Fields<'a>>, MeshFileError> {
        let rest = self.rest();
        self.at += rest.len() - rest.trim_ascii_start().len();
        if self.rest().is_empty() {
            return Ok(None);
        }
        let position = self.position();
        let line = self.skip_line();
        let text = std::str::from_utf8(line)
            .ok()
            .filter(|line| line.len() <= LONGEST_LINE)
            .ok_or_else(|| {
                MeshFileError::syntax(
                    position,
                    "a line of text with a keyword",
                    quoted_bytes(line),
                )
            })?;
        Ok(Some(match position {
            FilePosition::Byte(at) => Fields::at_byte(at, text),
            FilePosition::Line(at) | FilePosition::Item { line: at, .. } => {
                Fields::at_line(at, text)
            }
        }))
    }

    /// The next line that is not blank. Without one, the error names `expected`.
    pub(super) fn expect(&mut self, expected: &str) -> Result<Fields<'a>, MeshFileError> {
        let line = self.next()?;
        line.ok_or_else(|| MeshFileError::syntax(self.position(), expected, "the end of the file"))
    }

    /// Skips the rest of the present line and returns it.
    pub(super) fn skip_line(&mut self) -> &'a [u8] {
        let rest = self.rest();
        let end = rest.iter().position(|&byte| byte == b'\n');
        self.at += end.map_or(rest.len(), |end| end + 1);
        rest.get(..end.unwrap_or(rest.len())).unwrap_or_default()
    }

    /// Skips all lines up to a blank one.
    pub(super) fn skip_paragraph(&mut self) {
        while !self.skip_line().trim_ascii().is_empty() {}
    }

    /// Skips an array of `count` items after `line`, which must have ended.
    pub(super) fn skip_items(
        &mut self,
        line: &Fields<'_>,
        count: Option<usize>,
        items: Items,
    ) -> Result<(), MeshFileError> {
        let by_line = match items {
            Items::Numbers(scalar) => return self.array(line, count, scalar).map(drop),
            Items::Bits => {
                let count = if self.binary {
                    count.map(|count| count.div_ceil(8))
                } else {
                    count
                };
                return self.array(line, count, Scalar::U8).map(drop);
            }
            Items::Texts { by_line } => by_line,
        };
        line.end()?;
        let mut left = count.unwrap_or(usize::MAX);
        while left > 0 && !self.rest().is_empty() {
            left -= 1;
            if by_line || !self.binary {
                self.skip_line();
                continue;
            }
            let length = encoded_text(self.rest()).and_then(|length| usize::try_from(length).ok());
            match length.filter(|&length| length <= self.rest().len()) {
                Some(length) => self.at += length,
                None => self.at = self.file.len(),
            }
        }
        if left == 0 {
            return Ok(());
        }
        let expected = "as many texts after this line as it says";
        Err(MeshFileError::syntax(
            line.position(),
            expected,
            "the end of the file",
        ))
    }

    /// Reads an array of `count` numbers after `line`, which must have ended.
    pub(super) fn array(
        &mut self,
        line: &Fields<'_>,
        count: Option<usize>,
        scalar: Scalar,
    ) -> Result<Array<'a>, MeshFileError> {
        line.end()?;
        let too_few = |found: String| {
            let claimed = count.map_or_else(|| "too many".to_owned(), |count| count.to_string());
            let expected = format!("{claimed} numbers after this line, as it says");
            MeshFileError::syntax(line.position(), expected, found)
        };
        let offset = self.at;
        let rest = self.rest();
        let origin = Origin::File {
            file: self.file,
            offset,
        };
        if self.binary {
            let length = count.and_then(|count| count.checked_mul(scalar.size()));
            let bytes = length
                .and_then(|length| rest.get(..length))
                .ok_or_else(|| {
                    too_few(format!("{} bytes up to the end of the file", rest.len()))
                })?;
            self.at += bytes.len();
            return Ok(Array::bytes(Cow::Borrowed(bytes), scalar, true, origin));
        }
        let wanted = count.unwrap_or(usize::MAX);
        let length = text_length(rest, wanted)
            .map_err(|found| too_few(format!("{found} up to the end of the file")))?;
        let text = rest.get(..length).unwrap_or_default();
        self.at += length;
        Ok(Array::text(text, origin))
    }
}

/// The bytes of a text's length and of the text, at the start of `bytes`. VTK writes the length in one, two, four or
/// eight bytes, as the first two bits say (`vtkDataWriter::WriteArray`).
fn encoded_text(bytes: &[u8]) -> Option<u64> {
    let size = match bytes.first()? >> 6 {
        3 => 1,
        2 => 2,
        1 => 4,
        _ => 8,
    };
    let bytes = bytes.get(..size)?;
    let number = bytes
        .iter()
        .fold(0, |number, &byte| number << 8 | u64::from(byte));
    let length = number & (u64::MAX >> (64 - 8 * size + 2));
    length.checked_add(size as u64)
}

/// The size of the first `count` words (bytes); if there are fewer words, their number as the error.
fn text_length(text: &[u8], count: usize) -> Result<usize, usize> {
    let Some(last) = count.checked_sub(1) else {
        return Ok(0);
    };
    match nth_word(text, last) {
        Some(word) => Ok(word.end),
        None => Err(words(text).count()),
    }
}
