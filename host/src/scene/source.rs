//! The text of a scene, kept to say where a field stands in it.

use super::error::{Place, SceneError};
use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// Longest piece of a file that an error quotes, in characters.
const QUOTED: usize = 60;
/// Longest statement of what was found, in characters.
const LONGEST: usize = 400;

/// A scene's text and the name it goes by in messages.
#[derive(Clone, Debug)]
pub struct Source {
    /// The file as the person named it.
    pub name: String,
    /// What it says.
    pub text: String,
}

impl Source {
    /// An error about a field, such as `body[0].material.young`, found once the scene was read.
    pub fn error(
        &self,
        field: &str,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> SceneError {
        SceneError::Value {
            place: self.place(field),
            found: cut(&found.into(), LONGEST),
            allowed: allowed.into(),
        }
    }

    /// Where a field stands: its line, or that of the innermost table that should hold it.
    pub fn place(&self, field: &str) -> Place {
        // The text is parsed again, which is cheap and leaves the scene's types plain.
        let (root, _) = DeTable::parse_recoverable(&self.text);
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
            // A table that only dotted keys mention has no place of its own.
            if !next.span().is_empty() {
                span = next.span();
            }
            value = next.get_ref();
        }
        self.place_at(field, span.start)
    }

    /// The place of a field that begins at a byte.
    pub(super) fn place_at(&self, field: &str, byte: usize) -> Place {
        let before = &self.text.as_bytes()[..byte.min(self.text.len())];
        Place {
            file: self.name.clone(),
            line: before.split(|&b| b == b'\n').count(),
            field: cut(field, 2 * QUOTED),
        }
    }

    /// What the file says there: one line of it, cut short where it is long.
    pub(super) fn quote(&self, span: Range<usize>) -> String {
        quoted(self.text.get(span).unwrap_or_default())
    }
}

/// A piece of a file, fit for a message.
pub(super) fn quoted(text: &str) -> String {
    if text.trim().is_empty() {
        "nothing".to_owned()
    } else {
        cut(text, QUOTED)
    }
}

/// A text from outside, fit for a message: one line, without control characters, not too long.
pub(crate) fn cut(text: &str, most: usize) -> String {
    let text = text.trim();
    let line = text.lines().next().unwrap_or_default();
    let mut chars = line.chars().map(|c| if c.is_control() { '?' } else { c });
    let mut kept: String = chars.by_ref().take(most).collect();
    if chars.next().is_some() || line.len() < text.len() {
        kept.push_str("...");
    }
    kept
}
