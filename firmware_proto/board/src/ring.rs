//! A ring of bytes between an interrupt and the loop: one side puts, the other takes, and neither side waits.

use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

/// A ring that holds up to `N` - 1 bytes.
pub struct Ring<const N: usize> {
    bytes: [AtomicU8; N],
    /// Place of the next byte to put; only the putting side changes this number.
    head: AtomicUsize,
    /// Place of the next byte to take; only the taking side changes this number.
    tail: AtomicUsize,
}

impl<const N: usize> Ring<N> {
    /// An empty ring.
    pub const fn new() -> Self {
        Self {
            bytes: [const { AtomicU8::new(0) }; N],
            head: AtomicUsize::new(0),
            tail: AtomicUsize::new(0),
        }
    }

    /// The number of bytes that can be put.
    pub fn room(&self) -> usize {
        let (head, tail) = (
            self.head.load(Ordering::Relaxed),
            self.tail.load(Ordering::Acquire),
        );
        (tail + N - 1 - head) % N
    }

    /// Puts a byte. Returns false if there is no room: the byte is lost.
    pub fn put(&self, byte: u8) -> bool {
        if self.room() == 0 {
            return false;
        }
        let head = self.head.load(Ordering::Relaxed);
        self.bytes[head].store(byte, Ordering::Relaxed);
        self.head.store((head + 1) % N, Ordering::Release);
        true
    }

    /// Takes the oldest byte.
    pub fn take(&self) -> Option<u8> {
        let tail = self.tail.load(Ordering::Relaxed);
        if tail == self.head.load(Ordering::Acquire) {
            return None;
        }
        let byte = self.bytes[tail].load(Ordering::Relaxed);
        self.tail.store((tail + 1) % N, Ordering::Release);
        Some(byte)
    }
}
