//! What a scene file says, field by field, with its defaults. Units are SI.
//!
//! Each field that has a range checks it while it is read, so that the error carries the file's line and
//! the field's path.

pub mod body;
pub mod device;
pub mod hand;
pub mod mesh;
pub mod solve;

use super::check;
use serde::{Deserialize, Serialize};

pub use body::{Body, Handle, Load, Material, MeshSource, PatternName, Support};
pub use device::{Device, ModelName, SIMULATED};
pub use hand::{GripName, Hand, TaskName};
pub use solve::{Analysis, Solve};

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
    /// Fixes every random choice; `--seed` overrides it.
    #[serde(default)]
    pub seed: u64,
    /// The realtime loop.
    #[serde(default, rename = "loop", deserialize_with = "check::table")]
    pub realtime: Realtime,
    /// The host's physics.
    #[serde(default, deserialize_with = "check::table")]
    pub host: Host,
    /// What `palpate solve` does.
    #[serde(default, deserialize_with = "check::table")]
    pub solve: Solve,
    /// Acceleration of gravity (m/s^2).
    #[serde(default = "earth", deserialize_with = "check::finite3")]
    pub gravity: [f64; 3],
    /// Deformable bodies.
    #[serde(rename = "body", deserialize_with = "check::tables")]
    pub bodies: Vec<Body>,
    /// Haptic devices and the hands that hold them; a run needs at least one.
    #[serde(default, rename = "device", deserialize_with = "check::tables")]
    pub devices: Vec<Device>,
}

impl Scene {
    /// Index of the device that holds a handle of this scene: its consistency was checked when it was read, so the
    /// device exists.
    pub fn device_of(&self, handle: &Handle) -> usize {
        let holds = |device: &Device| device.name == handle.device;
        self.devices.iter().position(holds).unwrap_or(0)
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
    /// Ticks a second (Hz).
    #[serde(deserialize_with = "check::tick_rate")]
    pub rate: f64,
    /// Force between publications.
    #[serde(deserialize_with = "check::word")]
    pub scheme: SchemeName,
    /// `thesis` only: spring from handle to proxy (N/m).
    #[serde(deserialize_with = "check::not_negative")]
    pub thesis_stiffness: f64,
    /// `thesis` only: damping of the proxy (N s/m).
    #[serde(deserialize_with = "check::not_negative")]
    pub thesis_damping: f64,
    /// `proxy` only: spring between device and proxy (N/m); what the device's driver recommends if not given.
    #[serde(deserialize_with = "check::optional_positive")]
    pub proxy_stiffness: Option<f64>,
    /// `proxy` only: damper between device and proxy (N s/m); likewise.
    #[serde(deserialize_with = "check::optional_not_negative")]
    pub proxy_damping: Option<f64>,
    /// Share of a publication period over which a new model takes over.
    #[serde(deserialize_with = "check::share")]
    pub blend: f64,
    /// Age beyond which a model is not trusted (s); if not given, see [`Realtime::age_limit`].
    #[serde(deserialize_with = "check::optional_positive")]
    pub age_limit: Option<f64>,
    /// Time in which the force then fades (s).
    #[serde(deserialize_with = "check::positive")]
    pub decay: f64,
    /// Time in which it comes back (s).
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
    /// Age beyond which a model is not trusted (s). Under `capped` an old model is a passive spring, whatever has
    /// become of the body, and a force that fades loses what hands have put in: two seconds, the longest stall that
    /// the stress study knows. Under the others it is on its own: a tenth.
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
    /// The published wrench, held.
    Hold,
    /// Held, plus a spring to the proxy and damping (thesis, equation 4.5).
    Thesis,
    /// The local model's extrapolation.
    Linear,
    /// The same, felt through a spring and a damper to a proxy.
    Proxy,
    /// As `Linear`, damped once the hands have got more than they gave.
    Classic,
    /// As `Linear`, held to the energy that the hands have put in.
    Capped,
}

/// `[host]`: rates and solver.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Host {
    /// Physics steps a second (Hz).
    #[serde(deserialize_with = "check::rate")]
    pub step_rate: f64,
    /// Local models a second (Hz); at most `step_rate`, which it divides.
    #[serde(deserialize_with = "check::rate")]
    pub publish_rate: f64,
    /// Virtual clock: time from reading the hands to the model's arrival (s), at most 1.
    #[serde(deserialize_with = "check::latency")]
    pub latency: f64,
    /// Cut-off of the filter that smooths the handles' paths (Hz).
    #[serde(deserialize_with = "check::positive")]
    pub smoothing: f64,
    /// What solves a step.
    #[serde(deserialize_with = "check::word")]
    pub solver: SolverName,
    /// Real clock, frozen solvers: time after which a step is taken with what has been found (s); no limit if not
    /// given.
    #[serde(deserialize_with = "check::optional_positive")]
    pub budget: Option<f64>,
    /// Solver: residual relative to the step's first.
    #[serde(deserialize_with = "check::tolerance")]
    pub tolerance: f64,
    /// Solver: most iterations a step.
    #[serde(deserialize_with = "check::iterations")]
    pub max_iterations: usize,
}

/// `host.solver`: what solves a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SolverName {
    /// By the body.
    #[default]
    Auto,
    /// The assembled matrix, conjugate gradients on its diagonal blocks.
    Assembled,
    /// Nothing assembled, conjugate gradients on a frozen factor.
    Frozen,
    /// The same in single precision.
    FrozenSingle,
    /// As `Frozen`, on an incomplete factor with the motions of patches: for bodies whose complete one is too large.
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
        }
    }
}
