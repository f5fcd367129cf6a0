//! From a scene's bodies to sheets in the host loop.
//!
//! What only the mesh can tell is checked here: groups that do not exist, boxes that hold nothing. Such
//! errors carry the scene file's line and field like any other.

use super::body::{SheetBody, SheetBodyParts};
use super::path::HandlePath;
use super::plan;
use crate::scene::source::cut;
use crate::scene::spec::{self, MeshSource, Scene};
use crate::scene::{LoadedScene, SceneError};
use physics::Vec3;
use physics::fem::cholesky::Kernels;
use physics::fem::{Body, BodyConfig, Condenser, Freedom, HandleSpec, Material};
use physics::mesh::generate::{self, Pattern};
use physics::mesh::{self, Group, TriMesh};
use rt_core::Pose;

/// A residual below this is solved (N): a millionth of what the lightest-fingered device can render.
const ABSOLUTE_TOLERANCE: f64 = 1e-8;
/// Most groups of a mesh that an error lists, and longest name there, in characters.
const MOST_NAMES: usize = 16;
const LONGEST_NAME: usize = 64;

/// Builds every body of a scene, at rest, with `kernels` for its linear algebra.
///
/// # Errors
/// [`SceneError`], naming the file, line and field that cannot be built.
pub fn bodies(loaded: &LoadedScene, kernels: Kernels) -> Result<Vec<SheetBody>, SceneError> {
    (0..loaded.scene.bodies.len())
        .map(|index| body(loaded, index, kernels))
        .collect()
}

/// Number of physics steps from one publication to the next.
pub fn steps_per_publication(scene: &Scene) -> u64 {
    (scene.host.step_rate / scene.host.publish_rate)
        .round()
        .max(1.0) as u64
}

/// Where a body's handles are at rest: the centre of their vertices, in the body's order.
///
/// # Errors
/// As [`bodies`].
pub fn handle_origins(loaded: &LoadedScene, index: usize) -> Result<Vec<Vec3>, SceneError> {
    let mesh = mesh(loaded, index)?;
    Ok(handles(loaded, index, &mesh)?
        .into_iter()
        .map(|handle| handle.origin)
        .collect())
}

/// Builds the sheet of one body, at rest, with the places of its handles.
///
/// # Errors
/// As [`bodies`].
pub fn sheet(loaded: &LoadedScene, index: usize) -> Result<(Body, Vec<HandleSpec>), SceneError> {
    let scene = &loaded.scene;
    let body = &scene.bodies[index];
    let mesh = mesh(loaded, index)?;
    let materials = materials(loaded, index, &mesh)?;
    let handles = handles(loaded, index, &mesh)?;
    let config = BodyConfig {
        gravity: Vec3::from(scene.gravity),
        mass_damping: body.damping.mass,
        stiffness_damping: body.damping.stiffness,
        bending: body.bending,
        tolerance: scene.host.tolerance,
        absolute_tolerance: ABSOLUTE_TOLERANCE,
        max_iterations: scene.host.max_iterations,
    };
    let sheet = Body::sheet(&mesh, &materials, config, &handles)
        .map_err(|e| refuse(loaded, index, &e.to_string()))?;
    Ok((sheet, handles))
}

fn refuse(loaded: &LoadedScene, index: usize, what: &str) -> SceneError {
    loaded.source.error(
        &format!("body[{index}]"),
        what,
        "a sheet that can be simulated",
    )
}

fn body(loaded: &LoadedScene, index: usize, kernels: Kernels) -> Result<SheetBody, SceneError> {
    let scene = &loaded.scene;
    let body = &scene.bodies[index];
    let (sheet, handles) = sheet(loaded, index)?;
    let condenser = if plan::condenses(scene) {
        Some(
            Condenser::with_kernels(&sheet, kernels)
                .map_err(|e| refuse(loaded, index, &e.to_string()))?,
        )
    } else {
        None
    };
    let devices: Vec<u8> = body.handles.iter().map(|h| device_of(scene, h)).collect();
    let paths = handles
        .iter()
        .zip(&devices)
        .map(|(handle, device)| {
            HandlePath::new(
                usize::from(*device),
                scene.host.smoothing,
                Pose::at(handle.origin),
            )
        })
        .collect();
    Ok(SheetBody::new(SheetBodyParts {
        name: body.name.clone(),
        sheet,
        condenser,
        paths,
        devices,
        step: 1.0 / scene.host.step_rate,
        period: 1.0 / scene.host.publish_rate,
    }))
}

/// The scene's consistency was checked when it was read: the device exists.
fn device_of(scene: &Scene, handle: &spec::Handle) -> u8 {
    scene
        .devices
        .iter()
        .position(|device| device.name == handle.device)
        .unwrap_or(0) as u8
}

/// The mesh of one body, its triangles in the file's order.
///
/// # Errors
/// As [`bodies`].
pub fn mesh(loaded: &LoadedScene, index: usize) -> Result<TriMesh, SceneError> {
    match &loaded.scene.bodies[index].mesh {
        MeshSource::Sheet {
            length,
            width,
            cells: [nx, ny],
        } => generate::sheet(*length, *width, *nx, *ny, Pattern::Alternating).map_err(|e| {
            let field = format!("body[{index}].mesh.sheet");
            loaded
                .source
                .error(&field, e.to_string(), "a sheet with an area")
        }),
        MeshSource::File(name) => {
            let file = loaded.meshes[index].as_ref();
            let bytes = file.map_or(&[][..], |file| &file.bytes);
            mesh::read(name, bytes).map_err(|source| SceneError::Mesh {
                place: loaded.source.place(&format!("body[{index}].mesh.file")),
                path: file.map_or_else(|| name.into(), |file| file.path.clone()),
                source: Box::new(source),
            })
        }
    }
}

fn materials(
    loaded: &LoadedScene,
    index: usize,
    mesh: &TriMesh,
) -> Result<Vec<Material>, SceneError> {
    let body = &loaded.scene.bodies[index];
    let base = body.material;
    let mut materials = vec![
        Material {
            young: base.young,
            poisson: base.poisson,
            thickness: base.thickness,
            density: base.density,
        };
        mesh.triangles.len()
    ];
    for (number, region) in body.regions.iter().enumerate() {
        let field = format!("body[{index}].region[{number}]");
        let triangles = if let Some(name) = &region.group {
            group(
                loaded,
                &format!("{field}.group"),
                name,
                &mesh.triangle_groups,
            )?
            .to_vec()
        } else if let Some([low, high]) = region.in_box {
            let inside = triangles_in_box(mesh, Vec3::from(low), Vec3::from(high));
            not_empty(
                loaded,
                &format!("{field}.box"),
                inside,
                "triangle's barycentre",
            )?
        } else {
            Vec::new()
        };
        for triangle in triangles {
            let material = &mut materials[triangle as usize];
            material.young = region.young.unwrap_or(material.young);
            material.density = region.density.unwrap_or(material.density);
            material.thickness = region.thickness.unwrap_or(material.thickness);
        }
    }
    Ok(materials)
}

fn handles(
    loaded: &LoadedScene,
    index: usize,
    mesh: &TriMesh,
) -> Result<Vec<HandleSpec>, SceneError> {
    let handles = loaded.scene.bodies[index].handles.iter().enumerate();
    handles
        .map(|(number, handle)| {
            let field = format!("body[{index}].handle[{number}]");
            let vertices = if let Some(name) = &handle.group {
                group(loaded, &format!("{field}.group"), name, &mesh.vertex_groups)?.to_vec()
            } else if let Some([low, high]) = handle.in_box {
                let inside = mesh.vertices_in_box(Vec3::from(low), Vec3::from(high));
                not_empty(loaded, &format!("{field}.box"), inside, "vertex")?
            } else {
                Vec::new()
            };
            let sum: Vec3 = vertices.iter().map(|v| mesh.positions[*v as usize]).sum();
            let origin = sum / vertices.len().max(1) as f64;
            // The simulated devices actuate translations only: no rotation is condensed.
            Ok(HandleSpec {
                vertices,
                origin,
                freedom: Freedom::Translation,
            })
        })
        .collect()
}

fn group<'a>(
    loaded: &LoadedScene,
    field: &str,
    name: &str,
    groups: &'a [Group],
) -> Result<&'a [u32], SceneError> {
    groups
        .iter()
        .find(|group| group.name == name)
        .map(|group| &group.members[..])
        .ok_or_else(|| {
            // A file's names may be any text, and many.
            let names: Vec<_> = groups
                .iter()
                .take(MOST_NAMES)
                .map(|group| format!("\"{}\"", cut(&group.name, LONGEST_NAME)))
                .collect();
            let more = if groups.len() > MOST_NAMES {
                ", ..."
            } else {
                ""
            };
            let allowed = if names.is_empty() {
                "a box (the mesh has no such groups)".to_owned()
            } else {
                format!("a group of the mesh: {}{more}", names.join(", "))
            };
            loaded.source.error(field, format!("\"{name}\""), allowed)
        })
}

fn not_empty(
    loaded: &LoadedScene,
    field: &str,
    members: Vec<u32>,
    what: &str,
) -> Result<Vec<u32>, SceneError> {
    if members.is_empty() {
        Err(loaded.source.error(
            field,
            "a box that holds nothing",
            format!("one around at least one {what}"),
        ))
    } else {
        Ok(members)
    }
}

fn triangles_in_box(mesh: &TriMesh, low: Vec3, high: Vec3) -> Vec<u32> {
    (0_u32..)
        .zip(&mesh.triangles)
        .filter(|(_, corners)| {
            let sum: Vec3 = corners.iter().map(|v| mesh.positions[*v as usize]).sum();
            let centre = sum / 3.0;
            (0..3).all(|axis| (low[axis]..=high[axis]).contains(&centre[axis]))
        })
        .map(|(triangle, _)| triangle)
        .collect()
}
