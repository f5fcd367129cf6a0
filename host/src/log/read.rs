//! A whole log in memory, for tests and for programs that look at all ticks at once.

use super::index::{IndexError, LogIndex};
use crate::record::{ContactStep, ModelRow, PatchRow, TearEvent, TickRow};
use rt_core::Capabilities;
use std::collections::BTreeMap;
use std::io::{Cursor, Read, Seek};

/// A log, read whole. A long log takes several times the memory of its file; [`LogIndex`] reads it part by part.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// The facts that identify the run (see [`super::LogHeader`]).
    pub facts: BTreeMap<String, String>,
    /// The limits of the devices as they were driven, in the order of the scene.
    pub limits: Vec<Capabilities>,
    /// The text of the scene file.
    pub scene: String,
    /// The files that the scene names, by their names in the scene.
    pub files: BTreeMap<String, Vec<u8>>,
    /// The ticks, in the order of the file.
    pub rows: Vec<TickRow>,
    /// The local models, in the order of the file.
    pub models: Vec<ModelRow>,
    /// The patches of tools, in the order of the file.
    pub patches: Vec<PatchRow>,
    /// The edits by which bodies tore, in the order of the file.
    pub tears: Vec<TearEvent>,
    /// The contacts of the host steps, in the order of the file.
    pub contacts: Vec<ContactStep>,
    /// Whether the file has its end; `false` if its writer was killed.
    pub complete: bool,
}

/// The ticks of a log, in the order of the file.
///
/// # Errors
/// As [`Log::parse`].
pub fn read_log(bytes: &[u8]) -> Result<Vec<TickRow>, IndexError> {
    Ok(Log::parse(bytes)?.rows)
}

impl Log {
    /// Reads a log. A file that ends early yields all ticks before its end. Channels that palpate did not write
    /// are skipped.
    ///
    /// # Errors
    /// If the bytes are no MCAP file, are damaged before their end, or hold no ticks in the layout of this
    /// version.
    pub fn parse(bytes: &[u8]) -> Result<Self, IndexError> {
        Self::read(&mut LogIndex::open(Cursor::new(bytes))?)
    }

    /// Reads all chunks of an open log.
    ///
    /// # Errors
    /// As [`Log::parse`].
    pub fn read<R: Read + Seek>(from: &mut LogIndex<R>) -> Result<Self, IndexError> {
        let mut log = Self {
            facts: from.facts().clone(),
            limits: from.limits().to_vec(),
            scene: from.scene().to_owned(),
            files: from.files().clone(),
            complete: from.is_complete(),
            ..Self::default()
        };
        for number in 0..from.chunk_count() {
            let chunk = from.read_chunk(number)?;
            log.rows.extend_from_slice(chunk.records());
            log.models.extend_from_slice(chunk.records());
            log.patches.extend_from_slice(chunk.records());
            log.tears.extend_from_slice(chunk.records());
            log.contacts.extend_from_slice(chunk.records());
        }
        Ok(log)
    }
}

/// Whether a definition has the fields of `own`, in its order. Comments and constants do not count: they name values, and
/// a later version of palpate may name more. Fields that `own` calls optional may be missing, as in logs of earlier versions.
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
    let lines = own.lines().filter(|line| !line.contains("# optional"));
    let earlier = lines.collect::<Vec<_>>().join("\n");
    found == own.as_bytes()
        || std::str::from_utf8(found).is_ok_and(|found| {
            let found = fields(found);
            found == fields(own) || found == fields(&earlier)
        })
}
