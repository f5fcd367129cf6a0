//! Who watches a run: a list of observers, each of which is given every record.
//!
//! The summary and the log are observers; whoever runs a scene may add others ([`super::run_watched`]). Under the real clock
//! they work on the log's thread, fifty times a second; the tick knows of none of them.

use super::collect::Collected;
use runner::link::LogRecord;

/// What observers leave when a run is over.
#[derive(Debug, Default)]
pub struct Observed {
    /// What the run's telemetry adds up to.
    pub(super) collected: Collected,
    /// What ended an observer before the run was over.
    pub failures: Vec<String>,
}

/// Somebody who watches a run.
pub trait Observer: Send {
    /// Takes a record. Telemetry comes in the order of the ticks, and each model before the ticks that used it.
    fn take(&mut self, record: LogRecord<'_>);

    /// The run is over: adds what there is to say to `observed`.
    fn finish(self: Box<Self>, observed: &mut Observed);
}

/// The observers of a run, in the order in which they are given each record.
#[derive(Default)]
pub struct Observers(Vec<Box<dyn Observer>>);

impl Observers {
    /// Nobody yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// The same and one more.
    pub fn with(mut self, observer: impl Observer + 'static) -> Self {
        self.0.push(Box::new(observer));
        self
    }

    /// Gives everybody a record.
    pub(super) fn take(&mut self, record: LogRecord<'_>) {
        for observer in &mut self.0 {
            observer.take(record);
        }
    }

    /// Ends all of them. What they leave.
    pub(super) fn finish(self) -> Observed {
        let mut observed = Observed::default();
        for observer in self.0 {
            observer.finish(&mut observed);
        }
        observed
    }
}
