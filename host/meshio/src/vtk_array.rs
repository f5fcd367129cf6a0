//! Arrays of numbers in VTK files: text, or bytes of a given type and byte order.
//!
//! Numbers are parsed on demand. An array that is not encoded therefore takes no memory in addition to the file.

use crate::error::{FilePosition, MeshFileError};
use crate::text::{line_of, quoted_bytes};
use std::borrow::Cow;
use std::ops::Range;

/// The type of an encoded number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// Numbers, one after another.
pub(crate) struct Array<'a> {
    numbers: Numbers<'a>,
    origin: Origin<'a>,
    len: usize,
}

enum Numbers<'a> {
    Text(&'a [u8]),
    Bytes {
        bytes: Cow<'a, [u8]>,
        scalar: Scalar,
        big_endian: bool,
    },
}

/// The origin of an array, for the places in errors.
#[derive(Clone, Copy)]
pub(crate) enum Origin<'a> {
    /// The array is in the file without encoding, and begins at this byte.
    File { file: &'a [u8], offset: usize },
    /// The array was encoded in the lines after this one.
    Encoded { line: usize },
}

impl Scalar {
    /// The size of a number (bytes).
    pub(crate) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

impl<'a> Array<'a> {
    /// The numbers of a text, separated by blanks. `origin` is the beginning of the text.
    pub(crate) fn text(text: &'a [u8], origin: Origin<'a>) -> Self {
        Self {
            numbers: Numbers::Text(text),
            origin,
            len: words(text).count(),
        }
    }

    /// Numbers of one type. An incomplete number at the end is omitted.
    pub(crate) fn bytes(
        bytes: Cow<'a, [u8]>,
        scalar: Scalar,
        big_endian: bool,
        origin: Origin<'a>,
    ) -> Self {
        let len = bytes.len() / scalar.size();
        Self {
            numbers: Numbers::Bytes {
                bytes,
                scalar,
                big_endian,
            },
            origin,
            len,
        }
    }

    /// An array without numbers.
    pub(crate) fn none(line: usize) -> Self {
        Self::text(b"", Origin::Encoded { line })
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// The position of a number, or the end of the array if the number does not exist.
    pub(crate) fn position(&self, item: usize) -> FilePosition {
        match (self.origin, &self.numbers) {
            (Origin::Encoded { line }, _) => FilePosition::Item { line, item },
            (Origin::File { file, offset }, Numbers::Bytes { scalar, .. }) => {
                let within = item.saturating_mul(scalar.size());
                FilePosition::Byte(offset.saturating_add(within).min(file.len()))
            }
            (Origin::File { file, offset }, Numbers::Text(text)) => {
                let end = text.trim_ascii_end().len();
                let within = nth_word(text, item).map_or(end, |word| word.start);
                FilePosition::Line(line_of(file, offset.saturating_add(within)))
            }
        }
    }

    /// The numbers as reals, which must be finite. An error describes the expected number by `expected`.
    pub(crate) fn reals(
        &self,
        expected: &'static str,
    ) -> impl Iterator<Item = Result<f64, MeshFileError>> {
        let numbers = self.numbers(expected).enumerate();
        numbers.map(move |(item, number)| {
            number.and_then(|number| {
                if number.is_finite() {
                    return Ok(number);
                }
                let found = format!("{number:?}");
                Err(MeshFileError::syntax(self.position(item), expected, found))
            })
        })
    }

    /// The numbers as reals. An error describes the expected number by `expected`.
    pub(crate) fn numbers(
        &self,
        expected: &'static str,
    ) -> impl Iterator<Item = Result<f64, MeshFileError>> {
        let from_text = |word: &[u8]| std::str::from_utf8(word).ok()?.parse::<f64>().ok();
        let from_bytes = |bytes: &[u8], scalar, big| match scalar {
            Scalar::F32 => f64::from(f32::from_le_bytes(little(bytes, big))),
            Scalar::F64 => f64::from_le_bytes(little(bytes, big)),
            Scalar::U64 => u64::from_le_bytes(little(bytes, big)) as f64,
            _ => integer(bytes, scalar, big).unwrap_or_default() as f64,
        };
        let text = self.words().map(move |word| (from_text(word), word));
        let bytes = self
            .chunks()
            .map(move |(bytes, scalar, big)| (Some(from_bytes(bytes, scalar, big)), bytes));
        let numbers = text.chain(bytes).enumerate();
        numbers.map(move |(item, (number, raw))| {
            number.ok_or_else(|| {
                MeshFileError::syntax(self.position(item), expected, quoted_bytes(raw))
            })
        })
    }

    /// The numbers as whole numbers.
    pub(crate) fn integers(&self) -> impl Iterator<Item = Result<i64, MeshFileError>> {
        let from_text = |word: &[u8]| std::str::from_utf8(word).ok()?.parse::<i64>().ok();
        let text = self.words().map(move |word| (from_text(word), word));
        let bytes = self
            .chunks()
            .map(|(bytes, scalar, big)| (integer(bytes, scalar, big), bytes));
        text.chain(bytes).enumerate().map(|(item, (number, raw))| {
            number.ok_or_else(|| {
                let found = match &self.numbers {
                    Numbers::Text(_) => quoted_bytes(raw),
                    Numbers::Bytes { scalar, .. } => {
                        format!("one of type {scalar:?}, too large or not whole")
                    }
                };
                MeshFileError::syntax(self.position(item), "a whole number", found)
            })
        })
    }

    fn words(&self) -> impl Iterator<Item = &[u8]> {
        match &self.numbers {
            Numbers::Text(text) => Some(words(text)),
            Numbers::Bytes { .. } => None,
        }
        .into_iter()
        .flatten()
    }

    fn chunks(&self) -> impl Iterator<Item = (&[u8], Scalar, bool)> {
        match &self.numbers {
            Numbers::Text(_) => None,
            Numbers::Bytes {
                bytes,
                scalar,
                big_endian,
            } => Some(
                bytes
                    .chunks_exact(scalar.size())
                    .map(|chunk| (chunk, *scalar, *big_endian)),
            ),
        }
        .into_iter()
        .flatten()
    }
}

/// The words of a text.
pub(crate) fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(u8::is_ascii_whitespace)
        .filter(|word| !word.is_empty())
}

/// The position of word number `n`, from zero.
pub(crate) fn nth_word(text: &[u8], n: usize) -> Option<Range<usize>> {
    let mut seen = 0;
    let mut start = None;
    for (at, byte) in text.iter().chain(b" ").enumerate() {
        match (start, byte.is_ascii_whitespace()) {
            (None, false) => start = Some(at),
            (Some(from), true) if seen == n => return Some(from..at),
            (Some(_), true) => {
                seen += 1;
                start = None;
            }
            _ => {}
        }
    }
    None
}

/// The value as an integer, if the value is whole and in range.
fn integer(bytes: &[u8], scalar: Scalar, big_endian: bool) -> Option<i64> {
    if !scalar.is_integer() {
        return None;
    }
    let unsigned = u64::from_le_bytes(little(bytes, big_endian));
    Some(match scalar {
        Scalar::I8 => i64::from(unsigned as i8),
        Scalar::I16 => i64::from(unsigned as i16),
        Scalar::I32 => i64::from(unsigned as i32),
        Scalar::I64 => unsigned as i64,
        _ => i64::try_from(unsigned).ok()?,
    })
}

/// The bytes of a number, lowest first, padded with zeros.
fn little<const N: usize>(bytes: &[u8], big_endian: bool) -> [u8; N] {
    let mut number = [0; N];
    let fill = |number: &mut [u8; N], bytes: &mut dyn Iterator<Item = &u8>| {
        for (to, from) in number.iter_mut().zip(bytes) {
            *to = *from;
        }
    };
    if big_endian {
        fill(&mut number, &mut bytes.iter().rev());
    } else {
        fill(&mut number, &mut bytes.iter());
    }
    number
}
