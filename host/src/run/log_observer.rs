//! The log as an observer of a run.
//!
//! A log that can no longer be written (a full disk) ends early. The run and its summary continue without the log.

use super::Clock;
use super::log_frames::LogFrames;
use super::observer::{Observed, Observer};
use super::tears::TearEvents;
use crate::live::gather::Gatherer;
use crate::log::overview::OverviewBuilder;
use crate::log::{LogError, LogWriter};
use crate::record::{ContactStep, ModelRow, PatchRow};
use crate::scene::LoadedScene;
use runner::link::LogRecord;
use std::fs::File;
use std::io::BufWriter;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Length of the data that may be lost when the process is killed (s).
const FLUSH_PERIOD: f64 = 0.5;

type Writer = LogWriter<BufWriter<File>>;

/// Writes every record.
pub(super) struct LogObserver {
    /// The log's writer; `None` after a failure.
    log: Option<Writer>,
    failure: Option<LogError>,
    /// The frames of the bodies; `None` for a log without frames.
    frames: Option<LogFrames>,
    /// The edits of the sheets that tear.
    tears: TearEvents,
    /// The overview at the end of the log.
    overview: OverviewBuilder,
    /// Ticks from one flush to the next.
    flush_every: u64,
    taken: u64,
    logged: Arc<AtomicU64>,
}

impl LogObserver {
    /// An observer for a run of `loaded`. `frames` gives the frames of the bodies, and `tears` what tears. `logged` receives
    /// the number of ticks in the log that survive this process.
    pub(super) fn new(
        log: Writer,
        loaded: &LoadedScene,
        clock: Clock,
        (frames, tears): (Option<LogFrames>, TearEvents),
        logged: &Arc<AtomicU64>,
    ) -> Self {
        Self {
            log: Some(log),
            failure: None,
            frames,
            tears,
            overview: OverviewBuilder::new(Gatherer::new(loaded, clock)),
            flush_every: (loaded.scene.realtime.rate * FLUSH_PERIOD).max(1.0) as u64,
            taken: 0,
            logged: Arc::clone(logged),
        }
    }

    fn write(&mut self, write: impl FnOnce(&mut Writer) -> Result<(), LogError>) {
        if let Some(log) = &mut self.log
            && let Err(error) = write(log)
        {
            self.failure = Some(error);
            self.log = None;
        }
    }
}

impl LogObserver {
    /// Writes the frames that the host has taken. A frame precedes the ticks that follow its step.
    fn write_frames(&mut self) {
        if let Some(frames) = &mut self.frames
            && let Err(error) = frames.write(self.log.as_mut())
        {
            self.failure = Some(error);
            self.log = None;
        }
    }
}

impl Observer for LogObserver {
    fn take(&mut self, record: LogRecord<'_>) {
        match record {
            LogRecord::Model(body, model) => self.write(|log| {
                let mut row = ModelRow::new(body, model);
                log.write_record(row.stamp(), &mut row)
            }),
            LogRecord::Patch(device, patch) => self.write(|log| {
                let mut row = PatchRow::new(device, patch);
                log.write_record(row.stamp(), &mut row)
            }),
            LogRecord::Tick(telemetry) => {
                self.write_frames();
                while let Some((mut event, words)) = self.tears.next() {
                    self.write(|log| log.write_record(event.stamp(), &mut event));
                    if let Some(words) = words {
                        self.overview.tear(&telemetry.into(), &event, &words);
                    }
                }
                self.write(|log| log.write(telemetry));
                self.overview.take(&telemetry.into());
                self.taken += 1;
                if self.taken.is_multiple_of(self.flush_every) {
                    self.write(LogWriter::flush);
                    if self.log.is_some() {
                        // Relaxed: no other memory depends on this number.
                        self.logged.store(self.taken, Ordering::Relaxed);
                    }
                }
            }
        }
    }

    fn touched(&mut self, step: &mut ContactStep) {
        self.write(|log| log.write_record(step.stamp(), step));
    }

    /// Ends the log. If the log ended early, adds the reason to the failures.
    fn finish(mut self: Box<Self>, observed: &mut Observed) {
        self.write_frames();
        // No tick follows the last edits.
        while let Some((mut event, _)) = self.tears.next() {
            self.write(|log| log.write_record(event.stamp(), &mut event));
        }
        let overview = self.overview.finish();
        let ended = self.log.map_or(Ok(()), |mut log| {
            log.write_overview(&overview)?;
            log.finish().map(|_| ())
        });
        if let Some(error) = self.failure.or(ended.err()) {
            let what = format!("the log ended early: {error}");
            observed.failures.push(what);
        } else if let Some(lacks) = self.frames.as_ref().and_then(LogFrames::lacks) {
            observed.degradations.push(lacks);
        }
    }
}
