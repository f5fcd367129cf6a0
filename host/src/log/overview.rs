//! The overview of a log: the run in intervals of half a second, its events and its totals. The writer of a log attaches
//! the overview at the end, so that a player shows the whole run without reading the ticks.

use crate::live::gather::{Checkpoint, Gatherer, TickView};
use crate::live::{Event, Folded, Totals};
use crate::record::TearEvent;
use crate::scene::source::printable;
use serde::{Deserialize, Serialize};

/// Version of the overview.
pub const SCHEMA: &str = "palpate.overview/1";
/// Length of a piece (ns).
const PIECE_NS: u64 = 500_000_000;
/// Most pieces. A longer run has longer pieces: an hour of half seconds fits.
const MOST_PIECES: usize = 8192;
/// Most events in addition to the worst tick.
pub const MOST_EVENTS: usize = 1000;

/// The overview of a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Overview {
    /// [`SCHEMA`].
    pub schema: String,
    /// The run in pieces, in order.
    pub pieces: Vec<Interval>,
    /// The first events and the worst tick, in order.
    pub events: Vec<Event>,
    /// Events that are left out because there were too many.
    pub more_events: u64,
    /// The totals of the whole log.
    pub totals: Totals,
}

/// A part of the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Its ticks, folded.
    pub folded: Folded,
    /// The sums from the start of the run to its last tick.
    pub sums: Checkpoint,
}

/// Makes an overview, tick by tick.
#[derive(Clone, Debug)]
pub struct OverviewBuilder {
    gatherer: Gatherer,
    pieces: Vec<Interval>,
    piece_ns: u64,
    /// Time at which the present piece ends (ns); `None` before the first tick.
    until_ns: Option<u64>,
    events: Vec<Event>,
    more_events: u64,
}

impl OverviewBuilder {
    /// An overview without ticks. `gatherer` has taken no tick.
    pub fn new(gatherer: Gatherer) -> Self {
        Self {
            gatherer,
            pieces: Vec::new(),
            piece_ns: PIECE_NS,
            until_ns: None,
            events: Vec::new(),
            more_events: 0,
        }
    }

    /// Adds a tick.
    pub fn take(&mut self, tick: &TickView<'_>) {
        if self.until_ns.is_none_or(|until| tick.time_ns >= until) {
            self.end_piece();
            let number = tick.time_ns / self.piece_ns;
            self.until_ns = Some(number.saturating_add(1).saturating_mul(self.piece_ns));
        }
        self.gatherer.take(tick);
        let (events, more) = self.gatherer.events();
        let room = MOST_EVENTS.saturating_sub(self.events.len());
        self.more_events += more + events.len().saturating_sub(room) as u64;
        self.events.extend(events.into_iter().take(room));
    }

    /// Adds an edit by which a body tore, before the tick that follows the edit. `words` say what happened.
    pub fn tear(&mut self, tick: &TickView<'_>, event: &TearEvent, words: &str) {
        self.gatherer.tear(tick, event, words);
    }

    /// Ends the present piece, if it has ticks.
    fn end_piece(&mut self) {
        let sums = self.gatherer.checkpoint();
        let folded = self.gatherer.folded();
        if folded.ticks == 0 {
            return;
        }
        self.pieces.push(Interval { folded, sums });
        if self.pieces.len() >= MOST_PIECES {
            self.piece_ns = self.piece_ns.saturating_mul(2);
            let pieces = std::mem::take(&mut self.pieces);
            for piece in pieces {
                match self.pieces.last_mut() {
                    Some(last) if last.number(self.piece_ns) == piece.number(self.piece_ns) => {
                        last.join(piece);
                    }
                    _ => self.pieces.push(piece),
                }
            }
        }
    }

    /// The overview of the ticks so far.
    pub fn finish(mut self) -> Overview {
        self.end_piece();
        if let Some(worst) = self.gatherer.worst_tick() {
            let at = self
                .events
                .partition_point(|event| event.tick <= worst.tick);
            self.events.insert(at, worst);
        }
        Overview {
            schema: SCHEMA.into(),
            pieces: self.pieces,
            events: self.events,
            more_events: self.more_events,
            totals: self.gatherer.totals(),
        }
    }
}

impl Interval {
    /// Number of the piece among pieces of this length (ns).
    fn number(&self, piece_ns: u64) -> u64 {
        self.folded.from_ns / piece_ns
    }

    /// Adds the piece after this one.
    fn join(&mut self, mut next: Self) {
        next.folded.merge_before(&self.folded);
        *self = next;
    }
}

/// At most `most` intervals. Each of them joins some neighbours of `pieces`.
pub fn at_most<'a>(most: usize, pieces: impl ExactSizeIterator<Item = &'a Folded>) -> Vec<Folded> {
    let each = pieces.len().div_ceil(most.max(1)).max(1);
    let mut joined: Vec<Folded> = Vec::new();
    for (index, piece) in pieces.enumerate() {
        let mut piece = piece.clone();
        match joined.last_mut() {
            Some(last) if !index.is_multiple_of(each) => {
                piece.merge_before(last);
                *last = piece;
            }
            _ => joined.push(piece),
        }
    }
    joined
}

impl Overview {
    /// The overview in the bytes of an attachment; `None` if they are of another version, or contradict themselves.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let mut overview: Self = serde_json::from_slice(bytes).ok()?;
        for event in &mut overview.events {
            // A viewer prints it.
            event.text = printable(&event.text);
        }
        let in_order = |pair: &[Interval]| match pair {
            [a, b] => a.folded.to_ns < b.folded.from_ns && a.folded.last < b.folded.first,
            _ => true,
        };
        let mut pieces = overview.pieces.iter().map(|piece| &piece.folded);
        let sound = overview.schema == SCHEMA
            && overview.pieces.len() <= MOST_PIECES
            && overview.events.len() <= MOST_EVENTS + 1
            && overview.pieces.windows(2).all(in_order)
            && overview.events.is_sorted_by_key(|event| event.tick)
            && pieces.all(|piece| piece.from_ns <= piece.to_ns && piece.ticks > 0);
        sound.then_some(overview)
    }

    /// The overview as the bytes of an attachment.
    pub fn to_bytes(&self) -> Vec<u8> {
        // Text keys and finite numbers: writing to memory cannot fail.
        serde_json::to_vec(self).unwrap_or_default()
    }
}
