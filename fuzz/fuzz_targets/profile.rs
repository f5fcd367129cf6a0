//! The profile of a device, with identified numbers written into it.
#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| {
    fuzz_rules::device::profile(text);
});
