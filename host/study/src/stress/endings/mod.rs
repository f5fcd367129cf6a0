//! `palpate stress endings`: every way in which a command that holds a device may end.
//!
//! A cell is one command and one way out. The command is a process of its own in a terminal of its own. Its device is
//! emulated in this process, which sees the force that the device renders. Once the device renders a force, the command is
//! ended at a random moment. The device must have no force afterwards because the command said so, and not because the
//! device's watchdog ended; the exit code must name the signal, and a log must be complete and replay exactly.

mod device;
mod table;
pub mod terminal;

use super::jobs::{self, Cells, JobError, Options, Progress};
use super::{Done, Verdict};
use device::{NONE, Watched};
use host::log::Log;
use host::run::replay::{replay, scene_of};
use rustix::process::Signal;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::num::NonZero;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use terminal::{InTerminal, Session};

/// Default number of runs of each way out of each command, and that of a quick study.
pub const RUNS: [u64; 2] = [3, 1];
/// Longest time for anything that a command does, on a loaded machine. A command that takes longer has failed.
const LONGEST: Duration = Duration::from_secs(120);
/// Time after the end of a command in which the device is still watched: a WoodenHaptics holds its currents for 0.5 s.
const AFTER: Duration = Duration::from_millis(700);
/// Largest number of starts of a command that ends before it holds its device.
const STARTS: u32 = 10;
/// Longest delay from the first force to the way out (ms).
const DELAY_MS: u64 = 300;
/// Force from which a device counts as held (N).
const HELD: f64 = 0.1;

/// A command that holds a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Held {
    Virtual,
    Simulated,
    Firmware,
    WoodenHaptics,
    Plugin,
    Probe,
    Identify,
}

impl Held {
    const ALL: [Self; 7] = [
        Self::Virtual,
        Self::Simulated,
        Self::Firmware,
        Self::WoodenHaptics,
        Self::Plugin,
        Self::Probe,
        Self::Identify,
    ];
    const QUICK: [Self; 4] = [
        Self::Virtual,
        Self::Simulated,
        Self::Firmware,
        Self::WoodenHaptics,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Virtual => "run, virtual time",
            Self::Simulated => "run, simulated devices",
            Self::Firmware => "run, firmware protocol",
            Self::WoodenHaptics => "run, WoodenHaptics",
            Self::Plugin => "run, plug-in",
            Self::Probe => "device probe --pulse",
            Self::Identify => "device identify",
        }
    }
}

/// A way out of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Hangup,
    Interrupt,
    Quit,
    Terminate,
    Twice,
    CpuTime,
    ControlC,
    Closed,
    ClosedApart,
    Kill,
}

impl Way {
    const ALL: [Self; 10] = [
        Self::Hangup,
        Self::Interrupt,
        Self::Quit,
        Self::Terminate,
        Self::Twice,
        Self::CpuTime,
        Self::ControlC,
        Self::Closed,
        Self::ClosedApart,
        Self::Kill,
    ];
    const QUICK: [Self; 3] = [Self::Quit, Self::Twice, Self::Closed];

    fn name(self) -> &'static str {
        match self {
            Self::Hangup => "SIGHUP",
            Self::Interrupt => "SIGINT",
            Self::Quit => "SIGQUIT",
            Self::Terminate => "SIGTERM",
            Self::Twice => "SIGTERM twice",
            Self::CpuTime => "SIGXCPU",
            Self::ControlC => "Ctrl-C",
            Self::Closed => "terminal closed",
            Self::ClosedApart => "terminal closed, no signal",
            Self::Kill => "SIGKILL",
        }
    }

    /// The exit code; `None` for a command that a signal kills.
    fn code(self) -> Option<i32> {
        match self {
            Self::Hangup | Self::Closed | Self::ClosedApart => Some(129),
            Self::Interrupt | Self::ControlC => Some(130),
            Self::Quit => Some(131),
            Self::Terminate | Self::Twice => Some(143),
            Self::CpuTime => Some(128 + Signal::XCPU.as_raw()),
            Self::Kill => None,
        }
    }

    fn session(self) -> Session {
        if self == Self::ClosedApart {
            Session::Apart
        } else {
            Session::Controlled
        }
    }

    /// Takes the way out.
    fn take(self, program: &mut InTerminal) -> std::io::Result<()> {
        match self {
            Self::Hangup => program.signal(Signal::HUP),
            Self::Interrupt => program.signal(Signal::INT),
            Self::Quit => program.signal(Signal::QUIT),
            Self::Terminate => program.signal(Signal::TERM),
            Self::Twice => {
                program.signal(Signal::TERM)?;
                program.signal(Signal::TERM)
            }
            Self::CpuTime => program.signal(Signal::XCPU),
            Self::ControlC => program.type_bytes(b"\x03"),
            Self::Closed | Self::ClosedApart => {
                program.close();
                Ok(())
            }
            Self::Kill => program.signal(Signal::KILL),
        }
    }
}

/// The result of a cell.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The command.
    pub command: String,
    /// How the command was ended.
    pub way: String,
    /// Force that the device rendered just before (N). None if the command holds no device that is seen.
    pub before: Option<f64>,
    /// Time from the way out until the device rendered no force (s).
    pub released: Option<f64>,
    /// Force that the last bytes of the command left to the device (N).
    pub left: Option<f64>,
    /// Time from the way out until the command had ended (s).
    pub ended: f64,
    /// Exit code. None if a signal killed the command.
    pub code: Option<i32>,
    /// Number of ticks in the log that were replayed. None if the command writes no log.
    pub replayed: Option<u64>,
    /// What the cell was to show and did not.
    pub failures: Vec<String>,
}

/// A scene in which a device at rest at its origin stretches a block: the force is steady without any motion of the hand.
const SCENE: &str = r#"
name = "held"
duration = 600.0

[host]
step_rate = 100.0
publish_rate = 100.0

[[body]]
name = "block"
damping = { mass = 0.1, stiffness = 0.02 }
mesh.box = { size = [0.1, 0.1, 0.06], cells = [4, 4, 3] }
material = { law = "corotational", young = 10e3, poisson = 0.4, density = 1000.0 }
[[body.support]]
name = "table"
group = "bottom"
[[body.handle]]
name = "finger"
group = "top"
device = "touch"

[[device]]
name = "touch"
model = "MODEL"
connect = "CONNECT"
max_force = 4.0
mounting.origin = [0.0, 0.0, 0.035]
"#;

/// The commands and ways of a round of the study.
fn round(quick: bool) -> Vec<(Held, Way)> {
    let (held, ways) = if quick {
        (&Held::QUICK[..], &Way::QUICK[..])
    } else {
        (&Held::ALL[..], &Way::ALL[..])
    };
    let each = held
        .iter()
        .flat_map(|held| ways.iter().map(|way| (*held, *way)));
    each.collect()
}

/// The study.
#[derive(Clone, Debug)]
pub struct Study {
    seed: u64,
    cells: u64,
    quick: bool,
    round: Vec<(Held, Way)>,
}

impl Study {
    /// The study with `runs` runs of each way out of each command, or of a few ways out of a few commands if it is `quick`.
    pub fn new(seed: u64, runs: u64, quick: bool) -> Self {
        let round = round(quick);
        Self {
            seed,
            cells: runs.saturating_mul(round.len() as u64),
            quick,
            round,
        }
    }
}

impl super::Study for Study {
    type Outcome = Outcome;
    const NAME: &'static str = "endings";
    const SCHEMA: u32 = 1;

    fn seed(&self) -> u64 {
        self.seed
    }

    fn cells(&self) -> u64 {
        self.cells
    }

    fn settings(&self) -> serde_json::Value {
        serde_json::json!({ "quick": self.quick })
    }

    fn cell(&self, cell: u64, _: &Done<'_>) -> Outcome {
        let (held, way) = self.round[(cell % self.round.len() as u64) as usize];
        let mut outcome = Outcome {
            command: held.name().to_owned(),
            way: way.name().to_owned(),
            ..Outcome::default()
        };
        // Steele and Vigna's finalizer of SplitMix64.
        let mixed = self.seed.wrapping_add(cell);
        let mixed = mixed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let delay = Duration::from_millis((mixed >> 32) % DELAY_MS);
        if let Err(problem) = end(held, way, delay, &mut outcome) {
            outcome.failures.push(problem);
        }
        outcome
    }

    /// One cell after the other: the cells share the machine with devices in real time.
    fn run(
        &self,
        options: &Options,
        done: &Done<'_>,
        progress: &mut dyn FnMut(&Progress<'_>),
    ) -> Result<Cells<Outcome>, JobError> {
        let options = Options {
            threads: Some(NonZero::<usize>::MIN),
            ..options.clone()
        };
        let cell = |cell| self.cell(cell, done);
        jobs::run(&self.header(), &options, &cell, progress)
    }

    fn summary(&self, cells: &BTreeMap<u64, Outcome>) -> String {
        table::of(cells)
    }

    fn verdict(&self, cells: &BTreeMap<u64, Outcome>) -> Verdict {
        Verdict::of_failures(
            cells,
            |cell| &cell.failures,
            |number, cell, failure| {
                format!("cell {number}: {}, {}: {failure}", cell.command, cell.way)
            },
        )
    }
}

/// The command line of a cell, with its files in `folder`.
fn command(held: Held, device: Option<&Watched>, folder: &Path) -> Result<Vec<String>, String> {
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let mut command = vec![program.display().to_string()];
    let mut add = |parts: &[&str]| command.extend(parts.iter().map(|part| (*part).to_owned()));
    let connect = device.map_or("", |device| device.connect.as_str());
    let model = device.map_or("", |device| device.model);
    match held {
        Held::Probe => add(&[
            "device",
            "probe",
            connect,
            "--model",
            model,
            "--duration",
            "0.2",
            "--pulse",
        ]),
        Held::Identify => {
            add(&["device", "identify", connect, "--model", model]);
            add(&["--date", "2026-01-01", "--nobody-holds-it"]);
        }
        _ => {
            let file = |name: &str| folder.join(name).display().to_string();
            add(&["run", "--report-progress"]);
            add(&["--log", &file("run.mcap"), "--json", &file("run.json")]);
            match held {
                Held::Virtual => add(&["--duration", "86400"]),
                Held::Simulated => add(&["--duration", "600", "--clock", "real"]),
                _ => {
                    let scene = SCENE.replace("MODEL", model).replace("CONNECT", connect);
                    std::fs::write(folder.join("scene.toml"), scene)
                        .map_err(|error| error.to_string())?;
                    add(&["--clock", "real", "--armed", &file("scene.toml")]);
                }
            }
        }
    }
    Ok(command)
}

/// Whether a run has said that it has ticked.
fn has_ticked(screen: &[u8]) -> bool {
    let screen = String::from_utf8_lossy(screen);
    // The bar of the progress may stand before the text.
    let mut counts = screen.split("ticks ").skip(1).filter_map(|rest| {
        let (ticks, _) = rest.split_once(' ')?;
        ticks.parse::<u64>().ok()
    });
    counts.any(|ticks| ticks > 0)
}

/// What a program has written.
fn said(program: &InTerminal) -> String {
    String::from_utf8_lossy(&program.screen).into_owned()
}

/// Waits until the device of a command renders a force, or until the run has ticked if no device is seen. False if the
/// command has ended before.
///
/// # Errors
/// Neither happens.
fn holds(program: &mut InTerminal, device: Option<&Watched>) -> Result<bool, String> {
    let begun = Instant::now();
    while begun.elapsed() < LONGEST {
        program.read_for(Duration::from_millis(1));
        let holds = match device {
            Some(device) => device.force() > HELD,
            None => has_ticked(&program.screen),
        };
        let ended = program.ended().map_err(|error| error.to_string())?;
        if holds || ended.is_some() {
            return Ok(ended.is_none());
        }
    }
    let said = said(program);
    Err(format!("the command does not hold its device: {said}"))
}

/// Starts a command, and waits until it holds its device. On a busy machine a device may be silent for five ticks, at which
/// a guided motion ends by itself; the command is then started anew, because the cell has not begun.
///
/// # Errors
/// The command does not start, or never holds its device.
fn begin(way: Way, line: &[String], device: Option<&Watched>) -> Result<InTerminal, String> {
    let mut last = String::new();
    for _ in 0..STARTS {
        let mut program = InTerminal::start(way.session(), line)
            .map_err(|error| format!("the command cannot be started by setsid: {error}"))?;
        if holds(&mut program, device)? {
            return Ok(program);
        }
        last = said(&program);
    }
    Err(format!("the command never held its device: {last}"))
}

/// Runs a cell. What it was to show and did not is among the failures of `outcome`.
///
/// # Errors
/// What kept the cell from its end.
fn end(held: Held, way: Way, delay: Duration, outcome: &mut Outcome) -> Result<(), String> {
    let text = |error: std::io::Error| error.to_string();
    let folder = Folder::new().map_err(text)?;
    let device = Watched::begin(held, &folder.0)?;
    let line = command(held, device.as_ref(), &folder.0)?;
    let is_run = !matches!(held, Held::Probe | Held::Identify);
    let begun = Instant::now();
    let mut program = begin(way, &line, device.as_ref())?;
    if is_run {
        // A device that was silent for most of its run, because it was calibrated meanwhile, is a failure of the run.
        program.read_for(begun.elapsed() + delay);
        if !holds(&mut program, device.as_ref())? {
            return Err(format!("the run ended by itself: {}", said(&program)));
        }
    }
    outcome.before = device.as_ref().map(Watched::force);
    let moment = Instant::now();
    way.take(&mut program).map_err(text)?;
    let status = loop {
        program.read_for(Duration::from_millis(1));
        if let Some(status) = program.ended().map_err(text)? {
            break status;
        }
        if moment.elapsed() > LONGEST {
            return Err(format!("the command does not end: {}", said(&program)));
        }
    };
    outcome.ended = moment.elapsed().as_secs_f64();
    program.read_for(AFTER);
    outcome.code = status.code();
    let mut fail = |problem: String| outcome.failures.push(problem);
    if outcome.code != way.code() {
        let signal = status.signal();
        let said = said(&program);
        fail(format!(
            "ended with {:?}, signal {signal:?}: {said}",
            outcome.code
        ));
    }
    if let Some(device) = &device {
        outcome.released = Some(device.released_after(moment).as_secs_f64());
        outcome.left = Some(device.left());
        if way != Way::Kill && device.left() > NONE {
            fail(format!(
                "the command left a force of {:.3} N",
                device.left()
            ));
        }
        // Nobody releases the force of a plug-in that was killed.
        if device.force() > NONE && (way, held) != (Way::Kill, Held::Plugin) {
            fail(format!("the device renders {:.3} N", device.force()));
        }
    }
    if is_run {
        outcome.replayed = Some(check_files(&folder.0, way)?);
    }
    Ok(())
}

/// Replays the log, and looks for the summary of a command that ended in order. Returns the ticks of the log.
fn check_files(folder: &Path, way: Way) -> Result<u64, String> {
    let bytes =
        std::fs::read(folder.join("run.mcap")).map_err(|error| format!("the log: {error}"))?;
    let log = Log::parse(&bytes).map_err(|error| format!("the log: {error}"))?;
    if way != Way::Kill && !log.complete {
        return Err("the log lacks its end".to_owned());
    }
    if way != Way::Kill && !folder.join("run.json").exists() {
        return Err("there is no summary".to_owned());
    }
    // A run that is killed early has flushed no tick.
    if !log.rows.is_empty() {
        let scene = scene_of(&log, "the log").map_err(|error| error.to_string())?;
        let report = replay(&log, &scene, &mut |_| {}).map_err(|error| error.to_string())?;
        if !report.is_exact() {
            return Err(format!("the replay differs: {report}"));
        }
    }
    Ok(log.rows.len() as u64)
}

/// A folder for the files of a cell, removed with this value.
struct Folder(PathBuf);

impl Folder {
    fn new() -> std::io::Result<Self> {
        use std::sync::atomic::{AtomicU64, Ordering};
        static NEXT: AtomicU64 = AtomicU64::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let name = format!("palpate-endings-{}-{number}", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::create_dir(&path)?;
        Ok(Self(path))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
