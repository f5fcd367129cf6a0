//! Tools: all that one device holds. The handles of a scene that name the same device are the places of one tool, such
//! as the prongs of a fork. The tool is rigid: its places move with the device, and the hand feels the sum of their
//! forces and, where the device renders moments, of their moments about the origin of the tool.
//!
//! On one body, the places of a tool are one handle of the physics. On several bodies, the tool has one such handle on
//! each, and all of them turn about the same origin. Every body keeps its own account of energy for its part of the
//! force (`rt_core::Controller`), so the accounts of all bodies add up to the work of the device.

use super::{mesh, places};
use crate::scene::spec::{Body, Handle, Scene};
use crate::scene::{LoadedScene, SceneError};
use physics::Vec3;
use physics::mesh::Mesh;

/// The places of one tool on one body.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tool {
    /// The device that holds the tool.
    pub device: usize,
    /// The numbers of the body's handles that are places of the tool, in their order.
    pub places: Vec<usize>,
}

impl Tool {
    /// The name of the tool's part on `body`: the names of its places.
    pub fn name(&self, body: &Body) -> String {
        let names = self.places.iter().map(|&place| &*body.handles[place].name);
        names.collect::<Vec<_>>().join(" + ")
    }

    /// The first place of the tool on `body`.
    pub fn first<'a>(&self, body: &'a Body) -> &'a Handle {
        &body.handles[self.places[0]]
    }
}

/// The tools that hold a body, in the order of their first places. They are the handles of the body in the physics.
pub fn tools(scene: &Scene, body: &Body) -> Vec<Tool> {
    let mut tools: Vec<Tool> = Vec::new();
    for (number, handle) in body.handles.iter().enumerate() {
        let device = scene.device_of(handle);
        match tools.iter_mut().find(|tool| tool.device == device) {
            Some(tool) => tool.places.push(number),
            None => tools.push(Tool {
                device,
                places: vec![number],
            }),
        }
    }
    tools
}

/// The number of bodies that each device of a scene holds.
pub fn bodies_held(scene: &Scene) -> Vec<usize> {
    let mut held = vec![0; scene.devices.len()];
    for tool in scene.bodies.iter().flat_map(|body| tools(scene, body)) {
        if let Some(count) = held.get_mut(tool.device) {
            *count += 1;
        }
    }
    held
}

/// The origin of the tool that `device` holds, at rest (m): the mean of the centres of its places on all bodies; `None`
/// if the device holds nothing.
///
/// # Errors
/// [`SceneError`], naming the file, line and field, where a body has no mesh or a place no vertices.
pub(super) fn origin(loaded: &LoadedScene, device: usize) -> Result<Option<Vec3>, SceneError> {
    let mut centres = Vec::new();
    for (index, body) in loaded.scene.bodies.iter().enumerate() {
        let all = tools(&loaded.scene, body);
        let Some(tool) = all.iter().find(|tool| tool.device == device) else {
            continue;
        };
        let mesh = mesh::build(loaded, index)?;
        for &place in &tool.places {
            centres.push(centre(&vertices(loaded, index, place, &mesh)?, &mesh));
        }
    }
    let count = centres.len();
    Ok((count > 0).then(|| centres.iter().sum::<Vec3>() / count as f64))
}

/// The vertices of the handle number `place` of a body.
pub(super) fn vertices(
    loaded: &LoadedScene,
    index: usize,
    place: usize,
    mesh: &Mesh,
) -> Result<Vec<u32>, SceneError> {
    let handle = &loaded.scene.bodies[index].handles[place];
    let field = format!("body[{index}].handle[{place}]");
    let group = handle.group.as_deref();
    places::vertices(loaded, &field, group, handle.in_box, mesh)
}

/// The centre of vertices (m).
pub(super) fn centre(vertices: &[u32], mesh: &Mesh) -> Vec3 {
    let positions = mesh.positions();
    let sum: Vec3 = vertices.iter().map(|&v| positions[v as usize]).sum();
    sum / vertices.len().max(1) as f64
}
