//! Bytes and operations of a pass over arrays.

pub mod ceiling;

use core::ops::Add;

/// The work of a pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Bytes read.
    pub read: usize,
    /// Bytes written.
    pub written: usize,
    /// Bytes of the memory in which both lie: what a cache would have to hold.
    pub touched: usize,
    /// Operations on floating-point numbers.
    pub flops: usize,
}

impl Cost {
    /// The cost of reading `bytes` bytes.
    pub(crate) fn read(bytes: usize) -> Self {
        Self {
            read: bytes,
            touched: bytes,
            ..Self::default()
        }
    }

    /// The cost of writing `bytes` bytes.
    pub(crate) fn write(bytes: usize) -> Self {
        Self {
            written: bytes,
            touched: bytes,
            ..Self::default()
        }
    }

    /// The cost of reading and writing `bytes` bytes.
    pub(crate) fn update(bytes: usize) -> Self {
        Self {
            read: bytes,
            written: bytes,
            touched: bytes,
            flops: 0,
        }
    }

    /// So many operations.
    pub(crate) fn flops(flops: usize) -> Self {
        Self {
            flops,
            ..Self::default()
        }
    }

    /// This work without the bytes: another pass over data that are counted already.
    pub(crate) fn again(self) -> Self {
        Self { touched: 0, ..self }
    }
}

impl Add for Cost {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            read: self.read + other.read,
            written: self.written + other.written,
            touched: self.touched + other.touched,
            flops: self.flops + other.flops,
        }
    }
}
