//! The corpus of the fuzzers is read again without fuzzing tools: no panic, and errors of one line.

use corpus::inputs;
use host::log::read_log;
use host::scene::{Scene, recording};
use std::io;

#[test]
fn no_scene_of_the_corpus_panics() -> io::Result<()> {
    for input in inputs("scene")? {
        let text = String::from_utf8_lossy(&input.bytes);
        if let Err(error) = Scene::parse(&text, "scene.toml") {
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    }
    Ok(())
}

#[test]
fn no_device_file_of_the_corpus_panics() -> io::Result<()> {
    for input in inputs("device")? {
        let text = String::from_utf8_lossy(&input.bytes);
        if let Err(error) = sim::DeviceFile::parse(&text) {
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    }
    Ok(())
}

#[test]
fn no_recording_of_the_corpus_panics() -> io::Result<()> {
    for input in inputs("recording")? {
        let text = String::from_utf8_lossy(&input.bytes);
        if let Err(error) = recording::parse(&text, "hand.csv") {
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    }
    Ok(())
}

#[test]
fn no_log_of_the_corpus_panics() -> io::Result<()> {
    for input in inputs("log")? {
        let _ = read_log(&input.bytes);
    }
    Ok(())
}

#[test]
fn a_log_that_is_cut_anywhere_gives_the_ticks_before_its_end() -> io::Result<()> {
    let seeds = corpus::seeds("log")?;
    let whole = &seeds
        .iter()
        .find(|seed| seed.name == "short_log")
        .expect("a seed of that name")
        .bytes;
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
    let input = corpus::named("log", "record_beyond_its_chunk")?;
    let error = read_log(&input.bytes).expect_err("the file is damaged");
    let text = error.to_string();
    assert!(text.starts_with("the log is damaged at byte"), "{text}");
    Ok(())
}
