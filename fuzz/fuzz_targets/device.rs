//! A device's file: what is refused is refused in one line.
#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| {
    fuzz_rules::scene::device(text);
});
