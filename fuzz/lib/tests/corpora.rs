//! Replays the corpora of the fuzzers, without fuzzing tools. Those of the devices are replayed in `rt_core/devices/tests`,
//! beside what `tests/mutants` plants faults in.
//!
//! The least numbers of inputs that reach the rules are about half of those of the present corpora.

use fuzz_rules::{log, mesh, report, scene};
use host::log::read_log;
use std::io;

/// Runs a rule on all inputs of its target. At least `reached` inputs must reach what the rule is about.
fn replay(target: &str, reached: usize, rule: impl Fn(&[u8]) -> usize) -> io::Result<()> {
    let inputs = corpus::inputs(target)?;
    let mut count = 0;
    for input in &inputs {
        // A panic of the rule is shown below the name of its input.
        println!("{target}: {}", input.name);
        count += usize::from(rule(&input.bytes) > 0);
    }
    let all = inputs.len();
    println!("{target}: {count} of {all}");
    assert!(
        count >= reached,
        "{target}: {count} of {all} inputs, expected {reached}"
    );
    Ok(())
}

/// Runs a rule of texts.
fn replay_text(target: &str, reached: usize, rule: impl Fn(&str) -> usize) -> io::Result<()> {
    replay(target, reached, |bytes| {
        rule(&String::from_utf8_lossy(bytes))
    })
}

#[test]
fn reports() -> io::Result<()> {
    // A report of each kind is among the seeds.
    replay("reports", 7, report::reports)
}

#[test]
fn meshes() -> io::Result<()> {
    replay("gmsh", 1, mesh::gmsh)?;
    replay("obj", 15, mesh::obj)?;
    replay("vtk_legacy", 4, mesh::vtk_legacy)?;
    replay("vtk_xml", 21, mesh::vtk_xml)?;
    replay("solid", 18, mesh::solid)
}

#[test]
fn scenes_and_their_files() -> io::Result<()> {
    replay_text("scene", 1, scene::scene)?;
    replay_text("device", 1, scene::device)?;
    replay_text("recording", 2, scene::recording)
}

#[test]
fn logs_and_messages() -> io::Result<()> {
    replay("log", 1, log::read)?;
    replay("log", 1, log::play)?;
    replay("log_player", 1, log::play)?;
    replay("view_message", 7, log::message)
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
