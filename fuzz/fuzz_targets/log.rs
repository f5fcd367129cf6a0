//! A log, whole or cut.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = host::log::read_log(bytes);
});
