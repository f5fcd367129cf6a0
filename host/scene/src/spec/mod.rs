//! The format of a scene file, field by field, with the defaults. Units are SI.
//!
//! Each field that has a range checks the range while the file is read, so that the error names the line of the
//! file and the path of the field.

pub mod body;
pub mod contact;
mod device;
mod hand;
mod mesh;
mod placement;
pub mod solve;
mod tear;
mod tool;

use super::check;
use crate::settings::MachineTables;
use serde::{Deserialize, Serialize};

pub use body::{Body, Handle, Load, Material, Support};
pub use contact::{Contact, Obstacle};
pub use device::{ArmName, Device, EMULATED, Engage, ModelName, Mounting, SIMULATED, SquareWave};
pub use hand::{GripName, Hand, TaskName};
pub use mesh::{MeshSource, PatternName};
pub use placement::Rotation;
pub use solve::{Analysis, Solve};
pub use tear::{Notch, Starts, Tear, TearLawName};
pub use tool::Tool;

/// A whole scene.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Short name, used in logs and plots.
    pub name: String,
    /// One line for people.
    #[serde(default)]
    pub description: String,
    /// How long a run or a dynamic solve lasts (s), at most a day.
    #[serde(default = "one", deserialize_with = "check::duration")]
    pub duration: f64,
    /// Seed of every random choice; `--seed` overrides it.
    #[serde(default)]
    pub seed: u64,
    /// The realtime loop.
    #[serde(default, rename = "loop", deserialize_with = "check::table")]
    pub realtime: Realtime,
    /// The host's physics.
    #[serde(default, deserialize_with = "check::table")]
    pub host: Host,
    /// The settings of `palpate solve`.
    #[serde(default, deserialize_with = "check::table")]
    pub solve: Solve,
    /// Settings of the machine that this scene needs in place of those of the machine's own file.
    #[serde(default, deserialize_with = "check::table")]
    pub machine: MachineTables,
    /// Acceleration of gravity (m/s^2).
    #[serde(default = "earth", deserialize_with = "check::finite3")]
    pub gravity: [f64; 3],
    /// Deformable bodies; none in a scene of tools and obstacles.
    #[serde(default, rename = "body", deserialize_with = "check::tables")]
    pub bodies: Vec<Body>,
    /// What bodies touch and no body moves. A scene that was read has its tools at the end.
    #[serde(default, rename = "obstacle", deserialize_with = "check::tables")]
    pub obstacles: Vec<Obstacle>,
    /// What devices touch bodies with.
    #[serde(default, rename = "tool", deserialize_with = "check::tables")]
    pub tools: Vec<Tool>,
    /// Pairs that may touch.
    #[serde(default, rename = "contact", deserialize_with = "check::tables")]
    pub contacts: Vec<Contact>,
    /// Haptic devices and the hands that hold them; a run needs at least one.
    #[serde(default, rename = "device", deserialize_with = "check::tables")]
    pub devices: Vec<Device>,
}

impl Scene {
    /// Index of the device that holds a handle of this scene. The device exists, because the consistency of the scene
    /// was checked when the scene was read.
    pub fn device_of(&self, handle: &Handle) -> usize {
        let holds = |device: &Device| device.name == handle.device;
        self.devices.iter().position(holds).unwrap_or(0)
    }

    /// The obstacles of the scene without those that its tools are, once the scene was read.
    pub fn given_obstacles(&self) -> &[Obstacle] {
        let given = self.obstacles.len().saturating_sub(self.tools.len());
        &self.obstacles[..given]
    }

    /// The `[[contact]]` of two things of these names; `None` if the scene has none.
    pub fn contact_between(&self, one: &str, other: &str) -> Option<&Contact> {
        self.contacts.iter().find(|contact| {
            let [a, b] = [&*contact.between[0], &*contact.between[1]];
            [a, b] == [one, other] || [b, a] == [one, other]
        })
    }

    /// Each tool with the number of its device and that of its obstacle, once the scene was read.
    pub fn numbered_tools(&self) -> impl Iterator<Item = (&Tool, usize, usize)> {
        let given = self.given_obstacles().len();
        self.tools.iter().enumerate().map(move |(index, tool)| {
            let moves = |device: &Device| device.name == tool.device;
            let device = self.devices.iter().position(moves).unwrap_or(0);
            (tool, device, given + index)
        })
    }

    /// The button of the device of this index that an order lets a simulated hand press, as a mask: that by which its tool takes hold.
    /// Zero without one, and for a device that a person holds.
    pub fn ordered_button(&self, device: usize) -> u32 {
        let simulated = self.devices.get(device).is_some_and(Device::is_simulated);
        let mut tools = self.numbered_tools().filter(|(_, of, _)| *of == device);
        let tool = tools.next().filter(|_| simulated);
        tool.map_or(0, |(tool, ..)| tool.take_buttons())
    }

    /// The field of the obstacle of this number, in the order of a scene that was read.
    pub fn field_of_obstacle(&self, index: usize) -> String {
        match index.checked_sub(self.given_obstacles().len()) {
            Some(tool) => format!("tool[{tool}]"),
            None => format!("obstacle[{index}]"),
        }
    }

    /// Whether anything in the scene may touch: an obstacle and a body, two bodies, or a body and itself.
    pub fn has_contact(&self) -> bool {
        let touches_itself = self.bodies.iter().any(|body| body.self_contact);
        touches_itself || !self.obstacles.is_empty() || !self.contacts.is_empty()
    }
}

fn one() -> f64 {
    1.0
}

fn earth() -> [f64; 3] {
    [0.0, 0.0, -9.81]
}

/// `[loop]`: the realtime loop and its force scheme.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Realtime {
    /// Rate of the tick (Hz).
    #[serde(deserialize_with = "check::tick_rate")]
    pub rate: f64,
    /// The scheme: the rule that gives the force between publications.
    #[serde(deserialize_with = "check::word")]
    pub scheme: SchemeName,
    /// `thesis` only: spring from handle to proxy (N/m).
    #[serde(deserialize_with = "check::not_negative")]
    pub thesis_stiffness: f64,
    /// `thesis` only: damping of the proxy (N s/m).
    #[serde(deserialize_with = "check::not_negative")]
    pub thesis_damping: f64,
    /// `proxy` only: spring between device and proxy (N/m). Default: the value that the device's driver recommends.
    #[serde(deserialize_with = "check::optional_positive")]
    pub proxy_stiffness: Option<f64>,
    /// `proxy` only: damper between device and proxy (N s/m). Default: the value that the device's driver recommends.
    #[serde(deserialize_with = "check::optional_not_negative")]
    pub proxy_damping: Option<f64>,
    /// Duration of the blend into a new model, as a fraction of the publication period.
    #[serde(deserialize_with = "check::fraction")]
    pub blend: f64,
    /// Age beyond which a model is not trusted (s). Default: see [`Realtime::age_limit`].
    #[serde(deserialize_with = "check::optional_positive")]
    pub age_limit: Option<f64>,
    /// Time in which the force fades once the model is too old (s).
    #[serde(deserialize_with = "check::positive")]
    pub decay: f64,
    /// Time in which the force returns with a new model (s).
    #[serde(deserialize_with = "check::positive")]
    pub recovery: f64,
    /// Damping of the safe hold (N s/m).
    #[serde(deserialize_with = "check::not_negative")]
    pub hold_damping: f64,
}

impl Default for Realtime {
    fn default() -> Self {
        Self {
            rate: 1000.0,
            scheme: SchemeName::Capped,
            thesis_stiffness: 200.0,
            thesis_damping: 2.0,
            proxy_stiffness: None,
            proxy_damping: None,
            blend: 0.5,
            age_limit: None,
            decay: 0.3,
            recovery: 0.2,
            hold_damping: 2.0,
        }
    }
}

impl Realtime {
    /// Age beyond which a model is not trusted (s).
    ///
    /// Under `capped` an old model is a passive spring, whatever the state of the body, and a fading force loses the
    /// energy that the hands supplied. The default is therefore two seconds, the longest stall of the stress study.
    /// Under the other schemes nothing bounds the energy of an old model, and the default is 0.1 s.
    pub fn age_limit(&self) -> f64 {
        self.age_limit.unwrap_or(match self.scheme {
            SchemeName::Capped => 2.0,
            _ => 0.1,
        })
    }
}

/// Names of the force schemes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SchemeName {
    /// The published wrench, constant between publications.
    Hold,
    /// The published wrench, plus a spring to the proxy and damping (thesis, equation 4.5).
    Thesis,
    /// The extrapolation of the local model.
    Linear,
    /// As `Linear` for a massless proxy, which a virtual coupling connects to the device.
    Proxy,
    /// As `Linear`, with a damper once the hands have received more energy than they supplied.
    Classic,
    /// As `Linear`, with a cap: the springs return no more energy than the credit.
    Capped,
}

/// `[host]`: rates and solver.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Host {
    /// Rate of physics steps (Hz).
    #[serde(deserialize_with = "check::rate")]
    pub step_rate: f64,
    /// Rate of publications (Hz): `step_rate` divided by a whole number.
    #[serde(deserialize_with = "check::rate")]
    pub publish_rate: f64,
    /// Virtual clock: latency, the time from reading the hands to the arrival of the model (s), at most 1.
    #[serde(deserialize_with = "check::latency")]
    pub latency: f64,
    /// Cut-off of the filter that smooths the handles' paths (Hz).
    #[serde(deserialize_with = "check::positive")]
    pub smoothing: f64,
    /// The solver of a step.
    #[serde(deserialize_with = "check::word")]
    pub solver: SolverName,
    /// Real clock, frozen solvers: time after which a step takes its latest iterate (s). Default: no limit.
    #[serde(deserialize_with = "check::optional_positive")]
    pub budget: Option<f64>,
    /// Solver: final residual, relative to the first residual of the step.
    #[serde(deserialize_with = "check::tolerance")]
    pub tolerance: f64,
    /// Solver: largest number of iterations per step.
    #[serde(deserialize_with = "check::iterations")]
    pub max_iterations: usize,
    /// Threads that share the work of a step. The results do not depend on the number.
    #[serde(deserialize_with = "check::threads")]
    pub threads: usize,
}

/// `host.solver`: the solver of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SolverName {
    /// The host chooses the solver for each body.
    #[default]
    Auto,
    /// Conjugate gradients without an assembled matrix, preconditioned by a frozen factor.
    Frozen,
    /// As `Frozen`, with an incomplete factor and the motions of patches. It is for bodies whose complete factor is too
    /// large.
    Incomplete,
}

impl Default for Host {
    fn default() -> Self {
        Self {
            step_rate: 250.0,
            publish_rate: 250.0,
            latency: 0.004,
            smoothing: 30.0,
            solver: SolverName::Auto,
            budget: None,
            tolerance: 1e-6,
            max_iterations: 1000,
            threads: 1,
        }
    }
}

/// The mask of a button, which the scene counts from one, up to sixteen; zero for none.
pub fn button_mask(button: Option<usize>) -> u32 {
    button.map_or(0, |number| 1 << (number - 1))
}
