//! Parts of a file as errors quote them.

/// Longest quotation of a text, in characters.
const SHOWN: usize = 40;

/// A text of the file as a quotation: on one line, in quotation marks, shortened if it is long.
pub(crate) fn quoted(text: &str) -> String {
    let shown = shortened(text);
    if shown.len() < text.len() {
        format!("{shown:?}...")
    } else {
        format!("{shown:?}")
    }
}

/// As [`quoted`], for bytes that may not be text.
pub(crate) fn quoted_bytes(bytes: &[u8]) -> String {
    // A character takes up to four bytes.
    let shown = bytes.get(..4 * (SHOWN + 1)).unwrap_or(bytes);
    quoted(&String::from_utf8_lossy(shown))
}

/// The beginning of a text, shortened to the length of a quotation.
pub(crate) fn shortened(text: &str) -> &str {
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => text.get(..end).unwrap_or_default(),
        None => text,
    }
}

/// The line of a byte, from one.
pub(crate) fn line_of(bytes: &[u8], offset: usize) -> usize {
    let before = bytes.get(..offset).unwrap_or(bytes);
    1 + newlines(before)
}

/// The number of line ends within these bytes.
pub(crate) fn newlines(bytes: &[u8]) -> usize {
    bytes.split(|&byte| byte == b'\n').skip(1).count()
}
