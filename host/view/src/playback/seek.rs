//! Jumps: to a time, by ticks, to events.

use super::{PIECES, Player, PlayerError, SPAN};
use host::live::gather::Gatherer;
use host::live::{Folded, Message};
use host::log::index::TickAt;
use std::io::{Read, Seek};
use std::time::Duration;

/// Ticks up to which a step goes from tick to tick. Larger steps search by the number of the tick.
const NEAR: u64 = 2000;

impl<R: Read + Seek + Send> Player<R> {
    /// Shows the tick at `time_ns`, or the last tick before it; before the first tick, the first.
    pub(super) fn seek(&mut self, time_ns: u64) -> Result<(), PlayerError> {
        let place = match self.log.tick_at(time_ns)? {
            Some(place) => Some(place),
            None => self.log.first()?,
        };
        match place {
            Some(place) => self.show(place),
            None => Ok(()),
        }
    }

    /// Shows the tick at a place of the log, after the curves before it.
    pub(super) fn show(&mut self, place: TickAt) -> Result<(), PlayerError> {
        let Some(row) = self.log.row(place)? else {
            return Ok(());
        };
        let gatherer = self.gatherer_before(place, row.time_ns)?;
        let curves = self.curves(place, row.time_ns)?;
        self.history.replace(curves.clone());
        self.gatherer = gatherer;
        self.gatherer.take(&(&row).into());
        self.place = place;
        self.at_ns = row.time_ns as f64;
        self.waited = Duration::ZERO;
        self.waiting.push_back(Message::History(curves));
        self.make_frame(true)
    }

    /// A gatherer that has taken the ticks before `place`: its sums are those of the overview's pieces before `place`,
    /// and of the ticks since.
    fn gatherer_before(&mut self, place: TickAt, time_ns: u64) -> Result<Gatherer, PlayerError> {
        let mut gatherer = self.facts.gatherer.clone();
        let pieces = &self.overview.pieces;
        let before = pieces.partition_point(|piece| piece.folded.to_ns < time_ns);
        let piece = before.checked_sub(1).and_then(|i| pieces.get(i));
        let mut start = self.log.first()?;
        if let Some(piece) = piece
            && let Some(last) = self.log.tick_at(piece.folded.to_ns)?
            && last < place
            && let Some(row) = self.log.row(last)?
        {
            gatherer = gatherer.resume(&piece.sums, &(&row).into());
            start = self.log.next(last)?;
        }
        if let Some(start) = start {
            self.log.ticks_from(start, |at, row| {
                if at < place {
                    gatherer.take(&row.into());
                }
                at < place
            })?;
        }
        // Their curves and events are not those of the frame.
        let _ = (gatherer.folded(), gatherer.events());
        Ok(gatherer)
    }

    /// The curves of the ten seconds before the tick at `place`, without that tick.
    fn curves(&mut self, place: TickAt, time_ns: u64) -> Result<Vec<Folded>, PlayerError> {
        let span = (SPAN * 1e9) as u64;
        let from_ns = time_ns.saturating_sub(span);
        let start = match self.log.tick_at(from_ns)? {
            Some(start) => Some(start),
            None => self.log.first()?,
        };
        let Some(start) = start.filter(|start| *start < place) else {
            return Ok(Vec::new());
        };
        let each = span / PIECES;
        let mut gatherer = self.facts.gatherer.clone();
        let mut curves = Vec::new();
        let mut present = 0;
        self.log.ticks_from(start, |at, row| {
            if at >= place {
                return false;
            }
            let number = (row.time_ns.saturating_sub(from_ns) / each).min(PIECES - 1);
            if number != present {
                curves.push(gatherer.folded());
                present = number;
            }
            gatherer.take(&row.into());
            true
        })?;
        curves.push(gatherer.folded());
        curves.retain(|piece| piece.ticks > 0);
        Ok(curves)
    }

    /// Goes by a number of ticks, and pauses.
    pub(super) fn step(&mut self, ticks: i64) -> Result<(), PlayerError> {
        self.playing = false;
        let mut place = self.place;
        if ticks.unsigned_abs() <= NEAR {
            for _ in 0..ticks.unsigned_abs() {
                let next = if ticks > 0 {
                    self.log.next(place)?
                } else {
                    self.log.previous(place)?
                };
                match next {
                    Some(next) => place = next,
                    None => break,
                }
            }
        } else {
            let target = self.tick.saturating_add_signed(ticks);
            match self.tick_numbered(target)? {
                Some(found) => place = found,
                None => return Ok(()),
            }
        }
        if ticks == 1 && place != self.place {
            return self.step_on(place);
        }
        self.show(place)
    }

    /// Shows the next tick. The curves go on.
    fn step_on(&mut self, place: TickAt) -> Result<(), PlayerError> {
        let Some(row) = self.log.row(place)? else {
            return Ok(());
        };
        self.gatherer.take(&(&row).into());
        self.place = place;
        self.at_ns = row.time_ns as f64;
        self.waited = Duration::ZERO;
        self.make_frame(false)
    }

    /// The place of the tick of this number, or of the first tick after it; at the end, of the last tick.
    fn tick_numbered(&mut self, number: u64) -> Result<Option<TickAt>, PlayerError> {
        let pieces = &self.overview.pieces;
        let at = pieces.partition_point(|piece| piece.folded.last < number);
        let Some(piece) = pieces.get(at) else {
            return Ok(self.log.last()?);
        };
        let start = match self.log.tick_at(piece.folded.from_ns)? {
            Some(start) => Some(start),
            None => self.log.first()?,
        };
        let mut found = start;
        if let Some(start) = start {
            self.log.ticks_from(start, |place, row| {
                found = Some(place);
                row.tick < number
            })?;
        }
        Ok(found)
    }

    /// Goes to the next event, and pauses.
    pub(super) fn next_event(&mut self) -> Result<(), PlayerError> {
        let now = self.tick;
        let mut events = self.overview.events.iter();
        let next = events.find(|event| event.tick > now).map(|e| e.tick);
        self.show_event(next)
    }

    /// Goes to the event before the moment, and pauses.
    pub(super) fn previous_event(&mut self) -> Result<(), PlayerError> {
        let now = self.tick;
        let mut events = self.overview.events.iter().rev();
        let previous = events.find(|event| event.tick < now).map(|e| e.tick);
        self.show_event(previous)
    }

    fn show_event(&mut self, tick: Option<u64>) -> Result<(), PlayerError> {
        self.playing = false;
        let place = match tick {
            Some(tick) => self.tick_numbered(tick)?,
            None => None,
        };
        if let Some(place) = place {
            return self.show(place);
        }
        // No event lies in this direction: the moment stays.
        self.waiting.push_back(self.playback(false));
        Ok(())
    }
}
