//! The display in a terminal.
//!
//! [`show`] draws the messages of a feed until the person quits or the feed ends. [`lines()`](lines::lines) prints plain
//! lines if there is no terminal. A [`Model`] puts the messages together; [`draw()`](draw::draw) draws a model into a
//! buffer of cells, so that tests and pictures need no terminal.

mod body;
mod chart;
mod dots;
pub mod draw;
mod format;
mod histogram;
mod input;
pub mod keys;
pub mod lines;
pub mod model;
pub mod palette;
pub mod picture;
mod rows;
mod screen;
mod timeline;

use crate::feed::{Feed, FeedError};
use host::live::Message;
use input::Input;
use keys::{Order, View, Wish};
pub use model::{Model, Over};
use palette::{Colours, Palette};
use ratatui::crossterm::event::Event;
use screen::Screen;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Time between two pictures.
const PERIOD: Duration = Duration::from_millis(33);
/// Longest wait for a message before the keys are read.
const WAIT: Duration = Duration::from_millis(15);

/// Saves the shown moment, and returns a line for the person: the names of the files, or the reason why there are none.
pub type Save = Box<dyn FnMut(&Model) -> String>;

/// Passes an order of the operator on to the run, and returns a line for the person.
pub type Operate = Box<dyn FnMut(Order) -> String>;

/// How the display behaves.
#[derive(Default)]
pub struct Options {
    /// The run has the same terminal: Ctrl-C reaches the run, and the display ends with the run.
    pub attached: bool,
    /// The feed gives the next run after the end of a run, and the display waits for this run.
    pub waits: bool,
    /// The colours of the terminal.
    pub colours: Colours,
    /// Saves a moment. Without it, the key `s` says that moments cannot be saved.
    pub save: Option<Save>,
    /// Passes the operator's orders on. Without it, no key is an order.
    pub operate: Option<Operate>,
    /// The number of a signal that asks the program to end; zero for none.
    pub signal: Arc<AtomicUsize>,
}

/// Why the display ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The person quit.
    Quit,
    /// The run is over.
    Over,
    /// The program received this signal.
    Signal(u8),
}

/// Why the display failed.
#[derive(Debug, thiserror::Error)]
pub enum TerminalError {
    /// The terminal cannot be read or written.
    #[error("the terminal cannot be used: {0}; allowed: a terminal, or plain lines with --lines")]
    Terminal(#[from] io::Error),
    /// The lines cannot be written.
    #[error("the lines cannot be written: {0}")]
    Lines(io::Error),
    /// The feed ended early.
    #[error(transparent)]
    Feed(#[from] FeedError),
}

/// The signal that was received, if any.
fn signal(flag: &AtomicUsize) -> Option<Ended> {
    match u8::try_from(flag.load(Ordering::SeqCst)) {
        Ok(0) | Err(_) => None,
        Ok(number) => Some(Ended::Signal(number)),
    }
}

/// Shows a feed in the terminal of the standard input and output.
///
/// # Errors
/// [`TerminalError`] if the terminal cannot be used, or the feed ended early. The terminal is given back in every case.
pub fn show(mut feed: Box<dyn Feed>, options: &mut Options) -> Result<Ended, TerminalError> {
    let mut screen = Screen::begin(options.attached)?;
    let input = Input::begin()?;
    let palette = Palette(options.colours);
    let mut model = Model::default();
    let mut view = View {
        waits: options.waits,
        operates: options.operate.is_some(),
        ..View::default()
    };
    let mut broken = None;
    let mut drawn: Option<Instant> = None;
    loop {
        if let Some(ended) = signal(&options.signal) {
            return Ok(ended);
        }
        // All messages that are there, until the next picture is due.
        let mut changed = false;
        while goes_on(&model, options) && drawn.is_none_or(|drawn| drawn.elapsed() < PERIOD) {
            match feed.next(if changed { Duration::ZERO } else { WAIT }) {
                Ok(Some(message)) => model.take(message, Instant::now()),
                Ok(None) => break,
                Err(error) => {
                    model.over = Some(Over::Broken(error.to_string()));
                    broken = Some(error);
                }
            }
            changed = true;
            if drawn.is_none() {
                break;
            }
        }
        if model.over.is_some() && options.attached {
            return broken.map_or(Ok(Ended::Over), |error| Err(error.into()));
        }
        // After the end of the feed, only the keys are left to wait for.
        let mut wait = if goes_on(&model, options) {
            Duration::ZERO
        } else {
            PERIOD
        };
        while let Some(event) = input.next(wait)? {
            changed = true;
            wait = Duration::ZERO;
            let Event::Key(key) = event else {
                continue;
            };
            match keys::follow(&key, &mut view, &model) {
                Wish::None => {}
                Wish::Quit => return broken.map_or(Ok(Ended::Quit), |error| Err(error.into())),
                Wish::Command(command) => feed.command(&command),
                Wish::Order(order) => {
                    view.notice = options.operate.as_mut().map(|operate| operate(order));
                }
                Wish::Redraw => screen.terminal.clear()?,
                Wish::Save => {
                    let shown = view.stopped.as_deref().unwrap_or(&model);
                    let none = || "this display cannot save moments".to_owned();
                    let save = options.save.as_mut();
                    view.notice = Some(save.map_or_else(none, |save| save(shown)));
                }
            }
        }
        // The age of the frame changes also without messages.
        if changed || drawn.is_none_or(|drawn| drawn.elapsed() >= 3 * PERIOD) {
            let now = Instant::now();
            screen.terminal.draw(|frame| {
                let area = frame.area();
                draw::draw(frame.buffer_mut(), area, &model, &view, palette, now);
            })?;
            drawn = Some(now);
        }
    }
}

/// Whether the feed may give more messages: those of this run, or those of the next run.
fn goes_on(model: &Model, options: &Options) -> bool {
    match model.over {
        None => true,
        Some(Over::Ended(_)) => options.waits,
        Some(Over::Broken(_)) => false,
    }
}

/// A model of all messages that a feed gives at once.
///
/// # Errors
/// [`FeedError`] if the feed ended early.
pub fn collect(feed: &mut dyn Feed) -> Result<Model, FeedError> {
    let mut model = Model::default();
    for message in feed.present() {
        model.take(message, Instant::now());
    }
    while model.over.is_none() {
        match feed.next(Duration::ZERO)? {
            Some(Message::End(_)) | None => break,
            Some(message) => model.take(message, Instant::now()),
        }
    }
    Ok(model)
}

#[cfg(test)]
mod tests;
