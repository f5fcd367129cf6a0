//! A log that is read by its index: a moment of an hour's log without reading the hour.
//!
//! The end of a log lists its chunks with their times (<https://mcap.dev/spec>, "Summary Section"). [`LogIndex`] reads
//! this list and the records of the header; ticks, models and frames are then read chunk by chunk, each with its check
//! sum. A log whose writer was killed has no such list: its records are walked over once from the front, without their
//! content, and the log plays to where it ends.

mod decode;
mod open;
mod search;

pub use decode::Decoded;
pub use search::{BodyFrameAt, TickAt};

use super::LogError;
use super::overview::Overview;
use decode::Channels;
use mcap::McapError;
use rt_core::Capabilities;
use std::collections::BTreeMap;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::sync::Arc;

/// Most bytes of decoded chunks that are kept.
const CACHE: usize = 64 << 20;
/// Longest chunk that is read (bytes). The chunks of a log have a megabyte, or one frame of a large body.
const LONGEST_CHUNK: u64 = 1 << 28;

/// Why a log cannot be opened or read further.
#[derive(Debug, thiserror::Error)]
pub enum IndexError {
    /// The file cannot be read.
    #[error("the log cannot be read: {0}")]
    Io(#[from] io::Error),
    /// The bytes are no MCAP file.
    #[error("this file is not an MCAP file, and so is not a log of palpate")]
    NotALog,
    /// The file is damaged.
    #[error("the log is damaged at byte {offset}, in {part}: {source}")]
    Damaged {
        /// Where in the file the damaged record begins (bytes).
        offset: u64,
        /// The record, in words.
        part: &'static str,
        /// What is wrong.
        source: McapError,
    },
    /// A message does not match the definition of its channel.
    #[error(
        "the log is damaged: message {index} (from zero) of the chunk at byte {offset} does not match the definition \
         of its channel, or is too short"
    )]
    BadMessage {
        /// Where in the file the chunk begins (bytes).
        offset: u64,
        /// Number of the message in the chunk.
        index: usize,
    },
    /// The log has another layout, or no channel of ticks.
    #[error(transparent)]
    Log(#[from] LogError),
}

/// A chunk of the file.
#[derive(Clone, Debug)]
struct Chunk {
    /// Where its record begins (bytes).
    offset: u64,
    /// Length of the record with its head (bytes).
    length: u64,
    /// Time of the earliest message (ns).
    from_ns: u64,
    /// The channels of its messages; `None` if they are not known yet.
    channels: Option<Vec<u16>>,
    /// The file ends within this chunk.
    cut: bool,
}

/// A log that is read by its index.
pub struct LogIndex<R> {
    source: BufReader<R>,
    /// Length of the file (bytes).
    length: u64,
    facts: BTreeMap<String, String>,
    limits: Vec<Capabilities>,
    scene: String,
    files: BTreeMap<String, Vec<u8>>,
    overview: Option<Overview>,
    complete: bool,
    chunks: Vec<Chunk>,
    channels: Channels,
    /// Decoded chunks by their number, the least recently used first.
    cache: Vec<(usize, Arc<Decoded>)>,
}

impl<R: Read + Seek> LogIndex<R> {
    /// The facts that identify the run (see [`super::LogHeader`]).
    pub fn facts(&self) -> &BTreeMap<String, String> {
        &self.facts
    }

    /// The limits of the devices as they were driven; empty in a log of a version that did not log them.
    pub fn limits(&self) -> &[Capabilities] {
        &self.limits
    }

    /// The text of the scene file.
    pub fn scene(&self) -> &str {
        &self.scene
    }

    /// The files that the scene names, by their names in the scene.
    pub fn files(&self) -> &BTreeMap<String, Vec<u8>> {
        &self.files
    }

    /// The overview that the writer attached, if there is one.
    pub fn overview(&self) -> Option<&Overview> {
        self.overview.as_ref()
    }

    /// Whether the file has its end; `false` if its writer was killed.
    pub fn is_complete(&self) -> bool {
        self.complete
    }

    /// Number of chunks.
    pub fn chunk_count(&self) -> usize {
        self.chunks.len()
    }

    /// The content of a chunk. The chunks read last are kept in memory.
    ///
    /// # Errors
    /// [`IndexError`] if the file cannot be read, or the chunk is damaged.
    pub fn chunk(&mut self, number: usize) -> Result<Arc<Decoded>, IndexError> {
        if let Some(at) = self.cache.iter().position(|(kept, _)| *kept == number) {
            let entry = self.cache.remove(at);
            let decoded = Arc::clone(&entry.1);
            self.cache.push(entry);
            return Ok(decoded);
        }
        let decoded = Arc::new(self.read_chunk(number)?);
        self.cache.push((number, Arc::clone(&decoded)));
        let mut size: usize = self.cache.iter().map(|(_, kept)| kept.size()).sum();
        while size > CACHE && self.cache.len() > 1 {
            size -= self.cache.remove(0).1.size();
        }
        Ok(decoded)
    }

    /// The content of a chunk, which is not kept: for a reader that reads each chunk once.
    ///
    /// # Errors
    /// As [`LogIndex::chunk`].
    pub fn read_chunk(&mut self, number: usize) -> Result<Decoded, IndexError> {
        let Some(chunk) = self.chunks.get(number).cloned() else {
            return Ok(Decoded::default());
        };
        let bytes = read_at(&mut self.source, self.length, chunk.offset, chunk.length)?;
        let (decoded, channels) = decode::decode(&chunk, &bytes, &mut self.channels)?;
        if let Some(chunk) = self.chunks.get_mut(number) {
            chunk.channels = Some(channels);
        }
        Ok(decoded)
    }
}

/// Reads `length` bytes at `offset`.
fn read_at<R: Read + Seek>(
    source: &mut BufReader<R>,
    file: u64,
    offset: u64,
    length: u64,
) -> Result<Vec<u8>, IndexError> {
    let damaged = |source| IndexError::Damaged {
        offset,
        part: "a record",
        source,
    };
    // Nothing is reserved for a false length.
    if offset.checked_add(length).is_none_or(|end| end > file) {
        return Err(damaged(McapError::UnexpectedEof));
    }
    if length > LONGEST_CHUNK {
        return Err(damaged(McapError::ChunkTooLarge(length)));
    }
    let mut bytes = vec![0; usize::try_from(length).unwrap_or(usize::MAX)];
    source.seek(SeekFrom::Start(offset))?;
    match source.read_exact(&mut bytes) {
        Ok(()) => Ok(bytes),
        // The file became shorter.
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => {
            Err(damaged(McapError::UnexpectedEof))
        }
        Err(error) => Err(error.into()),
    }
}

#[cfg(test)]
mod tests;
