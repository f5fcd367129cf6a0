//! The upload of the Falcon's firmware, under a hostile boot loader.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzz_rules::device::falcon_boot(bytes);
});
