//! Merges a frame that a viewer did not take into the frame after it, so that the viewer misses no spike and no event.

use super::frame::{Frame, LogMessage};
use super::gather::MAX_EVENTS;

/// Most bytes of the log's messages in a frame that was merged.
pub const MAX_LOG: usize = 256 << 10;

impl Frame {
    /// Adds the curves, the events and the log's messages of `older`, the frame before, which the viewer did not take.
    /// If this frame has no vertices of a body, it takes those of `older`. The frame then counts `older` and the
    /// frames that `older` counts as dropped.
    ///
    /// Of the events, the first [`MAX_EVENTS`] are kept, and of the log's messages the first that have at most
    /// [`MAX_LOG`] bytes together. The others are counted. Frames may be merged in any grouping, with the same result.
    pub fn merge_before(&mut self, older: Self) {
        self.folded.merge_before(&older.folded);
        self.dropped += older.dropped + 1;
        self.last |= older.last;
        if self.host.is_none() {
            self.host = older.host;
        }
        if self.bodies.is_empty() {
            self.bodies = older.bodies;
        } else {
            for (body, older) in self.bodies.iter_mut().zip(older.bodies) {
                if body.vertices.is_none() {
                    body.vertices = older.vertices;
                }
            }
        }
        if self.hands.is_empty() {
            self.hands = older.hands;
        }

        let newer = std::mem::replace(&mut self.events, older.events);
        // After a gap in the list, later events are counted, too.
        let room = if older.more_events == 0 {
            MAX_EVENTS.saturating_sub(self.events.len())
        } else {
            0
        };
        let kept = room.min(newer.len());
        self.more_events += older.more_events + (newer.len() - kept) as u64;
        self.events.extend(newer.into_iter().take(kept));

        let newer = std::mem::replace(&mut self.log, older.log);
        let kept = if older.more_log == 0 {
            let taken = self.log.iter().map(|message| message.data.len()).sum();
            fitting(taken, &newer)
        } else {
            0
        };
        self.more_log += older.more_log + (newer.len() - kept) as u64;
        self.log.extend(newer.into_iter().take(kept));
    }
}

/// The number of the first messages that fit in addition to `taken` bytes.
fn fitting(taken: usize, messages: &[LogMessage]) -> usize {
    let mut bytes = taken;
    let fits = messages.iter().take_while(|message| {
        bytes = bytes.saturating_add(message.data.len());
        bytes <= MAX_LOG
    });
    fits.count()
}

#[cfg(test)]
mod tests;
