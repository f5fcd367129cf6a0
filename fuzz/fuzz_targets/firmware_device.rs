//! A device of the firmware protocol under a hostile host: no force but that of a sound wrench.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzz_rules::device::firmware_device(bytes);
});
