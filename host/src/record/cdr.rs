//! CDR, the byte layout of ROS 2 messages (XCDR version 1). Numbers are little-endian. Each number is aligned
//! to its own size, counted from the end of the four-byte header.

use super::field::{Leaf, Record, Visitor};
use rt_core::coupling::HostState;
use rt_core::safety::SafetyState;

/// Marks a message as little-endian XCDR1. The last two bytes are options, which are always zero here.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// Appends numbers to a message.
pub(crate) struct CdrWriter<'a> {
    bytes: &'a mut Vec<u8>,
}

impl<'a> CdrWriter<'a> {
    /// Begins a message in `bytes`. The former content is cleared; the capacity stays.
    pub(crate) fn begin(bytes: &'a mut Vec<u8>) -> Self {
        bytes.clear();
        bytes.extend_from_slice(&ENCAPSULATION);
        Self { bytes }
    }

    pub(crate) fn u8(&mut self, value: u8) {
        self.put([value]);
    }

    pub(crate) fn u32(&mut self, value: u32) {
        self.put(value.to_le_bytes());
    }

    pub(crate) fn u64(&mut self, value: u64) {
        self.put(value.to_le_bytes());
    }

    pub(crate) fn f64(&mut self, value: f64) {
        self.put(value.to_le_bytes());
    }

    /// A text without zero bytes: its length with the closing zero, the text, the zero.
    pub(crate) fn text(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(0);
    }

    fn put<const N: usize>(&mut self, number: [u8; N]) {
        let written = self.bytes.len() - ENCAPSULATION.len();
        let aligned = written.next_multiple_of(N) + ENCAPSULATION.len();
        self.bytes.resize(aligned, 0);
        self.bytes.extend_from_slice(&number);
    }
}

/// Reads the numbers of a message in their order. Each method returns `None` past the end.
pub(crate) struct CdrReader<'a> {
    /// The message after its header.
    bytes: &'a [u8],
    at: usize,
}

impl<'a> CdrReader<'a> {
    /// Begins to read a message; `None` if the message is not little-endian XCDR1.
    pub(crate) fn begin(message: &'a [u8]) -> Option<Self> {
        let (header, bytes) = message.split_at_checked(ENCAPSULATION.len())?;
        (header.starts_with(&ENCAPSULATION[..2])).then_some(Self { bytes, at: 0 })
    }

    pub(crate) fn u8(&mut self) -> Option<u8> {
        self.take().map(u8::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    pub(crate) fn f64(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let from = self.at.next_multiple_of(N);
        let number = self.bytes.get(from..)?.first_chunk::<N>()?;
        self.at = from + N;
        Some(*number)
    }
}

/// Writes a record into `bytes`, in place of the former content.
pub(crate) fn encode(record: &mut impl Record, bytes: &mut Vec<u8>) {
    // A writer takes every field.
    let _ = record.fields(&mut CdrWriter::begin(bytes));
}

/// Reads a record back; `None` if the message is too short, holds an unknown code or contradicts itself.
pub(crate) fn decode<R: Record>(message: &[u8]) -> Option<R> {
    let mut record = R::empty();
    record.fields(&mut CdrReader::begin(message)?)?;
    Some(record)
}

impl Visitor for CdrWriter<'_> {
    fn leaf(&mut self, _: &'static str, _: &'static str, leaf: Leaf<'_>) -> Option<()> {
        match leaf {
            Leaf::Number(x) => self.f64(*x),
            Leaf::Count(n) => self.u64(*n),
            Leaf::Small(n) => self.u32(*n),
            Leaf::Byte(n) => self.u8(*n),
            Leaf::Flag(flag) => self.u8(u8::from(*flag)),
            Leaf::Safety(state) => self.u8(state.code()),
            Leaf::Host(state) => self.u8(state.code()),
        }
        Some(())
    }

    fn length(&mut self, _: &'static str, length: usize) -> Option<usize> {
        self.u32(length as u32);
        Some(length)
    }
}

impl Visitor for CdrReader<'_> {
    fn leaf(&mut self, _: &'static str, _: &'static str, leaf: Leaf<'_>) -> Option<()> {
        match leaf {
            Leaf::Number(x) => *x = self.f64()?,
            Leaf::Count(n) => *n = self.u64()?,
            Leaf::Small(n) => *n = self.u32()?,
            Leaf::Byte(n) => *n = self.u8()?,
            Leaf::Flag(flag) => *flag = self.u8()? != 0,
            Leaf::Safety(state) => *state = *SafetyState::ALL.get(usize::from(self.u8()?))?,
            Leaf::Host(state) => *state = *HostState::ALL.get(usize::from(self.u8()?))?,
        }
        Some(())
    }

    fn length(&mut self, _: &'static str, _: usize) -> Option<usize> {
        Some(self.u32()? as usize)
    }

    fn is_at_end(&self) -> bool {
        let next = self.at.next_multiple_of(4);
        self.bytes.len() < next + 4
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_to_their_size_after_the_header() {
        let mut bytes = vec![9; 3];
        let mut writer = CdrWriter::begin(&mut bytes);
        writer.u8(7);
        writer.f64(1.0);
        writer.u32(2);
        writer.u64(3);
        let expected = [
            &[0, 1, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0][..],
            &1.0_f64.to_le_bytes(),
            &[2, 0, 0, 0, 0, 0, 0, 0],
            &[3, 0, 0, 0, 0, 0, 0, 0],
        ]
        .concat();
        assert_eq!(bytes, expected);

        let mut reader = CdrReader::begin(&bytes).expect("a header");
        assert_eq!(reader.u8(), Some(7));
        assert_eq!(reader.f64(), Some(1.0));
        assert_eq!(reader.u32(), Some(2));
        assert_eq!(reader.u64(), Some(3));
        assert_eq!(reader.u8(), None);
    }

    #[test]
    fn a_foreign_header_is_refused() {
        assert!(CdrReader::begin(&[0, 0, 0, 0, 1]).is_none());
        assert!(CdrReader::begin(&[0, 1]).is_none());
    }
}
