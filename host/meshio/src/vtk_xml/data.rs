//! Decodes the numbers of one array: base64, compression and byte order.
//!
//! An uncompressed array consists of its length in bytes and the bytes. A compressed array consists of the number of
//! blocks, the unpacked length of a block, the unpacked length of the last block if that is shorter (or zero), the
//! packed length of each block, and the blocks. `header_type` tells whether lengths have four or eight bytes.

use super::document::{Data, DataArray, Encoding};
use super::{MAX_RATIO, MAX_UNPACKED, MIN_UNPACKED};
use crate::error::{FilePosition, MeshFileError};
use crate::text::quoted_bytes;
use crate::vtk_array::{Array, Origin};
use flate2::{Decompress, FlushDecompress, Status};
use std::borrow::Cow;

/// Reads the arrays of one file, and limits their total unpacked size.
pub(super) struct Unpacker<'a> {
    file: &'a [u8],
    encoding: &'a Encoding<'a>,
    /// The number of bytes that may still be unpacked.
    budget: usize,
}

/// The encoded bytes that have not been read yet.
#[derive(Clone)]
enum Source<'a> {
    Raw { bytes: &'a [u8], offset: usize },
    Base64(Base64<'a>),
}

/// The position where an array begins, for errors.
#[derive(Clone, Copy)]
struct At {
    line: usize,
}

impl At {
    fn wrong(self, expected: impl Into<String>, found: impl Into<String>) -> MeshFileError {
        MeshFileError::syntax(FilePosition::Line(self.line), expected, found)
    }
}

impl<'a> Unpacker<'a> {
    pub(super) fn new<'d: 'a>(file: &'a [u8], encoding: &'d Encoding<'a>) -> Self {
        Self {
            file,
            encoding,
            budget: (file.len().saturating_mul(MAX_RATIO)).clamp(MIN_UNPACKED, MAX_UNPACKED),
        }
    }

    /// The numbers of an array.
    pub(super) fn array(&mut self, array: &DataArray<'a>) -> Result<Array<'a>, MeshFileError> {
        let at = At { line: array.line };
        let mut source = match array.data {
            Data::Ascii { text, offset } => {
                let file = self.file;
                return Ok(Array::text(text, Origin::File { file, offset }));
            }
            Data::Base64(text) => Source::Base64(Base64::new(text)),
            Data::Appended(offset) => self.appended(offset, at)?,
        };
        let (bytes, origin) = if self.encoding.compressed {
            let bytes = self.unpack(&mut source, at)?;
            (Cow::Owned(bytes), Origin::Encoded { line: at.line })
        } else {
            let length = self.length(&mut source, at)?;
            let origin = match &source {
                Source::Raw { offset, .. } => Origin::File {
                    file: self.file,
                    offset: *offset,
                },
                Source::Base64(_) => Origin::Encoded { line: at.line },
            };
            (source.take(length, at)?, origin)
        };
        if !bytes.len().is_multiple_of(array.scalar.size()) {
            let expected = format!("whole numbers of {} bytes", array.scalar.size());
            return Err(at.wrong(expected, format!("{} bytes", bytes.len())));
        }
        Ok(Array::bytes(
            bytes,
            array.scalar,
            self.encoding.big_endian,
            origin,
        ))
    }

    /// Appended data from an offset on.
    fn appended(&self, offset: u64, at: At) -> Result<Source<'a>, MeshFileError> {
        let Some(appended) = &self.encoding.appended else {
            return Err(at.wrong("AppendedData in the file", "none"));
        };
        let start = usize::try_from(offset).unwrap_or(usize::MAX);
        let bytes = appended.bytes.get(start..).ok_or_else(|| {
            let expected = format!("an offset up to {}", appended.bytes.len());
            at.wrong(expected, offset.to_string())
        })?;
        Ok(if appended.base64 {
            Source::Base64(Base64::new(bytes))
        } else {
            let offset = appended.offset.saturating_add(start);
            Source::Raw { bytes, offset }
        })
    }

    /// The next length.
    fn length(&self, source: &mut Source<'a>, at: At) -> Result<u64, MeshFileError> {
        let size = if self.encoding.long_lengths { 8 } else { 4 };
        let bytes = source.take(size, at)?;
        let fold = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        Ok(if self.encoding.big_endian {
            bytes.iter().fold(0, fold)
        } else {
            bytes.iter().rev().fold(0, fold)
        })
    }

    /// All blocks of a compressed array, unpacked. The sum of the lengths is compared with the budget before any block
    /// is unpacked.
    fn unpack(&mut self, source: &mut Source<'a>, at: At) -> Result<Vec<u8>, MeshFileError> {
        let count = self.length(source, at)?;
        let block = self.length(source, at)?;
        let last = self.length(source, at)?;
        if count == 0 {
            return Ok(Vec::new());
        }
        if block == 0 || last > block {
            let found = format!("blocks of {block} bytes and a last one of {last}");
            return Err(at.wrong("blocks of at least 1 byte, the last not longer", found));
        }
        let last = if last == 0 { block } else { last };
        let total = (count - 1)
            .checked_mul(block)
            .and_then(|n| n.checked_add(last));
        let total = total
            .and_then(|total| usize::try_from(total).ok())
            .filter(|&total| total <= self.budget)
            .ok_or_else(|| {
                let expected = format!(
                    "to unpack at most {} bytes more (the file has {})",
                    self.budget,
                    self.file.len()
                );
                at.wrong(expected, format!("{count} blocks of {block} bytes"))
            })?;
        self.budget -= total;

        // A length has at least four bytes, so the loop ends early if the source is too short for all lengths.
        let mut lengths = source.clone();
        let skipped = count.checked_mul(if self.encoding.long_lengths { 8 } else { 4 });
        source.skip(skipped.unwrap_or(u64::MAX), at)?;
        let mut unpacked = Vec::with_capacity(total);
        let mut inflate = Decompress::new(true);
        for number in 1..=count {
            let packed = self.length(&mut lengths, at)?;
            let packed = source.take(packed, at)?;
            let wanted = if number == count { last } else { block };
            let end = unpacked.len() + wanted as usize;
            inflate.reset(true);
            // The remaining room bounds the output: a block that unpacks to more does not reach its end.
            let status = inflate_block(&mut inflate, &packed, &mut unpacked, wanted as usize);
            if status != Some(Status::StreamEnd) || unpacked.len() != end {
                let expected = format!("block {number} to unpack to {wanted} bytes");
                return Err(at.wrong(expected, "another length, or bytes that are no zlib stream"));
            }
        }
        Ok(unpacked)
    }
}

/// Unpacks one block of at most `wanted` bytes onto the end of `unpacked`.
fn inflate_block(
    inflate: &mut Decompress,
    packed: &[u8],
    unpacked: &mut Vec<u8>,
    wanted: usize,
) -> Option<Status> {
    let start = unpacked.len();
    unpacked.resize(start + wanted, 0);
    let room = unpacked.get_mut(start..)?;
    let status = inflate
        .decompress(packed, room, FlushDecompress::Finish)
        .ok();
    let written = usize::try_from(inflate.total_out()).ok()?;
    unpacked.truncate(start + written);
    status
}

impl<'a> Source<'a> {
    /// The next `count` bytes.
    fn take(&mut self, count: u64, at: At) -> Result<Cow<'a, [u8]>, MeshFileError> {
        let wanted = usize::try_from(count).unwrap_or(usize::MAX);
        let too_few = |found: usize| {
            let found = format!("{found} bytes up to the end of the data");
            at.wrong(format!("{count} bytes of data"), found)
        };
        match self {
            Self::Raw { bytes, offset } => {
                let (taken, rest) = bytes
                    .split_at_checked(wanted)
                    .ok_or_else(|| too_few(bytes.len()))?;
                *bytes = rest;
                *offset += wanted;
                Ok(Cow::Borrowed(taken))
            }
            Self::Base64(text) => {
                let mut taken = Vec::with_capacity(wanted.min(text.most()));
                for byte in text.by_ref().take(wanted) {
                    taken.push(byte.map_err(|found| at.wrong("base64", quoted_bytes(&[found])))?);
                }
                if taken.len() < wanted {
                    return Err(too_few(taken.len()));
                }
                Ok(Cow::Owned(taken))
            }
        }
    }

    /// Skips the next `count` bytes.
    fn skip(&mut self, count: u64, at: At) -> Result<(), MeshFileError> {
        match self {
            Self::Raw { .. } => self.take(count, at).map(drop),
            Self::Base64(text) => {
                let wanted = usize::try_from(count).unwrap_or(usize::MAX);
                let skipped = text.by_ref().take(wanted).take_while(Result::is_ok).count();
                if skipped == wanted {
                    return Ok(());
                }
                let found = format!("{skipped} bytes up to the end of the data");
                Err(at.wrong(format!("{count} bytes of data"), found))
            }
        }
    }
}

/// Decodes a text in base64 (RFC 4648). Blanks are skipped. The text ends at the first tag. Padding may occur within
/// the text, because VTK encodes lengths and data separately, one after the other.
#[derive(Clone)]
struct Base64<'a> {
    text: std::slice::Iter<'a, u8>,
    /// The decoded bytes in reverse order: the next byte is the last.
    ready: [u8; 3],
    left: usize,
}

impl<'a> Base64<'a> {
    fn new(text: &'a [u8]) -> Self {
        Self {
            text: text.iter(),
            ready: [0; 3],
            left: 0,
        }
    }

    /// An upper bound on the number of remaining bytes.
    fn most(&self) -> usize {
        self.left + self.text.len() / 4 * 3
    }

    /// Decodes the next four characters. The error is the character that does not belong to base64.
    fn group(&mut self) -> Option<Result<(), u8>> {
        let mut bits = 0_u32;
        let mut padding = 0;
        for k in 0..4 {
            let Some(&byte) = self.text.find(|byte| !byte.is_ascii_whitespace()) else {
                // A text that ends within a group is incomplete.
                return (k > 0).then_some(Err(b' '));
            };
            let value = match byte {
                b'<' if k == 0 => {
                    self.text = [].iter();
                    return None;
                }
                b'A'..=b'Z' if padding == 0 => byte - b'A',
                b'a'..=b'z' if padding == 0 => byte - b'a' + 26,
                b'0'..=b'9' if padding == 0 => byte - b'0' + 52,
                b'+' if padding == 0 => 62,
                b'/' if padding == 0 => 63,
                b'=' if k >= 2 => {
                    padding += 1;
                    0
                }
                other => return Some(Err(other)),
            };
            bits = bits << 6 | u32::from(value);
        }
        let [_, a, b, c] = bits.to_be_bytes();
        self.left = 3 - padding;
        self.ready = match padding {
            0 => [c, b, a],
            1 => [b, a, 0],
            _ => [a, 0, 0],
        };
        Some(Ok(()))
    }
}

impl Iterator for Base64<'_> {
    type Item = Result<u8, u8>;

    fn next(&mut self) -> Option<Result<u8, u8>> {
        if self.left == 0
            && let Err(found) = self.group()?
        {
            return Some(Err(found));
        }
        self.left -= 1;
        self.ready.get(self.left).map(|&byte| Ok(byte))
    }
}
