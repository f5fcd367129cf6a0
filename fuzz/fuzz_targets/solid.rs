//! A mesh file of any format, which follows from how it begins: what is accepted is a mesh, and what is
//! accepted as a sheet is that sheet.
#![no_main]

use meshio::{read, read_mesh};
use physics::mesh::Mesh;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mesh = read_mesh("mesh", bytes);
    match &mesh {
        Ok(Mesh::Thread(mesh)) => mesh.validate().expect("what is read is valid"),
        Ok(Mesh::Sheet(mesh)) => mesh.validate().expect("what is read is valid"),
        Ok(Mesh::Solid(mesh)) => mesh.validate().expect("what is read is valid"),
        Err(error) => assert!(!error.to_string().contains('\n'), "an error is one line"),
    }
    if let Ok(sheet) = read("mesh", bytes) {
        assert_eq!(mesh, Ok(Mesh::Sheet(sheet)));
    }
});
