//! The program `palpate`: one file per command.
//!
//! Exit codes: 0 for success; 1 for a failure while the command ran; 2 for an invalid scene or argument; 128 plus
//! the number of a signal (130 for Ctrl-C, 129 for a closed terminal) for a command that a signal ended in order. A reader that closes the pipe of the
//! standard output changes no exit code.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)] // These macros panic: see `printing`.

#[macro_use]
mod printing;

mod bench;
mod bugreport;
mod compare;
mod device;
mod doctor;
mod fault;
mod latency;
mod mesh;
mod operator;
mod order;
mod outputs;
mod overrides;
mod panics;
mod plan;
mod progress;
mod replay;
mod run;
mod serve;
mod sets;
mod settings;
mod signals;
mod solve;
mod status;
mod stress;
mod sweep;
mod tips;
#[cfg(feature = "view")]
mod view;
#[cfg(feature = "view")]
mod watch;
mod written;

use clap::{Command, CommandFactory, FromArgMatches, Parser, Subcommand};
use host::preparation::Preparation;
use host::scene::{LoadedScene, SceneError};
use host::world::World;
use progress::ProgressBar;
use sets::{Sets, Values};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Counts the allocations of the tick's thread. There must be none.
#[global_allocator]
static ALLOCATOR: alloc_count::calls::Counting = alloc_count::calls::Counting;

/// A hard-realtime controller for haptic devices that touch deformable bodies.
///
/// Without a command, runs the built-in scene and prints a summary: two hands, each on a simulated device, stretch a
/// rubber sheet; the host runs finite elements, and the tick returns forces at 1 kHz.
#[derive(Debug, Parser)]
#[command(name = "palpate", version, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Task>,
}

const EXAMPLES: &str = "\
Examples:
  palpate run                                  run the built-in scene in virtual time
  palpate run --plot stretch.svg               draw force and position of both hands as well
  palpate run --clock real --log run.mcap      run in real time, with a log for Foxglove or PlotJuggler
  palpate run --replay run.mcap                run the ticks of a log again and compare them bit for bit
  palpate run my_scene.toml --seed 7           run your own scene
  palpate view run.mcap                        play a log back in the terminal
  palpate solve my_scene.toml --vtu out        find equilibrium without devices, as files for ParaView
  palpate compare my_scene.toml                compare the force schemes on your own scene
  palpate sweep my_scene.toml --set body[0].material.young=1e5,2e5,4e5
                                               run a scene for each value of a field
  palpate plan my_scene.toml                   print the stages that a scene needs, and why it skips others
  palpate latency --report latency.md          measure the latency of this machine, for a paper
  palpate settings                             print the settings of this machine, each with what gives it
  palpate device list                          print which devices are connected, and how a scene names them
  palpate doctor                               print what this machine lacks for a steady tick, and how to mend it
  palpate bench speed --quick                  measure run time against error, and compare with other programs
  palpate stress wall --quick                  find the stiffest wall of each device, and compare with theory";

#[derive(Debug, Subcommand)]
enum Task {
    /// Run a scene and print a summary
    Run(Box<run::RunArguments>),
    /// Print which stages a scene needs and why the others are skipped
    Plan(plan::PlanArguments),
    /// Print the settings of this machine: core and priority of the tick, threads of the devices, folder of logs
    Settings(settings::SettingsArguments),
    /// Run the scene of the machine's settings without an end, as a service does
    Serve(serve::ServeArguments),
    /// Ask a program that serves what it does
    Status(status::StatusArguments),
    /// Pack machine, settings, checks, messages and the last log into one archive, for an issue
    Bugreport(bugreport::BugreportArguments),
    /// Find equilibrium or motion of a scene without devices: forces, displacements, stress
    Solve(solve::SolveArguments),
    /// Run a scene under several force schemes and compare forces, energy and delays with a run without delays
    Compare(compare::CompareArguments),
    /// Run a scene with several values of its fields, side by side in one table and one figure
    Sweep(sweep::SweepArguments),
    /// Write the mesh of a scene's body, with its groups and materials, for Gmsh or ParaView
    Mesh(mesh::MeshArguments),
    /// List, probe and emulate devices
    Device(device::DeviceArguments),
    /// Check this machine for a steady tick: kernel, cores, power, limits, USB; and write a script that mends
    Doctor(doctor::DoctorArguments),
    /// Measure accuracy, speed and stability, and print the tables that the book quotes
    Bench(bench::BenchArguments),
    /// Measure how late the loop is, how often, and where from, alone and under load
    Latency(latency::LatencyArguments),
    /// Test devices, schemes and scenes at their limits, before a person touches a device
    Stress(stress::StressArguments),
    /// Show a run that is under way, or play a log back: in the terminal, in a browser, or in Foxglove
    #[cfg(feature = "view")]
    View(view::ViewArguments),
}

/// The reason why a command ended without its result.
#[derive(Debug, thiserror::Error)]
enum CommandError {
    #[error(transparent)]
    Run(#[from] host::run::RunError),
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error("with {given}: {source}")]
    Override { given: String, source: SceneError },
    #[error(
        "with {given}: found {count} values, allowed: one; `palpate sweep` makes a run for each of several values"
    )]
    ManyValues { given: String, count: usize },
    #[error("{argument}: found a time of {found} s, allowed: before the end of the run at {end} s")]
    AfterTheEnd {
        argument: &'static str,
        found: f64,
        end: f64,
    },
    #[error(
        "--order take: found no simulated device whose tool takes hold, allowed: a scene with `take_button` in the `[[tool]]` of one"
    )]
    NothingToTake,
    #[error(transparent)]
    Sweep(#[from] study::sweep::SweepError),
    #[error(
        "with {given}: found the device {found:?}, allowed: the devices of the scene: {allowed}"
    )]
    NoSuchDevice {
        given: String,
        found: String,
        allowed: String,
    },
    #[error(
        "--latency applies to virtual time only: found --clock real, under which the machine decides the latency"
    )]
    NeedsVirtualClock,
    #[cfg(feature = "view")]
    #[error(
        "--pace applies to virtual time only: found --clock real, under which a run has the pace of the clock"
    )]
    PaceNeedsVirtualClock,
    #[error(transparent)]
    File(#[from] host::atomic_file::AtomicFileError),
    #[error(transparent)]
    Output(#[from] outputs::OutputError),
    #[error(transparent)]
    Device(#[from] device::DeviceCommandError),
    #[error(
        "found {count} lacking conditions of a steady tick; the table above says which and how to mend them"
    )]
    Lacking { count: usize },
    #[error("found {count} unknown conditions of a steady tick; the table above says which")]
    Undetermined { count: usize },
    #[error("the run ended, but a part of the run failed")]
    Incomplete,
    #[error("{}: {source}", path.display())]
    Replay {
        path: PathBuf,
        source: Box<replay::ReplayFileError>,
    },
    #[error("the replay differs from the log")]
    Different,
    #[error("{}; shut down cleanly", signals::ended_by(*.0))]
    Signal(u8),
    #[error(
        "{0} applies to the thread of the tick, and a run in virtual time has no such thread: found --clock virtual, \
         allowed: --clock real"
    )]
    NeedsRealClock(&'static str),
    #[error("--core: {0}")]
    Core(#[from] runner::cores::NoSuchCore),
    #[error("cannot install the handlers of the signals that end the command: {0}")]
    Signals(std::io::Error),
    #[error(transparent)]
    Solve(physics::CondenseError),
    #[error("{}: found another ending, allowed for a mesh: .msh, .vtk or .vtu", .0.display())]
    MeshFormat(PathBuf),
    #[error("{}: {reason}", .path.display())]
    MeshFile { path: PathBuf, reason: String },
    #[error("--body: found {found:?}, allowed: {}", .allowed.join(", "))]
    NoSuchBody { found: String, allowed: Vec<String> },
    #[error(
        "--force-displacement: no support of the scene is displaced; give a [[body.support]] a `displacement`"
    )]
    NothingDisplaced,
    #[error(
        "{}: the socket of `palpate status` cannot be made: {source}; name another one by `serve.socket` of the settings",
        path.display()
    )]
    Socket {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{}: no `palpate serve` answers: {source}", path.display())]
    NotServed {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("no tick advances: the program is {0}")]
    NotRunning(String),
    #[error("--square-wave: {0}")]
    SquareWave(String),
    #[error("the system gave no process for the load: {0}; measure without it by --load none")]
    Load(std::io::Error),
    #[error(
        "--cyclictest: the program cyclictest cannot be started: {0}; install the package rt-tests"
    )]
    NoCyclictest(std::io::Error),
    #[error("--cyclictest: {0}")]
    Cyclictest(String),
    #[error("the solve stopped before full load; the reason is above")]
    NotSolved,
    #[error(transparent)]
    Study(#[from] study::StudyError),
    #[error(transparent)]
    Jobs(#[from] study::stress::jobs::JobError),
    #[error(transparent)]
    Seeds(#[from] study::stress::seeds::SeedsError),
    #[error("{failed} of {of} cells fail")]
    Stressed { failed: usize, of: usize },
    #[error("{failed} cases of the suite fail; the lines \"FAIL\" above name these cases")]
    Unstable { failed: usize },
    #[cfg(feature = "view")]
    #[error(transparent)]
    View(#[from] view::ViewError),
}

impl CommandError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Scene(_)
            | Self::Override { .. }
            | Self::NoSuchDevice { .. }
            | Self::ManyValues { .. }
            | Self::AfterTheEnd { .. }
            | Self::NothingToTake
            | Self::Sweep(_)
            | Self::NeedsVirtualClock
            | Self::NothingDisplaced
            | Self::SquareWave(_)
            | Self::Run(host::run::RunError::Scene(_) | host::run::RunError::FrameRate(_))
            | Self::Study(
                study::StudyError::Scene(_)
                | study::StudyError::PublishRate { .. }
                | study::StudyError::MeasuredFrom { .. },
            )
            | Self::MeshFormat(_)
            | Self::MeshFile { .. }
            | Self::NoSuchBody { .. }
            | Self::NeedsRealClock(_)
            | Self::Undetermined { .. }
            | Self::Core(_) => 2,
            #[cfg(feature = "view")]
            Self::PaceNeedsVirtualClock => 2,
            Self::Output(error) => error.exit_code(),
            Self::Device(error) => error.exit_code(),
            #[cfg(feature = "view")]
            Self::View(error) => error.exit_code(),
            Self::Signal(number) => 128_u8.saturating_add(*number),
            _ => 1,
        }
    }
}

/// Executes the command that the arguments of the process name. Returns the exit code.
pub fn main() -> ExitCode {
    // The processes of a plug-in and of a load are this program.
    if let Some(code) = devices::plugin::served().or_else(latency::served) {
        return code;
    }
    panics::report_in_one_line();
    signals::ignore_file_limit();
    let code = match parsed() {
        Ok(arguments) => execute(arguments.command),
        Err(code) => code,
    };
    match printing::end() {
        Ok(()) => ExitCode::from(code),
        Err(error) => {
            errln!("cannot write to the standard output: {error}");
            ExitCode::from(code.max(1))
        }
    }
}

impl Task {
    /// Whether the command has an end of its own for signals.
    fn ends_by_itself(&self) -> bool {
        match self {
            Self::Run(_) | Self::Device(_) | Self::Latency(_) | Self::Serve(_) => true,
            #[cfg(feature = "view")]
            Self::View(_) => true,
            _ => false,
        }
    }
}

/// The arguments of the command line. Prints help and errors; the error is the exit code.
fn parsed() -> Result<Arguments, u8> {
    let program = command();
    let given: Vec<_> = std::env::args_os().skip(1).collect();
    let words: Vec<_> = given
        .iter()
        .map(|word| word.to_string_lossy().into_owned())
        .collect();
    if let Some(tip) = tips::tip(&program, &words) {
        errln!("{tip}");
        return Err(2);
    }
    let name = OsString::from("palpate");
    let matched = program.try_get_matches_from([name].into_iter().chain(given));
    matched
        .and_then(|mut matches| Arguments::from_arg_matches_mut(&mut matches))
        .map_err(|message| {
            printing::print_message(&message);
            u8::try_from(message.exit_code()).unwrap_or(1)
        })
}

/// The commands and options of the program with their help, from which the package's man pages and completions are made.
pub fn command() -> Command {
    with_negative_numbers(Arguments::command())
}

/// The command, all of whose options take negative numbers: an option that does not allow one says what it allows.
fn with_negative_numbers(command: Command) -> Command {
    let command = command.mut_args(|argument| {
        let takes = argument.get_action().takes_values() && !argument.is_positional();
        argument.allow_negative_numbers(takes)
    });
    command.mut_subcommands(with_negative_numbers)
}

/// The seed of random choices.
fn seed(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| {
        format!(
            "found {text}, allowed: a whole number, 0 or above; the same seed gives the same run"
        )
    })
}

/// Executes a command and reports its error. Returns the exit code.
fn execute(command: Option<Task>) -> u8 {
    let command = command.unwrap_or_else(|| Task::Run(Box::default()));
    if !command.ends_by_itself() {
        signals::clean_up_at_the_end();
    }
    let result = match command {
        Task::Run(arguments) => run::run(&arguments),
        Task::Plan(arguments) => plan::run(&arguments),
        Task::Settings(arguments) => settings::run(&arguments),
        Task::Serve(arguments) => serve::run(&arguments),
        Task::Status(arguments) => status::run(&arguments),
        Task::Bugreport(arguments) => bugreport::run(&arguments),
        Task::Solve(arguments) => solve::run(&arguments),
        Task::Compare(arguments) => compare::run(&arguments),
        Task::Sweep(arguments) => sweep::run(&arguments),
        Task::Mesh(arguments) => mesh::run(&arguments),
        Task::Device(arguments) => device::run(&arguments),
        Task::Doctor(arguments) => doctor::run(&arguments),
        Task::Bench(arguments) => bench::run(&arguments),
        Task::Latency(arguments) => latency::run(&arguments),
        Task::Stress(arguments) => stress::run(&arguments),
        #[cfg(feature = "view")]
        Task::View(arguments) => view::run(&arguments),
    };
    match result {
        Ok(()) => 0,
        Err(error) => {
            errln!("{error}");
            error.exit_code()
        }
    }
}

/// The scene at `path`, or the built-in one, with the values of `sets`. Prints the values of the scene that are possible, but unlikely.
fn load(path: Option<&Path>, sets: &Sets) -> Result<LoadedScene, CommandError> {
    sets::load_with(path, sets.given()?, |_| Ok(()))
}

/// Builds a loaded scene. Prints what its meshes show to be possible, but unlikely.
fn build<'a>(loaded: &'a LoadedScene, bar: &ProgressBar) -> Result<World<'a>, CommandError> {
    bar.preparing(Preparation::Building);
    let world = World::new(loaded)?;
    for warning in &world.warnings[loaded.warnings.len()..] {
        bar.say(&format!("warning: {warning}"));
    }
    Ok(world)
}

/// A scene file as an argument.
#[derive(Clone, Debug, Default, clap::Args)]
struct SceneArgument {
    /// Scene file (TOML). Default: the built-in scene
    scene: Option<PathBuf>,
    #[command(flatten)]
    values: Values,
}

impl SceneArgument {
    /// The scene with the values of the arguments. Prints those that are possible, but unlikely.
    fn load(&self) -> Result<LoadedScene, CommandError> {
        self.values.load(self.scene.as_deref(), Vec::new())
    }
}

/// The commit from which this program was built, as `build.rs` found it.
const COMMIT: Option<&str> = option_env!("PALPATE_COMMIT");

/// Begins to show the progress of long work.
fn progress_bar() -> ProgressBar {
    ProgressBar::begin(true)
}
