//! The stages of a preparation, before the work has a measurable fraction: for people who wait.

/// A stage of the preparation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

impl Stage {
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
