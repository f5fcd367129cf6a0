//! The driver of the firmware protocol over a stream, under a hostile device.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzz_rules::device::firmware_host(bytes);
});
