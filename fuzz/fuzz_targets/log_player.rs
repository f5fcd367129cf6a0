//! A log that is played back.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzz_rules::log::play(bytes);
});
