//! The content of one chunk.

use super::{Chunk, IndexError};
use crate::log::read::same_fields;
use crate::log::{LogError, chunks, record};
use crate::record::{KINDS, Kind, List, Records};
use mcap::McapError;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::any::Any;
use std::collections::{BTreeMap, BTreeSet};

/// The messages of one chunk, by kind in the order of the file.
#[derive(Debug)]
pub struct Decoded {
    /// The records of each kind, in the order of the list of kinds.
    lists: [Box<dyn List>; KINDS.len()],
    /// About the size in memory (bytes).
    size: usize,
}

impl Default for Decoded {
    fn default() -> Self {
        Self {
            lists: KINDS.each_ref().map(|kind| (kind.list)()),
            size: 0,
        }
    }
}

impl Decoded {
    /// About the size in memory (bytes).
    pub(super) fn size(&self) -> usize {
        self.size
    }

    /// The records of this kind, with their channels and times.
    pub(super) fn of<K: Kind>(&self) -> Option<&Records<K>> {
        let mut lists = self.lists.iter().map(|list| &**list as &dyn Any);
        lists.find_map(|list| list.downcast_ref())
    }

    /// The records of this kind, in the order of the file.
    pub fn records<K: Kind>(&self) -> &[K] {
        self.of().map_or(&[], |list| &list.records)
    }
}

/// The schemas and channels that palpate wrote, by number. Schemas have their names.
#[derive(Clone, Debug, Default)]
pub(super) struct Channels {
    /// The kind of each schema, by its place in the list of kinds.
    schemas: BTreeMap<u16, usize>,
    /// The kind of each channel, and its topic.
    channels: BTreeMap<u16, (usize, String)>,
}

impl Channels {
    /// Takes the record of a schema or a channel; other records are ignored.
    pub(super) fn take(&mut self, record: Record<'_>) -> Result<(), LogError> {
        match record {
            Record::Schema { header, data } => {
                let known = KINDS.iter().enumerate();
                let mut known = known.filter(|(_, kind)| kind.schema_name == header.name);
                if let Some((kind, info)) = known.next() {
                    if !same_fields(&data, &(info.definition)()) {
                        return Err(LogError::OtherLayout);
                    }
                    self.schemas.insert(header.id, kind);
                }
            }
            Record::Channel(channel) => {
                if let Some(kind) = self.schemas.get(&channel.schema_id) {
                    if channel.message_encoding != "cdr" {
                        return Err(LogError::OtherLayout);
                    }
                    self.channels.insert(channel.id, (*kind, channel.topic));
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// The channels of this kind.
    pub(super) fn of<K: Kind>(&self) -> impl Iterator<Item = u16> {
        let channels = self.channels.iter();
        channels.filter_map(|(id, (kind, _))| is_of::<K>(*kind).then_some(*id))
    }

    /// The channel of this kind for the body of this name.
    pub(super) fn named<K: Kind>(&self, body: &str) -> Option<u16> {
        let topic = K::topic(body);
        let mut channels = self.channels.iter();
        channels.find_map(|(id, (kind, name))| (is_of::<K>(*kind) && *name == topic).then_some(*id))
    }
}

/// Whether the kind at this place in the list of kinds is `K`.
fn is_of<K: Kind>(kind: usize) -> bool {
    KINDS
        .get(kind)
        .is_some_and(|kind| kind.schema_name == K::SCHEMA_NAME)
}

/// Reads the records of a chunk: its messages, and the channels that they are on. `bytes` is its whole record.
pub(super) fn decode(
    chunk: &Chunk,
    bytes: &[u8],
    channels: &mut Channels,
) -> Result<(Decoded, Vec<u16>), IndexError> {
    let damaged = |source| IndexError::Damaged {
        offset: chunk.offset,
        part: "a chunk",
        source,
    };
    match bytes.first() {
        Some(&op::CHUNK) => {}
        _ => return Err(damaged(McapError::BadIndex)),
    }
    chunks::check(bytes).map_err(damaged)?;
    let mut reader = LinearReader::new_with_options(
        LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_validate_chunk_crcs(true)
            .with_record_length_limit(bytes.len()),
    );
    let mut decoded = Decoded {
        size: bytes.len(),
        ..Decoded::default()
    };
    let mut rest = bytes;
    let mut index = 0;
    let mut used = BTreeSet::new();
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let (head, tail) = rest.split_at(wanted.min(rest.len()));
                reader.insert(head.len()).copy_from_slice(head);
                reader.notify_read(head.len());
                rest = tail;
            }
            Ok(LinearReadEvent::Record { opcode, data }) => match opcode {
                op::SCHEMA | op::CHANNEL => {
                    channels.take(record::parse(opcode, data).map_err(damaged)?)?;
                }
                op::MESSAGE => {
                    let record = record::parse(opcode, data).map_err(damaged)?;
                    if let Record::Message { header, .. } = &record {
                        used.insert(header.channel_id);
                    }
                    if decoded.take(record, channels).is_none() {
                        return Err(IndexError::BadMessage {
                            offset: chunk.offset,
                            index,
                        });
                    }
                    index += 1;
                }
                _ => {}
            },
            // The messages before the end of the file are sound.
            Err(
                McapError::UnexpectedEof
                | McapError::RecordTooLarge { .. }
                | McapError::ChunkTooLarge(_),
            ) if chunk.cut => break,
            Err(error) => return Err(damaged(error)),
        }
    }
    decoded.size += decoded.lists.iter().map(|list| list.size()).sum::<usize>();
    Ok((decoded, used.into_iter().collect()))
}

impl Decoded {
    /// Takes a message; `None` if it does not match its definition.
    fn take(&mut self, record: Record<'_>, channels: &Channels) -> Option<()> {
        let Record::Message { header, data } = record else {
            return Some(());
        };
        let kind = channels.channels.get(&header.channel_id);
        match kind.and_then(|(kind, _)| self.lists.get_mut(*kind)) {
            Some(list) => list.take(header.channel_id, header.log_time, &data),
            None => Some(()),
        }
    }
}
