//! The text of a scene, kept to find the line of each field.

use super::error::{SceneError, SourceLocation};
use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// Longest part of a file that an error quotes, in characters.
const QUOTED: usize = 60;
/// Longest description of the value found, in characters.
const LONGEST: usize = 400;

/// The text of a scene, and the name of the scene in messages.
#[derive(Clone, Debug)]
pub struct Source {
    /// The name of the file, as the user gave it.
    pub name: String,
    /// The content of the file, with the overrides of the run.
    pub text: String,
    /// The content of the file itself, if there are overrides. Messages name its lines.
    file: Option<String>,
    /// Whether messages name the column, too.
    columns: bool,
}

impl Source {
    /// The text of a file.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            text: text.into(),
            file: None,
            columns: false,
        }
    }

    /// The same file, whose messages name the column, too.
    pub(super) fn with_columns(self) -> Self {
        Self {
            columns: true,
            ..self
        }
    }

    /// The same file with `text` in place of its content. Messages still name the lines of the file.
    pub(super) fn edited(&self, text: String) -> Self {
        let file = self.file.as_ref().unwrap_or(&self.text);
        Self {
            name: self.name.clone(),
            text,
            file: Some(file.clone()),
            columns: self.columns,
        }
    }

    /// An error about a field, such as `body[0].material.young`, that is found after the scene was read.
    pub fn error(
        &self,
        field: &str,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> SceneError {
        SceneError::Value {
            location: self.location(field),
            found: cut(&found.into(), LONGEST),
            allowed: allowed.into(),
        }
    }

    /// An error about a field whose fault is a sentence, and not a value.
    pub fn problem(&self, field: &str, problem: impl Into<String>) -> SceneError {
        SceneError::Malformed {
            location: self.location(field),
            problem: problem.into(),
        }
    }

    /// An error about a field that a table such as `body[0].material` needs and lacks, if only the rest of the scene
    /// tells that the table needs the field.
    pub fn missing(&self, table: &str, name: &str) -> SceneError {
        SceneError::Missing {
            location: self.location(table),
            name: format!("`{name}`"),
        }
    }

    /// The location of a field: its line, or the line of the innermost table that should hold it.
    pub fn location(&self, field: &str) -> SourceLocation {
        // The text is parsed again. This is cheap, and the types of the scene need no positions.
        let text = self.file.as_ref().unwrap_or(&self.text);
        let (root, _) = DeTable::parse_recoverable(text);
        let mut span = root.span();
        let root = DeValue::Table(root.into_inner());
        let mut value = &root;
        for step in field
            .split(['.', '['])
            .map(|step| step.trim_end_matches(']'))
        {
            let next = match step.parse::<usize>() {
                Ok(index) => value.get(index),
                Err(_) => value.get(step),
            };
            let Some(next) = next else { break };
            // A table that is defined by dotted keys only has no location of its own.
            if !next.span().is_empty() {
                span = next.span();
            }
            value = next.get_ref();
        }
        self.location_in(text, field, span.start)
    }

    /// The location of a field that begins at a byte of the text.
    pub(super) fn location_at(&self, field: &str, byte: usize) -> SourceLocation {
        self.location_in(&self.text, field, byte)
    }

    fn location_in(&self, text: &str, field: &str, byte: usize) -> SourceLocation {
        let before = &text.as_bytes()[..byte.min(text.len())];
        let line = before.rsplit(|&b| b == b'\n').next().unwrap_or_default();
        let column = 1 + String::from_utf8_lossy(line).chars().count();
        SourceLocation {
            file: self.name.clone(),
            line: before.split(|&b| b == b'\n').count(),
            column: self.columns.then_some(column),
            field: cut(field, 2 * QUOTED),
        }
    }

    /// The line of the file that contains a byte, shortened if it is long.
    pub(super) fn line_at(&self, byte: usize) -> String {
        let start = byte.min(self.text.len());
        let before = self.text.get(..start).unwrap_or_default();
        let first = before.rfind('\n').map_or(0, |end| end + 1);
        let rest = self.text.get(first..).unwrap_or_default();
        quoted(rest.lines().next().unwrap_or_default())
    }

    /// The text of the file within `span`: its first line, shortened if it is long.
    pub(super) fn quote(&self, span: Range<usize>) -> String {
        quoted(self.text.get(span).unwrap_or_default())
    }
}

/// A part of a file as a message quotes it.
pub(super) fn quoted(text: &str) -> String {
    if text.trim().is_empty() {
        "nothing".to_owned()
    } else {
        cut(text, QUOTED)
    }
}

/// A text from outside as a message quotes it: one line of at most `most` characters, without control characters.
pub fn cut(text: &str, most: usize) -> String {
    let text = text.trim();
    let line = text.lines().next().unwrap_or_default();
    let mut chars = line.chars();
    let mut kept = printable(&chars.by_ref().take(most).collect::<String>());
    if chars.next().is_some() || line.len() < text.len() {
        kept.push_str("...");
    }
    kept
}

/// A text from outside without control characters, which a terminal would obey: a question mark stands for each.
pub fn printable(text: &str) -> String {
    text.replace(char::is_control, "?")
}
