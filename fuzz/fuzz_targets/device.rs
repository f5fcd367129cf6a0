//! A device's file: what is refused is refused in one line.
#![no_main]

use sim::DeviceFile;

libfuzzer_sys::fuzz_target!(|text: &str| {
    if let Err(error) = DeviceFile::parse(text) {
        assert!(!error.to_string().contains('\n'), "an error is one line");
    }
});
