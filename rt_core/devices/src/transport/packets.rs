//! Packets of one length over a stream of bytes.
//!
//! HID separates reports, and a stream does not. A device whose packets all have the same length may be reached through
//! a stream that loses no byte (an emulator over TCP or a pty). Every packet then begins where the last one ended.

use super::Transport;
use std::time::{Duration, Instant};

/// Longest packet (bytes).
const LONGEST: usize = 64;

/// A stream, cut into packets.
#[derive(Debug)]
pub struct Packets<T> {
    stream: T,
    length: usize,
    /// The bytes of the packet that has begun.
    part: [u8; LONGEST],
    have: usize,
}

impl<T: Transport> Packets<T> {
    /// Cuts `stream` into packets of `length` bytes, from 1 to 64.
    pub fn new(stream: T, length: usize) -> Self {
        Self {
            stream,
            length: length.clamp(1, LONGEST),
            part: [0; LONGEST],
            have: 0,
        }
    }
}

impl<T: Transport> Transport for Packets<T> {
    /// Waits for a whole packet, at most for `wait`. The bytes of a packet that has begun are kept for the next call.
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        let start = Instant::now();
        loop {
            let left = self.part.get_mut(self.have..self.length);
            let left = left.unwrap_or_default();
            let remaining = wait.saturating_sub(start.elapsed());
            let count = self.stream.read(left, remaining)?;
            if count == 0 {
                return Ok(0);
            }
            self.have = self.have.saturating_add(count);
            if self.have >= self.length {
                self.have = 0;
                let packet = self.part.get(..self.length).unwrap_or_default();
                for (to, from) in buffer.iter_mut().zip(packet) {
                    *to = *from;
                }
                return Ok(self.length.min(buffer.len()));
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), i32> {
        self.stream.write(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::VecDeque;

    /// A stream that gives its bytes in the given pieces.
    struct Pieces(VecDeque<Vec<u8>>);

    impl Transport for Pieces {
        fn read(&mut self, buffer: &mut [u8], _: Duration) -> Result<usize, i32> {
            let Some(mut piece) = self.0.pop_front() else {
                return Ok(0);
            };
            let count = piece.len().min(buffer.len());
            buffer[..count].copy_from_slice(&piece[..count]);
            let rest = piece.split_off(count);
            if !rest.is_empty() {
                self.0.push_front(rest);
            }
            Ok(count)
        }
        fn write(&mut self, _: &[u8]) -> Result<(), i32> {
            Ok(())
        }
    }

    #[test]
    fn packets_are_whole_however_the_bytes_come() {
        let pieces = [vec![1], vec![2, 3, 4, 5], vec![], vec![6, 7, 8, 9, 10]];
        let mut packets = Packets::new(Pieces(pieces.into()), 3);
        let mut read = || {
            let mut buffer = [0; 64];
            let count = packets.read(&mut buffer, Duration::ZERO);
            count.map(|count| buffer[..count].to_vec())
        };
        assert_eq!(read(), Ok(vec![1, 2, 3]));
        // The stream had nothing for a while in the middle of a packet.
        assert_eq!(read(), Ok(vec![]));
        assert_eq!(read(), Ok(vec![4, 5, 6]));
        assert_eq!(read(), Ok(vec![7, 8, 9]));
        assert_eq!(read(), Ok(vec![]));
    }
}
