//! The packets of the Falcon, its FTDI chip and its driver, under a hostile device.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzz_rules::device::falcon(bytes);
});
