//! The table of a run as an observer: a row for each tick, written as the run goes.
//!
//! Rows are written whole: what is in the file when the process is killed is a table up to its last row. A table that can
//! no longer be written (a full disk) ends early; the run and its summary continue without it.

use super::observer::{Observed, Observer};
use crate::atomic_file::{AtomicFileError, Stream, open_stream, stream};
use crate::record::energy_sums;
use crate::scene::Scene;
use crate::table::{Columns, Line};
use rt_core::Telemetry;
use rt_core::coupling::HostState;
use rt_core::record::{BodyTelemetry, DeviceTelemetry};
use rt_core::safety::SafetyState;
use runner::link::LogRecord;
use std::fs::{OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Length of the data that may be lost when the process is killed (s).
const FLUSH_PERIOD: f64 = 0.5;
/// Most rows that wait to be written (bytes).
const WAITING: usize = 1 << 16;

/// The states of the last stage that have a column, in the order of the columns.
const SAFETY: [SafetyState; 14] = [
    SafetyState::Limited,
    SafetyState::Slewed,
    SafetyState::Recovering,
    SafetyState::TooFast,
    SafetyState::OutOfReach,
    SafetyState::Hot,
    SafetyState::Engaging,
    SafetyState::HandsOff,
    SafetyState::Disarmed,
    SafetyState::Stopped,
    SafetyState::Silent,
    SafetyState::LetGo,
    SafetyState::DeviceFault,
    SafetyState::NotANumber,
];

/// The states of a coupling without a model that it trusts, which have a column each.
const COUPLING: [HostState; 3] = [HostState::Waiting, HostState::Fading, HostState::Held];

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
        })
    }

    fn write(&mut self, telemetry: &Telemetry) {
        let line = &mut self.line;
        line.clear();
        line.whole(telemetry.tick);
        line.seconds(telemetry.time_ns);
        line.seconds(telemetry.lateness_ns);
        for device in telemetry.devices() {
            write_device(line, device);
        }
        for (body, capped) in telemetry.bodies().zip(&mut self.capped) {
            write_body(line, body, capped);
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
    for name in ["tick", "time_s", "lateness_s"] {
        columns.add("", name);
    }
    for device in &scene.devices {
        let of = &device.name;
        columns.vector(of, "position", "m");
        for part in ["w", "x", "y", "z"] {
            columns.add(of, &format!("orientation_{part}"));
        }
        columns.vector(of, "velocity", "m_per_s");
        columns.vector(of, "angular_velocity", "rad_per_s");
        columns.vector(of, "force", "N");
        columns.vector(of, "moment", "Nm");
        columns.vector(of, "slip", "m");
        columns.add(of, "slip_rad");
        columns.add(of, "buttons");
        columns.add(of, "missed");
        for state in SAFETY {
            columns.add(of, state.name());
        }
    }
    for body in &scene.bodies {
        let of = &body.name;
        for name in ["model", "model_age_s", "trust"] {
            columns.add(of, name);
        }
        for state in COUPLING {
            columns.add(of, state.name());
        }
        for name in ["capped", "withheld_N", "springs_N"] {
            columns.add(of, name);
        }
        for (name, _) in energy_sums(&rt_core::EnergyAccount::default()) {
            columns.add(of, &format!("{name}_J"));
        }
    }
    columns
}

fn write_device(line: &mut Line, device: &DeviceTelemetry) {
    let rotation = device.pose.rotation.quaternion();
    line.numbers(device.pose.position.iter().copied());
    line.numbers([rotation.w, rotation.i, rotation.j, rotation.k]);
    line.numbers(device.twist.linear.iter().copied());
    line.numbers(device.twist.angular.iter().copied());
    line.numbers(device.wrench.force.iter().copied());
    line.numbers(device.wrench.moment.iter().copied());
    line.numbers(device.slip.iter().copied());
    line.number(device.slip_angle);
    line.whole(u64::from(device.buttons));
    line.flag(!device.fresh);
    for state in SAFETY {
        line.flag(device.safety == state);
    }
}

/// `capped`: the ticks in which the cap reduced a wrench, before this tick.
fn write_body(line: &mut Line, body: &BodyTelemetry, capped: &mut u64) {
    line.whole(body.sequence);
    if body.sequence == 0 {
        line.number(f64::NAN);
    } else {
        line.seconds(body.age_ns);
    }
    line.number(body.trust);
    for state in COUPLING {
        line.flag(body.state == state);
    }
    line.flag(body.energy.capped > *capped);
    *capped = body.energy.capped;
    line.numbers([body.withheld.force, body.withheld.of]);
    for (_, sum) in energy_sums(&body.energy) {
        line.number(sum);
    }
}
