//! A mesh file: what is accepted is a mesh, with and without a flat pattern.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzz_rules::mesh::obj(bytes);
});
