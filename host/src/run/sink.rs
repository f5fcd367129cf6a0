//! Where a run's records go: added up for the summary, and into the log if there is one.
//!
//! A log that cannot be written on (a full disk) ends; the run and its summary go on without it.

use super::collect::{Collected, Collector};
use crate::log::{LogError, LogWriter};
use runner::link::LogRecord;
use std::fs::File;
use std::io::BufWriter;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// How much data may be lost when the process is killed (s).
const FLUSH_PERIOD: f64 = 0.5;

/// Where records go.
pub(super) struct Sink {
    collector: Collector,
    log: Option<LogWriter<BufWriter<File>>>,
    failure: Option<LogError>,
    /// Ticks from one flush to the next.
    flush_every: u64,
    taken: u64,
    logged: Arc<AtomicU64>,
}

impl Sink {
    /// For a run at `rate` ticks a second.
    pub(super) fn new(
        collector: Collector,
        log: Option<LogWriter<BufWriter<File>>>,
        rate: f64,
    ) -> Self {
        Self {
            collector,
            log,
            failure: None,
            flush_every: (rate * FLUSH_PERIOD).max(1.0) as u64,
            taken: 0,
            logged: Arc::new(AtomicU64::new(0)),
        }
    }

    /// Ticks in the log that survive this process; it counts on while the sink works elsewhere.
    pub(super) fn logged(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.logged)
    }

    /// Takes a record.
    pub(super) fn take(&mut self, record: LogRecord<'_>) {
        match record {
            LogRecord::Model(body, model) => self.write(|log| log.write_model(body, model)),
            LogRecord::Tick(telemetry) => {
                self.collector.take(telemetry);
                self.write(|log| log.write(telemetry));
                self.taken += 1;
                if self.taken.is_multiple_of(self.flush_every) {
                    self.write(LogWriter::flush);
                    if self.log.is_some() {
                        // Relaxed: the number carries nothing but itself.
                        self.logged.store(self.taken, Ordering::Relaxed);
                    }
                }
            }
        }
    }

    fn write(
        &mut self,
        write: impl FnOnce(&mut LogWriter<BufWriter<File>>) -> Result<(), LogError>,
    ) {
        if let Some(log) = &mut self.log
            && let Err(error) = write(log)
        {
            self.failure = Some(error);
            self.log = None;
        }
    }

    /// Ends the log. What the run adds up to, and why the log ended early if it did.
    pub(super) fn finish(self) -> (Collected, Option<LogError>) {
        let ended = self.log.map_or(Ok(()), |log| log.finish().map(|_| ()));
        (self.collector.finish(), self.failure.or(ended.err()))
    }
}
