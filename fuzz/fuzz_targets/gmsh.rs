//! A mesh file: what is accepted is a mesh.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    fuzz_rules::mesh::gmsh(bytes);
});
