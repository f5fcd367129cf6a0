//! `[solve]`: equilibrium or motion without devices.

use crate::check;
use serde::Deserialize;

/// `[solve]`: the settings of `palpate solve`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Solve {
    /// The kind of analysis.
    #[serde(deserialize_with = "check::word")]
    pub analysis: Analysis,
    /// `static`: number of steps in which displacements and loads grow, after the bodies have settled under their weight.
    /// Each step is a frame of the result. If nothing but the weight acts, the weight grows in these steps.
    #[serde(deserialize_with = "check::frames")]
    pub load_steps: usize,
    /// `dynamic`: length of a time step (s).
    #[serde(deserialize_with = "check::positive")]
    pub step: f64,
    /// `dynamic`: time discretization.
    #[serde(deserialize_with = "check::word")]
    pub scheme: TimeScheme,
    /// `dynamic`: time over which displacements and loads grow linearly to their full values (s). Default: the whole
    /// duration. The weight acts in full from the start.
    #[serde(deserialize_with = "check::optional_not_negative")]
    pub ramp: Option<f64>,
    /// `dynamic`: number of frames of the result, evenly spaced in time, in addition to the start.
    #[serde(deserialize_with = "check::frames")]
    pub frames: usize,
    /// Final residual, relative to the forces that balance.
    #[serde(deserialize_with = "check::tolerance")]
    pub tolerance: f64,
    /// Largest number of Newton iterations of one solve, before its step is halved.
    #[serde(deserialize_with = "check::iterations")]
    pub max_iterations: usize,
    /// Whether a step that inverts elements is halved, and refused if smaller steps invert elements as well.
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

/// The kind of analysis of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Analysis {
    /// Equilibrium.
    Static,
    /// Motion in time.
    Dynamic,
}

/// The time discretization.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TimeScheme {
    /// First order, strongly damped.
    ImplicitEuler,
    /// Second order, little damped; two solves a step.
    TrBdf2,
}
