//! A text as lines of fields, with errors that name the position.

use crate::error::{FilePosition, MeshFileError};
use crate::text::quoted;
use std::str::FromStr;

/// A line does not hold the expected text.
#[derive(Debug)]
pub(crate) struct Unexpected {
    /// Where.
    pub(crate) position: FilePosition,
    pub(crate) expected: String,
    pub(crate) found: String,
}

/// The lines of a text that are not blank, each with its number.
pub(crate) struct Lines<'a> {
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
    /// The number of the last line returned, from one; zero before the first.
    last: usize,
}

/// The rest of one line.
#[derive(Clone, Copy)]
pub(crate) struct Fields<'a> {
    /// The line's number, from one; in a file that is not text, the byte where the line begins, from zero.
    pub(crate) at: usize,
    is_byte: bool,
    rest: &'a str,
}

impl<'a> Lines<'a> {
    pub(crate) fn new(text: &'a str) -> Self {
        Self {
            lines: text.lines().enumerate(),
            last: 0,
        }
    }

    /// The number of the last line returned.
    pub(crate) fn last(&self) -> usize {
        self.last
    }

    /// The next line that is not blank, if any.
    pub(crate) fn next(&mut self) -> Option<Fields<'a>> {
        for (index, text) in self.lines.by_ref() {
            self.last = index + 1;
            let line = Fields::at_line(self.last, text);
            if !line.rest.is_empty() {
                return Some(line);
            }
        }
        None
    }

    /// The next line that is not blank. Without one, the error names `expected`.
    pub(crate) fn expect(&mut self, expected: &str) -> Result<Fields<'a>, Unexpected> {
        self.next().ok_or_else(|| Unexpected {
            position: FilePosition::Line(self.last.max(1)),
            expected: expected.to_owned(),
            found: "the end of the file".to_owned(),
        })
    }
}

impl<'a> Fields<'a> {
    /// The text of a line that begins at a byte of a file that is not text.
    pub(crate) fn at_byte(at: usize, text: &'a str) -> Self {
        Self {
            at,
            is_byte: true,
            rest: text.trim(),
        }
    }

    /// The text of a line with this number.
    pub(crate) fn at_line(at: usize, text: &'a str) -> Self {
        Self {
            is_byte: false,
            ..Self::at_byte(at, text)
        }
    }

    /// The position of the line.
    pub(crate) fn position(&self) -> FilePosition {
        if self.is_byte {
            FilePosition::Byte(self.at)
        } else {
            FilePosition::Line(self.at)
        }
    }

    /// The rest of the line, without blanks at either end.
    pub(crate) fn rest(&self) -> &'a str {
        self.rest
    }

    /// The error that the rest of the line is not `expected`.
    pub(crate) fn unexpected(&self, expected: &str) -> Unexpected {
        let found = if self.rest.is_empty() {
            "the end of the line".to_owned()
        } else {
            quoted(self.rest)
        };
        Unexpected {
            position: self.position(),
            expected: expected.to_owned(),
            found,
        }
    }

    /// The next field as text.
    pub(crate) fn word(&mut self, expected: &str) -> Result<&'a str, Unexpected> {
        if self.rest.is_empty() {
            return Err(self.unexpected(expected));
        }
        let (word, rest) = self
            .rest
            .split_once(char::is_whitespace)
            .unwrap_or((self.rest, ""));
        self.rest = rest.trim_start();
        Ok(word)
    }

    /// The next field as a number.
    pub(crate) fn number<T: FromStr>(&mut self, expected: &str) -> Result<T, Unexpected> {
        let word = self.word(expected)?;
        word.parse().map_err(|_| {
            Fields {
                rest: word,
                ..*self
            }
            .unexpected(expected)
        })
    }

    /// The next field as a count. An error quotes the rest of the line.
    pub(crate) fn count(&mut self, expected: &str) -> Result<usize, Unexpected> {
        let before = *self;
        let word = self.word(expected)?;
        word.parse().map_err(|_| before.unexpected(expected))
    }

    /// The next field as a finite number.
    pub(crate) fn finite(&mut self, expected: &str) -> Result<f64, Unexpected> {
        let word = self.word(expected)?;
        let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| {
            Fields {
                rest: word,
                ..*self
            }
            .unexpected(expected)
        })
    }

    /// Checks that the line has ended.
    pub(crate) fn end(&self) -> Result<(), Unexpected> {
        if self.rest.is_empty() {
            Ok(())
        } else {
            Err(self.unexpected("the end of the line"))
        }
    }
}

impl From<Unexpected> for MeshFileError {
    fn from(error: Unexpected) -> Self {
        Self::Syntax {
            position: error.position,
            expected: error.expected,
            found: error.found,
        }
    }
}
