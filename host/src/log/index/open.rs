//! Finds the chunks and the header of a log: in the index at its end, or by a walk over its records.

use super::decode::Channels;
use super::{Chunk, IndexError, LONGEST_CHUNK, LogIndex, read_at};
use crate::log::overview::Overview;
use crate::log::{
    LogError, METADATA_NAME, OVERVIEW_NAME, OVERVIEW_TYPE, SCENE_NAME, limits, record,
};
use crate::record::TickRow;
use crate::scene::source::printable;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError};
use std::collections::BTreeMap;
use std::io::{BufReader, Read, Seek, SeekFrom};

/// Bytes of a record's head: an operation code and a length.
const HEAD: u64 = 9;
/// Bytes of the record before the index, with its head.
const DATA_END: u64 = HEAD + 4;
/// Bytes of the footer, with its head, and of the magic number after it.
const END: u64 = HEAD + 20 + MAGIC.len() as u64;
/// Buffer of a walk (bytes).
const BUFFER: usize = 1 << 16;

impl<R: Read + Seek> LogIndex<R> {
    /// Opens a log.
    ///
    /// # Errors
    /// [`IndexError`] for a file that cannot be read, is no log of this version, or is damaged before its end.
    pub fn open(source: R) -> Result<Self, IndexError> {
        let mut source = BufReader::with_capacity(BUFFER, source);
        let length = source.seek(SeekFrom::End(0))?;
        let magic = read_at(&mut source, length, 0, length.min(MAGIC.len() as u64))?;
        if magic != MAGIC {
            return Err(IndexError::NotALog);
        }
        let mut log = Self {
            source,
            length,
            facts: BTreeMap::new(),
            limits: Vec::new(),
            scene: String::new(),
            files: BTreeMap::new(),
            overview: None,
            complete: false,
            chunks: Vec::new(),
            channels: Channels::default(),
            cache: Vec::new(),
        };
        match log.summary_start()? {
            Some(start) => log.read_summary(start)?,
            None => log.walk()?,
        }
        // A writer that is killed before its first flush leaves only the header. Such a log is empty.
        if log.complete && log.channels.of::<TickRow>().next().is_none() {
            return Err(LogError::NoTicks.into());
        }
        Ok(log)
    }

    /// Where the index begins; `None` for a log without an end or without an index.
    fn summary_start(&mut self) -> Result<Option<u64>, IndexError> {
        let Some(offset) = self.length.checked_sub(END) else {
            return Ok(None);
        };
        let end = read_at(&mut self.source, self.length, offset, END)?;
        let Some(footer) = end.strip_suffix(MAGIC) else {
            return Ok(None);
        };
        let Some((&op::FOOTER, fields)) = footer.split_first() else {
            return Ok(None);
        };
        let start = fields
            .get(8..)
            .and_then(<[u8]>::first_chunk)
            .map_or(0, |start| u64::from_le_bytes(*start));
        Ok((start > 0).then_some(start))
    }

    /// Reads the index, and the header that it names.
    ///
    /// `mcap::sans_io::summary_reader` would read the same records, but version 0.26 does not check the sum of the section, and
    /// reserves the memory that a damaged length asks for ([`record`]).
    fn read_summary(&mut self, start: u64) -> Result<(), IndexError> {
        let damaged = |source| IndexError::Damaged {
            offset: start,
            part: "the index",
            source,
        };
        // From the record before the index on, so that its check sum is checked.
        let from = start
            .checked_sub(DATA_END)
            .ok_or_else(|| damaged(McapError::BadFooter))?;
        let length = self
            .length
            .checked_sub(from)
            .ok_or_else(|| damaged(McapError::BadFooter))?;
        let bytes = read_at(&mut self.source, self.length, from, length)?;
        if bytes.first() != Some(&op::DATA_END) {
            return Err(damaged(McapError::BadFooter));
        }
        let mut reader = LinearReader::new_with_options(
            LinearReaderOptions::default()
                .with_skip_start_magic(true)
                .with_emit_chunks(true)
                .with_validate_summary_section_crc(true)
                .with_record_length_limit(bytes.len()),
        );
        let mut rest = bytes.as_slice();
        let (mut attachments, mut metadata) = (Vec::new(), Vec::new());
        while let Some(event) = reader.next_event() {
            match event.map_err(damaged)? {
                LinearReadEvent::ReadRequest(wanted) => {
                    let (head, tail) = rest.split_at(wanted.min(rest.len()));
                    reader.insert(head.len()).copy_from_slice(head);
                    reader.notify_read(head.len());
                    rest = tail;
                }
                LinearReadEvent::Record { opcode, data } => {
                    if !matches!(
                        opcode,
                        op::SCHEMA
                            | op::CHANNEL
                            | op::CHUNK_INDEX
                            | op::ATTACHMENT_INDEX
                            | op::METADATA_INDEX
                    ) {
                        continue;
                    }
                    match record::parse(opcode, data).map_err(damaged)? {
                        Record::ChunkIndex(index) => self.chunks.push(Chunk {
                            offset: index.chunk_start_offset,
                            length: index.chunk_length,
                            from_ns: index.message_start_time,
                            channels: (!index.message_index_offsets.is_empty())
                                .then(|| index.message_index_offsets.into_keys().collect()),
                            cut: false,
                        }),
                        Record::AttachmentIndex(index) => {
                            attachments.push((index.offset, index.length));
                        }
                        Record::MetadataIndex(index) => metadata.push((index.offset, index.length)),
                        record => self.channels.take(record)?,
                    }
                }
            }
        }
        // A false index cannot make this program read more than the file has.
        let places = attachments
            .iter()
            .chain(&metadata)
            .map(|(_, length)| *length);
        let places = places.chain(self.chunks.iter().map(|chunk| chunk.length));
        let sum = places.fold(0_u64, u64::saturating_add);
        if sum > self.length {
            return Err(damaged(McapError::BadIndex));
        }
        self.chunks.sort_by_key(|chunk| chunk.offset);
        attachments.sort_unstable();
        metadata.sort_unstable();
        for (offset, length) in attachments {
            self.read_header_record(op::ATTACHMENT, offset, length)?;
        }
        for (offset, length) in metadata {
            self.read_header_record(op::METADATA, offset, length)?;
        }
        self.complete = true;
        Ok(())
    }

    /// Reads an attachment or a metadata record of the header. `length` is that of the record with its head.
    fn read_header_record(
        &mut self,
        opcode: u8,
        offset: u64,
        length: u64,
    ) -> Result<(), IndexError> {
        let bytes = read_at(&mut self.source, self.length, offset, length)?;
        let damaged = |source| IndexError::Damaged {
            offset,
            part: if opcode == op::METADATA {
                "the facts of the run"
            } else {
                "an attached file"
            },
            source,
        };
        let data = match bytes.split_first_chunk::<{ HEAD as usize }>() {
            Some((&[found, ref length @ ..], data))
                if found == opcode && u64::from_le_bytes(*length) == data.len() as u64 =>
            {
                data
            }
            _ => return Err(damaged(McapError::BadIndex)),
        };
        // The check sum of an attachment is checked here, too.
        let parsed = record::parse(opcode, data).map_err(damaged)?;
        if let Record::Metadata(found) = &parsed {
            match found.name.as_str() {
                METADATA_NAME => self.facts = facts(&found.metadata),
                limits::NAME => {
                    let limits = limits::parse(self.limits.len(), &found.metadata)?;
                    self.limits.push(limits);
                }
                _ => {}
            }
            return Ok(());
        }
        let Some(file) = record::attachment(data) else {
            return Err(damaged(McapError::UnexpectedEof));
        };
        match file.name {
            OVERVIEW_NAME if file.media_type == OVERVIEW_TYPE => {
                self.overview = Overview::parse(file.content);
            }
            // Only the first attachment of this name is the scene: the scene may name a file of the same name.
            SCENE_NAME if self.scene.is_empty() => {
                // A scene that is not text is refused when its fields are read.
                self.scene = String::from_utf8_lossy(file.content).into_owned();
            }
            name => {
                self.files.insert(name.to_owned(), file.content.to_vec());
            }
        }
        Ok(())
    }

    /// Walks over the records of a log that has no index, without reading the content of chunks.
    fn walk(&mut self) -> Result<(), IndexError> {
        let mut at = MAGIC.len() as u64;
        let mut here = self.source.seek(SeekFrom::Start(at))?;
        loop {
            // A step within the buffer costs no system call.
            self.source.seek_relative(at as i64 - here as i64)?;
            here = at;
            let left = self.length - at;
            if left < HEAD {
                return Ok(());
            }
            let mut head = [0; HEAD as usize];
            self.source.read_exact(&mut head)?;
            here += HEAD;
            let [opcode, ref length @ ..] = head;
            let length = u64::from_le_bytes(*length).saturating_add(HEAD);
            let cut = length > left;
            match opcode {
                // A file system may leave zeros where the data were not written.
                0 | op::DATA_END | op::FOOTER => return Ok(()),
                op::CHUNK => {
                    let length = length.min(left);
                    if length > LONGEST_CHUNK {
                        return Err(IndexError::Damaged {
                            offset: at,
                            part: "a chunk",
                            source: McapError::ChunkTooLarge(length),
                        });
                    }
                    // The chunk begins with the time of its earliest message.
                    if length < HEAD + 8 {
                        return Ok(());
                    }
                    let mut time = [0; 8];
                    self.source.read_exact(&mut time)?;
                    here += 8;
                    let from_ns = u64::from_le_bytes(time);
                    self.chunks.push(Chunk {
                        offset: at,
                        length,
                        from_ns,
                        channels: None,
                        cut,
                    });
                }
                op::ATTACHMENT | op::METADATA if !cut => {
                    self.read_header_record(opcode, at, length)?;
                    here = self.source.stream_position()?;
                }
                _ => {}
            }
            if cut {
                return Ok(());
            }
            at += length;
        }
    }
}

/// The facts of a run, which programs print: each is one line without control characters.
fn facts(found: &BTreeMap<String, String>) -> BTreeMap<String, String> {
    let facts = found.iter();
    facts
        .map(|(name, fact)| (printable(name), printable(fact)))
        .collect()
}
