//! A scene's text: what is refused is refused in one line.
#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| {
    fuzz_rules::scene::scene(text);
});
