//! Grasps. A grasp is all that one device holds. The handles of a scene that name the same device are one grasp, such as
//! those of the prongs of a fork. The grasp is rigid: its handles move with the device, and the hand feels the sum of their
//! forces and, if the device renders moments, of their moments about the origin of the grasp.
//!
//! On one body, the handles of a grasp are one handle of the physics. On several bodies, the grasp has one such handle on
//! each, and all of them turn about the same origin. Every body keeps its own account of energy for its part of the
//! force (`rt_core::Controller`), so the accounts of all bodies add up to the work of the device.

use super::mesh::Notched;
use super::selection;
use crate::scene::spec::{Body, Handle, Scene};
use crate::scene::{LoadedScene, SceneError};
use physics::mesh::Mesh;
use physics::{Border, Freedom, HandleSpec, Vec3};

/// One grasp on one body.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grasp {
    /// The device that holds the handles.
    pub device: usize,
    /// The numbers of the scene's handles of the body that belong to the grasp, in their order.
    pub handles: Vec<usize>,
}

impl Grasp {
    /// The name of the grasp's part on `body`: the names of its handles.
    pub fn name(&self, body: &Body) -> String {
        let names = self
            .handles
            .iter()
            .map(|&number| &*body.handles[number].name);
        names.collect::<Vec<_>>().join(" + ")
    }

    /// The first handle of the grasp on `body`.
    pub fn first<'a>(&self, body: &'a Body) -> &'a Handle {
        &body.handles[self.handles[0]]
    }
}

/// The grasps of a body, in the order of their first handles. They are the handles of the body in the physics.
pub fn grasps(scene: &Scene, body: &Body) -> Vec<Grasp> {
    let mut grasps: Vec<Grasp> = Vec::new();
    for (number, handle) in body.handles.iter().enumerate() {
        let device = scene.device_of(handle);
        match grasps.iter_mut().find(|grasp| grasp.device == device) {
            Some(grasp) => grasp.handles.push(number),
            None => grasps.push(Grasp {
                device,
                handles: vec![number],
            }),
        }
    }
    grasps
}

/// The number of bodies that each device of a scene holds.
pub fn bodies_held(scene: &Scene) -> Vec<usize> {
    let mut held = vec![0; scene.devices.len()];
    for grasp in scene.bodies.iter().flat_map(|body| grasps(scene, body)) {
        if let Some(count) = held.get_mut(grasp.device) {
            *count += 1;
        }
    }
    held
}

/// The vertices of each handle of a body of the scene, in the order of the scene.
///
/// # Errors
/// [`SceneError`], naming the file, line and field, for a handle without vertices, or two that hold the same vertex.
pub(super) fn vertices(
    loaded: &LoadedScene,
    index: usize,
    mesh: &Mesh,
) -> Result<Vec<Vec<u32>>, SceneError> {
    let handles = &loaded.scene.bodies[index].handles;
    let mut all: Vec<Vec<u32>> = Vec::new();
    for (number, handle) in handles.iter().enumerate() {
        let field = format!("body[{index}].handle[{number}]");
        let group = handle.group.as_deref();
        let vertices = selection::vertices(loaded, &field, group, handle.in_box, mesh)?;
        for (other, earlier) in handles.iter().zip(&all) {
            let [this, other] = [&handle.name, &other.name].map(|name| format!("handle {name:?}"));
            held_once(loaded, &field, &this, &vertices, &other, earlier)?;
        }
        all.push(vertices);
    }
    Ok(all)
}

/// The origin of what each device of a scene holds, at rest (m): the mean of the centres of its handles on all bodies, whose
/// vertices are `held`; `None` for a device that holds nothing.
pub(super) fn origins(
    scene: &Scene,
    meshes: &[Notched<'_>],
    held: &[Vec<Vec<u32>>],
) -> Vec<Option<Vec3>> {
    let mut centres = vec![Vec::new(); scene.devices.len()];
    for ((body, notched), held) in scene.bodies.iter().zip(meshes).zip(held) {
        for grasp in grasps(scene, body) {
            let numbers = grasp.handles.iter();
            let each = numbers.map(|&number| centre(&held[number], &notched.mesh));
            centres[grasp.device].extend(each);
        }
    }
    let mean = |centres: Vec<Vec3>| {
        let count = centres.len();
        (count > 0).then(|| centres.iter().sum::<Vec3>() / count as f64)
    };
    centres.into_iter().map(mean).collect()
}

/// The handles of a scene's body: one for each grasp, of the vertices of its handles in the scene, which are `held`.
pub(super) fn handles(
    loaded: &LoadedScene,
    index: usize,
    mesh: &Mesh,
    mut held: Vec<Vec<u32>>,
    origins: &[Option<Vec3>],
) -> Vec<HandleSpec> {
    let spec = &loaded.scene.bodies[index];
    let bodies = bodies_held(&loaded.scene);
    let each = grasps(&loaded.scene, spec).into_iter().map(|grasp| {
        let handle = grasp.first(spec);
        let mut vertices: Vec<u32> = Vec::new();
        for &number in &grasp.handles {
            vertices.append(&mut held[number]);
        }
        vertices.sort_unstable();
        let holding = holding(
            vertices,
            mesh,
            freedom(loaded, handle),
            handle.border.into(),
        );
        let alone = grasp.handles.len() == 1 && bodies[grasp.device] == 1;
        let origin = if alone { None } else { origins[grasp.device] };
        HandleSpec {
            origin: origin.unwrap_or(holding.origin),
            ..holding
        }
    });
    each.collect()
}

/// Refuses `vertices`, which `this` holds rigidly by the scene's `field`, if `other` holds some of them, too.
pub(super) fn held_once(
    loaded: &LoadedScene,
    field: &str,
    this: &str,
    vertices: &[u32],
    other: &str,
    held: &[u32],
) -> Result<(), SceneError> {
    let shared = selection::shared(vertices, held);
    if shared == 0 {
        return Ok(());
    }
    let (of, others) = (vertices.len(), held.len());
    let found =
        format!("{shared} vertices in both {this} ({of} vertices) and {other} ({others} vertices)");
    let allowed = "vertices that only one of the two holds: make the group or the box of one of the two smaller";
    Err(loaded.source.error(field, found, allowed))
}

/// The degrees of freedom of a handle: those that its device actuates. Without an actuated rotation, only the
/// translations of the handle are condensed.
pub fn freedom(loaded: &LoadedScene, handle: &Handle) -> Freedom {
    let device = loaded.scene.device_of(handle);
    match loaded.models.get(device).and_then(|model| model.rotation) {
        Some(_) => Freedom::Rigid,
        None => Freedom::Translation,
    }
}

/// A handle about the centre of `vertices`.
pub(super) fn holding(
    vertices: Vec<u32>,
    mesh: &Mesh,
    freedom: Freedom,
    border: Border,
) -> HandleSpec {
    HandleSpec {
        origin: centre(&vertices, mesh),
        vertices,
        freedom,
        border,
    }
}

/// The centre of vertices (m).
pub(super) fn centre(vertices: &[u32], mesh: &Mesh) -> Vec3 {
    let positions = mesh.positions();
    let sum: Vec3 = vertices.iter().map(|&v| positions[v as usize]).sum();
    sum / vertices.len().max(1) as f64
}
