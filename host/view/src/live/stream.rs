//! Messages out of a stream of bytes.

use crate::feed::FeedError;
use host::live::message::LONGEST;
use host::live::{Message, MessageError};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::io::{self, Read};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

/// Bytes that are read at once.
const CHUNK: usize = 1 << 16;

/// A connection to a run.
#[derive(Debug)]
pub(super) struct Stream {
    socket: UnixStream,
    /// The bytes of the present message so far. The buffer grows with the bytes that come, and not with the length that
    /// the message gives.
    bytes: Vec<u8>,
    /// The bytes that are read at once.
    chunk: Vec<u8>,
    /// The part of `chunk` that belongs to later messages.
    left: std::ops::Range<usize>,
}

/// The result of a read of the stream.
pub(super) enum Heard {
    /// A message.
    Message(Box<Message>),
    /// No message within the time.
    Nothing,
}

impl Stream {
    pub(super) fn new(stream: UnixStream) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        Ok(Self {
            socket: stream,
            bytes: Vec::new(),
            chunk: vec![0; CHUNK],
            left: 0..0,
        })
    }

    /// The next message, if one comes within `wait`.
    ///
    /// # Errors
    /// [`FeedError::Io`] at the end of the stream, and [`FeedError::Message`] for bytes that are no message.
    pub(super) fn next(&mut self, wait: Duration) -> Result<Heard, FeedError> {
        let until = Instant::now() + wait;
        loop {
            if let Some(message) = self.complete()? {
                return Ok(Heard::Message(Box::new(message)));
            }
            match self.socket.read(&mut self.chunk) {
                Ok(0) => {
                    let end = "the run closed the connection";
                    return Err(io::Error::new(io::ErrorKind::UnexpectedEof, end).into());
                }
                Ok(count) => self.left = 0..count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    let left = until.saturating_duration_since(Instant::now());
                    if left.is_zero() {
                        return Ok(Heard::Nothing);
                    }
                    self.wait(left)?;
                }
                Err(error) => return Err(error.into()),
            }
        }
    }

    fn wait(&self, left: Duration) -> io::Result<()> {
        let mut files = [PollFd::new(&self.socket, PollFlags::IN)];
        let left = Timespec {
            tv_sec: i64::try_from(left.as_secs()).unwrap_or(i64::MAX),
            tv_nsec: i64::from(left.subsec_nanos()),
        };
        match poll(&mut files, Some(&left)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    /// Takes the bytes that were read, up to the end of the present message. The message, if it is complete.
    fn complete(&mut self) -> Result<Option<Message>, MessageError> {
        self.take_up_to(4);
        let Some((length, _)) = self.bytes.split_first_chunk::<4>() else {
            return Ok(None);
        };
        let length = u32::from_le_bytes(*length) as usize;
        if length > LONGEST {
            return Err(MessageError::Contradiction(
                "a message is longer than 512 MiB",
            ));
        }
        self.take_up_to(4 + length);
        if self.bytes.len() < 4 + length {
            return Ok(None);
        }
        let message = Message::decode(self.bytes.get(4..).unwrap_or_default())?;
        self.bytes.clear();
        Ok(Some(message))
    }

    /// Moves bytes that were read into the message until it has `length` of them.
    fn take_up_to(&mut self, length: usize) {
        let wanted = length.saturating_sub(self.bytes.len()).min(self.left.len());
        let end = self.left.start + wanted;
        if let Some(bytes) = self.chunk.get(self.left.start..end) {
            self.bytes.extend_from_slice(bytes);
        }
        self.left.start = end;
    }
}
