//! The reports and the driver of WoodenHaptics, under a hostile device.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzz_rules::device::woodenhaptics(bytes);
});
