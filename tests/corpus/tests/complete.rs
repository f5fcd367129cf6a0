//! No input is lost, in an archive or on the path into it.

use std::collections::BTreeSet;
use std::{fs, io};

/// The least number of inputs in each target's corpus. The fuzzers only add to them.
const AT_LEAST: [(&str, usize); 21] = [
    ("connection", 130),
    ("device", 1),
    ("falcon", 409),
    ("falcon_boot", 177),
    ("firmware_device", 417),
    ("firmware_host", 472),
    ("gmsh", 271),
    ("log", 1),
    ("log_player", 1),
    ("obj", 471),
    ("plugin_state", 146),
    ("profile", 278),
    ("recording", 197),
    ("reports", 12),
    ("scene", 124),
    ("solid", 350),
    ("sysfs", 200),
    ("view_message", 1),
    ("vtk_legacy", 297),
    ("vtk_xml", 345),
    ("woodenhaptics", 278),
];

#[test]
fn every_archive_holds_the_inputs_that_were_found() -> io::Result<()> {
    for (target, at_least) in AT_LEAST {
        let corpus = corpus::corpus(target)?;
        assert!(
            corpus.len() >= at_least,
            "{target}: {} inputs, expected {at_least} or more",
            corpus.len()
        );
        let names: BTreeSet<_> = corpus.iter().map(|input| &input.name).collect();
        assert_eq!(names.len(), corpus.len(), "{target}: a name is there twice");
        for input in &corpus {
            let plain = !input.name.is_empty() && !input.name.contains('/');
            assert!(plain, "{target}: {} is no plain file name", input.name);
        }
        assert!(!corpus::seeds(target)?.is_empty(), "{target}: no seeds");
    }
    Ok(())
}

#[test]
fn every_target_has_an_archive() -> io::Result<()> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fuzz/fuzz_targets");
    let mut targets = BTreeSet::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if let Some(name) = path.file_stem() {
            targets.insert(name.to_string_lossy().into_owned());
        }
    }
    let known: BTreeSet<_> = AT_LEAST.map(|(target, _)| target.to_owned()).into();
    assert_eq!(targets, known);
    Ok(())
}

#[test]
fn an_input_or_a_target_that_is_not_there_is_an_error_with_its_name() {
    let error = corpus::named("log", "nothing").expect_err("there is none");
    assert!(error.to_string().contains("nothing"), "{error}");
    let error = corpus::inputs("nowhere").expect_err("there is none");
    assert!(error.to_string().contains("nowhere"), "{error}");
}
