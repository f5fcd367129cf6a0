//! A message from a run to its viewer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzz_rules::log::message(bytes);
});
