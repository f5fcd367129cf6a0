//! `[solve]`: equilibrium or motion without devices.

use crate::scene::check;
use serde::Deserialize;

/// `[solve]`: how `palpate solve` goes about a scene.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Solve {
    /// What is asked.
    #[serde(deserialize_with = "check::word")]
    pub analysis: Analysis,
    /// `static`: steps in which displacements, loads and weight grow; each is a frame of the result.
    #[serde(deserialize_with = "check::frames")]
    pub load_steps: usize,
    /// `dynamic`: length of a time step (s).
    #[serde(deserialize_with = "check::positive")]
    pub step: f64,
    /// `dynamic`: how time is discretized.
    #[serde(deserialize_with = "check::word")]
    pub scheme: TimeScheme,
    /// `dynamic`: time over which displacements and loads grow, evenly, to their full values (s); weight is
    /// there from the start. Not given: the whole duration.
    #[serde(deserialize_with = "check::optional_not_negative")]
    pub ramp: Option<f64>,
    /// `dynamic`: frames of the result, evenly in time, beside the start.
    #[serde(deserialize_with = "check::frames")]
    pub frames: usize,
    /// Residual as a share of the forces that balance.
    #[serde(deserialize_with = "check::tolerance")]
    pub tolerance: f64,
    /// Most Newton iterations of one solve, before its step is halved.
    #[serde(deserialize_with = "check::iterations")]
    pub max_iterations: usize,
    /// Whether a step that turns elements inside out is halved, and refused if that does not help.
    pub refuse_inversion: bool,
}

impl Default for Solve {
    fn default() -> Self {
        Self {
            analysis: Analysis::Static,
            load_steps: 1,
            step: 0.01,
            scheme: TimeScheme::TrBdf2,
            ramp: None,
            frames: 20,
            tolerance: 1e-8,
            max_iterations: 50,
            refuse_inversion: true,
        }
    }
}

/// What is asked of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Analysis {
    /// Equilibrium.
    Static,
    /// Motion in time.
    Dynamic,
}

/// How time is discretized.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TimeScheme {
    /// First order, strongly damped.
    ImplicitEuler,
    /// Second order, little damped; two solves a step.
    TrBdf2,
}
