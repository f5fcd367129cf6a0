//! A mesh file: what is accepted is a mesh, with and without a flat pattern.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    match meshio::obj::parse(bytes) {
        Ok(mesh) => mesh.validate().expect("what is read is valid"),
        Err(error) => assert!(!error.to_string().contains('\n'), "an error is one line"),
    }
    match meshio::obj::parse_with_pattern(bytes, 0.01) {
        Ok(mesh) => mesh.validate().expect("what is read is valid"),
        Err(error) => assert!(!error.to_string().contains('\n'), "an error is one line"),
    }
});
