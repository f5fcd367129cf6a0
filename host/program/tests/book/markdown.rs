//! Pages of Markdown: their fenced blocks with the comments before them, and the prose around them.

use std::fs;
use std::path::Path;

/// A page.
pub(super) struct Page {
    /// The name of the file.
    pub(super) name: String,
    /// The blocks and comments, in the order of the page.
    pub(super) parts: Vec<Part>,
    text: String,
}

/// A comment or a block of a page.
pub(super) struct Part {
    /// The line of the page, counted from 1.
    pub(super) line: usize,
    /// The content.
    pub(super) kind: Kind,
}

/// The kinds of parts.
pub(super) enum Kind {
    /// The text of a comment.
    Comment(String),
    /// A fenced block: its language, which may be empty, and its text.
    Block(String, String),
}

impl Page {
    /// Reads a page.
    pub(super) fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).unwrap();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let mut parts = Vec::new();
        let mut block: Option<(usize, String, String)> = None;
        for (line, content) in (1..).zip(text.lines()) {
            let trimmed = content.trim();
            if let Some(fence) = trimmed.strip_prefix("```") {
                block = match block {
                    None => Some((line, fence.to_owned(), String::new())),
                    Some((line, language, text)) => {
                        let kind = Kind::Block(language, text);
                        parts.push(Part { line, kind });
                        None
                    }
                };
            } else if let Some((_, _, text)) = &mut block {
                text.push_str(content);
                text.push('\n');
            } else if let Some(comment) = comment(trimmed) {
                let kind = Kind::Comment(comment.to_owned());
                parts.push(Part { line, kind });
            }
        }
        assert!(block.is_none(), "{name}: a block has no end");
        Self { name, parts, text }
    }

    /// The text outside blocks and outside `code`.
    pub(super) fn prose(&self) -> String {
        let outside = self.text.split("\n```").step_by(2);
        let spans = outside.flat_map(|text| text.split('`').step_by(2));
        spans.collect()
    }
}

fn comment(line: &str) -> Option<&str> {
    Some(line.strip_prefix("<!--")?.strip_suffix("-->")?.trim())
}
