//! Pieces of a file as errors show them.

/// Found text longer than this many characters is shortened.
const SHOWN: usize = 40;

/// Found text: on one line, quoted, not too long.
pub(crate) fn quoted(text: &str) -> String {
    let shown = shortened(text);
    if shown.len() < text.len() {
        format!("{shown:?}...")
    } else {
        format!("{shown:?}")
    }
}

/// As [`quoted`], for bytes that may be no text.
pub(crate) fn quoted_bytes(bytes: &[u8]) -> String {
    // A character takes up to four bytes.
    let shown = bytes.get(..4 * (SHOWN + 1)).unwrap_or(bytes);
    quoted(&String::from_utf8_lossy(shown))
}

/// The start of a text, as much as an error shows.
pub(crate) fn shortened(text: &str) -> &str {
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => text.get(..end).unwrap_or_default(),
        None => text,
    }
}

/// The line, from one, in which a byte stands.
pub(crate) fn line_of(bytes: &[u8], offset: usize) -> usize {
    let before = bytes.get(..offset).unwrap_or(bytes);
    1 + newlines(before)
}

/// How many lines end within these bytes.
pub(crate) fn newlines(bytes: &[u8]) -> usize {
    bytes.split(|&byte| byte == b'\n').skip(1).count()
}
