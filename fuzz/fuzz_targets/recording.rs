//! A recorded motion: what is accepted has ascending times and finite numbers.
#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| {
    fuzz_rules::scene::recording(text);
});
