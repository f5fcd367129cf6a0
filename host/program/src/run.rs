//! `palpate run`: runs a scene from beginning to end.

use super::fault::fault;
use super::operator;
use super::order::order;
use super::outputs::{Declared, Format};
use super::overrides::Overrides;
use super::progress::ProgressBar;
use super::settings::{self, MachineArguments};
use super::signals::Ending;
#[cfg(feature = "view")]
use super::watch::Watch;
use super::{COMMIT, CommandError, SceneArgument, build};
use devices::panel::{Order, Panel, TimedOrder};
use host::engine::faults::HostFault;
use host::plot::Component;
use host::run::frames::FrameOptions;
#[cfg(feature = "view")]
use host::run::view::ViewOptions;
use host::run::{Clock, RunError, RunOptions, TickOutputs, slow_warning};
use host::scene::Scene;
use host::scene::spec::Device;
use physics::FactorCode;
use runner::{CallPolicy, Cores, Reserved};
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::sync::Arc;

/// Frames a second without `--frames` (Hz).
const FRAME_RATE: f64 = 25.0;

const EXAMPLES: &str = "\
Examples:
  palpate run --csv run.csv                           write a row for each tick
  palpate run --force-displacement run.svg            draw force against displacement of each device
  palpate run --vtu out --frames 50                   write 50 deformed meshes a second for ParaView
  palpate run --scheme linear --latency 0.02          try another scheme and another latency
  palpate run --replay run.mcap --csv run.csv         make the table from a log";

/// Arguments of `palpate run`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct RunArguments {
    #[command(flatten)]
    scene: SceneArgument,
    /// Clock of the run: virtual time is bit-for-bit reproducible, real time is that of the machine
    #[arg(long, value_enum, default_value_t = ClockName::Virtual)]
    clock: ClockName,
    /// Duration of the run in seconds. Default: the duration of the scene
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    duration: Option<f64>,
    /// Seed of every random choice. Default: the seed of the scene
    #[arg(long, value_parser = crate::seed)]
    seed: Option<u64>,
    /// Instructions of the linear algebra: the fastest of the machine, or portable ones, which give the same
    /// bytes on every machine
    #[arg(long, value_enum, default_value_t = InstructionsName::Auto)]
    instructions: InstructionsName,
    /// Log every tick (MCAP, for Foxglove, PlotJuggler and others). A relative path lies in `log.folder` of the settings,
    /// if they give one (`palpate settings`)
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Draw force and position over time (SVG or PNG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Draw the component of force and displacement along this axis of the scene, or their norm, so that the pictures of
    /// several runs compare. Default: the main direction of each device's force
    #[arg(long, value_name = "AXIS", value_enum, requires = "plot")]
    axis: Option<AxisName>,
    /// Write a row for each tick: time, poses, velocities and forces of the devices, age of the models, limits (CSV).
    /// Also with --replay
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Draw the force on the body against the displacement of each device (SVG or PNG). Also with --replay
    #[arg(long, value_name = "FILE")]
    force_displacement: Option<PathBuf>,
    /// Real clock: write the distributions of lateness and tick time, as a table (CSV) or as a picture (SVG or
    /// PNG): the fraction of ticks above a time, on logarithmic axes
    #[arg(long, value_name = "FILE")]
    histogram: Option<PathBuf>,
    /// Write the deformed bodies as VTU into this folder, and the list frames.pvd, for ParaView
    #[arg(long, value_name = "FOLDER", conflicts_with = "replay")]
    vtu: Option<PathBuf>,
    /// Frames of --vtu a second of the run's own time (Hz), at most `host.step_rate` of the scene. A frame is the state
    /// after the first step at or after its time. Default: 25, or `host.step_rate` if that is lower
    #[arg(long, value_name = "RATE", requires = "vtu")]
    frames: Option<f64>,
    /// Also write frames of the deformed bodies into the log, this many a second of the run's own time (Hz), at most
    /// `host.step_rate` of the scene. A frame is the state after the first step at or after its time
    #[arg(long, value_name = "RATE", requires = "log")]
    log_frames: Option<f64>,
    /// Write the summary as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Run the ticks of a log again, with the readings and the local models of the log, and compare bit for bit.
    /// If a scene is given, it replaces the scene of the log
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = [
            "clock", "duration", "seed", "instructions", "log", "plot", "histogram", "sets", "devices", "core",
            "priority", "settings",
        ]
    )]
    replay: Option<PathBuf>,
    /// Print lines on stderr with the number of ticks done and the number of ticks in the log
    #[arg(long, hide = true)]
    report_progress: bool,
    /// Make the host fail on purpose, to test the effect on the hand: stall@1.5+0.5 stalls the host at 1.5 s for
    /// 0.5 s; nan@T+D and topology@T+D publish bad models; panic@T ends the host. May be given several times
    #[arg(long, value_name = "FAULT", value_parser = fault, conflicts_with = "replay")]
    fault: Vec<HostFault>,
    /// Arm or stop the devices at a time of the run: arm@0.5 arms them at 0.5 s, and stop@2 stops their forces at 2 s
    /// until they are armed again; take@1 lets simulated hands take hold with their tools, and the next take lets go.
    /// May be given several times
    #[arg(long, value_name = "ORDER", value_parser = order, conflicts_with = "replay")]
    order: Vec<TimedOrder>,
    /// Real clock: refuse to start without the realtime privileges, and end the run at the first system call that
    /// the tick may not make; or only one of the two
    #[arg(long, value_name = "WHAT", value_enum, num_args = 0..=1, require_equals = true,
          default_missing_value = "all", conflicts_with = "replay")]
    strict: Option<Strict>,
    #[command(flatten)]
    machine: MachineArguments,
    #[command(flatten)]
    overrides: Overrides,
    #[cfg(feature = "view")]
    #[command(flatten)]
    view: ViewArguments,
}

/// Arguments of a run that viewers watch.
#[cfg(feature = "view")]
#[derive(Clone, Debug, Default, clap::Args)]
struct ViewArguments {
    /// Let viewers watch the run (`palpate view`), and show the run in this terminal: the key q closes the display, and
    /// Ctrl-C ends the run. Default of the socket: palpate/PID.sock in $XDG_RUNTIME_DIR, or /tmp/palpate-UID/PID.sock
    #[arg(long, value_name = "SOCKET", num_args = 0..=1, require_equals = true, conflicts_with = "replay")]
    // Absent, without a value, or with a value: clap describes an option with an optional value so.
    #[allow(clippy::option_option)]
    view: Option<Option<PathBuf>>,
    /// Virtual time with --view: seconds of the run for each second of the wall clock, or 0 for as fast as possible.
    /// Default: 1
    #[arg(long, value_name = "FACTOR", requires = "view", value_parser = pace)]
    pace: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Strict {
    /// End the run, without force, at the first system call that the tick may not make
    Syscalls,
    /// Do not start unless the system grants core, priority, locked memory and a processor without deep sleep states
    Privileges,
    /// Both
    All,
}

impl Default for RunArguments {
    fn default() -> Self {
        Self {
            scene: SceneArgument::default(),
            clock: ClockName::Virtual,
            duration: None,
            seed: None,
            instructions: InstructionsName::Auto,
            log: None,
            log_frames: None,
            plot: None,
            axis: None,
            csv: None,
            force_displacement: None,
            histogram: None,
            vtu: None,
            frames: None,
            json: None,
            replay: None,
            report_progress: false,
            fault: Vec::new(),
            order: Vec::new(),
            strict: None,
            machine: MachineArguments::default(),
            overrides: Overrides::default(),
            #[cfg(feature = "view")]
            view: ViewArguments::default(),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum ClockName {
    Virtual,
    Real,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum InstructionsName {
    Auto,
    Portable,
}

/// The component of a force that a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum AxisName {
    X,
    Y,
    Z,
    Norm,
}

impl From<AxisName> for Component {
    fn from(name: AxisName) -> Self {
        match name {
            AxisName::X => Self::Axis(0),
            AxisName::Y => Self::Axis(1),
            AxisName::Z => Self::Axis(2),
            AxisName::Norm => Self::Norm,
        }
    }
}

/// Parses a positive number of seconds, at most one day.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    let refused = || format!("found {text}, allowed: a number above 0 and up to 86400 (s)");
    let value: f64 = text.parse().map_err(|_| refused())?;
    if value > 0.0 && value <= 86_400.0 {
        Ok(value)
    } else {
        Err(refused())
    }
}

/// Parses a pace.
#[cfg(feature = "view")]
fn pace(text: &str) -> Result<f64, String> {
    let allowed = text.parse().ok();
    let allowed = allowed.filter(|value| *value == 0.0 || (0.001..=1000.0).contains(value));
    allowed.ok_or_else(|| format!("found {text}, allowed: 0, or a number from 0.001 to 1000"))
}

/// The system calls that a scene's devices need in the tick.
fn needed_calls(scene: &Scene) -> CallPolicy {
    let mut devices = scene.devices.iter();
    if devices.all(Device::is_simulated) {
        CallPolicy::Simulated
    } else {
        CallPolicy::Hid
    }
}

/// Refuses faults and orders that would come after the end of the run, without effect.
fn before_the_end(arguments: &RunArguments, scene: &Scene) -> Result<(), CommandError> {
    let end = arguments.duration.unwrap_or(scene.duration);
    let faults = arguments.fault.iter().map(|fault| ("--fault", fault.at));
    let orders = arguments.order.iter().map(|order| ("--order", order.at));
    match faults.chain(orders).find(|(_, at)| *at >= end) {
        None => Ok(()),
        Some((argument, found)) => Err(CommandError::AfterTheEnd {
            argument,
            found,
            end,
        }),
    }
}

/// Refuses orders to take hold in a scene in which no simulated hand can.
fn can_take(arguments: &RunArguments, scene: &Scene) -> Result<(), CommandError> {
    let asks = arguments.order.iter().any(|one| one.order == Order::Take);
    let can = (0..scene.devices.len()).any(|device| scene.ordered_button(device) != 0);
    if asks && !can {
        return Err(CommandError::NothingToTake);
    }
    Ok(())
}

/// Refuses what is about the tick's own thread if there is none.
fn needs_real_clock(arguments: &RunArguments) -> Result<(), CommandError> {
    let given = [
        ("--strict", arguments.strict.is_some()),
        ("--core", arguments.machine.core.is_some()),
        ("--priority", arguments.machine.priority.is_some()),
        ("--histogram", arguments.histogram.is_some()),
    ];
    match given.into_iter().find(|(_, given)| *given) {
        Some((option, _)) if arguments.clock == ClockName::Virtual => {
            Err(CommandError::NeedsRealClock(option))
        }
        _ => Ok(()),
    }
}

pub(super) fn run(arguments: &RunArguments) -> Result<(), CommandError> {
    let ticks = TickOutputs {
        csv: arguments.csv.clone(),
        force_displacement: arguments.force_displacement.clone(),
    };
    if let Some(path) = &arguments.replay {
        let (scene, json) = (&arguments.scene.scene, &arguments.json);
        return super::replay::run(path, scene.as_deref(), json.as_ref(), &ticks);
    }
    let real = arguments.clock == ClockName::Real;
    needs_real_clock(arguments)?;
    let scene = arguments.scene.scene.as_deref();
    if arguments.overrides.has_latency() && real {
        return Err(CommandError::NeedsVirtualClock);
    }
    #[cfg(feature = "view")]
    if arguments.view.pace.is_some() && real {
        return Err(CommandError::PaceNeedsVirtualClock);
    }
    // The scene may name the core of the tick, so it is read before the first thread starts.
    let loaded = arguments.overrides.load(&arguments.scene)?;
    let settings = arguments.machine.resolve(Some(&loaded))?;
    let (core, idle) = (settings.core.value, settings.idle_sibling.value);
    let log = arguments.log.as_deref().map(|path| settings.log(path));
    // Before the scene is built: a signal that comes meanwhile must not end a program that opens devices. The threads that
    // start here leave the core of the tick free, as the threads of the run do.
    let reserved = real.then(|| Reserved::new(core, idle, &Cores::of_this_machine()));
    let ending = Ending::begin(real)?;
    let panel = Panel::default();
    #[cfg_attr(
        not(feature = "view"),
        expect(
            unused_variables,
            reason = "a display alone takes the terminal from the operator"
        )
    )]
    let keyboard = real.then(|| operator::begin(&panel)).transpose()?;
    drop(reserved);
    let frames = arguments.vtu.as_ref().map(|folder| FrameOptions {
        folder: folder.clone(),
        rate: arguments
            .frames
            .unwrap_or(FRAME_RATE.min(loaded.scene.host.step_rate)),
    });
    if let Some(frames) = &frames {
        frames.check(&loaded.scene).map_err(RunError::from)?;
    }
    if let Some(rate) = arguments.log_frames {
        host::run::log_frames::check_rate(rate, &loaded.scene).map_err(RunError::from)?;
    }
    before_the_end(arguments, &loaded.scene)?;
    can_take(arguments, &loaded.scene)?;
    let _held = Declared::default()
        .scene(scene, &loaded)
        .file("--log", log.as_ref(), Format::Mcap)
        .file("--plot", arguments.plot.as_ref(), Format::Picture)
        .frames("--vtu", arguments.vtu.as_ref(), &loaded.scene.bodies)
        .ticks(&ticks)
        .file(
            "--histogram",
            arguments.histogram.as_ref(),
            Format::Distribution,
        )
        .file("--json", arguments.json.as_ref(), Format::Json)
        .check()?;
    let mut options = RunOptions {
        duration: arguments.duration,
        seed: arguments.seed,
        log,
        log_frames: arguments.log_frames,
        plot: arguments.plot.clone(),
        component: arguments.axis.map_or(Component::default(), Component::from),
        ticks,
        histogram: arguments.histogram.clone(),
        frames,
        json: arguments.json.clone(),
        faults: arguments.fault.clone(),
        orders: arguments.order.clone(),
        stop: Arc::clone(ending.stop()),
        panel,
        instructions: match arguments.instructions {
            InstructionsName::Auto => FactorCode::Fastest,
            InstructionsName::Portable => FactorCode::Portable,
        },
        ..RunOptions::new(match arguments.clock {
            ClockName::Virtual => Clock::Virtual,
            ClockName::Real => Clock::Real,
        })
    };
    options.commit = COMMIT;
    #[cfg(feature = "view")]
    let mut watch = arguments
        .view
        .view
        .clone()
        .map(|socket| Watch::new(socket, keyboard.as_ref()));
    #[cfg(feature = "view")]
    {
        options.view = watch.as_ref().map(|watch| ViewOptions {
            socket: watch.named_socket(),
            pace: arguments.view.pace.unwrap_or(1.0),
        });
    }
    options.runner.require_grants =
        matches!(arguments.strict, Some(Strict::Privileges | Strict::All));
    let watched = matches!(arguments.strict, Some(Strict::Syscalls | Strict::All));
    options.runner.calls = watched.then(|| needed_calls(&loaded.scene));
    settings::apply(&settings, &mut options);
    // A display that has the terminal reads its keys.
    let lines = options.view.is_none() || !std::io::stdout().is_terminal();
    let mut waiting = operator::waiting(&loaded.scene, real, lines);
    if !options.orders.is_empty() {
        waiting = None;
    }
    let bar = ProgressBar::begin(!arguments.report_progress);
    let world = build(&loaded, &bar)?;
    let mut judged = real.then(|| super::doctor::line(&settings));
    let mut warned = false;
    let result = host::run::run(&world, &options, &mut |progress| {
        if let Some(preparation) = progress.preparation {
            bar.preparing(preparation);
            return;
        }
        // The devices are open now.
        for told in judged.take().into_iter().chain(waiting.take()) {
            bar.say(&told);
        }
        let position = (1000.0 * progress.fraction()) as u64;
        #[cfg(feature = "view")]
        if watch.as_mut().is_some_and(|watch| watch.shows(&bar)) {
            // The display has the terminal. The summary repeats the warning.
            return;
        }
        match options.clock {
            Clock::Real => bar.draw_here(position),
            // A display has ended the thread that draws.
            Clock::Virtual if options.view.is_some() => bar.draw_here(position),
            Clock::Virtual => bar.set_position(position),
        }
        if let Some(slow) = progress.slow.filter(|_| !warned) {
            warned = true;
            let warning = slow_warning(&loaded, &options, slow);
            bar.say(&format!("warning: {warning}"));
        }
        if arguments.report_progress {
            let line = format!("ticks {} logged {}\n", progress.ticks, progress.logged);
            // One write call, so that a reader never sees half a line. Without a reader the error does not matter.
            let _ = std::io::stderr().write_all(line.as_bytes());
        }
    });
    #[cfg(feature = "view")]
    drop(watch);
    bar.finish_and_clear();
    let summary = result?;
    out!("{summary}");
    let list = options.frames.as_ref().map(FrameOptions::list_file);
    for (output, path) in [
        ("log", &options.log),
        ("plot", &options.plot),
        ("csv", &options.ticks.csv),
        ("curve", &options.ticks.force_displacement),
        ("histogram", &options.histogram),
        ("vtu", &list),
        ("json", &options.json),
    ] {
        if let Some(path) = path
            .as_ref()
            .filter(|path| !summary.unwritten.contains(path))
        {
            outln!("  {output:<10} {}", path.display());
        }
    }
    if !summary.failures.is_empty() {
        return Err(CommandError::Incomplete);
    }
    // A signal after the last tick has ended nothing.
    if summary.tick.stopped {
        ending.result()
    } else {
        Ok(())
    }
}
