//! Keys and changes of size, read by a thread of its own.
//!
//! On a terminal whose other end is closed, `crossterm` 0.29 reads without end. The thread that draws must go on to see
//! the signals, and the process then ends with the thread that reads.

use ratatui::crossterm::event::{self, Event};
use std::io;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// The events of a terminal.
pub(super) struct Input(Receiver<io::Result<Event>>);

impl Input {
    /// Begins to read.
    pub(super) fn begin() -> io::Result<Self> {
        let (sender, receiver) = channel();
        let read = move || {
            loop {
                let event = event::read();
                let failed = event.is_err();
                if sender.send(event).is_err() || failed {
                    break;
                }
            }
        };
        let thread = std::thread::Builder::new()
            .stack_size(runner::STACK)
            .name("palpate-keys".into());
        thread.spawn(read)?;
        Ok(Self(receiver))
    }

    /// The next event; `None` if there was none within `wait`.
    pub(super) fn next(&self, wait: Duration) -> io::Result<Option<Event>> {
        match self.0.recv_timeout(wait) {
            Ok(event) => event.map(Some),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(io::ErrorKind::UnexpectedEof.into()),
        }
    }
}
