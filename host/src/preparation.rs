//! What is prepared before the work has a measurable fraction: for people who wait.

/// A part of the preparation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preparation {
    /// Reading scenes and meshes, and preparing anything else that has no variant.
    Reading,
    /// Making the meshes and elements of bodies.
    Building,
    /// Bringing bodies to equilibrium under their weight.
    Settling,
    /// Making the first factor of a matrix.
    Factorizing,
    /// Timing the first steps.
    Timing,
}

impl Preparation {
    /// The preparation for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Reading => "preparing",
            Self::Building => "building the bodies",
            Self::Settling => "settling the bodies under their weight",
            Self::Factorizing => "factorizing",
            Self::Timing => "timing a step",
        }
    }
}
