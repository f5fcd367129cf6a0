//! The answer of `palpate serve` to `palpate status`, over a Unix socket: a client connects and reads one value of JSON.
//!
//! A thread answers one client after the other, and gives each of them a second. The run writes its state into a shared value.
//! Neither the tick nor the host takes part.

use host::run::observer::{Observed, Observer};
use runner::link::LogRecord;
use serde::{Deserialize, Serialize};
use std::fs::{Permissions, remove_file, set_permissions};
use std::io::{self, Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Version of the JSON.
const SCHEMA: &str = "palpate.status/1";
/// Time that a client has.
const PATIENCE: Duration = Duration::from_secs(1);
/// Largest answer (bytes).
const MOST: u64 = 1 << 20;

/// What `palpate serve` does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Status {
    /// Version of this layout.
    pub(crate) schema: String,
    /// `starting`, `running`, or `waiting` (for a device, or after a failure).
    pub(crate) state: String,
    /// Name of the scene.
    pub(crate) scene: String,
    /// Time since the start of the program (s).
    pub(crate) uptime: f64,
    /// Ticks of the present run.
    pub(crate) ticks: u64,
    /// Deadlines that the present run skipped.
    pub(crate) skipped: u64,
    /// The largest lateness of a wake-up in the present run (s).
    pub(crate) longest_lateness: f64,
    /// The devices, in the scene's order.
    pub(crate) devices: Vec<DeviceStatus>,
    /// Ticks in the logs of the present run that survive the program; zero without a log.
    pub(crate) logged: u64,
    /// The folder of the logs; `None` without a log.
    pub(crate) logs: Option<PathBuf>,
    /// The last failure, in words; `None` if there was none.
    pub(crate) last_failure: Option<String>,
}

/// A device of the present run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct DeviceStatus {
    /// Its name in the scene.
    pub(crate) name: String,
    /// Whether it gave a good state in the last tick.
    pub(crate) fresh: bool,
    /// What the last stage did to its force in the last tick, in words.
    pub(crate) safety: String,
}

/// The state that the run writes and the clients read.
#[derive(Clone, Debug)]
pub(super) struct Board(Arc<Mutex<Status>>, Instant);

impl Board {
    pub(super) fn new() -> Self {
        let status = Status {
            schema: SCHEMA.to_owned(),
            state: "starting".to_owned(),
            scene: String::new(),
            uptime: 0.0,
            ticks: 0,
            skipped: 0,
            longest_lateness: 0.0,
            devices: Vec::new(),
            logged: 0,
            logs: None,
            last_failure: None,
        };
        Self(Arc::new(Mutex::new(status)), Instant::now())
    }

    /// The status, to read or write. A thread that panicked meanwhile leaves it as it was.
    pub(super) fn open(&self) -> MutexGuard<'_, Status> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Answers clients at the socket `path` until the program ends.
    ///
    /// # Errors
    /// The socket cannot be made, or another program answers there.
    pub(super) fn answer_at(&self, path: &Path) -> io::Result<()> {
        if UnixStream::connect(path).is_ok() {
            return Err(io::Error::new(
                io::ErrorKind::AddrInUse,
                "another palpate serve answers there",
            ));
        }
        // The socket of a program that was killed is in the way.
        let _ = remove_file(path);
        let listener = UnixListener::bind(path)?;
        // The group may ask.
        set_permissions(path, Permissions::from_mode(0o660))?;
        let board = self.clone();
        let answer = move || {
            for client in listener.incoming().flatten() {
                let mut status = board.open().clone();
                status.uptime = board.1.elapsed().as_secs_f64();
                // A client that has gone, or that does not read, gets no answer.
                let _ = client.set_write_timeout(Some(PATIENCE));
                let _ = serde_json::to_vec(&status).map(|answer| (&client).write_all(&answer));
            }
        };
        let thread = std::thread::Builder::new().stack_size(runner::STACK);
        thread.name("palpate-status".into()).spawn(answer)?;
        Ok(())
    }
}

/// Asks the program at the socket `path`.
///
/// # Errors
/// No program answers there, or its answer is of another version.
pub(crate) fn ask(path: &Path) -> io::Result<Status> {
    let stream = UnixStream::connect(path)?;
    stream.set_read_timeout(Some(2 * PATIENCE))?;
    let mut answer = Vec::new();
    stream.take(MOST).read_to_end(&mut answer)?;
    Ok(serde_json::from_slice(&answer)?)
}

/// The observer that writes what the ticks show.
pub(super) struct Watch {
    board: Board,
    period_ns: u64,
    /// Nominal time of the last tick (ns), and its number.
    last: Option<(u64, u64)>,
}

impl Watch {
    pub(super) fn new(board: &Board, rate: f64) -> Self {
        Self {
            board: board.clone(),
            period_ns: (1e9 / rate).round().max(1.0) as u64,
            last: None,
        }
    }
}

impl Observer for Watch {
    fn take(&mut self, record: LogRecord<'_>) {
        let LogRecord::Tick(telemetry) = record else {
            return;
        };
        let mut status = self.board.open();
        if let Some((time_ns, tick)) = self.last
            && telemetry.tick == tick + 1
        {
            let slots = telemetry.time_ns.saturating_sub(time_ns) / self.period_ns;
            status.skipped += slots.saturating_sub(1);
        }
        self.last = Some((telemetry.time_ns, telemetry.tick));
        let lateness = telemetry.lateness_ns as f64 * 1e-9;
        status.longest_lateness = status.longest_lateness.max(lateness);
        for (shown, device) in status.devices.iter_mut().zip(telemetry.devices()) {
            shown.fresh = device.fresh;
            let words = device.safety.words().unwrap_or(device.safety.name());
            if shown.safety != words {
                words.clone_into(&mut shown.safety);
            }
        }
    }

    fn finish(self: Box<Self>, _: &mut Observed) {}
}
