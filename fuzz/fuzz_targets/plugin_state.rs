//! The state and the capabilities that a plug-in fills in.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzz_rules::device::plugin_state(bytes);
});
