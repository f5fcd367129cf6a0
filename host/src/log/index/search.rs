//! Ticks and frames by their time.

use super::decode::Decoded;
use super::{Chunk, IndexError, LogIndex};
use crate::record::{BodyFrame, Cloud, ContactStep, Kind, PatchRow, Surface, TickRow};
use std::io::{Read, Seek};

/// The place of a tick in the log. Places are in the order of the ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TickAt {
    chunk: usize,
    row: usize,
}

/// A body after a host step.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyFrameAt {
    /// The step and the topology epoch.
    pub frame: BodyFrame,
    /// Positions (m), three numbers a vertex.
    pub positions: Vec<f32>,
}

impl Chunk {
    /// Whether the chunk may hold messages of `channel`.
    fn may_have(&self, channel: u16) -> bool {
        let channels = self.channels.as_ref();
        channels.is_none_or(|channels| channels.contains(&channel))
    }
}

impl Decoded {
    /// The newest record of this kind at or before `time_ns` on a channel.
    fn newest<K: Kind>(&self, channel: u16, time_ns: u64) -> Option<&K> {
        self.newest_that(channel, time_ns, |_| true)
    }

    /// The newest of these records that `fits`.
    fn newest_that<K: Kind>(
        &self,
        channel: u16,
        time_ns: u64,
        fits: impl Fn(&K) -> bool,
    ) -> Option<&K> {
        let list = self.of::<K>()?;
        let mut records = list.places.iter().zip(&list.records).rev();
        let newest =
            records.find(|((of, at), record)| *of == channel && *at <= time_ns && fits(record));
        newest.map(|(_, record)| record)
    }
}

impl<R: Read + Seek> LogIndex<R> {
    /// The tick at a place that this log gave.
    ///
    /// # Errors
    /// [`IndexError`] if the chunk cannot be read again.
    pub fn row(&mut self, place: TickAt) -> Result<Option<TickRow>, IndexError> {
        let chunk = self.chunk(place.chunk)?;
        Ok(chunk.records().get(place.row).cloned())
    }

    /// The first tick; `None` for a log without ticks.
    ///
    /// # Errors
    /// [`IndexError`].
    pub fn first(&mut self) -> Result<Option<TickAt>, IndexError> {
        self.first_in(0..self.chunks.len())
    }

    /// The last tick; `None` for a log without ticks.
    ///
    /// # Errors
    /// [`IndexError`].
    pub fn last(&mut self) -> Result<Option<TickAt>, IndexError> {
        self.last_in(0..self.chunks.len(), u64::MAX)
    }

    /// The tick after a place.
    ///
    /// # Errors
    /// [`IndexError`].
    pub fn next(&mut self, place: TickAt) -> Result<Option<TickAt>, IndexError> {
        let row = place.row + 1;
        if row < self.chunk(place.chunk)?.records::<TickRow>().len() {
            return Ok(Some(TickAt { row, ..place }));
        }
        self.first_in(place.chunk + 1..self.chunks.len())
    }

    /// The tick before a place.
    ///
    /// # Errors
    /// [`IndexError`].
    pub fn previous(&mut self, place: TickAt) -> Result<Option<TickAt>, IndexError> {
        match place.row.checked_sub(1) {
            Some(row) => Ok(Some(TickAt { row, ..place })),
            None => self.last_in(0..place.chunk, u64::MAX),
        }
    }

    /// The last tick at or before `time_ns`; `None` before the first tick.
    ///
    /// # Errors
    /// [`IndexError`].
    pub fn tick_at(&mut self, time_ns: u64) -> Result<Option<TickAt>, IndexError> {
        self.last_in(0..self.chunks.len(), time_ns)
    }

    /// The newest frame of the body of this name at or before `time_ns`.
    ///
    /// # Errors
    /// [`IndexError`].
    pub fn frame_at(
        &mut self,
        name: &str,
        time_ns: u64,
    ) -> Result<Option<BodyFrameAt>, IndexError> {
        let clouds = self.channels.named::<Cloud>(name);
        let frames = self.channels.named::<BodyFrame>(name);
        let (Some(clouds), Some(frames)) = (clouds, frames) else {
            return Ok(None);
        };
        let mut found: Option<Cloud> = None;
        for number in (0..self.chunks.len()).rev() {
            let chunk = self.chunks.get(number);
            if chunk.is_none_or(|chunk| {
                chunk.from_ns > time_ns || !(chunk.may_have(clouds) || chunk.may_have(frames))
            }) {
                continue;
            }
            let decoded = self.chunk(number)?;
            if found.is_none() {
                found = decoded.newest(clouds, time_ns).cloned();
            }
            // A chunk may end between the two messages of a frame.
            if let Some(cloud) = &mut found {
                let facts = decoded.newest::<BodyFrame>(frames, cloud.time_ns);
                if let Some(frame) = facts.filter(|facts| facts.time_ns == cloud.time_ns) {
                    return Ok(Some(BodyFrameAt {
                        frame: *frame,
                        positions: std::mem::take(&mut cloud.positions),
                    }));
                }
            }
        }
        Ok(None)
    }

    /// The newest surface of the body of this name at or before `time_ns`.
    ///
    /// # Errors
    /// [`IndexError`].
    pub fn surface_at(&mut self, name: &str, time_ns: u64) -> Result<Option<Surface>, IndexError> {
        self.newest_at(name, time_ns)
    }

    /// The contacts of the newest host step at or before `time_ns`; `None` in a log without contacts.
    ///
    /// # Errors
    /// [`IndexError`].
    pub fn contacts_at(&mut self, time_ns: u64) -> Result<Option<ContactStep>, IndexError> {
        self.newest_at("", time_ns)
    }

    /// The patch of this number for the tool of a device, which was published at or before `time_ns`; `None` if the log lacks it.
    ///
    /// # Errors
    /// [`IndexError`].
    pub fn patch_at(
        &mut self,
        (device, sequence): (u8, u64),
        time_ns: u64,
    ) -> Result<Option<PatchRow>, IndexError> {
        let fits = |row: &PatchRow| row.device == device && row.sequence <= sequence;
        let found = self.newest_that("", time_ns, fits)?;
        Ok(found.filter(|row| row.sequence == sequence))
    }

    /// The newest record of a kind at or before `time_ns`, on the channel of the body of this name.
    fn newest_at<K: Kind>(&mut self, name: &str, time_ns: u64) -> Result<Option<K>, IndexError> {
        self.newest_that(name, time_ns, |_| true)
    }

    /// The newest of these records that `fits`.
    fn newest_that<K: Kind>(
        &mut self,
        name: &str,
        time_ns: u64,
        fits: impl Fn(&K) -> bool,
    ) -> Result<Option<K>, IndexError> {
        let Some(channel) = self.channels.named::<K>(name) else {
            return Ok(None);
        };
        for number in (0..self.chunks.len()).rev() {
            let chunk = self.chunks.get(number);
            if chunk.is_none_or(|chunk| chunk.from_ns > time_ns || !chunk.may_have(channel)) {
                continue;
            }
            let chunk = self.chunk(number)?;
            if let Some(record) = chunk.newest_that(channel, time_ns, &fits) {
                return Ok(Some(record.clone()));
            }
        }
        Ok(None)
    }

    /// Whether the log has channels for frames of bodies.
    pub fn has_frames(&self) -> bool {
        self.channels.of::<Cloud>().next().is_some()
    }

    /// Gives `see` every tick from the place `from` on while `see` returns true.
    ///
    /// # Errors
    /// [`IndexError`].
    pub fn ticks_from(
        &mut self,
        from: TickAt,
        mut see: impl FnMut(TickAt, &TickRow) -> bool,
    ) -> Result<(), IndexError> {
        let mut start = from.row;
        for number in from.chunk..self.chunks.len() {
            if self.may_have_ticks(number) {
                let chunk = self.chunk(number)?;
                for (row, tick) in chunk.records().iter().enumerate().skip(start) {
                    if !see(TickAt { chunk: number, row }, tick) {
                        return Ok(());
                    }
                }
            }
            start = 0;
        }
        Ok(())
    }

    fn may_have_ticks(&self, number: usize) -> bool {
        let chunk = self.chunks.get(number);
        chunk.is_some_and(|chunk| {
            chunk.channels.is_none() || self.channels.of::<TickRow>().any(|id| chunk.may_have(id))
        })
    }

    /// The first tick in these chunks.
    fn first_in(
        &mut self,
        chunks: impl Iterator<Item = usize>,
    ) -> Result<Option<TickAt>, IndexError> {
        for chunk in chunks {
            if self.may_have_ticks(chunk) && !self.chunk(chunk)?.records::<TickRow>().is_empty() {
                return Ok(Some(TickAt { chunk, row: 0 }));
            }
        }
        Ok(None)
    }

    /// The last tick in these chunks at or before `time_ns`.
    fn last_in(
        &mut self,
        chunks: impl DoubleEndedIterator<Item = usize>,
        time_ns: u64,
    ) -> Result<Option<TickAt>, IndexError> {
        for chunk in chunks.rev() {
            // The models of a chunk may be older than its ticks, but no tick is older than the chunk says.
            let later = self.chunks.get(chunk);
            if later.is_none_or(|later| later.from_ns > time_ns) || !self.may_have_ticks(chunk) {
                continue;
            }
            let decoded = self.chunk(chunk)?;
            let ticks = decoded.records::<TickRow>();
            let before = ticks.partition_point(|row| row.time_ns <= time_ns);
            if let Some(row) = before.checked_sub(1) {
                return Ok(Some(TickAt { chunk, row }));
            }
        }
        Ok(None)
    }
}
