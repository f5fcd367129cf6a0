//! A log played back: the feed of a log.
//!
//! A [`Player`] shows one tick of the log at a time. While it plays, each frame folds all ticks since the frame before,
//! so that no spike is lost. After a jump, the curves of the ten seconds before come first. The clock of the player is
//! what its caller says ([`Player::advance`]); as a [`Feed`], the player follows the clock of the machine.

mod error;
mod facts;
mod seek;
mod shown;

pub use error::PlayerError;

use crate::feed::{Command, Feed, FeedError};
use crate::history::History;
use crate::stress::Stresses;
use facts::Facts;
use host::live::gather::Gatherer;
use host::live::{Frame, Message, Playback};
use host::log::index::{LogIndex, TickAt};
use host::log::overview::{Overview, at_most};
use host::record::Surface;
use std::collections::VecDeque;
use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;
use std::time::{Duration, Instant};

/// Least time of the wall between two frames.
const FRAME: Duration = Duration::from_nanos(16_666_667);
/// Seconds of the log in the curves.
const SPAN: f64 = 10.0;
/// Most intervals of the curves after a jump.
const PIECES: u64 = 600;
/// Most intervals of the timeline.
const TIMELINE: usize = 600;
/// Allowed speeds: seconds of the log for each second of the wall.
const SPEEDS: std::ops::RangeInclusive<f64> = 0.001..=100.0;

/// Plays a log.
pub struct Player<R> {
    log: LogIndex<R>,
    facts: Facts,
    overview: Overview,
    /// The first message to a viewer.
    hello: Message,
    notes: Vec<String>,
    /// Times of the first and the last tick (ns).
    from_ns: u64,
    to_ns: u64,
    playing: bool,
    speed: f64,
    /// The time of the log that the clock has reached (ns). The tick that is shown is the last one before it.
    at_ns: f64,
    /// Time of the wall since the last frame.
    waited: Duration,
    /// The position of the shown tick in the log.
    place: TickAt,
    /// Its number.
    tick: u64,
    /// Has taken the ticks up to the one that is shown.
    gatherer: Gatherer,
    number: u64,
    history: History,
    stresses: Stresses,
    /// Whether frames have stresses.
    stressed: bool,
    /// The surfaces that were sent last, one a body. A display keeps one surface a body, too.
    surfaces: Vec<Surface>,
    frame: Frame,
    /// Messages that were made and not taken.
    waiting: VecDeque<Message>,
    failed: Option<FeedError>,
    /// When the clock of the machine was last read.
    read: Option<Instant>,
}

impl Player<File> {
    /// Opens the log at `path`. A log without an overview, such as that of a killed run, is read once from the front;
    /// `progress` is given the fraction done.
    ///
    /// # Errors
    /// [`PlayerError`].
    pub fn open(path: &Path, progress: impl FnMut(f64)) -> Result<Self, PlayerError> {
        let name = path.display().to_string();
        let file = host::input::open(path).map_err(|source| PlayerError::Open {
            log: name.clone(),
            source,
        })?;
        Self::of(file, &name, progress)
    }
}

impl<R: Read + Seek + Send> Player<R> {
    /// The end of the log (s): a period after its last tick.
    pub fn end(&self) -> f64 {
        let period = match &self.hello {
            Message::Hello(hello) => 1.0 / hello.tick_rate,
            _ => 0.0,
        };
        self.to_ns as f64 * 1e-9 + period
    }

    /// Moves the clock by `wall`. While the log plays, the tick that is then due is shown, at most sixty times a second.
    pub fn advance(&mut self, wall: Duration) {
        if !self.playing || self.failed.is_some() {
            return;
        }
        self.at_ns += wall.as_secs_f64() * 1e9 * self.speed;
        self.waited = self.waited.saturating_add(wall);
        if self.waited < FRAME {
            return;
        }
        self.waited = Duration::ZERO;
        if let Err(error) = self.play_on() {
            self.fail(&error);
        }
    }

    /// Shows the tick that is due, and folds the ticks since the one that is shown.
    fn play_on(&mut self) -> Result<(), PlayerError> {
        let until_ns = self.at_ns.max(0.0) as u64;
        let mut reached = None;
        if let Some(from) = self.log.next(self.place)? {
            let gatherer = &mut self.gatherer;
            self.log.ticks_from(from, |place, row| {
                if row.time_ns > until_ns {
                    return false;
                }
                gatherer.take(&row.into());
                reached = Some(place);
                true
            })?;
        }
        let ended = until_ns >= self.to_ns;
        if ended {
            self.playing = false;
            self.at_ns = self.to_ns as f64;
        }
        if let Some(place) = reached {
            self.place = place;
            self.make_frame(false)?;
        } else if ended {
            self.waiting.push_back(self.playback(false));
        }
        Ok(())
    }

    fn fail(&mut self, error: &PlayerError) {
        self.playing = false;
        self.failed = Some(FeedError::Log(error.to_string()));
    }

    /// How the log is played; with the events and the timeline if `whole`.
    fn playback(&self, whole: bool) -> Message {
        let mut playback = Playback {
            playing: self.playing,
            speed: self.speed,
            from_ns: self.from_ns,
            to_ns: self.to_ns,
            at_ns: self.frame.time_ns,
            tick: self.tick,
            complete: self.log.is_complete(),
            has_frames: self.log.has_frames(),
            notes: self.notes.clone(),
            ..Playback::default()
        };
        if whole {
            playback.events.clone_from(&self.overview.events);
            playback.overview = at_most(
                TIMELINE,
                self.overview.pieces.iter().map(|piece| &piece.folded),
            );
        }
        Message::Playback(Box::new(playback))
    }

    fn obey(&mut self, command: &Command) -> Result<(), PlayerError> {
        match *command {
            Command::Play => {
                // At its end, the log plays again from the front.
                if self.frame.time_ns >= self.to_ns && self.from_ns < self.to_ns {
                    self.seek(self.from_ns)?;
                }
                self.playing = true;
                // The time of the pause does not count.
                self.read = None;
            }
            Command::Pause => self.playing = false,
            Command::Speed { factor } if factor.is_finite() => {
                self.speed = factor.clamp(*SPEEDS.start(), *SPEEDS.end());
            }
            Command::Seek { time_ns } => return self.seek(time_ns),
            Command::Step { ticks } => return self.step(ticks),
            Command::Next => return self.next_event(),
            Command::Previous => return self.previous_event(),
            Command::Stress { on } => {
                self.stressed = on;
                // The moment stays, and its vertices are sent again.
                return self.make_frame(true);
            }
            Command::Speed { .. } => return Ok(()),
        }
        self.waiting.push_back(self.playback(false));
        Ok(())
    }

    /// A message that was made; `None` if there is none.
    ///
    /// # Errors
    /// [`FeedError::Log`] if the log cannot be read further.
    pub fn take(&mut self) -> Result<Option<Message>, FeedError> {
        if let Some(message) = self.waiting.pop_front() {
            return Ok(Some(message));
        }
        self.failed.take().map_or(Ok(None), Err)
    }
}

impl<R: Read + Seek + Send> Feed for Player<R> {
    fn next(&mut self, wait: Duration) -> Result<Option<Message>, FeedError> {
        if let Some(message) = self.take()? {
            return Ok(Some(message));
        }
        let due = if self.playing {
            FRAME.saturating_sub(self.waited)
        } else {
            wait
        };
        let now = Instant::now();
        let since = self.read.map_or(Duration::ZERO, |read| now - read);
        std::thread::sleep(due.saturating_sub(since).min(wait));
        let now = Instant::now();
        let wall = self.read.map_or(Duration::ZERO, |read| now - read);
        self.read = Some(now);
        self.advance(wall);
        self.take()
    }

    fn command(&mut self, command: &Command) {
        if let Err(error) = self.obey(command) {
            self.fail(&error);
        }
    }

    fn present(&self) -> Vec<Message> {
        let mut messages = vec![self.hello.clone()];
        let surfaces = self.surfaces.iter().cloned().map(Message::Surface);
        messages.extend(surfaces);
        messages.push(Message::History(self.history.pieces().cloned().collect()));
        messages.push(Message::Frame(Box::new(self.frame.clone())));
        messages.push(self.playback(true));
        messages
    }
}

#[cfg(test)]
mod tests;
