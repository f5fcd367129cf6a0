//! The connection of a device in a scene.
#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| {
    fuzz_rules::device::connection(text);
});
