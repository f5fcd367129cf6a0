//! `[device.hand]`: the hands that hold devices, with their grips and tasks.

use crate::check;
use serde::Deserialize;
use sim::{Arm, TaskKind, Wrist};

/// `[device.hand]`: an arm that follows a trajectory, the sum of task, waypoints, sinusoids and recording.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hand {
    /// The grip: a named set of mass, damping and stiffness of the arm and of the wrist.
    #[serde(default, deserialize_with = "check::optional_word")]
    pub grip: Option<GripName>,
    /// Moving mass (kg), if it differs from the grip's.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub mass: Option<f64>,
    /// Stiffness towards the trajectory (N/m), if it differs from the grip's.
    #[serde(default, deserialize_with = "check::optional_not_negative")]
    pub stiffness: Option<f64>,
    /// Damping (N s/m), if it differs from the grip's.
    #[serde(default, deserialize_with = "check::optional_not_negative")]
    pub damping: Option<f64>,
    /// RMS amplitude of the tremor (m).
    #[serde(default, deserialize_with = "check::not_negative")]
    pub tremor: f64,
    /// The task of the hand. The fields from `direction` to `variation` are parameters of the task.
    #[serde(default, deserialize_with = "check::optional_word")]
    pub task: Option<TaskName>,
    /// Every task: direction of the motion, in device axes. The length of the vector has no effect.
    #[serde(default, deserialize_with = "check::optional_finite3")]
    pub direction: Option<[f64; 3]>,
    /// Every task: displacement along the direction (m).
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub depth: Option<f64>,
    /// All but `shake`: mean speed of a reach (m/s).
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub speed: Option<f64>,
    /// All but `shake`: time at rest before each reach (s).
    #[serde(default, deserialize_with = "check::optional_not_negative")]
    pub pause: Option<f64>,
    /// `rub`, `move_together`, `shake`: displacement sideways (m).
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub width: Option<f64>,
    /// `rub`, `shake`: frequency of the rhythm (Hz), at most 5.
    #[serde(default, deserialize_with = "check::optional_hand_frequency")]
    pub frequency: Option<f64>,
    /// Every task: fraction by which its parameters vary from one repetition to the next, at most 0.5.
    #[serde(default, deserialize_with = "check::optional_variation")]
    pub variation: Option<f64>,
    /// Rows `[time, x, y, z]` joined by minimum-jerk segments (s, m from the start).
    #[serde(default, deserialize_with = "check::rows4")]
    pub waypoints: Vec<[f64; 4]>,
    /// Rows `[time, x, y, z]` of rotation vectors of the handle, joined by minimum-jerk segments (s, rad from the start).
    #[serde(default, deserialize_with = "check::rows4")]
    pub turns: Vec<[f64; 4]>,
    /// Sinusoids of the trajectory.
    #[serde(default, deserialize_with = "check::tables")]
    pub sines: Vec<Sine>,
    /// The buttons that the hand presses.
    #[serde(default, deserialize_with = "check::tables")]
    pub presses: Vec<Press>,
    /// The contours that the hand traces.
    #[serde(default, deserialize_with = "check::tables")]
    pub traces: Vec<Trace>,
    /// A recorded trajectory, its path relative to the scene file (CSV: time, x, y, z).
    #[serde(default)]
    pub recording: Option<String>,
}

impl Hand {
    /// The arm of the grip, or the typical arm without a grip. Mass, damping and stiffness of the hand replace those of
    /// the grip.
    pub fn arm(&self) -> Arm {
        let grip = self.grip.map_or(Arm::default(), GripName::arm);
        Arm {
            mass: self.mass.unwrap_or(grip.mass),
            damping: self.damping.unwrap_or(grip.damping),
            stiffness: self.stiffness.unwrap_or(grip.stiffness),
        }
    }

    /// The wrist of the grip, or the typical wrist without a grip.
    pub fn wrist(&self) -> Wrist {
        self.grip.map_or(Wrist::default(), GripName::wrist)
    }
}

/// Names of grips, from relaxed to rigid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GripName {
    /// A loose grip of two fingers: 0.1 kg, 2 N s/m, 30 N/m.
    Relaxed,
    /// The arm of a person who does not resist: 0.554 kg, 6.45 N s/m, 135 N/m.
    Typical,
    /// A firm grip: 0.95 kg, 25 N s/m, 700 N/m.
    Firm,
    /// A braced fist: 2 kg, 60 N s/m, 2,000 N/m.
    Rigid,
}

impl GripName {
    /// The index of the grip in [`Arm::GRIPS`] and [`Wrist::GRIPS`].
    fn place(self) -> usize {
        match self {
            Self::Relaxed => 0,
            Self::Typical => 1,
            Self::Firm => 2,
            Self::Rigid => 3,
        }
    }

    fn arm(self) -> Arm {
        Arm::GRIPS[self.place()].1
    }

    fn wrist(self) -> Wrist {
        Wrist::GRIPS[self.place()].1
    }
}

/// Names of tasks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TaskName {
    /// The hand reaches along the direction and returns at once, repeatedly, with a pause before each reach.
    Tap,
    /// The hand reaches along the direction after a pause, and stays there.
    PressAndHold,
    /// The hand reaches along the direction after a pause, and swings sideways there.
    Rub,
    /// The hand pulls along the direction, holds for the pause and returns, repeatedly.
    PullApart,
    /// The hand moves along a closed path as large as the depth and the width. Hands with equal fields move alike.
    MoveTogether,
    /// The hand swings along the direction, and less regularly sideways.
    Shake,
}

impl TaskName {
    /// The task of the simulation.
    pub fn kind(self) -> TaskKind {
        match self {
            Self::Tap => TaskKind::Tap,
            Self::PressAndHold => TaskKind::PressAndHold,
            Self::Rub => TaskKind::Rub,
            Self::PullApart => TaskKind::PullApart,
            Self::MoveTogether => TaskKind::MoveTogether,
            Self::Shake => TaskKind::Shake,
        }
    }
}

/// One button that a hand holds down for a time.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Press {
    /// The button, counted from one.
    #[serde(deserialize_with = "check::button")]
    pub button: usize,
    /// Start (s).
    #[serde(deserialize_with = "check::not_negative")]
    pub from: f64,
    /// End (s).
    #[serde(deserialize_with = "check::not_negative")]
    pub to: f64,
}

/// One contour that a hand traces: it presses a surface and moves along it.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trace {
    /// Start (s).
    #[serde(deserialize_with = "check::not_negative")]
    pub from: f64,
    /// End (s).
    #[serde(deserialize_with = "check::not_negative")]
    pub to: f64,
    /// Where the surface is, in device axes. The length of the vector has no effect.
    #[serde(deserialize_with = "check::finite3")]
    pub direction: [f64; 3],
    /// Where the hand goes on, in device axes. The length of the vector has no effect.
    #[serde(deserialize_with = "check::finite3")]
    pub heading: [f64; 3],
    /// The force with which the hand presses (N).
    #[serde(deserialize_with = "check::positive")]
    pub force: f64,
    /// Speed along the surface (m/s).
    #[serde(deserialize_with = "check::positive")]
    pub speed: f64,
}

/// One sinusoid of a hand's trajectory.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sine {
    /// Amplitude (m).
    #[serde(deserialize_with = "check::finite3")]
    pub amplitude: [f64; 3],
    /// Frequency (Hz), at most 5.
    #[serde(deserialize_with = "check::hand_frequency")]
    pub frequency: f64,
    /// Phase (rad).
    #[serde(default, deserialize_with = "check::finite")]
    pub phase: f64,
}
