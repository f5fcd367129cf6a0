//! The plan: what the host does for a scene, as data.
//!
//! A scene pays only for what it needs. What that is follows from the scene and its bodies' meshes, before anything runs:
//! the engine is built from a [`BodyPlan`] ([`super::build`]), and `palpate plan` prints the same, stage by stage ([`Stage`]).

mod stages;

pub use stages::{Stage, in_words, stages};

use super::choice::{Choice, choose};
use super::virtual_coupling::Link;
use crate::bodies::{self, Built, Kind};
use crate::scene::LoadedScene;
use crate::scene::spec::{self, Scene, SchemeName};
use physics::Freedom;

/// What the host does for one body.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct BodyPlan {
    /// Name of the body.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// Its solver, and why that one.
    #[serde(flatten)]
    pub choice: Choice,
    /// Whether its bending resists.
    pub bends: bool,
    /// Handles that devices hold.
    pub handles: usize,
    /// Handles whose devices drive their rotation: it is condensed, too.
    pub turned: usize,
    /// Whether stiffness and damping are condensed onto the handles: the scheme uses them.
    pub condenses: bool,
    /// Whether its models say how much energy they store: the scheme uses it.
    pub tells_energy: bool,
    /// Length of a step (s).
    pub step: f64,
    /// Publication period (s).
    pub period: f64,
    /// How far ahead models are to be good for (s): from the state that one tells of to the last tick that uses it.
    pub horizon: f64,
    /// By handle, what ties its device to a proxy, where devices feel the body through one.
    pub links: Option<Vec<Link>>,
}

impl BodyPlan {
    /// For the body of this index, as built.
    pub fn new(loaded: &LoadedScene, index: usize, built: &Built) -> Self {
        let scene = &loaded.scene;
        let spec = &scene.bodies[index];
        let rigid = |handle: &&spec::Handle| bodies::freedom(loaded, handle) == Freedom::Rigid;
        let period = 1.0 / scene.host.publish_rate;
        Self {
            name: spec.name.clone(),
            kind: built.kind,
            choice: choose(scene, &built.body),
            bends: bodies::bending(spec, built.kind) > 0.0,
            handles: spec.handles.len(),
            turned: spec.handles.iter().filter(rigid).count(),
            condenses: condenses(scene),
            tells_energy: tells_energy(scene),
            step: 1.0 / scene.host.step_rate,
            period,
            horizon: period + scene.host.latency,
            links: (scene.realtime.scheme == SchemeName::Proxy).then(|| links(loaded, spec)),
        }
    }
}

/// Whether the scheme uses the published stiffness and damping.
fn condenses(scene: &Scene) -> bool {
    matches!(
        scene.realtime.scheme,
        SchemeName::Linear | SchemeName::Proxy | SchemeName::Classic | SchemeName::Capped
    )
}

/// Whether the scheme uses the published energy.
pub fn tells_energy(scene: &Scene) -> bool {
    matches!(
        scene.realtime.scheme,
        SchemeName::Classic | SchemeName::Capped
    )
}

/// What ties the device of each handle to its proxy: the scene's figures, or what the device's driver recommends.
pub fn links(loaded: &LoadedScene, body: &spec::Body) -> Vec<Link> {
    let scene = &loaded.scene;
    let each = body.handles.iter().map(|handle| {
        let index = scene.device_of(handle);
        let device = &scene.devices[index];
        let recommended = Link::recommended(&loaded.models[index]);
        // A scene's metre is felt as `1 / motion_scale` metres of the device, forces the other way round.
        let scale = device.motion_scale * device.motion_scale;
        let realtime = &scene.realtime;
        Link {
            stiffness: realtime
                .proxy_stiffness
                .unwrap_or(recommended.stiffness / scale),
            damping: realtime
                .proxy_damping
                .unwrap_or(recommended.damping / scale),
        }
    });
    each.collect()
}
