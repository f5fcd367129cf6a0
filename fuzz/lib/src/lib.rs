//! What must hold for any bytes from outside: the rules of the fuzz targets (`fuzz/fuzz_targets`), and of the tests that
//! replay on stable Rust what the fuzzers found.
//!
//! A rule is a function of one input. The function panics if the input breaks the rule, and returns how often the input
//! reached what the rule is about, so that a test can demand that its inputs are not all refused at the door. The rules
//! call public interfaces only.
//!
//! - [`device`]: drivers, protocols, connections and profiles of devices.
//! - [`report`]: the reports of the firmware protocol.
//! - [`mesh`], [`scene`]: the files of a person.
//! - [`log`]: logs, and the messages from a run to its viewer.
//! - [`changed`]: sound inputs, changed at random.
//! - [`synthetic`]: a made-up run, for the tests of the viewer.

pub mod changed;
pub mod device;
#[cfg(feature = "host")]
pub mod log;
#[cfg(feature = "host")]
pub mod mesh;
pub mod report;
#[cfg(feature = "host")]
pub mod scene;
#[cfg(feature = "host")]
pub mod sound;
#[cfg(feature = "host")]
pub mod synthetic;

/// Checks the error of a reader: a person is shown one line.
#[cfg(feature = "host")]
fn is_one_line(error: &dyn std::error::Error) {
    let text = error.to_string();
    assert!(!text.contains('\n'), "an error is one line: {text}");
}
