//! The plan: the work of the host for a scene, as data.
//!
//! A scene pays only for the stages that it needs. The scene and the meshes of its bodies determine them before
//! anything runs: the engine is built from a [`BodyPlan`] ([`super::build`]), and `palpate plan` prints the same
//! plan, stage by stage ([`Stage`]).

mod stages;
mod tool;

pub use stages::{Stage, in_words, stages};
pub use tool::ToolPlan;

use super::choice::{Choice, choose};
use super::stiff::Renderable;
use super::virtual_coupling::Spring;
use crate::scene::LoadedScene;
use crate::scene::spec::{self, Scene, SchemeName, Starts, TearLawName};
use crate::world::shapes::round;
use crate::world::{self, Grasp, Kind, TearSpec, World};
use physics::Freedom;
use rt_core::Vec3;
use rt_core::device_frame::DeviceFrame;
use std::fmt;

/// The plan of one body: its solver, its handles and its rates.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct BodyPlan {
    /// Name of the body.
    pub name: String,
    /// Its kind.
    pub kind: Kind,
    /// Its solver, and the reason for the choice.
    #[serde(flatten)]
    pub choice: Choice,
    /// Whether its bending resists.
    pub bends: bool,
    /// Number of its handles.
    pub handles: usize,
    /// Number of handles whose devices drive their rotation, which is then condensed, too.
    pub turned: usize,
    /// Whether stiffness and damping are condensed onto the handles, because the scheme uses them.
    pub condenses: bool,
    /// Whether its models state the energy that they store, because the scheme uses it.
    pub publishes_energy: bool,
    /// Length of a step (s).
    pub step: f64,
    /// Publication period (s).
    pub period: f64,
    /// The largest age at which models must be good (s): from a model's reference to the last tick that uses the
    /// model.
    pub horizon: f64,
    /// The time over which models predict the response of the body to its hands (s).
    pub response: f64,
    /// By handle, the link between its device and the proxy; `None` under schemes without proxies.
    pub links: Option<Vec<Spring>>,
    /// What each device of the scene can render of the body; empty under schemes that bound no stiffness.
    #[serde(skip)]
    pub renderable: Vec<Renderable>,
    /// Its tearing, if it tears.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tear: Option<TearPlan>,
}

/// The tearing of one body.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct TearPlan {
    /// The law of tearing.
    pub law: TearLawName,
    /// Where tears start.
    pub starts: Starts,
    /// Number of tips that notches have at the start.
    pub tips: usize,
    /// Number of vertices that tears may add.
    pub room: usize,
    /// By how much the tear of a short notch starts too late at most, relative to the load; missing without a short notch.
    pub late: Option<f64>,
}

/// Two things that may touch.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ContactPlan {
    /// The names.
    pub between: [String; 2],
    /// The ratio of friction to normal force in sliding.
    pub friction: f64,
    /// The distance at which contact begins (m).
    pub distance: f64,
}

impl ContactPlan {
    /// All pairs of a world that may touch.
    pub fn all(world: &World<'_>) -> Vec<Self> {
        let scene = &world.loaded.scene;
        let pairs = world.contacts.pairs.iter().map(|pair| Self {
            between: pair.between.map(|thing| thing.name(scene).to_owned()),
            friction: pair.friction,
            distance: pair.distance,
        });
        pairs.collect()
    }
}

impl fmt::Display for ContactPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [one, other] = &self.between;
        let with = if one == other { "itself" } else { other };
        let (friction, distance) = (self.friction, round(1e3 * self.distance));
        write!(
            f,
            "{one} with {with}: friction {friction}, from a distance of {distance} mm"
        )
    }
}

impl TearPlan {
    fn new(tear: &TearSpec) -> Self {
        Self {
            law: tear.law,
            starts: tear.starts,
            tips: tear.tips.len(),
            room: tear.room,
            late: tear.late,
        }
    }
}

impl BodyPlan {
    /// The plan of the body number `index` of a world.
    pub fn new(world: &World<'_>, index: usize) -> Self {
        let (loaded, built) = (world.loaded, &world.bodies[index]);
        let scene = &loaded.scene;
        let spec = &scene.bodies[index];
        let grasps = world::grasps(scene, spec);
        let rigid = |grasp: &&Grasp| world::freedom(loaded, grasp.first(spec)) == Freedom::Rigid;
        let host = &scene.host;
        // A publication keeps the host busy, so the next comes with the first step after its latency.
        let busy = (host.latency * host.step_rate - 1e-9).ceil() / host.step_rate;
        let period = (1.0 / host.publish_rate).max(busy);
        // The newest record of a hand is a tick old when a model is made of it. That tick matters if a model serves for a
        // few ticks; models that serve for long are as good without it, and quieter.
        let tick = 1.0 / scene.realtime.rate;
        let serves = period + host.latency;
        let horizon = serves + tick * (tick / serves).min(1.0);
        // A hand that shakes is beside the filtered path of its handle for as long as the filter remembers. The body answers
        // this displacement as it answers a slow one. The stiffness of a shorter time would resist it by the inertia, too.
        let memory = 1.0 / (2.0 * core::f64::consts::PI * host.smoothing);
        Self {
            name: spec.name.clone(),
            kind: built.kind,
            choice: choose(scene, &built.body),
            bends: world::bending(spec, built.kind) > 0.0,
            handles: grasps.len(),
            turned: grasps.iter().filter(rigid).count(),
            condenses: condenses(scene),
            publishes_energy: publishes_energy(scene),
            step: 1.0 / scene.host.step_rate,
            period,
            horizon,
            response: horizon.max(memory),
            tear: built.tear.as_ref().map(TearPlan::new),
            links: (scene.realtime.scheme == SchemeName::Proxy).then(|| links(loaded, spec)),
            renderable: if condenses(scene) && scene.realtime.scheme != SchemeName::Proxy {
                renderable(loaded)
            } else {
                Vec::new()
            },
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
pub fn publishes_energy(scene: &Scene) -> bool {
    matches!(
        scene.realtime.scheme,
        SchemeName::Classic | SchemeName::Capped
    )
}

/// The link between the device and the proxy of each handle: with the scene's parameters, or with those that the
/// device's driver recommends.
pub fn links(loaded: &LoadedScene, body: &spec::Body) -> Vec<Spring> {
    let scene = &loaded.scene;
    let each = world::grasps(scene, body).into_iter().map(|grasp| {
        let index = grasp.device;
        let device = &scene.devices[index];
        let recommended = Spring::recommended(&loaded.models[index]);
        // A metre of the scene is `1 / motion_scale` metres of the device. Forces scale inversely.
        let scale = device.motion_scale * device.motion_scale;
        let realtime = &scene.realtime;
        Spring {
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

/// Change of the force by one count (N) that a hand at rest hardly feels: a hold that trembles at the edge of a count then
/// ripples by 0.1 N.
const CALM: f64 = 0.2;

/// What each device of the scene can render of one body, in the units of the scene: the stiffness `2 f_c / delta`, or
/// `2 b / T` in ticks of `T` if that is more ([`super::stiff`]), and the damping. The bodies that a device holds share
/// them. A device whose friction and damping are not known has no limit of the stiffness.
pub fn renderable(loaded: &LoadedScene) -> Vec<Renderable> {
    let scene = &loaded.scene;
    let period = 1.0 / scene.realtime.rate;
    let held = world::bodies_held(scene);
    let most = |friction: f64, count: f64, damping: f64, share: f64| {
        let most = (2.0 * friction / count).max(2.0 * damping / period) / share;
        if most > 0.0 { most } else { f64::INFINITY }
    };
    let devices = scene.devices.iter().zip(&loaded.models).zip(held);
    devices
        .map(|((device, model), held)| {
            let held = held.max(1) as f64;
            let scale = device.motion_scale * device.motion_scale;
            let whole = most(model.friction, model.position_step, model.damping, 1.0);
            Renderable {
                stiffness: whole / (held * scale),
                turning: model.rotation.map_or(f64::INFINITY, |turning| {
                    most(turning.friction, turning.step, turning.damping, held)
                }),
                calm: (CALM / (whole * model.position_step)).min(1.0),
                damping: if scene.realtime.scheme == SchemeName::Capped {
                    let frame = DeviceFrame {
                        motion_scale: device.motion_scale,
                        ..DeviceFrame::at(Vec3::zeros())
                    };
                    let port = world::port(model, f64::INFINITY, &frame, period);
                    [port.most_damping, port.most_turning_damping].map(|most| most / held)
                } else {
                    [f64::INFINITY; 2]
                },
            }
        })
        .collect()
}
