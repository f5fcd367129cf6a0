//! `palpate serve`: runs the scene of the machine's settings without an end, as the service of a haptic PC does.
//!
//! The program waits for devices that are absent, and begins again after a failure. A service manager learns from the first tick on
//! that the program is ready, and its watchdog is fed only while ticks advance. SIGTERM first releases the forces, and then ends the
//! logs. SIGHUP reads settings and scene again: if they are wrong, the old run goes on.

mod notify;
pub(crate) mod status;

use super::operator;
use super::outputs::{Declared, Format};
use super::settings::{self, MachineArguments};
use super::signals::Ending;
use super::{COMMIT, CommandError, load, sets::Sets};
use devices::panel::Panel;
use host::atomic_file::write_json;
use host::log::series::SeriesOptions;
use host::run::observer::Observers;
use host::run::{Clock, Progress, RunOptions, run_watched};
use host::scene::LoadedScene;
use host::scene::settings::Settings;
use host::world::World;
use notify::Notify;
use runner::{Cores, Reserved, Stop};
use status::{Board, DeviceStatus, Watch};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

const EXAMPLES: &str = "\
Signals:
  SIGTERM, SIGINT   release the forces, end the logs, and end with exit code 0
  SIGHUP            read settings and scene again; if they are wrong, the old run goes on
  SIGUSR2, SIGUSR1  arm the devices; stop their forces (systemctl kill -s USR2 palpate)

Examples:
  palpate serve                                run the scene of /etc/palpate/palpate.toml
  palpate serve --settings palpate.toml        with other settings
  palpate status                               ask a program that serves
  palpate run --replay palpate-000001-0001.mcap
                                               replay the logs of a run, from its first file on";

/// Length of a run that has no end (s): thirty years.
const WITHOUT_END: f64 = 1e9;
/// Time between two looks for a signal while the program waits.
const LOOK: Duration = Duration::from_millis(50);
/// The lag of the log behind the ticks from which on the program says so (s of ticks).
const BEHIND: f64 = 5.0;
/// Bytes of a MiB.
const MIB: u64 = 1 << 20;

/// Arguments of `palpate serve`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ServeArguments {
    #[command(flatten)]
    machine: MachineArguments,
    /// Write the summary of each run at its end as JSON; the last one stays
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What runs: the settings, and the scene that they name.
struct Configured {
    settings: Settings,
    loaded: LoadedScene,
}

impl Configured {
    /// Reads settings and scene.
    fn read(machine: &MachineArguments) -> Result<Self, CommandError> {
        // The settings name the scene, and the scene may carry settings.
        let named = machine.resolve(None)?.serve_scene.value;
        let loaded = load(named.as_deref(), &Sets::default())?;
        let settings = machine.resolve(Some(&loaded))?;
        // A scene that cannot be built is as wrong as one that cannot be read.
        World::new(&loaded)?;
        Ok(Self { settings, loaded })
    }

    /// Where the logs go; `None` for a run without logs.
    fn series(&self) -> Option<SeriesOptions> {
        let settings = &self.settings;
        settings.serve_log.value.then(|| SeriesOptions {
            folder: match settings.log_folder.value.as_path() {
                folder if folder == Path::new("") => Path::new(".").to_owned(),
                folder => folder.to_owned(),
            },
            file_bytes: settings.file_mib.value.saturating_mul(MIB),
            file_seconds: settings.file_minutes.value.saturating_mul(60),
            total_bytes: settings.total_mib.value.saturating_mul(MIB),
        })
    }
}

/// Why a run ended.
enum End {
    /// A signal asked for the end of the program.
    Stopped,
    /// A signal brought another configuration.
    Replaced(Box<Configured>),
    /// The run failed, or could not begin.
    Failed(String),
}

/// The program between its runs.
struct Server<'a> {
    machine: &'a MachineArguments,
    /// The file of the summary of the last run.
    json: Option<&'a Path>,
    /// The operator's orders.
    panel: Panel,
    ending: Ending,
    notify: Notify,
    board: Board,
    /// Whether the service manager knows that the program is ready.
    is_ready: bool,
    /// Whether the log is behind the ticks.
    is_log_behind: bool,
}

pub(super) fn run(arguments: &ServeArguments) -> Result<(), CommandError> {
    let _held = Declared::default()
        .file("--json", arguments.json.as_ref(), Format::Json)
        .check()?;
    let mut current = Configured::read(&arguments.machine)?;
    // The threads that start here leave the core of the tick free, as the threads of the run do.
    let settings = &current.settings;
    let (core, idle) = (settings.core.value, settings.idle_sibling.value);
    let reserved = Reserved::new(core, idle, &Cores::of_this_machine());
    let ending = Ending::serving()?;
    let panel = Panel::default();
    operator::begin(&panel)?;
    let board = Board::new();
    // Another socket takes another start of the program.
    let socket = current.settings.socket.value.clone();
    let answered = board.answer_at(&socket);
    answered.map_err(|source| CommandError::Socket {
        path: socket.clone(),
        source,
    })?;
    drop(reserved);
    let mut server = Server {
        machine: &arguments.machine,
        json: arguments.json.as_deref(),
        panel,
        ending,
        notify: Notify::from_environment(),
        board,
        is_ready: false,
        is_log_behind: false,
    };
    errln!("{}", super::doctor::line(&current.settings));
    let mut said = String::new();
    loop {
        match server.run(&current) {
            End::Stopped => break,
            End::Replaced(new) => {
                errln!(
                    "the new settings and the scene {:?} are in use",
                    new.loaded.scene.name
                );
                current = *new;
            }
            End::Failed(failure) => {
                // A device that stays absent is told once.
                if said != failure {
                    errln!(
                        "{failure}\npalpate serve tries again every {} s",
                        current.settings.retry.value
                    );
                    said.clone_from(&failure);
                }
                match server.wait(&current, failure) {
                    End::Stopped => break,
                    End::Replaced(new) => current = *new,
                    End::Failed(_) => {}
                }
            }
        }
    }
    // A socket that stays is replaced by the next start.
    let _ = std::fs::remove_file(socket);
    Ok(())
}

impl Server<'_> {
    /// Runs what is configured until a signal or a failure.
    fn run(&mut self, configured: &Configured) -> End {
        let Configured { settings, loaded } = configured;
        let stop = Arc::new(Stop::new());
        let mut options = RunOptions {
            duration: Some(WITHOUT_END),
            series: configured.series(),
            panel: self.panel.clone(),
            stop: Arc::clone(&stop),
            commit: COMMIT,
            ..RunOptions::new(Clock::Real)
        };
        settings::apply(settings, &mut options);
        self.show(&options, loaded);
        let world = match World::new(loaded) {
            Ok(world) => world,
            Err(error) => return End::Failed(error.to_string()),
        };
        let watch = Watch::new(&self.board, loaded.scene.realtime.rate);
        let mut next = None;
        let mut last = 0;
        let ran = run_watched(
            &world,
            &options,
            Observers::new().with(watch),
            &mut |progress| {
                if next.is_none() {
                    self.advance(&progress, &mut last);
                    self.tell_of_log(&progress, &options, loaded.scene.realtime.rate);
                    next = self.asked();
                    if next.is_some() {
                        stop.request();
                    }
                }
            },
        );
        match (ran, next) {
            (Err(error), _) => End::Failed(error.to_string()),
            (Ok(summary), next) => {
                out!("{summary}");
                // The service goes on without the file.
                if let Some(Err(error)) = self.json.map(|path| write_json(path, &summary)) {
                    errln!("{error}");
                }
                next.unwrap_or_else(|| End::Failed(summary.failures.join("\n")))
            }
        }
    }

    /// Shows the beginning of a run.
    fn show(&self, options: &RunOptions, loaded: &LoadedScene) {
        let mut status = self.board.open();
        // A program that waits goes on waiting until ticks advance.
        if status.state == "running" {
            "starting".clone_into(&mut status.state);
        }
        status.scene.clone_from(&loaded.scene.name);
        (status.ticks, status.skipped, status.logged) = (0, 0, 0);
        status.longest_lateness = 0.0;
        status.logs = options.series.as_ref().map(|series| series.folder.clone());
        let devices = loaded.scene.devices.iter().map(|device| DeviceStatus {
            name: device.name.clone(),
            fresh: false,
            safety: "waiting".to_owned(),
        });
        status.devices = devices.collect();
    }

    /// Tells the service manager and the clients that ticks have advanced. `last` is the number of ticks of the previous call.
    fn advance(&mut self, progress: &Progress, last: &mut u64) {
        if progress.preparation.is_some() || progress.ticks <= *last {
            return;
        }
        *last = progress.ticks;
        if !self.is_ready {
            self.is_ready = true;
            self.notify.say("READY=1\nSTATUS=the tick runs");
        }
        self.notify.feed();
        let mut status = self.board.open();
        "running".clone_into(&mut status.state);
        (status.ticks, status.logged) = (progress.ticks, progress.logged);
    }

    /// Tells when the log falls behind the ticks, and when it has caught up. The run goes on.
    fn tell_of_log(&mut self, progress: &Progress, options: &RunOptions, rate: f64) {
        let behind = progress.ticks.saturating_sub(progress.logged) as f64;
        let is_behind = options.series.is_some() && behind > BEHIND * rate;
        if is_behind == self.is_log_behind {
            return;
        }
        self.is_log_behind = is_behind;
        if is_behind {
            let said = "the last ticks are not in the log yet: the disk is full or slow";
            errln!("{said}");
            self.board.open().last_failure = Some(said.to_owned());
        } else {
            errln!("the log has caught up with the ticks");
        }
    }

    /// What a signal has asked for. A configuration that is wrong is told, and the run goes on.
    fn asked(&mut self) -> Option<End> {
        if self.ending.stop().is_requested() {
            self.notify.say("STOPPING=1");
            return Some(End::Stopped);
        }
        if !self.ending.takes_reload() {
            return None;
        }
        match Configured::read(self.machine) {
            Ok(new) => {
                // The first tick of the new run says that the program is ready again.
                self.is_ready = false;
                self.notify.say("RELOADING=1");
                Some(End::Replaced(Box::new(new)))
            }
            Err(error) => {
                errln!("{error}\nthe new settings are refused, and the old ones stay in use");
                self.board.open().last_failure = Some(error.to_string());
                None
            }
        }
    }

    /// Waits before the next attempt. Before the first tick, the service manager is asked for patience.
    fn wait(&mut self, configured: &Configured, failure: String) -> End {
        let retry = Duration::from_secs_f64(configured.settings.retry.value);
        if !self.is_ready {
            let patience = (retry + Duration::from_secs(30)).as_micros();
            self.notify.say(&format!(
                "EXTEND_TIMEOUT_USEC={patience}\nSTATUS=waiting: {}",
                failure.replace('\n', " ")
            ));
        }
        {
            let mut status = self.board.open();
            "waiting".clone_into(&mut status.state);
            status.last_failure = Some(failure.clone());
        }
        let start = Instant::now();
        while start.elapsed() < retry {
            if let Some(end) = self.asked() {
                return end;
            }
            std::thread::sleep(LOOK);
        }
        End::Failed(failure)
    }
}
