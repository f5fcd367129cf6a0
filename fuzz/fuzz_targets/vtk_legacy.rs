//! A mesh file: what is accepted is a mesh.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    match meshio::vtk_legacy::parse(bytes) {
        Ok(mesh) => mesh.validate().expect("what is read is valid"),
        Err(error) => assert!(!error.to_string().contains('\n'), "an error is one line"),
    }
});
