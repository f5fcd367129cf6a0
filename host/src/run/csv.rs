//! The table of a run as an observer: a row for each tick, written as the run goes.
//!
//! Rows are written whole: what is in the file when the process is killed is a table up to its last row. A table that can
//! no longer be written (a full disk) ends early; the run and its summary continue without it.

use super::observer::{Observed, Observer};
use crate::atomic_file::{AtomicFileError, Stream, open_stream, stream};
use crate::record::ContactStep;
use crate::record::contact::{ContactSum, contact_columns};
use crate::record::tick::{body_columns, device_columns, tick_columns, tool_columns};
use crate::scene::Scene;
use crate::table::{Columns, Line};
use crate::world::contact::touching;
use rt_core::Telemetry;
use rt_core::record::{BodyTelemetry, DeviceTelemetry, ToolTelemetry};
use runner::link::LogRecord;
use std::fs::{OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Length of the data that may be lost when the process is killed (s).
const FLUSH_PERIOD: f64 = 0.5;
/// Most rows that wait to be written (bytes).
const WAITING: usize = 1 << 16;

/// Writes a row for each tick.
pub(super) struct CsvObserver {
    path: PathBuf,
    /// The open file; `None` after a failure.
    file: Option<Box<dyn Write + Send>>,
    /// Rows that are not written yet.
    rows: String,
    failure: Option<io::Error>,
    line: Line,
    /// Ticks from one flush to the next.
    flush_every: u64,
    taken: u64,
    /// By body: the ticks in which the cap reduced a wrench so far.
    capped: Vec<u64>,
    /// The devices of the tools, in the scene's order.
    tools: Vec<usize>,
    /// The sums of the newest host step, by pair that may touch.
    sums: Vec<ContactSum>,
}

impl CsvObserver {
    /// Begins the table at `path`, in place of an older file.
    ///
    /// # Errors
    /// If the file cannot be written, or another program writes to it.
    pub(super) fn begin(path: &Path, scene: &Scene) -> Result<Self, AtomicFileError> {
        let failed = |source| AtomicFileError {
            path: path.to_owned(),
            source,
        };
        let file = open(path).map_err(failed)?;
        Ok(Self {
            path: path.to_owned(),
            file: Some(file),
            rows: columns(scene).header(),
            failure: None,
            line: Line::default(),
            flush_every: (scene.realtime.rate * FLUSH_PERIOD).max(1.0) as u64,
            taken: 0,
            capped: vec![0; scene.bodies.len()],
            tools: scene
                .numbered_tools()
                .map(|(_, device, _)| device)
                .collect(),
            sums: pairs(scene),
        })
    }

    fn write(&mut self, telemetry: &Telemetry) {
        let line = &mut self.line;
        line.clear();
        tick_columns(telemetry, line);
        for device in telemetry.devices() {
            device_columns(device, line);
        }
        for (body, capped) in telemetry.bodies().zip(&mut self.capped) {
            body_columns(body, *capped, line);
            *capped = body.energy.capped;
        }
        for device in &self.tools {
            let found = telemetry
                .tools()
                .find(|tool| usize::from(tool.device) == *device);
            tool_columns(found.unwrap_or(&ToolTelemetry::empty()), line);
        }
        for sum in &self.sums {
            contact_columns(sum, line);
        }
        self.rows.push_str(line.end());
        self.taken += 1;
        if self.rows.len() >= WAITING || self.taken.is_multiple_of(self.flush_every) {
            self.flush();
        }
    }

    /// Writes the rows that wait.
    fn flush(&mut self) {
        if let Some(file) = &mut self.file {
            let written = file.write_all(self.rows.as_bytes());
            if let Err(error) = written.and_then(|()| file.flush()) {
                self.file = None;
                // A reader that closes its pipe has read enough.
                self.failure = (error.kind() != io::ErrorKind::BrokenPipe).then_some(error);
            }
        }
        self.rows.clear();
    }
}

impl Observer for CsvObserver {
    fn take(&mut self, record: LogRecord<'_>) {
        if let LogRecord::Tick(telemetry) = record {
            self.write(telemetry);
        }
    }

    fn touched(&mut self, step: &mut ContactStep) {
        for sum in &mut self.sums {
            *sum = step.sum(sum.sides);
        }
    }

    /// Ends the table. If the table ended early, adds the reason to the failures.
    fn finish(mut self: Box<Self>, observed: &mut Observed) {
        self.flush();
        if let Some(error) = self.failure.take() {
            let path = self.path.display();
            let failure = format!("the table {path} ended early: {error}");
            observed.failures.push(failure);
        }
    }
}

/// Opens, locks and empties the file at `path`. The names of the standard streams mean the streams of this process.
fn open(path: &Path) -> io::Result<Box<dyn Write + Send>> {
    match stream(path) {
        Some(Stream::Output) => return Ok(Box::new(io::stdout())),
        Some(Stream::Error) => return Ok(Box::new(io::stderr())),
        None => {}
    }
    if std::fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir()) {
        return Ok(Box::new(open_stream(path)?));
    }
    let mut options = OpenOptions::new();
    let file = options
        .write(true)
        .create(true)
        .truncate(false)
        .open(path)?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => {
            return Err(io::Error::new(
                io::ErrorKind::ResourceBusy,
                "another program is writing to this table; give each run a table of its own",
            ));
        }
        // Some file systems have no locks.
        Ok(()) | Err(TryLockError::Error(_)) => {}
    }
    file.set_len(0)?;
    Ok(Box::new(file))
}

/// The columns, in the order in which `CsvObserver::write` fills them.
fn columns(scene: &Scene) -> Columns {
    let mut columns = Columns::default();
    tick_columns(&Telemetry::empty(), &mut columns.of(""));
    for device in &scene.devices {
        device_columns(&DeviceTelemetry::empty(), &mut columns.of(&device.name));
    }
    for body in &scene.bodies {
        body_columns(&BodyTelemetry::empty(), 0, &mut columns.of(&body.name));
    }
    for tool in &scene.tools {
        tool_columns(&ToolTelemetry::empty(), &mut columns.of(&tool.name));
    }
    for between in touching(scene) {
        let names = between.map(|thing| thing.name(scene));
        contact_columns(&ContactSum::default(), &mut columns.of(&names.join("_")));
    }
    columns
}

/// The pairs that may touch, before the first step.
fn pairs(scene: &Scene) -> Vec<ContactSum> {
    let pairs = touching(scene).into_iter().map(|between| ContactSum {
        sides: between.map(|thing| thing.number(scene)),
        ..ContactSum::default()
    });
    pairs.collect()
}
