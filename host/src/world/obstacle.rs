//! The obstacles of the physics, from those of a scene.

use crate::scene::plausible::EXTENT_OF_FILE;
use crate::scene::poses::FASTEST;
use crate::scene::spec::contact::ObstacleMesh;
use crate::scene::spec::{self, Rotation};
use crate::scene::{LoadedScene, MeshFile, SceneError};
use nalgebra::{Isometry3, UnitQuaternion};
use physics::Vec3;
use physics::contact::Obstacle;
use physics::contact::obstacle::{ClosedMesh, Frames, Geometry, Motion, ObstacleError};
use physics::mesh::{Bounds, Mesh};

/// Builds the obstacle number `index` of those that the scene gives.
///
/// # Errors
/// [`SceneError`] at the field of the mesh: for a mesh that is open or inverted or no surface, and for frames that differ
/// in their triangles or jump.
pub(super) fn build(loaded: &LoadedScene, index: usize) -> Result<Obstacle, SceneError> {
    let spec = &loaded.scene.obstacles[index];
    let files = &loaded.obstacles[index];
    let refuse = |error: ObstacleError| {
        let field = format!("obstacle[{index}]");
        let allowed = "an obstacle that can move so";
        loaded.source.error(&field, error.to_string(), allowed)
    };
    let motion = match &files.poses {
        Some(rows) => Motion::Poses(rows.clone()),
        None => Motion::Still(pose(spec)),
    };
    match (&spec.mesh, spec.shape()) {
        (Some(mesh), _) => animated(loaded, index, mesh, motion).and_then(|(geometry, motion)| {
            Obstacle::new(Geometry::Mesh(geometry), motion).map_err(refuse)
        }),
        (None, Some(shape)) => Obstacle::new(Geometry::Shape(shape), motion).map_err(refuse),
        // The consistency of the scene was checked: an obstacle without a mesh has a shape.
        (None, None) => Err(refuse(ObstacleError::Empty)),
    }
}

/// The pose of an obstacle that follows no table.
fn pose(spec: &spec::Obstacle) -> Isometry3<f64> {
    let turn = (spec.rotation).map_or_else(UnitQuaternion::identity, Rotation::quaternion);
    Isometry3::from_parts(spec.position.unwrap_or_default().into(), turn)
}

/// The mesh of an obstacle, and its motion: frames if it has them, otherwise `motion`.
fn animated(
    loaded: &LoadedScene,
    index: usize,
    spec: &ObstacleMesh,
    motion: Motion,
) -> Result<(ClosedMesh, Motion), SceneError> {
    let field = format!("obstacle[{index}].mesh.file");
    let mut frames = Vec::new();
    let mut triangles = Vec::new();
    for (number, file) in loaded.obstacles[index].frames.iter().enumerate() {
        let (positions, found) = surface(loaded, &field, file, spec.scale.unwrap_or(1.0))?;
        if number == 0 {
            triangles = found;
        } else if found != triangles {
            let found = format!(
                "other triangles in {} than in {}",
                file.path.display(),
                loaded.obstacles[index].frames[0].path.display()
            );
            let allowed = "frames that have the same triangles: only the vertices move";
            return Err(loaded.source.error(&field, found, allowed));
        }
        frames.push(positions);
    }
    let first = frames.first().cloned().unwrap_or_default();
    if let Some(bounds) = Bounds::of(&first) {
        let what = " along the longest side of the mesh";
        EXTENT_OF_FILE.judge(&loaded.source, &field, what, bounds.size().max())?;
    }
    let closed = ClosedMesh::new(first, triangles).map_err(|error| {
        let allowed = "a closed mesh with its normals outwards";
        loaded.source.error(&field, error.to_string(), allowed)
    })?;
    for (positions, file) in frames.iter().zip(&loaded.obstacles[index].frames).skip(1) {
        let volume = closed.volume_at(positions);
        if volume <= 0.0 {
            let file = file.path.display();
            let error = ObstacleError::Inverted(volume);
            let allowed = "frames whose normals point outwards";
            let found = format!("{file}: {error}");
            return Err(loaded.source.error(&field, found, allowed));
        }
    }
    let Some(rate) = spec.frame_rate else {
        return Ok((closed, motion));
    };
    for (number, pair) in frames.windows(2).enumerate() {
        let moves = pair[0].iter().zip(&pair[1]).map(|(a, b)| (b - a).norm());
        let speed = rate * moves.fold(0.0, f64::max);
        if speed > FASTEST {
            let file = &loaded.obstacles[index].frames[number + 1].path;
            let found = format!("a jump: {speed:.4e} m/s to {}", file.display());
            let allowed = format!("up to {FASTEST} m/s: is `frame_rate` right?");
            return Err(loaded.source.error(&field, found, allowed));
        }
    }
    let frames = Frames {
        rate,
        positions: frames,
        pose: pose(&loaded.scene.obstacles[index]),
    };
    Ok((closed, Motion::Frames(frames)))
}

/// The vertices (m) and triangles of the surface of a mesh file.
pub(super) fn surface(
    loaded: &LoadedScene,
    field: &str,
    file: &MeshFile,
    scale: f64,
) -> Result<(Vec<Vec3>, Vec<[u32; 3]>), SceneError> {
    let mesh = file.mesh().map_err(|source| SceneError::Mesh {
        location: loaded.source.location(field),
        path: file.path.clone(),
        source: Box::new(source.clone()),
    })?;
    let triangles = match mesh {
        Mesh::Sheet(mesh) => mesh.triangles.clone(),
        Mesh::Solid(mesh) => mesh.boundary(),
        Mesh::Thread(_) => {
            let allowed = "a mesh of triangles or of tetrahedra";
            return Err(loaded.source.error(field, "a mesh of lines", allowed));
        }
    };
    // The vertices inside a solid touch nothing.
    let mut numbers = vec![u32::MAX; mesh.positions().len()];
    for vertex in triangles.iter().flatten() {
        numbers[*vertex as usize] = 0;
    }
    let mut positions = Vec::new();
    for (number, position) in numbers.iter_mut().zip(mesh.positions()) {
        if *number == 0 {
            *number = positions.len() as u32;
            positions.push(position * scale);
        }
    }
    let renumbered = triangles
        .iter()
        .map(|corners| corners.map(|v| numbers[v as usize]));
    Ok((positions, renumbered.collect()))
}
