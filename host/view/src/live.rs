//! A feed from a run, over its Unix socket.
//!
//! The feed sends nothing to the run. It keeps what [`Feed::present`] needs, and computes stresses if it is asked to.

mod connect;
mod kept;
mod stream;

pub use connect::LiveError;

use crate::feed::{Command, Feed, FeedError};
use crate::stress::Stresses;
use host::live::Message;
use kept::Kept;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use stream::{Heard, Stream};

/// Time from one attempt to connect to the next.
const RETRY: Duration = Duration::from_millis(250);

/// Which run is shown.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LiveOptions {
    /// The socket of the run; `None` for the only run of this user.
    pub socket: Option<PathBuf>,
    /// Waits for a run if there is none, and connects again when a run ends or the connection breaks off.
    pub wait: bool,
}

/// A feed from a run.
#[derive(Debug)]
pub struct LiveFeed {
    options: LiveOptions,
    /// The connection; `None` between two runs.
    stream: Option<Stream>,
    kept: Kept,
    /// Whether the run has sent its end.
    over: bool,
    stressed: bool,
    stresses: Option<Stresses>,
}

impl LiveFeed {
    /// Connects to a run.
    ///
    /// # Errors
    /// [`LiveError`] if there is no run or several, or the run does not let this user connect. A feed that waits begins
    /// without a run.
    pub fn open(options: &LiveOptions) -> Result<Self, LiveError> {
        let stream = match connect::connect(options.socket.as_deref()) {
            Ok(stream) => Some(stream),
            Err(LiveError::NoRun { .. } | LiveError::NoRunAt { .. }) if options.wait => None,
            Err(error) => return Err(error),
        };
        Ok(Self {
            options: options.clone(),
            stream,
            kept: Kept::default(),
            over: false,
            stressed: false,
            stresses: None,
        })
    }

    /// Takes note of a message, and adds stresses to a frame.
    fn note(&mut self, message: &mut Message) {
        match message {
            Message::Hello(hello) => {
                self.over = false;
                self.stresses = self.stressed.then(|| Stresses::new(hello));
            }
            Message::Frame(frame) => {
                if let Some(stresses) = &mut self.stresses {
                    // A body without stresses is shown without stresses.
                    let _ = stresses.add(frame);
                }
            }
            Message::End(_) => self.over = true,
            _ => {}
        }
        self.kept.take(message);
    }

    /// The result of the end of the stream. A feed that waits continues without a connection.
    fn closed(&mut self, error: std::io::Error) -> Result<(), FeedError> {
        self.stream = None;
        match (self.options.wait, self.over) {
            (true, _) => Ok(()),
            (false, true) => Err(FeedError::Ended),
            (false, false) => Err(error.into()),
        }
    }
}

impl Feed for LiveFeed {
    fn next(&mut self, wait: Duration) -> Result<Option<Message>, FeedError> {
        let until = Instant::now() + wait;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let Some(stream) = &mut self.stream else {
                if !self.options.wait {
                    return Err(FeedError::Ended);
                }
                match connect::connect(self.options.socket.as_deref()) {
                    Ok(stream) => self.stream = Some(stream),
                    Err(_) if left.is_zero() => return Ok(None),
                    Err(_) => std::thread::sleep(left.min(RETRY)),
                }
                continue;
            };
            match stream.next(left) {
                Ok(Heard::Message(message)) => {
                    if let Message::Refused(why) = *message {
                        self.stream = None;
                        return Err(FeedError::Refused(why));
                    }
                    let mut message = *message;
                    self.note(&mut message);
                    return Ok(Some(message));
                }
                Ok(Heard::Nothing) => return Ok(None),
                Err(FeedError::Io(error)) => self.closed(error)?,
                Err(error) => {
                    self.stream = None;
                    return Err(error);
                }
            }
        }
    }

    fn command(&mut self, command: &Command) {
        if let Command::Stress { on } = command {
            self.stressed = *on;
            let hello = self.kept.hello().filter(|_| *on);
            self.stresses = hello.map(Stresses::new);
        }
    }

    fn present(&self) -> Vec<Message> {
        self.kept.present()
    }
}
