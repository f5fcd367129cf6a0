//! The synthetic sheet at the pace of a run, or as a log that is played.

use fuzz_rules::synthetic::Synthetic;
use host::live::{Message, Playback, Source};
use std::time::{Duration, Instant};
use view::feed::{Command, Feed, FeedError};

/// Time between two frames.
const PERIOD: Duration = Duration::from_millis(16);
/// Length of the log (ns).
const LENGTH_NS: u64 = 60_000_000_000;

/// The synthetic feed at the pace of a run, and with the playback of a log if this is asked for.
pub(crate) struct Paced {
    feed: Synthetic,
    due: Instant,
    left: u64,
    log: Option<Playback>,
    changed: bool,
}

impl Paced {
    /// A run, or a log of one minute, with `edge` vertices along an edge of the sheet. It gives no frame after the
    /// first `frames`.
    pub(crate) fn new(edge: u32, log: bool, frames: u64) -> Self {
        let feed = Synthetic::with_edge(u64::MAX, edge);
        let log = log.then(|| Playback {
            playing: true,
            speed: 1.0,
            to_ns: LENGTH_NS,
            complete: true,
            has_frames: true,
            events: feed.events(LENGTH_NS),
            overview: feed.overview(LENGTH_NS),
            ..Playback::default()
        });
        Self {
            feed,
            due: Instant::now(),
            left: frames,
            log,
            changed: false,
        }
    }
}

impl Feed for Paced {
    fn next(&mut self, wait: Duration) -> Result<Option<Message>, FeedError> {
        if let Some(playback) = self.log.as_ref().filter(|_| self.changed) {
            self.changed = false;
            return Ok(Some(Message::Playback(Box::new(playback.clone()))));
        }
        let paused = self.log.as_ref().is_some_and(|log| !log.playing);
        let now = Instant::now();
        if self.left == 0 || paused || self.due > now + wait {
            std::thread::sleep(wait);
            return Ok(None);
        }
        std::thread::sleep(self.due.saturating_duration_since(now));
        let mut message = self.feed.next(Duration::ZERO)?;
        match &mut message {
            Some(Message::Frame(frame)) => {
                self.left -= 1;
                self.due = Instant::now().max(self.due) + PERIOD;
                if let Some(log) = &mut self.log {
                    (log.at_ns, log.tick) = (frame.time_ns, frame.folded.last);
                    self.changed = true;
                }
            }
            Some(Message::Hello(hello)) if self.log.is_some() => {
                hello.source = Source::Log;
                hello.file = "/synthetic.mcap".into();
                self.changed = true;
            }
            _ => {}
        }
        Ok(message)
    }

    fn command(&mut self, command: &Command) {
        self.feed.command(command);
        let Some(log) = &mut self.log else { return };
        match *command {
            Command::Play => (log.playing, self.due) = (true, Instant::now()),
            Command::Pause => log.playing = false,
            Command::Speed { factor } => log.speed = factor,
            Command::Seek { time_ns } => {
                log.at_ns = time_ns.clamp(log.from_ns, log.to_ns);
                log.tick = log.at_ns / 1_000_000;
            }
            Command::Step { ticks } => {
                log.playing = false;
                log.tick = log.tick.saturating_add_signed(ticks);
                log.at_ns = log.tick * 1_000_000;
            }
            _ => {}
        }
        self.changed = true;
    }

    fn present(&self) -> Vec<Message> {
        let mut present = self.feed.present();
        if let Some(playback) = &self.log {
            if let Some(Message::Hello(hello)) = present.first_mut() {
                hello.source = Source::Log;
                hello.file = "/synthetic.mcap".into();
            }
            present.push(Message::Playback(Box::new(playback.clone())));
        }
        present
    }
}
