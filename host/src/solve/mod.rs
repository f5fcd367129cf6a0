//! Solves a scene without devices: equilibrium under displacements and loads, or motion in time.
//!
//! Handles stay at their rest poses. Supports move and loads grow in proportion to the load steps of a static
//! solve, or to the time of the ramp of a dynamic solve. In a static solve, bodies settle under their weight first,
//! with their supports in their places. Each body is solved by itself, unless something touches in the scene: then all
//! bodies are solved together, for equilibrium (`contact`). Obstacles stay where they start.

mod contact;
mod curve;
mod drive;
pub mod frames;
pub mod grid;
pub(crate) mod report;
mod result;
mod table;

use crate::scene::SceneError;
use crate::scene::spec::Analysis;
use crate::world::World;
use drive::State;
use meshio::write_vtu::UnstructuredGrid;
use physics::CondenseError;

pub use contact::check_solved;
pub use curve::has_load_curves;
pub use result::{BodySolution, Extreme, PairRow, PairSolution, Reaction, Row, SCHEMA, Solution};

/// A state of one body to be kept as a frame of the result.
#[derive(Debug)]
pub struct Frame<'a> {
    /// The body's name.
    pub body: &'a str,
    /// Number of the frame, from 0 at rest.
    pub number: usize,
    /// Time (s), or fraction of the displacements and loads. If bodies settle under their weight first, rest is at -1
    /// and the settled state is at 0.
    pub at: f64,
    /// Positions, displacement, velocity, stress, material.
    pub grid: UnstructuredGrid,
}

/// The reason why a scene could not be solved at all. A solve that ends early is a [`Solution`] with a failure.
#[derive(Debug, thiserror::Error)]
pub enum SolveError<E> {
    /// There is no memory for the matrix.
    #[error(transparent)]
    Matrix(#[from] CondenseError),
    /// A surface cannot touch, or the scene asks for a motion with contact.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A frame could not be kept.
    #[error(transparent)]
    Frame(E),
}

/// Solves every body of a scene. If `wants_frames`, the function passes each frame to `frame`, whose error ends
/// the solve. It passes the fraction of the steps done to `progress`.
///
/// # Errors
/// [`SolveError`].
///
/// ```
/// use host::scene::Scene;
/// use host::solve::solve;
/// use host::world::World;
/// use std::convert::Infallible;
///
/// let loaded = Scene::embedded_default()?;
/// let world = World::new(&loaded)?;
/// let solution = solve(&world, false, &mut |_| {}, &mut |_| Ok::<(), Infallible>(()))?;
/// assert!(solution.failures.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn solve<E>(
    world: &World<'_>,
    wants_frames: bool,
    progress: &mut dyn FnMut(f64),
    frame: &mut dyn FnMut(Frame<'_>) -> Result<(), E>,
) -> Result<Solution, SolveError<E>> {
    let scene = &world.loaded.scene;
    let count = scene.bodies.len();
    progress(0.0);
    let mut solution = Solution {
        schema: SCHEMA,
        scene: scene.name.clone(),
        warnings: world.warnings.iter().map(ToString::to_string).collect(),
        analysis: scene.solve.analysis,
        scheme: (scene.solve.analysis == Analysis::Dynamic).then_some(scene.solve.scheme),
        bodies: Vec::new(),
        contacts: Vec::new(),
        failures: Vec::new(),
    };
    let mut keep = |drive: &drive::Drive, index: usize, number, at, pressure| {
        if !wants_frames {
            return Ok(());
        }
        frame(Frame {
            body: &scene.bodies[index].name,
            number,
            at,
            grid: drive.grid(pressure),
        })
        .map_err(SolveError::Frame)
    };
    let rest = if drive::settles_first(scene) {
        -1.0
    } else {
        0.0
    };
    if !world.contacts.is_empty() {
        contact::solve(world, rest, &mut solution, progress, &mut keep)?;
        return Ok(solution);
    }
    for index in 0..count {
        let mut drive = drive::Drive::new(scene, index, world.bodies[index].clone(), false)?;
        keep(&drive, index, 0, rest, None)?;
        let failure = loop {
            match drive.advance() {
                Ok(Some(state)) => {
                    if let Some(number) = state.frame {
                        keep(&drive, index, number, state.at, None)?;
                    }
                    progress((index as f64 + state.done) / count as f64);
                }
                Ok(None) => break None,
                Err(error) => break Some(error),
            }
        };
        if let Some(error) = failure {
            if let Some(State {
                frame: Some(number),
                at,
                ..
            }) = drive.halt()
            {
                keep(&drive, index, number, at, None)?;
            }
            let (name, at) = (&scene.bodies[index].name, drive.place());
            solution.failures.push(format!("{name}: {at}: {error}"));
        }
        solution.bodies.push(drive.finish());
    }
    Ok(solution)
}
