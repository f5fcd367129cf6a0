//! Reads a log back, including one that a killed process left without its end.

use std::collections::BTreeMap;

use mcap::McapError;
use mcap::parse_record;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::{LogError, METADATA_NAME, ModelRow, OVERVIEW_NAME, OVERVIEW_TYPE, SCENE_NAME, TickRow};
use super::{chunks, model, tear, tick};
use crate::run::tears::TearEvent;

/// A log, read whole.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// The facts that identify the run (see [`super::LogHeader`]).
    pub facts: BTreeMap<String, String>,
    /// The text of the scene file.
    pub scene: String,
    /// The files that the scene names, by their names in the scene.
    pub files: BTreeMap<String, Vec<u8>>,
    /// The ticks, in the order of the file.
    pub rows: Vec<TickRow>,
    /// The local models, in the order of the file.
    pub models: Vec<ModelRow>,
    /// The edits by which bodies tore, in the order of the file.
    pub tears: Vec<TearEvent>,
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
    /// Reads a log. A file that ends early yields all ticks before its end. Channels that palpate did not write
    /// are skipped.
    ///
    /// # Errors
    /// If the bytes are no MCAP file, are damaged before their end, or hold no ticks in the layout of this
    /// version.
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
                    // At the end of the file, zero bytes tell the reader that nothing is left.
                    let (head, tail) = rest.split_at(wanted.min(rest.len()));
                    reader.insert(head.len()).copy_from_slice(head);
                    reader.notify_read(head.len());
                    rest = tail;
                }
                Ok(LinearReadEvent::Record { opcode, data }) => parser.record(opcode, data)?,
                // A record that reaches beyond the last byte was cut as well.
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

/// The part of the log that has been read so far.
#[derive(Default)]
struct Parser {
    log: Log,
    /// The schemas and channels that palpate wrote, by number.
    schemas: BTreeMap<u16, Content>,
    channels: BTreeMap<u16, Content>,
    messages: usize,
}

/// The content of a channel that palpate wrote.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Content {
    Ticks,
    Models,
    Tears,
}

/// The content that a schema of this name describes, and the definition of this version.
fn known_schema(name: &str) -> Option<(Content, &'static str)> {
    match name {
        tick::SCHEMA_NAME => Some((Content::Ticks, tick::SCHEMA)),
        model::SCHEMA_NAME => Some((Content::Models, model::SCHEMA)),
        tear::SCHEMA_NAME => Some((Content::Tears, tear::SCHEMA)),
        _ => None,
    }
}

/// Whether a definition has the fields of `own`, in its order. Comments and constants do not count: they name values, and
/// a later version of palpate may name more.
pub(super) fn same_fields(found: &[u8], own: &str) -> bool {
    // Only constants and the lines between two definitions have a sign of equality.
    let fields = |text: &str| -> Vec<String> {
        let lines = text
            .lines()
            .map(|line| line.split('#').next().unwrap_or(""));
        let fields = lines.filter(|line| !line.contains('=') && !line.trim().is_empty());
        fields
            .map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "))
            .collect()
    };
    found == own.as_bytes()
        || std::str::from_utf8(found).is_ok_and(|found| fields(found) == fields(own))
}

impl Parser {
    fn record(&mut self, opcode: u8, data: &[u8]) -> Result<(), LogError> {
        if opcode == op::ATTACHMENT {
            match attachment(data) {
                // Only the first attachment of this name is the scene: the scene may name a file of the same name.
                Some(file) if file.name == SCENE_NAME && self.log.scene.is_empty() => {
                    // A scene that is not text is refused when the log is replayed.
                    self.log.scene = String::from_utf8_lossy(file.content).into_owned();
                }
                // The overview is not a file of the scene.
                Some(file) if file.name == OVERVIEW_NAME && file.media_type == OVERVIEW_TYPE => {}
                Some(file) => {
                    let (name, bytes) = (file.name.to_owned(), file.content.to_vec());
                    self.log.files.insert(name, bytes);
                }
                None => {}
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
            Record::Schema { header, data } => {
                if let Some((content, definition)) = known_schema(&header.name) {
                    if !same_fields(&data, definition) {
                        return Err(LogError::OtherLayout);
                    }
                    self.schemas.insert(header.id, content);
                }
            }
            Record::Channel(channel) => {
                if let Some(content) = self.schemas.get(&channel.schema_id) {
                    if channel.message_encoding != "cdr" {
                        return Err(LogError::OtherLayout);
                    }
                    self.channels.insert(channel.id, *content);
                }
            }
            Record::Message { header, data } => {
                let bad = LogError::BadMessage {
                    index: self.messages,
                };
                match self.channels.get(&header.channel_id) {
                    Some(Content::Ticks) => {
                        self.log.rows.push(tick::decode(&data).ok_or(bad)?);
                    }
                    Some(Content::Models) => {
                        self.log.models.push(model::decode(&data).ok_or(bad)?);
                    }
                    Some(Content::Tears) => {
                        self.log.tears.push(tear::decode(&data).ok_or(bad)?);
                    }
                    None => {}
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
        // A writer that is killed before its first flush leaves only the header. Such a log is empty.
        if complete && !self.channels.values().any(|c| *c == Content::Ticks) {
            return Err(LogError::NoTicks);
        }
        Ok(Log {
            complete,
            ..self.log
        })
    }
}

/// An attachment record.
pub(super) struct Attached<'a> {
    pub(super) name: &'a str,
    pub(super) media_type: &'a str,
    pub(super) content: &'a [u8],
    /// Number of bytes after the content.
    pub(super) after: usize,
}

/// Reads an attachment record. This function parses the record itself because the parser of the mcap crate panics on a
/// record that is too short.
pub(super) fn attachment(record: &[u8]) -> Option<Attached<'_>> {
    // The record holds two times, then name, media type and content, each after its length.
    let (_, rest) = record.split_at_checked(16)?;
    let (name, rest) = text(rest)?;
    let (media_type, rest) = text(rest)?;
    let (length, rest) = rest.split_first_chunk()?;
    let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
    let (content, after) = rest.split_at_checked(length)?;
    Some(Attached {
        name,
        media_type,
        content,
        after: after.len(),
    })
}

/// A text after its length, and the bytes after the text.
fn text(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    let (text, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
    Some((std::str::from_utf8(text).ok()?, rest))
}
