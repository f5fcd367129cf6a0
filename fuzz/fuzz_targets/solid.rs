//! A mesh file of any format, which follows from how it begins: what is accepted is a mesh, and what is
//! accepted as a sheet is that sheet.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzz_rules::mesh::solid(bytes);
});
