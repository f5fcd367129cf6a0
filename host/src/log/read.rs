//! Reading a log back, also one that a killed process left without its end.

use std::collections::BTreeMap;

use mcap::McapError;
use mcap::parse_record;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::{LogError, METADATA_NAME, SCENE_NAME, TickRow, chunks, tick};

/// A log, read whole.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// What identifies the run (see [`super::LogHeader`]).
    pub facts: BTreeMap<String, String>,
    /// The text of its scene file.
    pub scene: String,
    /// The ticks, in the order of the file.
    pub rows: Vec<TickRow>,
    /// Whether the file has its end; `false` if its writer was killed.
    pub complete: bool,
}

/// The ticks of a log, in the order of the file.
///
/// # Errors
/// As [`Log::parse`].
pub fn read_log(bytes: &[u8]) -> Result<Vec<TickRow>, LogError> {
    Ok(Log::parse(bytes)?.rows)
}

impl Log {
    /// Reads a log. A file that ends early gives all ticks before its end; channels that are not
    /// palpate's are passed over.
    ///
    /// # Errors
    /// If the bytes are no MCAP file, are damaged before their end, or hold no ticks as this version
    /// writes them.
    pub fn parse(bytes: &[u8]) -> Result<Self, LogError> {
        chunks::check(bytes).map_err(LogError::Damaged)?;
        let mut reader = LinearReader::new_with_options(
            LinearReaderOptions::default()
                .with_validate_chunk_crcs(true)
                .with_record_length_limit(bytes.len()),
        );
        let mut parser = Parser::default();
        let mut rest = bytes;
        while let Some(event) = reader.next_event() {
            match event {
                Ok(LinearReadEvent::ReadRequest(wanted)) => {
                    // Nothing left: zero bytes tell the reader so.
                    let (head, tail) = rest.split_at(wanted.min(rest.len()));
                    reader.insert(head.len()).copy_from_slice(head);
                    reader.notify_read(head.len());
                    rest = tail;
                }
                Ok(LinearReadEvent::Record { opcode, data }) => parser.record(opcode, data)?,
                // A record that reaches beyond the last byte was cut, too.
                Err(
                    McapError::UnexpectedEof
                    | McapError::RecordTooLarge { .. }
                    | McapError::ChunkTooLarge(_),
                ) if bytes.starts_with(mcap::MAGIC) => return parser.finish(false),
                Err(error) => return Err(LogError::Damaged(error)),
            }
        }
        parser.finish(true)
    }
}

/// What is known so far of the file under way.
#[derive(Default)]
struct Parser {
    log: Log,
    /// Schemas that are ticks, and the channels that carry them.
    schemas: Vec<u16>,
    channels: Vec<u16>,
    messages: usize,
}

impl Parser {
    fn record(&mut self, opcode: u8, data: &[u8]) -> Result<(), LogError> {
        if opcode == op::ATTACHMENT {
            if let Some(scene) = scene_of(data) {
                scene.clone_into(&mut self.log.scene);
            }
            return Ok(());
        }
        if !matches!(
            opcode,
            op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA
        ) {
            return Ok(());
        }
        match parse_record(opcode, data).map_err(LogError::Damaged)? {
            Record::Schema { header, data } if header.name == tick::SCHEMA_NAME => {
                if *data != *tick::SCHEMA.as_bytes() {
                    return Err(LogError::OtherLayout);
                }
                self.schemas.push(header.id);
            }
            Record::Channel(channel) if self.schemas.contains(&channel.schema_id) => {
                if channel.message_encoding != "cdr" {
                    return Err(LogError::OtherLayout);
                }
                self.channels.push(channel.id);
            }
            Record::Message { header, data } => {
                if self.channels.contains(&header.channel_id) {
                    let row = tick::decode(&data);
                    self.log.rows.push(row.ok_or(LogError::BadTick {
                        index: self.messages,
                    })?);
                }
                self.messages += 1;
            }
            Record::Metadata(metadata) if metadata.name == METADATA_NAME => {
                self.log.facts = metadata.metadata;
            }
            _ => {}
        }
        Ok(())
    }

    fn finish(self, complete: bool) -> Result<Log, LogError> {
        // A writer killed before its first flush leaves the header alone: that log is empty.
        if complete && self.channels.is_empty() {
            return Err(LogError::NoTicks);
        }
        Ok(Log {
            complete,
            ..self.log
        })
    }
}

/// The text of an attachment record if it is the scene. (By hand: the parser of the mcap crate panics
/// on a record that is too short.)
fn scene_of(record: &[u8]) -> Option<&str> {
    // Two times; then name, media type and content, each after its length.
    let (_, rest) = record.split_at_checked(16)?;
    let (length, rest) = rest.split_first_chunk()?;
    let (name, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
    let (length, rest) = rest.split_first_chunk()?;
    let (_, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
    let (length, rest) = rest.split_first_chunk()?;
    let (content, _) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
    if name != SCENE_NAME.as_bytes() {
        return None;
    }
    std::str::from_utf8(content).ok()
}
