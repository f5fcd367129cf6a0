//! `[device.hand]`: the hands that hold devices, how they grip and what they do.

use crate::scene::check;
use serde::Deserialize;
use sim::{Arm, TaskKind, Wrist};

/// `[device.hand]`: an arm that follows a trajectory. Task, waypoints, sinusoids and recording add up.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hand {
    /// How it holds the device: mass, damping and stiffness at once, and those of the wrist.
    #[serde(default, deserialize_with = "check::optional_word")]
    pub grip: Option<GripName>,
    /// Moving mass (kg), if not the grip's.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub mass: Option<f64>,
    /// Stiffness towards the trajectory (N/m), if not the grip's.
    #[serde(default, deserialize_with = "check::optional_not_negative")]
    pub stiffness: Option<f64>,
    /// Damping (N s/m), if not the grip's.
    #[serde(default, deserialize_with = "check::optional_not_negative")]
    pub damping: Option<f64>,
    /// Root mean square of the tremor (m).
    #[serde(default, deserialize_with = "check::not_negative")]
    pub tremor: f64,
    /// What it does; the fields from `direction` to `variation` are the task's.
    #[serde(default, deserialize_with = "check::optional_word")]
    pub task: Option<TaskName>,
    /// Every task: where to, device axes; only the direction counts.
    #[serde(default, deserialize_with = "check::optional_finite3")]
    pub direction: Option<[f64; 3]>,
    /// Every task: how far along the direction (m).
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub depth: Option<f64>,
    /// All but `shake`: mean speed of a reach (m/s).
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub speed: Option<f64>,
    /// All but `shake`: time at rest before each reach (s).
    #[serde(default, deserialize_with = "check::optional_not_negative")]
    pub pause: Option<f64>,
    /// `rub`, `move_together`, `shake`: how far sideways (m).
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub width: Option<f64>,
    /// `rub`, `shake`: frequency of the rhythm (Hz), at most 5.
    #[serde(default, deserialize_with = "check::optional_hand_frequency")]
    pub frequency: Option<f64>,
    /// Every task: share by which its numbers vary from one time to the next, at most 0.5.
    #[serde(default, deserialize_with = "check::optional_variation")]
    pub variation: Option<f64>,
    /// Rows `[time, x, y, z]` joined by minimum-jerk segments (s, m from the start).
    #[serde(default, deserialize_with = "check::rows4")]
    pub waypoints: Vec<[f64; 4]>,
    /// Sinusoids added to it.
    #[serde(default, deserialize_with = "check::tables")]
    pub sines: Vec<Sine>,
    /// A recorded trajectory, its path relative to the scene file (CSV: time, x, y, z).
    #[serde(default)]
    pub recording: Option<String>,
}

impl Hand {
    /// The arm: the grip's, or the typical one, with the numbers that are given in place of its.
    pub fn arm(&self) -> Arm {
        let grip = self.grip.map_or(Arm::default(), GripName::arm);
        Arm {
            mass: self.mass.unwrap_or(grip.mass),
            damping: self.damping.unwrap_or(grip.damping),
            stiffness: self.stiffness.unwrap_or(grip.stiffness),
        }
    }

    /// The wrist: the grip's, or the typical one.
    pub fn wrist(&self) -> Wrist {
        self.grip.map_or(Wrist::default(), GripName::wrist)
    }
}

/// Names of grips, from relaxed to rigid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GripName {
    /// Two fingers that barely hold: 0.1 kg, 2 N s/m, 30 N/m.
    Relaxed,
    /// The arm of a person who does not resist: 0.554 kg, 6.45 N s/m, 135 N/m.
    Typical,
    /// A hand that means to hold on: 0.95 kg, 25 N s/m, 700 N/m.
    Firm,
    /// A braced fist: 2 kg, 60 N s/m, 2,000 N/m.
    Rigid,
}

impl GripName {
    /// The place among the grips of [`Arm::GRIPS`] and [`Wrist::GRIPS`].
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
    /// Goes in and comes back at once, again and again with a pause in between.
    Tap,
    /// Goes in after a pause, and stays.
    PressAndHold,
    /// Goes in after a pause, and swings sideways there.
    Rub,
    /// Pulls out, holds for the pause, lets back, again and again.
    PullApart,
    /// Goes round by the depth and the width; hands with equal fields go alike.
    MoveTogether,
    /// Swings along the direction, and less regularly sideways.
    Shake,
}

impl TaskName {
    /// What the simulation calls it.
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
