//! `palpate view`: shows a run or a log, in the terminal, in a browser, or to other programs.
//!
//! The command is a process of its own without privileges. It only reads: nothing that a person does here reaches the
//! run. The one exception is the display that a run under the real clock starts on its own terminal: two of its keys arm
//! and stop the devices, by the signals that [`super::operator`] takes.

mod stills;

use super::outputs::{Declared, Format};
use super::{CommandError, operator};
use ::view::feed::{Command, Feed, FeedError};
use ::view::foxglove::{self, FoxgloveError};
use ::view::live::{LiveError, LiveFeed, LiveOptions};
use ::view::playback::{Player, PlayerError};
use ::view::terminal::palette::{Colours, Palette};
use ::view::terminal::{self, Ended, Options, TerminalError, draw, keys, lines, picture};
use ::view::web::{self, WebError};
use host::atomic_file::{AtomicFileError, write_atomically};
use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// The signals that end a viewer.
const SIGNALS: [i32; 4] = [SIGTERM, SIGHUP, SIGINT, SIGQUIT];

const EXAMPLES: &str = "\
Examples:
  palpate view                                 show the run of this user, in the terminal
  palpate view --lines                         print one line a second instead
  palpate view --web                           print the address of a page that shows the run
  palpate view run.mcap                        play a log back
  palpate view run.mcap --from 2.5 --speed 0.1 begin at 2.5 s, ten times slower
  palpate view run.mcap --at 2.9 --plot a.svg  draw one moment of a log
  palpate view --foxglove                      serve the run to Foxglove

In the terminal, the key h lists the keys, and q quits. A run goes on without its viewer.";

/// Arguments of `palpate view`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ViewArguments {
    /// Log to play back (MCAP). Without a log, the viewer shows a run
    #[arg(conflicts_with = "socket")]
    log: Option<PathBuf>,
    /// Unix socket of the run. Default: that of the only run of this user
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    /// Print a line for each second and each event, also in a terminal
    #[arg(long, conflicts_with_all = ["web", "foxglove"])]
    lines: bool,
    /// Serve a page to browsers on this machine only, and print its address. Default of the port: any free port
    #[arg(long, value_name = "PORT", num_args = 0..=1, require_equals = true, default_missing_value = "0",
          conflicts_with = "foxglove")]
    web: Option<u16>,
    /// Serve a run to Foxglove and other programs that speak its protocol, on this machine only. These programs open a
    /// log without a server. Default of the port: 8765
    #[arg(long, value_name = "PORT", num_args = 0..=1, require_equals = true, default_missing_value = "8765",
          conflicts_with = "log")]
    foxglove: Option<u16>,
    /// Log: seconds of the log for each second of the wall clock, 0.001 to 100. Default: 1
    #[arg(long, value_name = "X", value_parser = speed, requires = "log")]
    speed: Option<f64>,
    /// Log: begin at this time of the log
    #[arg(long, value_name = "SECONDS", value_parser = instant, requires = "log")]
    from: Option<f64>,
    /// Log: write the state at this time of the log with --plot, --csv or --curves, and end
    #[arg(long, value_name = "SECONDS", value_parser = instant, requires = "log",
          conflicts_with_all = ["lines", "web", "foxglove", "from", "speed"])]
    at: Option<f64>,
    /// Draw the bodies, the hands and their forces at the moment --at (SVG or PNG)
    #[arg(long, value_name = "FILE", requires = "at")]
    plot: Option<PathBuf>,
    /// Write the vertices of the bodies at the moment --at (CSV)
    #[arg(long, value_name = "FILE", requires = "at")]
    csv: Option<PathBuf>,
    /// Write the curves of the 10 s before the moment --at (CSV)
    #[arg(long, value_name = "FILE", requires = "at")]
    curves: Option<PathBuf>,
    /// Wait for a run, and for the next run after its end
    #[arg(long, conflicts_with = "log")]
    wait: bool,
    /// Pages of this origin, such as `https://viewer.example`, may read the run through --foxglove. May be given several
    /// times. Default: desktop programs and pages of this machine
    #[arg(long, value_name = "ORIGIN", requires = "foxglove")]
    allow_origin: Vec<String>,
    /// Compute the stresses of the bodies, in this process
    #[arg(long)]
    stress: bool,
    /// The run has the same terminal
    #[arg(long, hide = true)]
    attached: bool,
    /// The process of the run that takes the operator's orders
    #[arg(long, value_name = "PID", hide = true, requires = "attached")]
    operates: Option<u32>,
    /// Draw the terminal for the book: as a picture (SVG), or as text for another ending
    #[arg(long, value_name = "FILE", hide = true)]
    terminal_picture: Option<PathBuf>,
    /// Size of the terminal in the picture, and the panel: 1 to 5
    #[arg(long, value_name = "WIDTH HEIGHT TAB", hide = true, num_args = 3, requires = "terminal_picture",
          default_values_t = [120, 36, 1])]
    terminal_size: Vec<u16>,
}

/// Why a run or a log could not be shown.
#[derive(Debug, thiserror::Error)]
pub(super) enum ViewError {
    #[error(transparent)]
    Run(#[from] LiveError),
    #[error(transparent)]
    Terminal(#[from] TerminalError),
    #[error(transparent)]
    Feed(#[from] FeedError),
    #[error(transparent)]
    Log(#[from] PlayerError),
    #[error(transparent)]
    Web(#[from] WebError),
    #[error(transparent)]
    Foxglove(#[from] FoxgloveError),
    #[error("the handlers of signals cannot be installed: {0}")]
    Signals(io::Error),
    #[error("--at: found no output, allowed: one or more of --plot, --csv and --curves")]
    NothingToWrite,
    #[error("the log has no tick, and so no moment")]
    NoMoment,
    #[error("--{option}: found {found} s, allowed: up to the end of the log at {end:.3} s")]
    AfterTheLog {
        option: &'static str,
        found: f64,
        end: f64,
    },
    #[error(transparent)]
    File(#[from] AtomicFileError),
}

impl ViewError {
    pub(super) fn exit_code(&self) -> u8 {
        match self {
            Self::NothingToWrite | Self::AfterTheLog { .. } => 2,
            _ => 1,
        }
    }
}

/// Runs the command.
pub(super) fn run(arguments: &ViewArguments) -> Result<(), CommandError> {
    if arguments.at.is_some() && arguments.terminal_picture.is_none() {
        return write_still(arguments);
    }
    match show(arguments)? {
        Ended::Signal(number) => Err(CommandError::Signal(number)),
        Ended::Quit | Ended::Over => Ok(()),
    }
}

fn show(arguments: &ViewArguments) -> Result<Ended, ViewError> {
    let mut feed = feed(arguments)?;
    if arguments.stress {
        feed.command(&Command::Stress { on: true });
    }
    if let Some(path) = &arguments.terminal_picture {
        return draw_terminal(arguments, feed, path).map(|()| Ended::Over);
    }
    if let Some(port) = arguments.web {
        return serve_page(feed, port);
    }
    if let Some(port) = arguments.foxglove {
        return serve_foxglove(feed, port, arguments);
    }
    let mut options = Options {
        attached: arguments.attached,
        waits: arguments.wait,
        colours: Colours::of_environment(),
        save: Some(Box::new(stills::save)),
        operate: arguments.operates.map(operator::by_signals),
        signal: signals(arguments.attached).map_err(ViewError::Signals)?,
    };
    let terminal = io::stdin().is_terminal() && io::stdout().is_terminal();
    if arguments.lines || !terminal {
        return Ok(lines::lines(feed, &options, &mut Printed)?);
    }
    Ok(terminal::show(feed, &mut options)?)
}

/// The feed that the arguments name.
fn feed(arguments: &ViewArguments) -> Result<Box<dyn Feed>, ViewError> {
    match &arguments.log {
        Some(log) => playback(log, arguments),
        None => live(arguments),
    }
}

/// A feed from a run.
fn live(arguments: &ViewArguments) -> Result<Box<dyn Feed>, ViewError> {
    Ok(Box::new(LiveFeed::open(&LiveOptions {
        socket: arguments.socket.clone(),
        wait: arguments.wait,
    })?))
}

/// A feed from a log.
fn playback(log: &Path, arguments: &ViewArguments) -> Result<Box<dyn Feed>, ViewError> {
    // A log without an end is read once from the front.
    let bar = super::progress_bar();
    let player = Player::open(log, |fraction| bar.set_position((1000.0 * fraction) as u64));
    bar.finish_and_clear();
    let mut player = player?;
    if let Some(factor) = arguments.speed {
        player.command(&Command::Speed { factor });
    }
    let instants = [("from", arguments.from), ("at", arguments.at)];
    let instants = instants.into_iter();
    for (option, seconds) in instants.filter_map(|(option, given)| Some((option, given?))) {
        let end = player.end();
        if seconds > end {
            return Err(ViewError::AfterTheLog {
                option,
                found: seconds,
                end,
            });
        }
        let time_ns = (seconds * 1e9).round() as u64;
        player.command(&Command::Seek { time_ns });
    }
    Ok(Box::new(player))
}

/// Serves a page until a signal.
fn serve_page(feed: Box<dyn Feed>, port: u16) -> Result<Ended, ViewError> {
    let stop = Arc::new(AtomicBool::new(false));
    let received = signals(false).map_err(ViewError::Signals)?;
    for signal in SIGNALS {
        let flag = Arc::clone(&stop);
        signal_hook::flag::register(signal, flag).map_err(ViewError::Signals)?;
    }
    let options = web::Options {
        port,
        say: Arc::new(|line| outln!("{line}")),
        draw: Arc::new(stills::made),
        stop,
    };
    web::serve(feed, &options)?;
    // A person ends the page with Ctrl-C.
    match received.load(Ordering::SeqCst) as i32 {
        SIGTERM => Ok(Ended::Signal(SIGTERM as u8)),
        _ => Ok(Ended::Quit),
    }
}

/// Serves Foxglove until the feed ends. A signal ends the program at once.
fn serve_foxglove(
    feed: Box<dyn Feed>,
    port: u16,
    arguments: &ViewArguments,
) -> Result<Ended, ViewError> {
    let options = foxglove::Options {
        port,
        origins: arguments.allow_origin.clone(),
        say: Arc::new(|line| outln!("{line}")),
        ..foxglove::Options::default()
    };
    foxglove::serve(feed, &options)?;
    Ok(Ended::Over)
}

/// Writes a still of a log.
fn write_still(arguments: &ViewArguments) -> Result<(), CommandError> {
    let outputs = [&arguments.plot, &arguments.csv, &arguments.curves];
    if outputs.iter().all(|output| output.is_none()) {
        return Err(ViewError::NothingToWrite.into());
    }
    let _held = Declared::default()
        .input("the log", arguments.log.as_deref())
        .file("--plot", arguments.plot.as_ref(), Format::Picture)
        .file("--csv", arguments.csv.as_ref(), Format::Csv)
        .file("--curves", arguments.curves.as_ref(), Format::Csv)
        .check()?;
    let mut feed = feed(arguments)?;
    feed.command(&Command::Pause);
    let model = terminal::collect(feed.as_mut()).map_err(ViewError::from)?;
    let shown = model.shown().ok_or(ViewError::NoMoment)?;
    let still = shown.still();
    if let Some(path) = &arguments.plot {
        host::plot::write_picture(path, &still.picture())?;
    }
    if let Some(path) = &arguments.csv {
        write_atomically(path, still.vertices_csv().as_bytes())?;
    }
    if let Some(path) = &arguments.curves {
        write_atomically(path, still.curves_csv().as_bytes())?;
    }
    for path in outputs.into_iter().flatten() {
        outln!("{}", path.display());
    }
    Ok(())
}

/// Draws the terminal as it is at the time --at, or at the end of the feed.
fn draw_terminal(
    arguments: &ViewArguments,
    mut feed: Box<dyn Feed>,
    path: &Path,
) -> Result<(), ViewError> {
    feed.command(&Command::Pause);
    let model = terminal::collect(feed.as_mut())?;
    let &[width, height, tab] = arguments.terminal_size.as_slice() else {
        return Ok(());
    };
    let tab = usize::from(tab.clamp(1, 5)) - 1;
    let view = keys::View {
        tab: keys::Tab::ALL[tab].0,
        ..keys::View::default()
    };
    let cells = draw::cells(width, height, &model, &view, Palette(Colours::True));
    let is_svg = path.extension().is_some_and(|ending| ending == "svg");
    let drawn = if is_svg {
        picture::svg(&cells)
    } else {
        picture::text(&cells)
    };
    write_atomically(path, drawn.as_bytes())?;
    Ok(())
}

/// Notes the signals that end the viewer. If the run has the same terminal, Ctrl-C and SIGQUIT are for the run, which
/// then ends, and the viewer with it.
fn signals(attached: bool) -> io::Result<Arc<AtomicUsize>> {
    let received = Arc::new(AtomicUsize::new(0));
    let ignored = Arc::new(AtomicUsize::new(0));
    for signal in SIGNALS {
        let flag = if attached && [SIGINT, SIGQUIT].contains(&signal) {
            &ignored
        } else {
            &received
        };
        signal_hook::flag::register_usize(signal, Arc::clone(flag), signal as usize)?;
    }
    Ok(received)
}

/// The standard output of this program, which does not complain about a closed pipe.
struct Printed;

impl io::Write for Printed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        out!("{}", String::from_utf8_lossy(bytes));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stdout().flush()
    }
}

/// Seconds of the log for each second of the wall clock.
fn speed(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "expected a number".to_owned())?;
    if (0.001..=100.0).contains(&value) {
        Ok(value)
    } else {
        Err(format!("found {text}, allowed: 0.001 to 100"))
    }
}

/// An instant of a log (s).
fn instant(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "expected a number".to_owned())?;
    if (0.0..=1e9).contains(&value) {
        Ok(value)
    } else {
        Err(format!("found {text}, allowed: 0 to 1e9"))
    }
}
