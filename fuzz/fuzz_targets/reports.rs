//! Reports from and to a device, and streams of them: what is accepted is written again as it was.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzz_rules::report::reports(bytes);
});
