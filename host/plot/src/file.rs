//! Writes a picture to a file, in the format that the ending of its name says.

use std::path::Path;

use crate::atomic_file::{AtomicFileError, write_atomically};

use super::picture::Picture;

/// Writes the picture to `path`: as PNG if the name ends in `.png`, and as SVG otherwise.
///
/// # Errors
/// The file cannot be written.
pub fn write_picture(path: &Path, picture: &Picture) -> Result<(), AtomicFileError> {
    let ending = path.extension();
    if !ending.is_some_and(|ending| ending.eq_ignore_ascii_case("png")) {
        return write_atomically(path, picture.svg().as_bytes());
    }
    let pixels = picture.png().map_err(|source| AtomicFileError {
        path: path.to_owned(),
        source,
    })?;
    write_atomically(path, &pixels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line_chart;

    #[test]
    fn the_ending_selects_the_format() {
        let folder = tempfile::tempdir().expect("a folder");
        let picture = line_chart("a & b", "x", "y", false, false, &[]);
        let written = |name: &str| {
            let path = folder.path().join(name);
            write_picture(&path, &picture).expect("written");
            std::fs::read(path).expect("there")
        };
        for name in ["x.svg", "x", "x.dat"] {
            assert_eq!(written(name), picture.svg().as_bytes(), "{name}");
        }
        for name in ["x.png", "x.PNG"] {
            let image = tiny_skia::Pixmap::decode_png(&written(name)).expect("a PNG");
            assert_eq!((image.width(), image.height()), (1440, 920));
        }
        // Every picture of a pair is the same.
        assert_eq!(written("x.png"), written("y.png"));
    }
}
