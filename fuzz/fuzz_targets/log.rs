//! A log, whole or cut.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzz_rules::log::read(bytes);
});
