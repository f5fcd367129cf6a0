//! The feed of a viewer: the frames of a run or of a log.

use host::live::{Message, MessageError};
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// A command of a person to a feed. A page sends commands as JSON, such as `{"do":"seek","time_ns":1500000000}`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Command {
    /// A log: play.
    Play,
    /// A log: stop at the present moment.
    Pause,
    /// A log: go forward by this number of ticks, or back if it is negative, and pause.
    Step {
        /// The number of ticks.
        ticks: i64,
    },
    /// A log: go to the tick at this time, or the last tick before it.
    Seek {
        /// The time (ns).
        time_ns: u64,
    },
    /// A log: seconds of the log for each second of the wall.
    Speed {
        /// The factor: from 0.001 to 100.
        factor: f64,
    },
    /// A log: go to the next event, and pause.
    Next,
    /// A log: go to the event before the present moment, and pause.
    Previous,
    /// Whether frames have stresses. A run and a log compute stresses in the viewer's process.
    Stress {
        /// Whether they do.
        on: bool,
    },
}

/// Why a feed ended early.
#[derive(Debug, thiserror::Error)]
pub enum FeedError {
    /// The stream of a run ended or could not be read.
    #[error("the connection to the run broke off: {0}")]
    Io(#[from] std::io::Error),
    /// The run sent bytes that are no message.
    #[error("the stream of the run cannot be read: {0}")]
    Message(#[from] MessageError),
    /// The run ended, after it sent [`Message::End`].
    #[error("the run ended")]
    Ended,
    /// The run refused the viewer.
    #[error("{0}")]
    Refused(String),
    /// The log could not be read further.
    #[error("{0}")]
    Log(String),
}

/// A source of messages. The first message is a `Hello`; each `Surface` precedes the frames that need it.
pub trait Feed: Send {
    /// The next message; `None` if none came within `wait`.
    ///
    /// # Errors
    /// [`FeedError`] if no further message can come. A run that ends gives [`Message::End`] first.
    fn next(&mut self, wait: Duration) -> Result<Option<Message>, FeedError>;

    /// Takes a command. A feed that cannot follow a command ignores it.
    fn command(&mut self, command: &Command);

    /// Messages that describe the present state from the beginning, for a viewer that joins later: `Hello`, the
    /// surfaces, `History`, the last frame with all vertices, and for a log `Playback`.
    fn present(&self) -> Vec<Message>;
}
