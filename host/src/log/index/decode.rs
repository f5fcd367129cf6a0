//! The content of one chunk.

use super::{Chunk, IndexError};
use crate::log::read::same_fields;
use crate::log::{LogError, chunks, record};
use crate::record::cdr::decode as read;
use crate::record::{BodyFrame, Cloud, Kind, ModelRow, Surface, TearEvent, TickRow, cloud};
use mcap::McapError;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The messages of one chunk, in the order of the file.
#[derive(Clone, Debug, Default)]
pub struct Decoded {
    /// The ticks.
    pub ticks: Vec<TickRow>,
    /// The local models.
    pub models: Vec<ModelRow>,
    /// The edits by which bodies tore.
    pub tears: Vec<TearEvent>,
    /// The facts of the bodies' frames, by channel.
    pub(super) frames: Vec<(u16, BodyFrame)>,
    /// The positions of the bodies' frames: channel, time (ns), three numbers a vertex (m).
    pub(super) clouds: Vec<(u16, u64, Arc<[f32]>)>,
    /// The surfaces: channel, time (ns) of the first frame, surface.
    pub(super) surfaces: Vec<(u16, u64, Arc<Surface>)>,
    /// About the size in memory (bytes).
    size: usize,
}

impl Decoded {
    /// About the size in memory (bytes).
    pub(super) fn size(&self) -> usize {
        self.size
    }
}

/// The schemas and channels that palpate wrote, by number. Schemas have their names.
#[derive(Clone, Debug, Default)]
pub(super) struct Channels {
    schemas: BTreeMap<u16, &'static str>,
    channels: BTreeMap<u16, (&'static str, String)>,
}

/// The schema of this name, and its definition in this version.
fn known_schema(name: &str) -> Option<(&'static str, String)> {
    fn of<K: Kind>() -> (&'static str, fn() -> String) {
        (K::SCHEMA_NAME, K::definition)
    }
    let kinds = [
        of::<TickRow>(),
        of::<ModelRow>(),
        of::<TearEvent>(),
        of::<BodyFrame>(),
        of::<Surface>(),
        of::<Cloud>(),
    ];
    let mut found = kinds.into_iter().filter(|(known, _)| *known == name);
    found.next().map(|(name, definition)| (name, definition()))
}

impl Channels {
    /// Takes the record of a schema or a channel; other records are ignored.
    pub(super) fn take(&mut self, record: Record<'_>) -> Result<(), LogError> {
        match record {
            Record::Schema { header, data } => {
                if let Some((name, definition)) = known_schema(&header.name) {
                    if !same_fields(&data, &definition) {
                        return Err(LogError::OtherLayout);
                    }
                    self.schemas.insert(header.id, name);
                }
            }
            Record::Channel(channel) => {
                if let Some(name) = self.schemas.get(&channel.schema_id) {
                    if channel.message_encoding != "cdr" {
                        return Err(LogError::OtherLayout);
                    }
                    self.channels.insert(channel.id, (name, channel.topic));
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// The channels of this kind.
    pub(super) fn of<K: Kind>(&self) -> impl Iterator<Item = u16> {
        let channels = self.channels.iter();
        channels.filter_map(|(id, (found, _))| (*found == K::SCHEMA_NAME).then_some(*id))
    }

    /// The channel of this kind for the body of this name.
    pub(super) fn named<K: Kind>(&self, body: &str) -> Option<u16> {
        let topic = K::topic(body);
        let mut channels = self.channels.iter();
        channels.find_map(|(id, (found, name))| {
            (*found == K::SCHEMA_NAME && *name == topic).then_some(*id)
        })
    }
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
    decoded.size += decoded.size_of_rows();
    Ok((decoded, used.into_iter().collect()))
}

impl Decoded {
    /// Takes a message; `None` if it does not match its definition.
    fn take(&mut self, record: Record<'_>, channels: &Channels) -> Option<()> {
        let Record::Message { header, data } = record else {
            return Some(());
        };
        let Some((name, _)) = channels.channels.get(&header.channel_id) else {
            return Some(());
        };
        let (channel, time_ns) = (header.channel_id, header.log_time);
        match *name {
            TickRow::SCHEMA_NAME => {
                let row: TickRow = read(&data)?;
                // The order of the ticks is what a search relies on.
                let in_order = self
                    .ticks
                    .last()
                    .is_none_or(|last| last.tick < row.tick && last.time_ns <= row.time_ns);
                if !in_order || row.time_ns != time_ns {
                    return None;
                }
                self.ticks.push(row);
            }
            ModelRow::SCHEMA_NAME => self.models.push(read(&data)?),
            TearEvent::SCHEMA_NAME => self.tears.push(read(&data)?),
            BodyFrame::SCHEMA_NAME => self.frames.push((channel, read(&data)?)),
            Cloud::SCHEMA_NAME => {
                let positions = cloud::decode(time_ns, &data)?;
                self.clouds.push((channel, time_ns, positions.into()));
            }
            Surface::SCHEMA_NAME => {
                let surface = Arc::new(read(&data)?);
                self.surfaces.push((channel, time_ns, surface));
            }
            _ => {}
        }
        Some(())
    }

    fn size_of_rows(&self) -> usize {
        let ticks = self.ticks.iter().map(|row| {
            size_of_val(row)
                + size_of_val(row.devices.as_slice())
                + size_of_val(row.bodies.as_slice())
                + size_of_val(row.readings.as_slice())
        });
        let clouds = self.clouds.iter().map(|(_, _, p)| size_of_val(&**p));
        // Models and surfaces are about as large as their messages, which the chunk's size counts.
        ticks.sum::<usize>() + clouds.sum::<usize>()
    }
}
