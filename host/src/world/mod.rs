//! The world: a scene, built once.
//!
//! A [`World`] has the bodies of the physics, the obstacles and what touches ([`Contacts`]), the grasps of the devices
//! ([`Grasp`]), and the mountings of the devices ([`Mount`]). Every later step of a run takes a `&World`. Code that moves a body clones it.
//!
//! This module makes the checks that need the mesh: groups that do not exist, empty boxes, the thickness of a
//! solid. Their errors name the line and the field of the scene file, as all errors of a scene do.

mod body;
pub mod contact;
mod grasp;
pub mod groups;
mod hand;
mod kind;
mod load;
mod material;
mod mesh;
mod mount;
mod narrow;
mod notch;
mod obstacle;
mod port;
mod press;
pub(crate) mod reach;
mod selection;
pub mod shapes;
mod survey;
mod tear;
mod tool;

use crate::scene::plausible::Warning;
use crate::scene::{LoadedScene, SceneError};
use mesh::Notched;
use physics::contact::Obstacle;
use physics::contact::rounded::Rounded;
use physics::{Body, CondenseError, Condenser};
use std::sync::{Arc, OnceLock};

pub use body::{Built, Carrier};
pub use contact::Contacts;
pub(crate) use hand::build as build_hand;

pub use grasp::{Grasp, bodies_held, freedom, grasps};
pub use kind::{Kind, bending};
pub use mount::Mount;
pub use port::{port, scheme};
pub use tear::TearSpec;

/// A scene, built.
#[derive(Debug)]
pub struct World<'a> {
    /// The scene from which the world is built.
    pub loaded: &'a LoadedScene,
    /// The bodies, at rest, in the order of the scene.
    pub bodies: Vec<Built>,
    /// What bodies touch and no body moves, in the order of the scene: its tools are the last ones.
    pub obstacles: Vec<Obstacle>,
    /// What may touch.
    pub contacts: Contacts,
    /// Where each device stands.
    pub mounts: Vec<Mount>,
    /// All warnings of the scene: those of its fields, then those of its meshes.
    pub warnings: Vec<Warning>,
    /// The bodies at the start of a run, once a run has asked for them; `None` for a body that starts at rest.
    starts: OnceLock<Vec<Option<Body>>>,
}

impl<'a> World<'a> {
    /// Builds a scene.
    ///
    /// # Errors
    /// [`SceneError`], naming the file, line and field that cannot be built.
    pub fn new(loaded: &'a LoadedScene) -> Result<Self, SceneError> {
        let scene = &loaded.scene;
        let bodies = 0..scene.bodies.len();
        let meshes: Vec<Notched<'_>> = bodies
            .map(|index| mesh::build(loaded, index))
            .collect::<Result<_, _>>()?;
        let numbered = || meshes.iter().enumerate();
        let held: Vec<Vec<Vec<u32>>> = numbered()
            .map(|(index, notched)| grasp::vertices(loaded, index, &notched.mesh))
            .collect::<Result<_, _>>()?;
        let mut origins = grasp::origins(scene, &meshes, &held);
        for (tool, device, _) in scene.numbered_tools() {
            origins[device] = Some(tool.position.into());
        }
        let mounts = (0..scene.devices.len())
            .map(|device| mount::mount(loaded, device, origins[device]))
            .collect::<Result<Vec<_>, _>>()?;
        let mut warnings = survey::warnings(loaded, &meshes, &mounts);
        let each = meshes.into_iter().zip(held).enumerate();
        let bodies = each
            .map(|(index, (notched, held))| body::build(loaded, index, notched, held, &origins))
            .collect::<Result<Vec<Built>, _>>()?;
        let tools = (0..scene.tools.len()).map(|index| tool::build(loaded, index));
        let obstacles = (0..scene.given_obstacles().len())
            .map(|index| obstacle::build(loaded, index))
            .chain(tools)
            .collect::<Result<Vec<_>, _>>()?;
        let contacts = Contacts::new(loaded, &bodies);
        contact::check_start(loaded, &bodies, &obstacles, &contacts)?;
        tool::check_start(loaded, &obstacles)?;
        warnings.extend(narrow::warnings(loaded, &bodies, &obstacles, &contacts));
        let shapes = obstacles.iter().filter_map(Obstacle::rounded);
        warnings.extend(reach::warnings(loaded, shapes));
        Ok(Self {
            loaded,
            bodies,
            obstacles,
            contacts,
            mounts,
            warnings,
            starts: OnceLock::new(),
        })
    }

    /// The shape of each tool, in the order of the scene.
    pub fn tool_shapes(&self) -> impl Iterator<Item = &Arc<Rounded>> {
        let given = self.loaded.scene.given_obstacles().len();
        self.obstacles[given..].iter().filter_map(Obstacle::rounded)
    }

    /// Brings copies of the bodies to the start of a run, at the first call: to rest under their weight and their loads
    /// while their handles are held. A body that would meet something on the way starts undeformed.
    pub fn settle(&self) {
        self.settled();
    }

    /// The body number `index` at the start of a run ([`settle`](Self::settle)).
    pub fn start(&self, index: usize) -> &Body {
        let settled = &self.settled()[index];
        settled.as_ref().unwrap_or(&self.bodies[index].body)
    }

    fn settled(&self) -> &[Option<Body>] {
        self.starts.get_or_init(|| {
            let mut starts: Vec<_> = self.bodies.iter().map(Built::settled).collect();
            contact::keep_apart(&self.contacts, &self.bodies, &self.obstacles, &mut starts);
            starts
        })
    }
}

/// Condenses a body at rest onto its handles, for local models published every `period` seconds.
///
/// # Errors
/// [`CondenseError`] if the body cannot be condensed.
pub fn condense(built: &Built, period: f64) -> Result<Condenser, CondenseError> {
    let mut body = built.body.clone();
    let mut condenser = Condenser::new(&body)?;
    body.assemble();
    condenser.condense(&body, period)?;
    Ok(condenser)
}
