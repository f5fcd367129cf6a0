//! What the program is doing before its work has a measurable fraction: for people who wait.
//!
//! One number for the whole process, which a program may show from another thread. Nothing depends on it.

use std::sync::atomic::{AtomicU8, Ordering};

/// A stage of the preparation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Stage {
    /// Reading scenes and meshes, and preparing anything that has no stage of its own.
    Preparing,
    /// Making the meshes and elements of bodies.
    Building,
    /// Bringing bodies to equilibrium under their weight.
    Settling,
    /// Making the first factor of a matrix.
    Factorizing,
    /// Timing the first steps.
    Timing,
}

/// All stages, by their numbers.
const STAGES: [Stage; 5] = [
    Stage::Preparing,
    Stage::Building,
    Stage::Settling,
    Stage::Factorizing,
    Stage::Timing,
];

static NOW: AtomicU8 = AtomicU8::new(Stage::Preparing as u8);

impl Stage {
    /// Says that the process is now at this stage.
    pub fn begin(self) {
        // The number guards no other data.
        NOW.store(self as u8, Ordering::Relaxed);
    }

    /// The stage that the process is at.
    pub fn now() -> Self {
        let number = usize::from(NOW.load(Ordering::Relaxed));
        STAGES.get(number).copied().unwrap_or(Self::Preparing)
    }

    /// The stage for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Preparing => "preparing",
            Self::Building => "building the bodies",
            Self::Settling => "settling the bodies under their weight",
            Self::Factorizing => "factorizing",
            Self::Timing => "timing a step",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stage_that_began_last_is_the_present_one() {
        for stage in STAGES {
            stage.begin();
            assert_eq!(Stage::now(), stage);
        }
    }
}
