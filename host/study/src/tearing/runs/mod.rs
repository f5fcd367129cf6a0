//! Tears in whole runs of the shipped scenes: the course of the force, the times of the steps, and the error of the
//! force between publications.
//!
//! - [`figure`]: the force over a tear (thesis, figure 4.7).
//! - [`table`]: the times of the steps (thesis, table 4.1).
//! - [`feel`]: the force of slow hosts against that of a host that steps in every tick.

pub mod feel;
pub mod figure;
pub mod table;
mod tables;

use crate::{Level, StudyError};
use host::scene::{LoadedScene, Scene};
use serde::Serialize;
use std::collections::BTreeMap;

/// A shipped scene in which a sheet tears: its name, and its text.
pub type Shipped = (&'static str, &'static str);

/// A square of cloth.
pub const CLOTH: Shipped = (
    "tear_cloth.toml",
    include_str!("../../../../scenes/tear_cloth.toml"),
);

/// A banknote in its plane.
pub const BANKNOTE: Shipped = (
    "banknote.toml",
    include_str!("../../../../scenes/banknote.toml"),
);

/// A banknote out of its plane.
pub const BANKNOTE_SHEAR: Shipped = (
    "banknote_shear.toml",
    include_str!("../../../../scenes/banknote_shear.toml"),
);

/// Builds a shipped scene.
///
/// # Errors
/// [`StudyError`] if the scene cannot be built.
pub fn load((name, text): Shipped) -> Result<LoadedScene, StudyError> {
    Ok(Scene::load_texts(name, text, &BTreeMap::new())?)
}

/// A part of the study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunSection {
    /// The course of the force.
    Figure,
    /// The times of the steps.
    Table,
    /// The error of the force between publications.
    Feel,
}

/// The results of the study. A part that did not run is missing.
#[derive(Clone, Debug, Serialize)]
pub struct TearingRuns {
    /// `palpate.tearing_runs/1`.
    pub schema: &'static str,
    /// The extent of the computation.
    pub level: Level,
    /// The course of the force.
    pub figure: Option<figure::Course>,
    /// The times of the steps, by scene.
    pub table: Option<Vec<table::Row>>,
    /// The error of the force between publications.
    pub feel: Option<feel::Feel>,
}

/// Runs a part. `progress` receives the fraction done. `level` shortens the runs. The times of the steps are those of
/// `scenes`, or of the shipped scenes of cloth and banknote if `scenes` is empty.
///
/// # Errors
/// [`StudyError`].
pub fn run(
    part: RunSection,
    scenes: &[LoadedScene],
    level: Level,
    progress: &dyn Fn(f64),
) -> Result<TearingRuns, StudyError> {
    let mut found = TearingRuns {
        schema: "palpate.tearing_runs/1",
        level,
        figure: None,
        table: None,
        feel: None,
    };
    // The hands of the cloth have begun to tear it by then.
    let most = match level {
        Level::Quick => 2.0,
        Level::Full => f64::INFINITY,
    };
    match part {
        RunSection::Figure => found.figure = Some(figure::run(&load(CLOTH)?, most, progress)?),
        RunSection::Table => {
            let shipped = match scenes {
                [] => vec![load(CLOTH)?, load(BANKNOTE)?, load(BANKNOTE_SHEAR)?],
                _ => Vec::new(),
            };
            let scenes = if scenes.is_empty() { &shipped } else { scenes };
            let rows = scenes.iter().enumerate().map(|(number, scene)| {
                let progress = |done: f64| progress((number as f64 + done) / scenes.len() as f64);
                table::run(scene, most, &progress)
            });
            found.table = Some(rows.collect::<Result<_, _>>()?);
        }
        RunSection::Feel => found.feel = Some(feel::run(&load(CLOTH)?, most, progress)?),
    }
    Ok(found)
}
