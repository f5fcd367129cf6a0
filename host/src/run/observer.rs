//! The observers of a run. Each observer receives every record.
//!
//! The summary and the log are observers. The caller of a run may add others ([`super::run_watched`]). Under the real
//! clock the observers work on the log's thread, a hundred times a second. The tick does not depend on them.

use super::collect::Collected;
use super::contacts::ContactSteps;
use crate::record::ContactStep;
use runner::kernel::KernelWindow;
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

    /// Takes the contacts of a host step, before the first tick that follows the step.
    fn touched(&mut self, _step: &mut ContactStep) {}

    /// Takes what the kernel counted for the tick's thread in a window of the run, after every tick that ended in the window.
    /// Only a run under the real clock has such counts.
    fn counted(&mut self, _window: &KernelWindow) {}

    /// Called after the records that waited have been taken, and many times a second while none comes.
    fn drained(&mut self) {}

    /// Ends the observer when the run is over, and adds its results to `observed`.
    fn finish(self: Box<Self>, observed: &mut Observed);
}

/// The observers of a run, in the order in which they receive each record.
#[derive(Default)]
pub struct Observers {
    list: Vec<Box<dyn Observer>>,
    /// The contacts of the host steps.
    contacts: ContactSteps,
    /// The number of the next tick.
    next: u64,
}

impl Observers {
    /// A list without observers.
    pub fn new() -> Self {
        Self::default()
    }

    /// The list with `observer` added at its end.
    pub fn with(mut self, observer: impl Observer + 'static) -> Self {
        self.list.push(Box::new(observer));
        self
    }

    /// The list whose observers take `contacts`.
    pub(super) fn touching(mut self, contacts: ContactSteps) -> Self {
        self.contacts = contacts;
        self
    }

    /// Gives every observer a record, and before a tick the contacts of the steps that were due until the tick.
    pub(super) fn take(&mut self, record: LogRecord<'_>) {
        if let LogRecord::Tick(telemetry) = &record {
            self.take_contacts(telemetry.time_ns, telemetry.tick);
            self.next = telemetry.tick + 1;
        }
        for observer in &mut self.list {
            observer.take(record);
        }
    }

    fn take_contacts(&mut self, until_ns: u64, tick: u64) {
        let list = &mut self.list;
        self.contacts.until(until_ns, |step| {
            step.tick = tick;
            for observer in &mut *list {
                observer.touched(step);
            }
        });
    }

    /// Gives every observer the contacts of a step of a log.
    pub(super) fn touched(&mut self, step: &mut ContactStep) {
        for observer in &mut self.list {
            observer.touched(step);
        }
    }

    /// Gives every observer a window of the kernel's counts.
    pub(super) fn counted(&mut self, window: &KernelWindow) {
        for observer in &mut self.list {
            observer.counted(window);
        }
    }

    /// Tells every observer that the records that waited have been taken.
    pub(super) fn drained(&mut self) {
        for observer in &mut self.list {
            observer.drained();
        }
    }

    /// Ends all observers and returns their results.
    pub(super) fn finish(mut self) -> Observed {
        // No tick follows the last steps.
        self.take_contacts(u64::MAX, self.next);
        let mut observed = Observed::default();
        for observer in self.list {
            observer.finish(&mut observed);
        }
        let missing = self.contacts.missing();
        if missing > 0 {
            observed.degradations.push(format!(
                "log and table lack the contacts of {missing} host steps, because they were not written as fast as the run"
            ));
        }
        observed
    }
}
