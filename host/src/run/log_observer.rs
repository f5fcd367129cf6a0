//! The log as an observer of a run.
//!
//! A log that can no longer be written (a full disk) ends early. The run and its summary continue without the log. In a series
//! of files, another file is begun as soon as that is possible.

use super::Clock;
use super::log_frames::LogFrames;
use super::observer::{Observed, Observer};
use super::tears::TearEvents;
use crate::live::gather::Gatherer;
use crate::log::overview::{Overview, OverviewBuilder};
use crate::log::series::Series;
use crate::log::{LogError, LogFile, LogWriter};
use crate::record::{ContactStep, ModelRow, PatchRow};
use crate::scene::LoadedScene;
use runner::link::LogRecord;
use std::fs::File;
use std::io::BufWriter;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Length of the data that may be lost when the process is killed (s).
const FLUSH_PERIOD: f64 = 0.5;
const FLUSHES_A_SECOND: u64 = 2;

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
    /// What begins the next file; `None` for a log of one file.
    next: Option<Next>,
}

/// What begins a file of a series.
pub(super) struct Next {
    pub series: Series,
    /// Begins a log of the run in a file.
    pub begin: Box<dyn Fn(LogFile) -> Result<Writer, LogError> + Send>,
    pub loaded: LoadedScene,
    pub clock: Clock,
    /// Number of ticks before the present file.
    pub before: u64,
    /// Number of ticks that no file has, because none could be written.
    pub lost: u64,
}

impl Next {
    /// Begins the next file. A file whose beginning does not reach the disk is removed again.
    fn begin(&mut self) -> Result<Writer, LogError> {
        let path = self.series.next();
        let begun = LogFile::open(&path).and_then(&self.begin);
        if begun.is_err() {
            self.series.give_up();
        }
        begun
    }
}

impl LogObserver {
    /// An observer for a run of `loaded`. `frames` gives the frames of the bodies, and `tears` what tears. `logged` receives
    /// the number of ticks in the log that survive this process. `next` begins further files.
    pub(super) fn new(
        log: Writer,
        loaded: &LoadedScene,
        clock: Clock,
        (frames, tears): (Option<LogFrames>, TearEvents),
        logged: &Arc<AtomicU64>,
        next: Option<Next>,
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
            next,
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

impl LogObserver {
    /// Begins the next file of a series, if the present one is over or could not be written.
    fn turn_over(&mut self) {
        let Some(next) = &mut self.next else {
            return;
        };
        let ticks = self.taken - next.before;
        match self.log.take() {
            Some(log)
                if !next
                    .series
                    .is_over(ticks / self.flush_every / FLUSHES_A_SECOND) =>
            {
                self.log = Some(log);
                return;
            }
            Some(log) => {
                let fresh = OverviewBuilder::new(Gatherer::new(&next.loaded, next.clock));
                let overview = std::mem::replace(&mut self.overview, fresh).finish();
                self.failure = end(log, &overview).err();
            }
            None => next.lost += self.flush_every,
        }
        match next.begin() {
            Ok(log) => {
                self.log = Some(log);
                self.failure = None;
            }
            Err(error) => self.failure = Some(error),
        }
        next.before = self.taken;
    }
}

/// Ends a file with its overview.
fn end(mut log: Writer, overview: &Overview) -> Result<(), LogError> {
    log.write_overview(overview)?;
    log.finish().map(drop)
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
                    self.turn_over();
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
        let ended = self.log.map_or(Ok(()), |log| end(log, &overview));
        if let Some(lost) = self.next.map(|next| next.lost).filter(|lost| *lost > 0) {
            let lacks = format!(
                "the logs lack about {lost} ticks, because no file could be written meanwhile"
            );
            observed.degradations.push(lacks);
        }
        if let Some(error) = self.failure.or(ended.err()) {
            let what = format!("the log ended early: {error}");
            observed.failures.push(what);
        } else if let Some(lacks) = self.frames.as_ref().and_then(LogFrames::lacks) {
            observed.degradations.push(lacks);
        }
    }
}
