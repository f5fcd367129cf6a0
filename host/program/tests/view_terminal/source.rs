//! A run for the display: a socket on which the test sends the frames of a made-up run, at their pace.

use fuzz_rules::synthetic::Synthetic;
use host::live::Message;
use std::io::{self, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::thread;
use std::time::{Duration, Instant};

/// The run of one viewer. The viewer finds it at [`Source::socket`].
pub(super) struct Source(tempfile::TempDir);

impl Source {
    /// A run of `frames` frames of 16 ms, from the moment at which a viewer connects.
    pub(super) fn start(frames: u64) -> Self {
        let source = Self(tempfile::tempdir().expect("a folder"));
        let listener = UnixListener::bind(source.socket()).expect("a socket");
        thread::spawn(move || {
            let (viewer, _) = listener.accept().expect("a viewer");
            // A viewer may go before the end.
            let _ = send(viewer, frames);
        });
        source
    }

    pub(super) fn socket(&self) -> PathBuf {
        self.0.path().join("run.sock")
    }
}

fn send(mut viewer: UnixStream, frames: u64) -> io::Result<()> {
    let begun = Instant::now();
    for message in Synthetic::new(frames).messages() {
        if let Message::Frame(frame) = &message {
            let due = Duration::from_nanos(frame.time_ns);
            thread::sleep(due.saturating_sub(begun.elapsed()));
        }
        let mut bytes = Vec::new();
        message.encode_in_stream(&mut bytes);
        viewer.write_all(&bytes)?;
        if matches!(message, Message::End(_)) {
            break;
        }
    }
    Ok(())
}
