//! The log of a run: every tick, in an MCAP file that public tools open (Foxglove, PlotJuggler, the
//! Python package `mcap-ros2-support`).
//!
//! - Ticks are ROS 2 messages (`palpate_msgs/msg/Tick`) on the channel `/tick`. The file holds the definition of
//!   these messages. The time of a message is the nominal time of its tick, from the start of the run.
//! - Local models (`palpate_msgs/msg/LocalModel`) are on the channel `/model`, each before the first tick
//!   that used it. The time of a message is the time of the model's reference.
//! - The metadata record `palpate` identifies the run, and each record `palpate.device` has the limits of a device as it
//!   was driven. The attachment `scene.toml` is the scene, and the other attachments are the files that the scene names.
//!   A replay needs only the raw readings, the models, the limits and the scene.
//! - With the channels of [`Group::Frames`], the log also holds frames of the bodies: on the channel `/bodies/NAME` the deformed
//!   vertices as a point cloud (`sensor_msgs/msg/PointCloud2`), on `/bodies/NAME/frame` the step and the topology epoch
//!   of each cloud (`palpate_msgs/msg/BodyFrame`), and on `/bodies/NAME/surface` the surface of each topology epoch
//!   (`palpate_msgs/msg/Surface`). The time of a frame is the due time of its step. Replays skip these channels.
//! - With the channels of [`Group::Tears`], the log of a scene with sheets that tear holds every edit of a sheet on the channel
//!   `/bodies/NAME/tears` (`palpate_msgs/msg/Tear`). The time of a message is the due time of the step.
//! - With the channel of [`Group::Contacts`], the log of a scene with contact holds the contacts of every host step on the
//!   channel `/contacts` (`palpate_msgs/msg/Contacts`). Replays skip this channel.
//! - With the channel of [`Group::Tools`], the log of a scene with tools holds the patches that the tick received on the channel
//!   `/patch` (`palpate_msgs/msg/Patch`), each before the first tick that uses it. A replay needs them.
//! - The attachment `palpate.overview` at the end summarizes the run ([`overview`]), so that a player opens the log
//!   by its index ([`index`]). It is not a file of the scene.
//! - Two logs of the same ticks hold the same bytes: no wall clock and no random number enters.
//! - The ticks since the last [`LogWriter::flush`] wait in memory. A killed process leaves a valid log without
//!   an index, which [`index::LogIndex`] reads.

mod chunks;
mod file;
pub mod index;
mod limits;
pub mod overview;
mod read;
mod record;
pub mod series;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Seek, Write};

use mcap::records::MessageHeader;
use mcap::write::Metadata;
use mcap::{Attachment, McapError, WriteOptions, Writer};
use rt_core::{Capabilities, Telemetry};

use crate::record::{Group, Kind, Stamp, TickRow};

pub(crate) use file::LogFile;
use overview::Overview;
pub use read::{Log, read_log};

const METADATA_NAME: &str = "palpate";
const SCENE_NAME: &str = "scene.toml";
/// Name and media type of the overview. The media type tells it from a file of the scene with the same name.
const OVERVIEW_NAME: &str = "palpate.overview";
const OVERVIEW_TYPE: &str = "application/json";
/// A chunk ends at this size even without a flush (bytes).
const CHUNK_SIZE: u64 = 1 << 20;

/// The identity and the input of a run, written before its first tick.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LogHeader {
    /// The facts that identify the run: scene name, seed, scheme, clock, version, instruction path.
    pub facts: BTreeMap<String, String>,
    /// The limits of the devices as they are driven, in the order of the scene.
    pub limits: Vec<Capabilities>,
    /// The text of the scene file.
    pub scene: String,
    /// The files that the scene names, by their names in the scene.
    pub files: BTreeMap<String, Vec<u8>>,
}

/// Why a log could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file could not be created.
    #[error("cannot create the log {log}: {source}")]
    Create {
        /// The log, as messages name it.
        log: String,
        /// The system's error.
        source: io::Error,
    },
    /// Another program writes to the file.
    #[error(
        "cannot write the log {log}: another program is writing to this log; give each run a log of its own"
    )]
    Busy {
        /// The log, as messages name it.
        log: String,
    },
    /// The file could not be written.
    #[error(
        "cannot write the log {log}: {source} (the ticks that were flushed before are in the log)"
    )]
    Write {
        /// The log, as messages name it.
        log: String,
        /// The system's error.
        source: io::Error,
    },
    /// The file is a sound MCAP file but has no channel of ticks.
    #[error(
        "this file has no channel of {} and so is not a log of palpate",
        TickRow::SCHEMA_NAME
    )]
    NoTicks,
    /// The definition of the messages differs from that of this version.
    #[error(
        "the messages of this log have another layout: another version of palpate wrote the log"
    )]
    OtherLayout,
    /// The limits of a device are not those of any device.
    #[error(
        "the log is damaged: device {index} (from zero), {field}: found {found}, allowed: {allowed}"
    )]
    Limits {
        /// Index of the device.
        index: usize,
        /// The field.
        field: &'static str,
        /// The value found.
        found: String,
        /// The allowed values.
        allowed: &'static str,
    },
}

/// Writes a log, tick by tick.
///
/// ```
/// use host::log::{Log, LogHeader, LogWriter};
/// use std::io::Cursor;
///
/// let mut writer = LogWriter::create(Cursor::new(Vec::new()), &LogHeader::default())?;
/// writer.write(&rt_core::Telemetry::empty())?;
/// let bytes = writer.finish()?.into_inner();
/// assert_eq!(Log::parse(&bytes)?.rows.len(), 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct LogWriter<W: Write + Seek> {
    writer: Writer<W>,
    /// The channels by the type of their messages and by body, each with the count of its messages.
    channels: BTreeMap<(&'static str, usize), (u16, u32)>,
    /// The present message. The buffer is kept for its capacity.
    message: Vec<u8>,
    /// The name of the log in errors.
    name: String,
}

impl LogWriter<BufWriter<File>> {
    /// Begins a log in a file, whose older content is lost.
    ///
    /// # Errors
    /// If the file cannot be emptied or written.
    pub(crate) fn begin_file(file: LogFile, header: &LogHeader) -> Result<Self, LogError> {
        let (file, name) = file.begin()?;
        Self::with_name(BufWriter::new(file), name, header)
    }
}

impl<W: Write + Seek> LogWriter<W> {
    /// Begins a log on any writer.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn create(writer: W, header: &LogHeader) -> Result<Self, LogError> {
        Self::with_name(writer, "in memory".to_owned(), header)
    }

    fn with_name(writer: W, name: String, header: &LogHeader) -> Result<Self, LogError> {
        let mut log = match begin(writer, header) {
            Ok(writer) => Self {
                writer,
                channels: BTreeMap::new(),
                message: Vec::new(),
                name,
            },
            Err(error) => return Err(write_error(&name, error)),
        };
        log.add(Group::Run, 0, "")?;
        Ok(log)
    }

    /// Gives the log the channels of the kinds of a group for the body of this index and name. The caller does so before
    /// the first tick. Channels of the run have the index zero.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn add(&mut self, group: Group, body: usize, name: &str) -> Result<(), LogError> {
        // The ROS 2 profile requires this key. An empty value means the defaults.
        let qos = BTreeMap::from([("offered_qos_profiles".to_owned(), String::new())]);
        for channel in group.channels(name) {
            let definition = channel.schema_text.as_bytes();
            let writer = &mut self.writer;
            let id = writer
                .add_schema(channel.schema_name, channel.schema_encoding, definition)
                .and_then(|schema| {
                    writer.add_channel(schema, &channel.topic, channel.encoding, &qos)
                })
                .map_err(|error| write_error(&self.name, error))?;
            self.channels.insert((channel.schema_name, body), (id, 0));
        }
        Ok(())
    }

    /// Adds a record. A record of a body without a channel is ignored.
    ///
    /// The caller writes a model before the first tick that uses it, and a surface before the first frame of its topology
    /// epoch.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write_record<K: Kind>(&mut self, stamp: Stamp, record: &mut K) -> Result<(), LogError> {
        let place = (K::SCHEMA_NAME, stamp.body);
        let Some((channel_id, count)) = self.channels.get_mut(&place) else {
            return Ok(());
        };
        record.encode(&mut self.message);
        let header = MessageHeader {
            channel_id: *channel_id,
            sequence: stamp.number.unwrap_or(*count),
            log_time: stamp.time_ns,
            publish_time: stamp.time_ns,
        };
        *count = count.wrapping_add(1);
        self.writer
            .write_to_known_channel(&header, &self.message)
            .map_err(|error| write_error(&self.name, error))
    }

    /// Adds a tick.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write(&mut self, telemetry: &Telemetry) -> Result<(), LogError> {
        let mut row = TickRow::from(telemetry);
        self.write_record(row.stamp(), &mut row)
    }

    /// Hands all ticks so far to the system, so that they survive this process. Each call ends a chunk of the
    /// file: one call per half second of data is often enough.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn flush(&mut self) -> Result<(), LogError> {
        self.writer
            .flush()
            .map_err(|error| write_error(&self.name, error))
    }

    /// Attaches the overview of the run. The caller does so once, after the last tick.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write_overview(&mut self, overview: &Overview) -> Result<(), LogError> {
        self.writer
            .attach(&Attachment {
                log_time: 0,
                create_time: 0,
                name: OVERVIEW_NAME.to_owned(),
                media_type: OVERVIEW_TYPE.to_owned(),
                data: overview.to_bytes().into(),
            })
            .map_err(|error| write_error(&self.name, error))
    }

    /// Ends the log with its index, and returns the writer.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn finish(mut self) -> Result<W, LogError> {
        self.writer
            .finish()
            .map_err(|error| write_error(&self.name, error))?;
        Ok(self.writer.into_inner())
    }
}

fn begin<W: Write + Seek>(writer: W, header: &LogHeader) -> Result<Writer<W>, McapError> {
    let options = WriteOptions::new()
        .profile("ros2")
        .compression(None)
        .chunk_size(Some(CHUNK_SIZE))
        // Chunks are built in memory and written whole: a killed process leaves no incomplete header.
        .disable_seeking(true);
    let mut writer = Writer::with_options(writer, options)?;
    let facts = (METADATA_NAME, header.facts.clone());
    let devices = header.limits.iter().enumerate();
    let devices = devices.map(|(index, limits)| (limits::NAME, limits::facts(index, limits)));
    for (name, metadata) in std::iter::once(facts).chain(devices) {
        let name = name.to_owned();
        writer.write_metadata(&Metadata { name, metadata })?;
    }
    let scene = (SCENE_NAME, "application/toml", header.scene.as_bytes());
    let files = header
        .files
        .iter()
        .map(|(name, bytes)| (name.as_str(), "application/octet-stream", bytes.as_slice()));
    for (name, media_type, bytes) in std::iter::once(scene).chain(files) {
        writer.attach(&Attachment {
            log_time: 0,
            create_time: 0,
            name: name.to_owned(),
            media_type: media_type.to_owned(),
            data: bytes.into(),
        })?;
    }
    writer.flush()?;
    Ok(writer)
}

fn write_error(log: &str, error: McapError) -> LogError {
    let source = match error {
        McapError::Io(source) => source,
        McapError::AttemptedWriteAfterFailure => io::Error::other("an earlier write failed"),
        other => io::Error::other(other),
    };
    LogError::Write {
        log: log.to_owned(),
        source,
    }
}

#[cfg(test)]
mod tests;
