//! The encoding of messages.
//!
//! A message is a **kind** (one byte, then three zero bytes), the length of its JSON part (`u32`), the JSON part, padded
//! with spaces to a multiple of four bytes, and its binary part. All numbers of the binary part are little-endian. In a
//! stream, each message has its length (`u32`) before it; a WebSocket message has none.

use super::Folded;
use super::frame::{Frame, Hello, LogMessage, PROTOCOL, Playback};
use crate::record::Surface;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Longest message that a viewer accepts (bytes).
pub const LONGEST: usize = 1 << 29;

/// A message.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// The facts that do not change.
    Hello(Box<Hello>),
    /// The connectivity of a body.
    Surface(Surface),
    /// A moment.
    Frame(Box<Frame>),
    /// The curves around the present moment, in place of those that the viewer has: after a viewer connects, and after
    /// a jump in a log.
    History(Vec<Folded>),
    /// How a log is played back.
    Playback(Box<Playback>),
    /// The run ended. The summary as `--json` writes it; empty if there is none.
    End(String),
    /// The viewer is refused, or the source ended early: the reason in words.
    Refused(String),
}

/// Why bytes are no message.
#[derive(Debug, thiserror::Error)]
pub enum MessageError {
    /// The message is shorter than its parts.
    #[error("a message is too short: {0} is cut off")]
    Short(&'static str),
    /// Bytes are left over.
    #[error("a message has {0} bytes after its end")]
    Long(usize),
    /// A message of this kind does not exist.
    #[error("a message has the unknown kind {0}")]
    Kind(u8),
    /// The JSON part does not describe a message of this kind.
    #[error("the JSON part of a message cannot be read: {0}")]
    Json(#[from] serde_json::Error),
    /// A number in the binary part does not fit, such as a triangle of a vertex that does not exist.
    #[error("a message contradicts itself: {0}")]
    Contradiction(&'static str),
    /// The stream has another version.
    #[error(
        "the stream has the version {0:?}, and this program reads {PROTOCOL:?}; view the run with the program that \
         runs it"
    )]
    Version(String),
}

/// The names and lengths of the files of a [`Hello`].
#[derive(Serialize, Deserialize)]
struct HelloJson<'a> {
    #[serde(flatten)]
    hello: std::borrow::Cow<'a, Hello>,
    file_lengths: BTreeMap<String, u64>,
}

/// The version of a [`Hello`].
#[derive(Deserialize)]
struct ProtocolJson {
    protocol: String,
}

impl Message {
    /// The kind, the first byte of a message.
    pub fn kind(&self) -> u8 {
        match self {
            Self::Hello(_) => 1,
            Self::Surface(_) => 2,
            Self::Frame(_) => 3,
            Self::History(_) => 4,
            Self::Playback(_) => 5,
            Self::End(_) => 6,
            Self::Refused(_) => 7,
        }
    }

    /// Appends the message to `bytes`.
    pub fn encode(&self, bytes: &mut Vec<u8>) {
        bytes.extend([self.kind(), 0, 0, 0]);
        match self {
            Self::Hello(hello) => {
                let lengths = hello.files.iter();
                let lengths = lengths.map(|(name, file)| (name.clone(), file.len() as u64));
                let json = HelloJson {
                    hello: std::borrow::Cow::Borrowed(hello),
                    file_lengths: lengths.collect(),
                };
                put_json(&json, bytes);
                hello.files.values().for_each(|file| bytes.extend(file));
            }
            Self::Surface(surface) => {
                put_json(surface, bytes);
                put_floats(&surface.rest, bytes);
                for index in surface.triangles.iter().chain(&surface.lines) {
                    bytes.extend(index.to_le_bytes());
                }
            }
            Self::Frame(frame) => {
                put_json(frame, bytes);
                for vertices in frame
                    .bodies
                    .iter()
                    .filter_map(|body| body.vertices.as_ref())
                {
                    put_floats(&vertices.positions, bytes);
                    put_floats(&vertices.stress, bytes);
                }
                frame
                    .log
                    .iter()
                    .for_each(|message| bytes.extend(&message.data));
            }
            Self::History(folded) => put_json(folded, bytes),
            Self::Playback(playback) => put_json(playback, bytes),
            Self::End(text) | Self::Refused(text) => put_json(text, bytes),
        }
    }

    /// Appends the message with its length before it, as a stream has it.
    pub fn encode_in_stream(&self, bytes: &mut Vec<u8>) {
        let start = bytes.len();
        bytes.extend([0; 4]);
        self.encode(bytes);
        let length = (bytes.len() - start - 4) as u32;
        if let Some(head) = bytes.get_mut(start..start + 4) {
            head.copy_from_slice(&length.to_le_bytes());
        }
    }

    /// Reads a message.
    ///
    /// # Errors
    /// [`MessageError`] for bytes that are no message, or a message that contradicts itself.
    pub fn decode(bytes: &[u8]) -> Result<Self, MessageError> {
        let mut from = Reader(bytes);
        let [kind, _, _, _] = *from.array("the kind")?;
        let json = u32::from_le_bytes(*from.array("the length of the JSON part")?);
        let json = from.take(u64::from(json), "the JSON part")?;
        let message = match kind {
            1 => {
                // Another version may have other fields, so its name is read first.
                let ProtocolJson { protocol } = serde_json::from_slice(json)?;
                if protocol != PROTOCOL {
                    return Err(MessageError::Version(protocol));
                }
                let HelloJson {
                    hello,
                    file_lengths,
                } = serde_json::from_slice(json)?;
                let mut hello = hello.into_owned();
                for (name, length) in file_lengths {
                    let file = from.take(length, "a file")?.to_vec();
                    hello.files.insert(name, file);
                }
                Self::Hello(Box::new(hello))
            }
            2 => {
                let mut surface: Surface = serde_json::from_slice(json)?;
                surface.rest = from.floats(3 * u64::from(surface.vertices), "the positions")?;
                surface.triangles = from.indices(3, surface.triangle_count, surface.vertices)?;
                surface.lines = from.indices(2, surface.line_count, surface.vertices)?;
                Self::Surface(surface)
            }
            3 => {
                let mut frame: Frame = serde_json::from_slice(json)?;
                for vertices in frame
                    .bodies
                    .iter_mut()
                    .filter_map(|body| body.vertices.as_mut())
                {
                    let count = u64::from(vertices.count);
                    vertices.positions = from.floats(3 * count, "the positions")?;
                    if vertices.stressed {
                        vertices.stress = from.floats(count, "the stresses")?;
                    }
                }
                for LogMessage { length, data, .. } in &mut frame.log {
                    *data = from
                        .take(u64::from(*length), "a message of the log")?
                        .to_vec();
                }
                Self::Frame(Box::new(frame))
            }
            4 => Self::History(serde_json::from_slice(json)?),
            5 => Self::Playback(Box::new(serde_json::from_slice(json)?)),
            6 => Self::End(serde_json::from_slice(json)?),
            7 => Self::Refused(serde_json::from_slice(json)?),
            other => return Err(MessageError::Kind(other)),
        };
        match from.0.len() {
            0 => Ok(message),
            left => Err(MessageError::Long(left)),
        }
    }
}

/// Writes the length of the JSON part and the JSON part.
fn put_json(value: &impl Serialize, bytes: &mut Vec<u8>) {
    let start = bytes.len();
    bytes.extend([0; 4]);
    // A value of these types has only text keys and finite numbers or `null`: writing to memory cannot fail.
    let _ = serde_json::to_writer(&mut *bytes, value);
    while !(bytes.len() - start).is_multiple_of(4) {
        bytes.push(b' ');
    }
    let length = (bytes.len() - start - 4) as u32;
    if let Some(head) = bytes.get_mut(start..start + 4) {
        head.copy_from_slice(&length.to_le_bytes());
    }
}

fn put_floats(values: &[f32], bytes: &mut Vec<u8>) {
    let start = bytes.len();
    bytes.resize(start + 4 * values.len(), 0);
    let room = bytes.get_mut(start..).unwrap_or_default();
    // One copy of the whole, if the processor is little-endian.
    for (four, value) in room.as_chunks_mut().0.iter_mut().zip(values) {
        *four = value.to_le_bytes();
    }
}

/// The bytes that are not read yet.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn array<const N: usize>(&mut self, part: &'static str) -> Result<&'a [u8; N], MessageError> {
        let (head, rest) = self
            .0
            .split_first_chunk()
            .ok_or(MessageError::Short(part))?;
        self.0 = rest;
        Ok(head)
    }

    /// The next `length` bytes. Nothing is reserved for a false length.
    fn take(&mut self, length: u64, part: &'static str) -> Result<&'a [u8], MessageError> {
        let length = usize::try_from(length).unwrap_or(usize::MAX);
        let short = MessageError::Short(part);
        let (head, rest) = self.0.split_at_checked(length).ok_or(short)?;
        self.0 = rest;
        Ok(head)
    }

    fn floats(&mut self, count: u64, part: &'static str) -> Result<Vec<f32>, MessageError> {
        let bytes = self.take(count.saturating_mul(4), part)?;
        Ok(bytes
            .as_chunks()
            .0
            .iter()
            .map(|four| f32::from_le_bytes(*four))
            .collect())
    }

    /// The vertices of `count` triangles or lines.
    fn indices(&mut self, each: u64, count: u32, vertices: u32) -> Result<Vec<u32>, MessageError> {
        let bytes = self.take(u64::from(count) * each * 4, "the connectivity")?;
        let indices = bytes
            .as_chunks()
            .0
            .iter()
            .map(|four| u32::from_le_bytes(*four));
        let indices: Vec<u32> = indices.collect();
        if indices.iter().any(|index| *index >= vertices) {
            return Err(MessageError::Contradiction(
                "a triangle or a line has a vertex that does not exist",
            ));
        }
        Ok(indices)
    }
}

#[cfg(test)]
mod tests;
