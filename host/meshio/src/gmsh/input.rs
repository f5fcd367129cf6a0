//! The items of an MSH file: lines of numbers in a text file, and the same numbers without lines in a binary file.
//!
//! The sections of both files have the same items in the same order, so one reader reads both. The names of sections and
//! the beginnings of fields are lines of text in a binary file, too.

use crate::error::{FilePosition, GmshError};
use crate::lines::{Fields, Lines, Unexpected};
use std::fmt::Display;
use std::str::FromStr;

/// Longest line of text in a binary file (bytes). The line of a section's name is far shorter.
const LONGEST_LINE: usize = 1024;

/// A file, and how much of it has been read.
pub(super) enum Input<'a> {
    /// A file of text.
    Text {
        lines: Lines<'a>,
        /// The rest of the present item's line.
        item: Fields<'a>,
        len: usize,
    },
    /// A binary file.
    Binary {
        file: &'a [u8],
        /// The next byte.
        at: usize,
        big_endian: bool,
    },
}

impl<'a> Input<'a> {
    pub(super) fn text(text: &'a str) -> Self {
        Self::Text {
            lines: Lines::new(text),
            item: Fields::at_byte(0, ""),
            len: text.len(),
        }
    }

    pub(super) fn binary(file: &'a [u8]) -> Self {
        Self::Binary {
            file,
            at: 0,
            big_endian: false,
        }
    }

    pub(super) fn is_binary(&self) -> bool {
        matches!(self, Self::Binary { .. })
    }

    /// The last position read, as [`Fields::at`](crate::lines::Fields).
    pub(super) fn last(&self) -> usize {
        match self {
            Self::Text { lines, .. } => lines.last(),
            Self::Binary { at, .. } => *at,
        }
    }

    /// A vector with room for the number of items that the file claims to hold, but for no more than the file can hold
    /// if each item takes at least `least` bytes.
    pub(super) fn room<T>(&self, claimed: usize, least: usize) -> Vec<T> {
        let len = match self {
            Self::Text { len, .. } => *len,
            Self::Binary { file, .. } => file.len(),
        };
        Vec::with_capacity(claimed.min(len / least))
    }

    /// The next line of text that is not blank, if any.
    pub(super) fn next_line(&mut self) -> Result<Option<Fields<'a>>, Unexpected> {
        let (file, at) = match self {
            Self::Text { lines, .. } => return Ok(lines.next()),
            Self::Binary { file, at, .. } => (*file, at),
        };
        let rest = file.get(*at..).unwrap_or_default();
        let text = rest.trim_ascii_start();
        if text.is_empty() {
            return Ok(None);
        }
        let start = *at + rest.len() - text.len();
        let end = text.iter().position(|&byte| byte == b'\n');
        let line = text.get(..end.unwrap_or(text.len())).unwrap_or_default();
        *at = start + line.len() + usize::from(end.is_some());
        let line = std::str::from_utf8(line)
            .ok()
            .filter(|line| line.len() <= LONGEST_LINE);
        line.map(|line| Some(Fields::at_byte(start, line)))
            .ok_or_else(|| Unexpected {
                position: FilePosition::Byte(start),
                expected: "a line of text".to_owned(),
                found: "other bytes".to_owned(),
            })
    }

    /// The next line of text that is not blank. Without one, the error names `expected`.
    pub(super) fn line(&mut self, expected: &str) -> Result<Fields<'a>, Unexpected> {
        if let Self::Text { lines, .. } = self {
            return lines.expect(expected);
        }
        let line = self.next_line()?;
        line.ok_or_else(|| self.ended(expected))
    }

    /// Checks that the next line of text is `marker` alone.
    pub(super) fn marker(&mut self, marker: &str) -> Result<(), Unexpected> {
        let fields = self.line(marker)?;
        if fields.rest() == marker {
            Ok(())
        } else {
            Err(fields.unexpected(marker))
        }
    }

    /// Skips a section to its end.
    pub(super) fn skip(&mut self, section: &str) -> Result<(), Unexpected> {
        let end = format!("$End{}", section.trim_start_matches('$'));
        if let Self::Binary { file, at, .. } = self {
            let rest = file.get(*at..).unwrap_or_default();
            let marker = rest
                .windows(end.len())
                .position(|bytes| bytes == end.as_bytes());
            *at += marker.unwrap_or(rest.len());
            return self.marker(&end);
        }
        while self.line(&end)?.rest() != end {}
        Ok(())
    }

    /// Begins an item: in a text file, the next line that is not blank.
    pub(super) fn item(&mut self, expected: &str) -> Result<Fields<'a>, Unexpected> {
        if let Self::Text { lines, item, .. } = self {
            *item = lines.expect(expected)?;
        }
        Ok(self.mark())
    }

    /// The rest of the present item.
    pub(super) fn mark(&self) -> Fields<'a> {
        match self {
            Self::Text { item, .. } => *item,
            Self::Binary { at, .. } => Fields::at_byte(*at, ""),
        }
    }

    /// Ends an item: in a text file, its line must have ended.
    pub(super) fn end(&self) -> Result<(), Unexpected> {
        match self {
            Self::Text { item, .. } => item.end(),
            Self::Binary { .. } => Ok(()),
        }
    }

    /// The error that `found` at `mark` is not `expected`.
    pub(super) fn refuse(&self, mark: &Fields, expected: &str, found: impl Display) -> GmshError {
        let mut error = mark.unexpected(expected);
        if self.is_binary() {
            error.found = found.to_string();
        }
        error.into()
    }

    /// The next number of the item that is an `int` in a binary file.
    pub(super) fn int<T: FromStr + TryFrom<i32>>(
        &mut self,
        expected: &str,
    ) -> Result<T, Unexpected> {
        if let Self::Text { item, .. } = self {
            return item.number(expected);
        }
        let position = self.mark().position();
        let (bytes, big_endian) = self.take(expected)?;
        let number = if big_endian {
            i32::from_be_bytes(bytes)
        } else {
            i32::from_le_bytes(bytes)
        };
        T::try_from(number).map_err(|_| unexpected(position, expected, number))
    }

    /// The next number of the item that is a `size_t` in a binary file.
    pub(super) fn size<T: FromStr + TryFrom<u64>>(
        &mut self,
        expected: &str,
    ) -> Result<T, Unexpected> {
        if let Self::Text { item, .. } = self {
            return item.number(expected);
        }
        let position = self.mark().position();
        let (bytes, big_endian) = self.take(expected)?;
        let number = if big_endian {
            u64::from_be_bytes(bytes)
        } else {
            u64::from_le_bytes(bytes)
        };
        T::try_from(number).map_err(|_| unexpected(position, expected, number))
    }

    /// The next number of the item that is a `double` in a binary file. It has to be finite.
    pub(super) fn real(&mut self, expected: &str) -> Result<f64, Unexpected> {
        if let Self::Text { item, .. } = self {
            return item.finite(expected);
        }
        let position = self.mark().position();
        let number = self.number(expected)?;
        if number.is_finite() {
            Ok(number)
        } else {
            Err(unexpected(position, expected, number))
        }
    }

    /// As [`Self::real`], finite or not.
    pub(super) fn number(&mut self, expected: &str) -> Result<f64, Unexpected> {
        if let Self::Text { item, .. } = self {
            return item.number(expected);
        }
        let (bytes, big_endian) = self.take(expected)?;
        Ok(if big_endian {
            f64::from_be_bytes(bytes)
        } else {
            f64::from_le_bytes(bytes)
        })
    }

    /// The next number of the item, which is not used: a `double` in a binary file.
    pub(super) fn unused(&mut self, expected: &str) -> Result<(), Unexpected> {
        match self {
            Self::Text { item, .. } => item.word(expected).map(drop),
            Self::Binary { .. } => self.take::<8>(expected).map(drop),
        }
    }

    /// Skips a list of numbers that ends an item: in a binary file, their number and as many numbers of the type `int`.
    /// In a text file the next item's line follows in any case.
    pub(super) fn skip_ints(&mut self, expected: &str) -> Result<(), Unexpected> {
        if self.is_binary() {
            for _ in 0..self.size::<u64>(expected)? {
                self.take::<4>(expected)?;
            }
        }
        Ok(())
    }

    /// Reads the number one, by which a binary file tells its byte order.
    pub(super) fn byte_order(&mut self) -> Result<(), Unexpected> {
        const EXPECTED: &str = "the number 1 in four bytes, which tells the byte order";
        let position = self.mark().position();
        let (bytes, _) = self.take::<4>(EXPECTED)?;
        let is_big = match bytes {
            [1, 0, 0, 0] => false,
            [0, 0, 0, 1] => true,
            _ => {
                let found = i32::from_le_bytes(bytes);
                return Err(unexpected(position, EXPECTED, found));
            }
        };
        if let Self::Binary { big_endian, .. } = self {
            *big_endian = is_big;
        }
        Ok(())
    }

    /// The next bytes of a binary file, and whether their order is that of big-endian numbers.
    fn take<const N: usize>(&mut self, expected: &str) -> Result<([u8; N], bool), Unexpected> {
        if let Self::Binary {
            file,
            at,
            big_endian,
        } = self
            && let Some((bytes, _)) = file.get(*at..).and_then(<[u8]>::split_first_chunk::<N>)
        {
            *at += N;
            return Ok((*bytes, *big_endian));
        }
        Err(self.ended(expected))
    }

    /// The error that the file has ended.
    fn ended(&self, expected: &str) -> Unexpected {
        unexpected(self.mark().position(), expected, "the end of the file")
    }
}

fn unexpected(position: FilePosition, expected: &str, found: impl Display) -> Unexpected {
    Unexpected {
        position,
        expected: expected.to_owned(),
        found: found.to_string(),
    }
}
