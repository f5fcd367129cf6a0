//! What the fuzzers found worth keeping is read again, without fuzzing tools: no panic, one-line errors.

use host::log::read_log;
use host::scene::{Scene, recording};
use std::path::Path;
use std::{fs, io};

const FUZZ: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../fuzz");

/// All files of a target.
fn files(target: &str) -> io::Result<Vec<Vec<u8>>> {
    let mut files = Vec::new();
    for folder in ["seeds", "corpus"] {
        for entry in fs::read_dir(Path::new(FUZZ).join(folder).join(target))? {
            files.push(fs::read(entry?.path())?);
        }
    }
    assert!(!files.is_empty(), "{target}: no files");
    Ok(files)
}

#[test]
fn scenes() -> io::Result<()> {
    for bytes in files("scene")? {
        let text = String::from_utf8_lossy(&bytes);
        if let Err(error) = Scene::parse(&text, "scene.toml") {
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    }
    Ok(())
}

#[test]
fn devices() -> io::Result<()> {
    for bytes in files("device")? {
        let text = String::from_utf8_lossy(&bytes);
        if let Err(error) = sim::DeviceFile::parse(&text) {
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    }
    Ok(())
}

#[test]
fn recordings() -> io::Result<()> {
    for bytes in files("recording")? {
        let text = String::from_utf8_lossy(&bytes);
        if let Err(error) = recording::parse(&text, "hand.csv") {
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    }
    Ok(())
}

#[test]
fn logs() -> io::Result<()> {
    for bytes in files("log")? {
        let _ = read_log(&bytes);
    }
    Ok(())
}

#[test]
fn a_log_that_is_cut_anywhere_gives_the_ticks_before_its_end() -> io::Result<()> {
    let whole = fs::read(Path::new(FUZZ).join("seeds/log/short_log"))?;
    let mut last = 0;
    for end in (0..whole.len()).step_by(7) {
        let rows = read_log(&whole[..end]).map_or(0, |rows| rows.len());
        assert!(rows >= last, "a longer file gives no fewer ticks");
        last = rows;
    }
    assert!(last > 0);
    Ok(())
}

#[test]
fn a_record_that_reaches_beyond_its_chunk_is_an_error() -> io::Result<()> {
    let bytes = fs::read(Path::new(FUZZ).join("corpus/log/record_beyond_its_chunk"))?;
    let error = read_log(&bytes).expect_err("the file is damaged");
    let text = error.to_string();
    assert!(
        text.starts_with("not an MCAP file, or a damaged one"),
        "{text}"
    );
    Ok(())
}
