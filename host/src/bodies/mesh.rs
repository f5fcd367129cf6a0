//! The mesh of a body: generated, or read from a file.

use crate::scene::spec::{MeshSource, PatternName};
use crate::scene::{LoadedScene, SceneError};
use physics::mesh::generate::{self, Pattern};
use physics::mesh::generate_box::solid_box;
use physics::mesh::generate_plate::{plate_with_hole, quarter_plate_with_hole};
use physics::mesh::{Cells, Mesh};

/// The mesh of one body. Its elements are in the order of the file.
pub(super) fn build(loaded: &LoadedScene, index: usize) -> Result<Mesh, SceneError> {
    let spec = &loaded.scene.bodies[index].mesh;
    let field = |name: &str| format!("body[{index}].mesh.{name}");
    let refuse = |name: &str, found: &dyn std::fmt::Display, allowed: &str| {
        loaded
            .source
            .error(&field(name), found.to_string(), allowed)
    };
    let mesh = match &spec.source {
        MeshSource::Sheet {
            length,
            width,
            cells: [nx, ny],
            pattern,
        } => {
            let pattern = match pattern {
                PatternName::Regular => Pattern::Regular,
                PatternName::Alternating => Pattern::Alternating,
            };
            generate::sheet(*length, *width, *nx, *ny, pattern)
                .map(Mesh::Sheet)
                .map_err(|e| refuse("sheet", &e, "a sheet with an area"))?
        }
        MeshSource::Plate { plate, quarter } => {
            let made = if *quarter {
                quarter_plate_with_hole(plate)
            } else {
                plate_with_hole(plate)
            };
            made.map(Mesh::Sheet)
                .map_err(|e| refuse("plate", &e, "a plate around its hole"))?
        }
        MeshSource::Box { size, cells } => solid_box(*size, *cells)
            .map(Mesh::Solid)
            .map_err(|e| refuse("box", &e, "a box with a volume"))?,
        MeshSource::File(name) => {
            let file = loaded.meshes[index].as_ref();
            let bytes = file.map_or(&[][..], |file| &file.bytes);
            meshio::read_mesh(name, bytes).map_err(|source| SceneError::Mesh {
                place: loaded.source.place(&field("file")),
                path: file.map_or_else(|| name.into(), |file| file.path.clone()),
                source: Box::new(source),
            })?
        }
    };
    match mesh {
        Mesh::Solid(mesh) if spec.quadratic && matches!(mesh.cells, Cells::Linear(_)) => {
            Ok(Mesh::Solid(mesh.quadratic()))
        }
        Mesh::Sheet(_) if spec.quadratic => {
            let allowed = "1: triangles are linear";
            Err(refuse("order", &"2 for a mesh of triangles", allowed))
        }
        mesh => Ok(mesh),
    }
}
