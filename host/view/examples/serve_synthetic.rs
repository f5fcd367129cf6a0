//! Serves the page with the synthetic sheet, for the tests of the page and for its development.
//!
//! ```sh
//! cargo run -p palpate-view --example serve_synthetic -- [--port PORT] [--edge VERTICES] [--log] [--stall-after FRAMES]
//! ```

use host::live::{Message, Playback, Source};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use view::feed::{Command, Feed, FeedError};
use view::synthetic::Synthetic;
use view::web::{Options, Picture, serve};

/// Time between two frames.
const PERIOD: Duration = Duration::from_millis(16);

/// The synthetic feed at the pace of a run, and with the playback of a log where this is asked for.
struct Paced {
    feed: Synthetic,
    due: Instant,
    left: u64,
    log: Option<Playback>,
    changed: bool,
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

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut port, mut edge, mut log, mut left) = (0, 21, false, u64::MAX);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut number = || arguments.next().unwrap_or_default().parse::<u64>();
        match argument.as_str() {
            "--port" => port = number()? as u16,
            "--edge" => edge = number()? as u32,
            "--stall-after" => left = number()?,
            "--log" => log = true,
            other => return Err(format!("the argument {other} is unknown").into()),
        }
    }
    let options = Options {
        port,
        opened: Box::new(|address| println!("{address}")),
        moment: Arc::new(|_, picture| match picture {
            Picture::Csv => Ok(b"time_s\n0\n".to_vec()),
            _ => Err("The synthetic feed has no picture.".into()),
        }),
        stop: Arc::new(AtomicBool::new(false)),
    };
    let mut feed = Synthetic::with_edge(u64::MAX, edge);
    let playback = log.then(|| Playback {
        playing: true,
        speed: 1.0,
        to_ns: 60_000_000_000,
        complete: true,
        has_frames: true,
        events: feed.events(60_000_000_000),
        overview: feed.overview(60_000_000_000),
        ..Playback::default()
    });
    if playback.is_some() {
        feed.command(&Command::Play);
    }
    let paced = Paced {
        feed,
        due: Instant::now(),
        left,
        log: playback,
        changed: false,
    };
    serve(Box::new(paced), &options)?;
    Ok(())
}
