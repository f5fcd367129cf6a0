//! A scene's text: what is refused is refused in one line.
#![no_main]

use host::scene::Scene;

libfuzzer_sys::fuzz_target!(|text: &str| {
    if let Err(error) = Scene::parse(text, "scene.toml") {
        assert!(!error.to_string().contains('\n'), "an error is one line");
    }
});
