//! The mesh of a body: generated, or read from a file.

use super::notch::{self, Cuts};
use crate::scene::plausible::{EXTENT, EXTENT_OF_FILE, Warning};
use crate::scene::spec::{Body, MeshSource, PatternName, Rotation};
use crate::scene::{LoadedScene, SceneError};
use physics::Vec3;
use physics::mesh::generate::{self, Pattern};
use physics::mesh::generate_box::solid_box;
use physics::mesh::generate_plate::{plate_with_hole, quarter_plate_with_hole};
use physics::mesh::generate_thread::straight_thread;
use physics::mesh::{Bounds, Cells, Mesh, TriMesh};
use std::borrow::Cow;

/// The mesh of one body, with its notches.
pub(super) struct Notched<'a> {
    /// The mesh, placed in the world.
    pub(super) mesh: Cow<'a, Mesh>,
    /// The notches in it.
    pub(super) cuts: Cuts,
}

/// The mesh of one body, placed in the world, its elements in the file's order, with its notches.
///
/// # Errors
/// [`SceneError`], naming the file, line and field, for a mesh that cannot be made, or of a size that no scene means.
pub(super) fn build(loaded: &LoadedScene, index: usize) -> Result<Notched<'_>, SceneError> {
    let mut mesh = at_origin(loaded, index)?;
    let body = &loaded.scene.bodies[index];
    let mut scale = body.mesh.scale;
    let mut cuts = Cuts::default();
    if let Some(tear) = &body.tear {
        let whole = sheet(loaded, index, &mesh)?;
        if !tear.notches.is_empty() {
            let mut whole = whole.clone();
            // Notches are in metres.
            let scale = scale.take().unwrap_or(1.0);
            for vertex in &mut whole.positions {
                *vertex *= scale;
            }
            let (notched, made) = notch::cut(loaded, index, tear, &whole)?;
            mesh = Cow::Owned(Mesh::Sheet(notched));
            cuts = made;
        }
    }
    // A body that is not placed keeps its coordinates to the last bit, and the mesh of its file is not copied.
    if scale.is_some() || body.rotation.is_some() || body.position != [0.0; 3] {
        let scale = scale.unwrap_or(1.0);
        let position = Vec3::from(body.position);
        let turn = body.rotation.map(Rotation::matrix);
        for vertex in mesh.to_mut().positions_mut() {
            let scaled = *vertex * scale;
            *vertex = turn.map_or(scaled, |turn| turn * scaled) + position;
        }
    }
    extent(loaded, index, &mesh)?;
    Ok(Notched { mesh, cuts })
}

/// The triangles of a body that tears.
fn sheet<'a>(
    loaded: &LoadedScene,
    index: usize,
    mesh: &'a Mesh,
) -> Result<&'a TriMesh, SceneError> {
    let found = match mesh {
        Mesh::Sheet(sheet) => return Ok(sheet),
        Mesh::Thread(_) => "the tear of a thread",
        Mesh::Solid(_) => "the tear of a solid",
    };
    let field = format!("body[{index}].tear");
    let allowed = "no such table, because only sheets tear";
    Err(loaded.source.error(&field, found, allowed))
}

/// Judges the size of a body: the longest side of the box around its mesh.
///
/// # Errors
/// [`SceneError::Value`] for a body of a size that no scene means.
pub(super) fn extent(
    loaded: &LoadedScene,
    index: usize,
    mesh: &Mesh,
) -> Result<Option<Warning>, SceneError> {
    let Some(bounds) = Bounds::of(mesh.positions()) else {
        return Ok(None);
    };
    let spec = &loaded.scene.bodies[index].mesh;
    let (quantity, field) = match &spec.source {
        MeshSource::File(_) if spec.scale.is_some() => (EXTENT_OF_FILE, "scale"),
        MeshSource::File(_) => (EXTENT_OF_FILE, "file"),
        _ => (EXTENT, ""),
    };
    let field = format!("body[{index}].mesh.{field}");
    let field = field.trim_end_matches('.');
    let what = " along the longest side of the mesh";
    quantity.judge(&loaded.source, field, what, bounds.size().max())
}

/// A direction in the axes of a body's mesh, in world axes. A flat pattern has axes of its own, which do not turn.
pub(super) fn turned(body: &Body, mesh: &Mesh, direction: Vec3) -> Vec3 {
    let is_cut = matches!(mesh, Mesh::Sheet(mesh) if mesh.flat_pattern.is_some());
    match body.rotation {
        Some(rotation) if !is_cut => rotation.matrix() * direction,
        _ => direction,
    }
}

/// The mesh of one body in its own coordinates: those of the file, or those of the generator.
fn at_origin(loaded: &LoadedScene, index: usize) -> Result<Cow<'_, Mesh>, SceneError> {
    let spec = &loaded.scene.bodies[index].mesh;
    let mesh = match &spec.source {
        MeshSource::File(_) => Cow::Borrowed(from_file(loaded, index)?),
        generator => Cow::Owned(generated(loaded, index, generator)?),
    };
    match &*mesh {
        Mesh::Solid(linear) if spec.quadratic && matches!(linear.cells, Cells::Linear(_)) => {
            Ok(Cow::Owned(Mesh::Solid(linear.quadratic())))
        }
        Mesh::Thread(_) if spec.quadratic => {
            let field = format!("body[{index}].mesh.order");
            let found = "2 for a mesh of lines";
            Err(loaded.source.error(&field, found, "1: lines are linear"))
        }
        Mesh::Sheet(_) if spec.quadratic => {
            let field = format!("body[{index}].mesh.order");
            let found = "2 for a mesh of triangles";
            Err(loaded
                .source
                .error(&field, found, "1: triangles are linear"))
        }
        _ => Ok(mesh),
    }
}

/// The mesh that a generator makes.
fn generated(loaded: &LoadedScene, index: usize, source: &MeshSource) -> Result<Mesh, SceneError> {
    let field = |name: &str| format!("body[{index}].mesh.{name}");
    let refuse = |name: &str, found: &dyn std::fmt::Display, allowed: &str| {
        loaded
            .source
            .error(&field(name), found.to_string(), allowed)
    };
    Ok(match source {
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
        MeshSource::Thread { length, segments } => straight_thread(*length, *segments)
            .map(Mesh::Thread)
            .map_err(|e| refuse("thread", &e, "a thread with a length"))?,
        MeshSource::Box { size, cells } => solid_box(*size, *cells)
            .map(Mesh::Solid)
            .map_err(|e| refuse("box", &e, "a box with a volume"))?,
        MeshSource::File(_) => from_file(loaded, index)?.clone(),
    })
}

/// The mesh of the file that a body names, as it was loaded.
fn from_file(loaded: &LoadedScene, index: usize) -> Result<&Mesh, SceneError> {
    let field = format!("body[{index}].mesh.file");
    let file = loaded.meshes[index].as_ref().ok_or_else(|| {
        loaded
            .source
            .error(&field, "no file", "a file that was loaded")
    })?;
    file.mesh().map_err(|source| SceneError::Mesh {
        location: loaded.source.location(&field),
        path: file.path.clone(),
        source: Box::new(source.clone()),
    })
}
