//! Tearing of sheets against fracture mechanics: onset, force, path and energy, on meshes of several sizes and patterns.
//!
//! - `delaunay`, `patterns`: the meshes of the specimens. `specimen`: their materials.
//! - `rig`: a sheet that tears, with its stepper. `pull`: a notched sheet that two hands tear. `plate`: a plate with a slit
//!   or a notch under even tractions.
//! - [`meshes`]: force and energy of a tear on different meshes. [`strip`]: the start of a tear in a long strip.
//!   [`trousers`]: the force of a trousers test.
//! - [`running`]: the displacement at which a tear runs through a strip.
//! - [`smooth`]: the force of hands that tear a cloth, whatever the damping and the steps.
//! - [`kinks`]: the start and the first kink of a crack at an angle to the load. [`notches`]: the start at short notches.
//!   [`strength`]: strips without a notch.
//! - [`energy`]: the account of the energy of a tear.
//! - [`edits`]: what tears do to a mesh.
//! - [`runs`]: tears in whole runs of the shipped scenes.

mod delaunay;
pub mod edits;
pub mod energy;
pub mod kinks;
pub mod meshes;
pub mod notches;
pub mod patterns;
mod plate;
mod pull;
pub(crate) mod rig;
pub mod running;
pub mod runs;
pub mod smooth;
mod specimen;
pub mod strength;
pub mod strip;
mod tables;
pub mod trousers;

pub use patterns::{Pattern, Patterned, Rectangle, Slit, Triangles};
pub use pull::EditErrors;
pub use specimen::{CLOTH, PAPER, Stuff};

use crate::{Level, StudyError};
use serde::Serialize;

/// The numbers of triangles of the meshes.
const SIZES: [usize; 4] = [700, 1400, 2800, 5600];

/// A section of the study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// Force, energy and start on different meshes.
    Mesh,
    /// The displacement at which a tear runs through a strip.
    Running,
    /// The force of a cloth, by damping and steps.
    Smooth,
    /// The force of a trousers test.
    Trousers,
    /// The start and the direction of a tear.
    Path,
    /// The start at short notches.
    Notches,
    /// Strips without a notch.
    Strength,
    /// The account of the energy.
    Energy,
    /// What tears do to a mesh.
    Meshes,
}

impl Section {
    /// All sections, in their order.
    pub const ALL: [Self; 9] = [
        Self::Mesh,
        Self::Running,
        Self::Smooth,
        Self::Trousers,
        Self::Path,
        Self::Notches,
        Self::Strength,
        Self::Energy,
        Self::Meshes,
    ];
}

/// The results of the study. A section that did not run is missing.
#[derive(Clone, Debug, Serialize)]
pub struct TearingStudy {
    /// `palpate.tearing/1`.
    pub schema: &'static str,
    /// The extent of the computation.
    pub level: Level,
    /// Force, energy and start on different meshes.
    pub mesh: Option<meshes::MeshStudy>,
    /// The tears through strips.
    pub running: Option<Vec<running::Run>>,
    /// The forces of cloths.
    pub smooth: Option<Vec<smooth::Smooth>>,
    /// The forces of trousers tests.
    pub trousers: Option<Vec<trousers::Trousers>>,
    /// The starts and the first kinks of cracks.
    pub path: Option<Vec<kinks::Kink>>,
    /// The starts at short notches.
    pub notches: Option<Vec<notches::Notch>>,
    /// The strips without a notch.
    pub strength: Option<Vec<strength::Strip>>,
    /// The accounts of the energy.
    pub energy: Option<Vec<energy::Account>>,
    /// The meshes before and after tears.
    pub meshes: Option<Vec<edits::Mesh>>,
}

/// Runs some sections. `progress` receives the fraction done.
///
/// # Errors
/// [`StudyError`].
pub fn run(
    sections: &[Section],
    level: Level,
    progress: &dyn Fn(f64),
) -> Result<TearingStudy, StudyError> {
    let mut found = TearingStudy {
        schema: "palpate.tearing/1",
        level,
        mesh: None,
        running: None,
        smooth: None,
        trousers: None,
        path: None,
        notches: None,
        strength: None,
        energy: None,
        meshes: None,
    };
    let count = sections.len().max(1) as f64;
    for (number, section) in sections.iter().enumerate() {
        let progress = |done: f64| progress((number as f64 + done) / count);
        match section {
            Section::Mesh => found.mesh = Some(meshes::run(level, &progress)?),
            Section::Running => found.running = Some(running::run(level, &progress)?),
            Section::Smooth => found.smooth = Some(smooth::run(level, &progress)?),
            Section::Trousers => found.trousers = Some(trousers::run(level, &progress)?),
            Section::Path => found.path = Some(kinks::run(level, &progress)?),
            Section::Notches => found.notches = Some(notches::run(level, &progress)?),
            Section::Strength => found.strength = Some(strength::run(level, &progress)?),
            Section::Energy => found.energy = Some(energy::run(level, &progress)?),
            Section::Meshes => found.meshes = Some(edits::run(level, &progress)?),
        }
    }
    Ok(found)
}
