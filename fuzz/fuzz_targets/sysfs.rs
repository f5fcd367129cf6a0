//! What the kernel tells of a HID device.
#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| {
    fuzz_rules::device::sysfs(text);
});
