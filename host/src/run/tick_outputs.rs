//! The outputs that are made of ticks alone: the table and the force-displacement curves. A replay of a log makes them as
//! well as a run.

use super::csv::CsvObserver;
use super::load_curve::LoadCurveObserver;
use super::observer::Observers;
use crate::atomic_file::AtomicFileError;
use crate::scene::Scene;
use std::path::PathBuf;

/// The outputs that are made of the ticks of a run or a replay.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TickOutputs {
    /// Path of the table with a row for each tick (CSV).
    pub csv: Option<PathBuf>,
    /// Path of the picture of force against displacement.
    pub force_displacement: Option<PathBuf>,
}

impl TickOutputs {
    /// `observers`, and those that write these outputs. The table is begun.
    ///
    /// # Errors
    /// If the table cannot be begun.
    pub fn observe(
        &self,
        scene: &Scene,
        mut observers: Observers,
    ) -> Result<Observers, AtomicFileError> {
        if let Some(path) = &self.csv {
            observers = observers.with(CsvObserver::begin(path, scene)?);
        }
        if let Some(path) = &self.force_displacement {
            observers = observers.with(LoadCurveObserver::new(path, scene));
        }
        Ok(observers)
    }
}
