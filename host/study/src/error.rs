//! The errors of the studies.

use host::scene::SceneError;
use physics::mesh::MeshError;
use physics::mesh::generate::SheetError;
use physics::mesh::generate_box::BoxError;
use physics::mesh::generate_plate::PlateError;
use physics::{BodyError, CondenseError, StepError};

/// Why a study, or a cell of it, could not run.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// A scene cannot be built.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The host of a scene cannot publish at a rate.
    #[error(
        "--publish-rates: found {found:?}, allowed: host.step_rate of the scene, {step_rate:?}, divided by a whole number"
    )]
    PublishRate {
        /// The rate that was asked for (Hz).
        found: f64,
        /// Physics steps of the host a second (Hz).
        step_rate: f64,
    },
    /// A comparison would measure nothing, because its runs end before the measurements begin.
    #[error(
        "--from: found {found}, allowed: a number below the duration of the runs, which is {duration} (s)"
    )]
    MeasuredFrom {
        /// The time that was asked for (s).
        found: f64,
        /// Length of the runs (s).
        duration: f64,
    },
    /// The reference has the hands of a scene hold handles, and no tools.
    #[error(
        "the reference moves handles alone, and the tool {0:?} touches. A host that steps in every tick tells its force: \
         palpate run --set host.step_rate=1000 --set host.publish_rate=1000 --set host.latency=0"
    )]
    Tool(String),
    /// The host of a run panicked.
    #[error("the host panicked: {0}")]
    Host(String),
    /// The text of a scene cannot be read as TOML.
    #[error(transparent)]
    Text(#[from] toml::de::Error),
    /// A sheet cannot be generated.
    #[error(transparent)]
    Sheet(#[from] SheetError),
    /// A box cannot be generated.
    #[error(transparent)]
    Box(#[from] BoxError),
    /// A plate cannot be generated.
    #[error(transparent)]
    Plate(#[from] PlateError),
    /// The vertices of a slit are not joined by edges: it is too near to another one or to a corner.
    #[error("a slit of a specimen is not made of edges of its mesh")]
    Slit,
    /// A tear of a specimen ended before its measurement did.
    #[error("the tear of a specimen rests before it has the length to be measured")]
    Rests,
    /// A patch about the tip of a tear cannot be measured.
    #[error(transparent)]
    Tear(#[from] physics::tear::TearError),
    /// A sheet cannot tear.
    #[error(transparent)]
    Tearing(#[from] physics::TearingError),
    /// A mesh is no surface that can tear.
    #[error(transparent)]
    Surface(#[from] physics::topology::SurfaceError),
    /// A mesh has no border.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// An obstacle cannot be built.
    #[error(transparent)]
    Obstacle(#[from] physics::contact::obstacle::ObstacleError),
    /// A mesh of a specimen cannot be read.
    #[error(transparent)]
    File(#[from] meshio::MeshFileError),
    /// A body cannot be built or changed.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// A step or an equilibrium failed.
    #[error(transparent)]
    Step(#[from] StepError),
    /// `palpate solve` did not find an equilibrium.
    #[error("an equilibrium was not found: {0}")]
    Unsolved(String),
    /// A condensation or a factorization failed.
    #[error(transparent)]
    Condense(#[from] CondenseError),
}
