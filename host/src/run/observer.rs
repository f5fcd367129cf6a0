//! The observers of a run. Each observer receives every record.
//!
//! The summary and the log are observers. The caller of a run may add others ([`super::run_watched`]). Under the real
//! clock the observers work on the log's thread, fifty times a second. The tick does not depend on them.

use super::collect::Collected;
use runner::link::LogRecord;
use std::path::PathBuf;

/// The results of the observers at the end of a run.
#[derive(Debug, Default)]
pub struct Observed {
    /// The totals of the run's telemetry.
    pub(super) collected: Collected,
    /// The failures that ended an observer before the end of the run.
    pub failures: Vec<String>,
    /// The missing parts of outputs that did not fail, with their causes.
    pub degradations: Vec<String>,
    /// The files that could not be written. The reasons are among the failures.
    pub unwritten: Vec<PathBuf>,
}

/// An observer of a run.
pub trait Observer: Send {
    /// Takes a record. Telemetry comes in the order of the ticks, and each model before the ticks that used it.
    fn take(&mut self, record: LogRecord<'_>);

    /// Called after the records that waited have been taken, and many times a second while none comes.
    fn drained(&mut self) {}

    /// Ends the observer when the run is over, and adds its results to `observed`.
    fn finish(self: Box<Self>, observed: &mut Observed);
}

/// The observers of a run, in the order in which they receive each record.
#[derive(Default)]
pub struct Observers(Vec<Box<dyn Observer>>);

impl Observers {
    /// A list without observers.
    pub fn new() -> Self {
        Self::default()
    }

    /// The list with `observer` added at its end.
    pub fn with(mut self, observer: impl Observer + 'static) -> Self {
        self.0.push(Box::new(observer));
        self
    }

    /// Gives every observer a record.
    pub(super) fn take(&mut self, record: LogRecord<'_>) {
        for observer in &mut self.0 {
            observer.take(record);
        }
    }

    /// Tells every observer that the records that waited have been taken.
    pub(super) fn drained(&mut self) {
        for observer in &mut self.0 {
            observer.drained();
        }
    }

    /// Ends all observers and returns their results.
    pub(super) fn finish(self) -> Observed {
        let mut observed = Observed::default();
        for observer in self.0 {
            observer.finish(&mut observed);
        }
        observed
    }
}
