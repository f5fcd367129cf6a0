//! The log of a run: every tick in an MCAP file that public tools open (Foxglove, PlotJuggler, the
//! Python package `mcap-ros2-support`).
//!
//! - Ticks are ROS 2 messages (`palpate_msgs/msg/Tick`) on the channel `/tick`; the file holds their
//!   definition. Their time is the tick's nominal time, from the run's start.
//! - Local models (`palpate_msgs/msg/LocalModel`) are on the channel `/model`, each before the first tick
//!   that used it, at the time at which its state held.
//! - The metadata record `palpate` says how the run came about; the attachment `scene.toml` is its
//!   scene, and the other attachments are the files that the scene names. The ticks' raw readings, the
//!   models and the scene are all that a replay needs.
//! - Two logs of the same ticks hold the same bytes: no wall clock and no random number enters.
//! - The ticks since the last [`LogWriter::flush`] wait in memory. What a killed process leaves is a
//!   valid log without its index, and [`Log::parse`] reads it.

mod cdr;
mod chunks;
mod geometry;
mod model;
mod read;
mod reading;
mod tick;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Seek, Write};
use std::path::Path;

use mcap::records::MessageHeader;
use mcap::write::Metadata;
use mcap::{Attachment, McapError, WriteOptions, Writer};
use rt_core::{LocalModel, Telemetry};

pub use model::ModelRow;
pub use read::{Log, read_log};
pub use reading::{LoggedReading, ReadFault};
pub use tick::{TickRow, energy_sums};

const TICK_TOPIC: &str = "/tick";
const MODEL_TOPIC: &str = "/model";
const METADATA_NAME: &str = "palpate";
const SCENE_NAME: &str = "scene.toml";
/// A chunk ends at this size even if nobody flushes (bytes).
const CHUNK_SIZE: u64 = 1 << 20;

/// How a run came about.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogHeader {
    /// What identifies the run: scene name, seed, scheme, clock, version, instruction path.
    pub facts: BTreeMap<String, String>,
    /// The text of the scene file.
    pub scene: String,
    /// The files that the scene names, by the names that it calls them.
    pub files: BTreeMap<String, Vec<u8>>,
}

/// Why a log could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file could not be made.
    #[error("cannot create the log {log}: {source}")]
    Create {
        /// Which log.
        log: String,
        /// What the system said.
        source: io::Error,
    },
    /// The file could not be written on.
    #[error("cannot write the log {log}: {source} (what was flushed before is kept)")]
    Write {
        /// Which log.
        log: String,
        /// What the system said.
        source: io::Error,
    },
    /// The bytes are no MCAP file, or one that is damaged before its end.
    #[error("not an MCAP file, or a damaged one: {0}")]
    Damaged(McapError),
    /// The file is sound but holds no ticks.
    #[error(
        "no channel of {} in this file: it is not a log of palpate",
        tick::SCHEMA_NAME
    )]
    NoTicks,
    /// The ticks are laid out otherwise than here.
    #[error("the ticks of this log are laid out otherwise: it was written by another version")]
    OtherLayout,
    /// A tick or a model that does not match the definition.
    #[error("message {index} (from zero) is not what its channel says, or is cut short")]
    BadMessage {
        /// Number of the message in the file.
        index: usize,
    },
}

/// Writes a log, tick by tick.
pub struct LogWriter<W: Write + Seek> {
    writer: Writer<W>,
    channels: Channels,
    models: u32,
    /// The message under way; kept for its capacity.
    message: Vec<u8>,
    /// How errors call the log.
    name: String,
}

impl LogWriter<BufWriter<File>> {
    /// Begins a log in a new file, in the place of an older one.
    ///
    /// # Errors
    /// If the file cannot be created or written.
    pub(crate) fn create_file(path: &Path, header: &LogHeader) -> Result<Self, LogError> {
        let name = path.display().to_string();
        match File::create(path) {
            Ok(file) => Self::with_name(BufWriter::new(file), name, header),
            Err(source) => Err(LogError::Create { log: name, source }),
        }
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
        match begin(writer, header) {
            Ok((writer, channels)) => Ok(Self {
                writer,
                channels,
                models: 0,
                message: Vec::new(),
                name,
            }),
            Err(error) => Err(write_error(&name, error)),
        }
    }

    /// Adds a tick.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write(&mut self, telemetry: &Telemetry) -> Result<(), LogError> {
        tick::encode(telemetry, &mut self.message);
        let header = MessageHeader {
            channel_id: self.channels.tick,
            // Wraps after 49 days of ticks.
            sequence: telemetry.tick as u32,
            log_time: telemetry.time_ns,
            publish_time: telemetry.time_ns,
        };
        self.put(&header)
    }

    /// Adds a model of the body of index `body`. It belongs before the first tick that uses it.
    ///
    /// # Errors
    /// If the writer fails.
    pub(crate) fn write_model(&mut self, body: u8, model: &LocalModel) -> Result<(), LogError> {
        model::encode(body, model, &mut self.message);
        let header = MessageHeader {
            channel_id: self.channels.model,
            sequence: self.models,
            log_time: model.time_ns,
            publish_time: model.time_ns,
        };
        self.models = self.models.wrapping_add(1);
        self.put(&header)
    }

    fn put(&mut self, header: &MessageHeader) -> Result<(), LogError> {
        self.writer
            .write_to_known_channel(header, &self.message)
            .map_err(|error| write_error(&self.name, error))
    }

    /// Hands all ticks so far to the system, so that they survive this process. A chunk of the file
    /// ends with each call: every half second of data is often enough.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn flush(&mut self) -> Result<(), LogError> {
        self.writer
            .flush()
            .map_err(|error| write_error(&self.name, error))
    }

    /// Ends the log with its index, and gives the writer back.
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

/// The channels' numbers in the file.
#[derive(Clone, Copy)]
struct Channels {
    tick: u16,
    model: u16,
}

fn begin<W: Write + Seek>(
    writer: W,
    header: &LogHeader,
) -> Result<(Writer<W>, Channels), McapError> {
    let options = WriteOptions::new()
        .profile("ros2")
        .compression(None)
        .chunk_size(Some(CHUNK_SIZE))
        // Chunks are built in memory and written whole: a killed process leaves no half header.
        .disable_seeking(true);
    let mut writer = Writer::with_options(writer, options)?;
    let metadata = Metadata {
        name: METADATA_NAME.to_owned(),
        metadata: header.facts.clone(),
    };
    writer.write_metadata(&metadata)?;
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
    // The ROS 2 profile asks for this key; empty means the defaults.
    let qos = BTreeMap::from([("offered_qos_profiles".to_owned(), String::new())]);
    let mut channel = |topic: &str, name: &str, definition: &str| {
        let schema = writer.add_schema(name, "ros2msg", definition.as_bytes())?;
        writer.add_channel(schema, topic, "cdr", &qos)
    };
    let channels = Channels {
        tick: channel(TICK_TOPIC, tick::SCHEMA_NAME, tick::SCHEMA)?,
        model: channel(MODEL_TOPIC, model::SCHEMA_NAME, model::SCHEMA)?,
    };
    Ok((writer, channels))
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
