//! The overview of a log: the run in pieces of half a second, its events and its totals. The writer of a log attaches
//! the overview at the end, so that a player shows the whole run without reading the ticks.

use super::TickRow;
use super::fold::{Fold, FoldFacts, Sums, join};
use crate::live::{Bins, Event, EventKind, Folded, Totals};
use runner::latency::Latencies;
use serde::{Deserialize, Serialize};

/// Version of the overview.
pub const SCHEMA: &str = "palpate.overview/1";
/// Length of a piece (ns).
const PIECE_NS: u64 = 500_000_000;
/// Most pieces. A longer run has longer pieces: an hour of half seconds fits.
const MOST_PIECES: usize = 8192;
/// Most events.
pub const MOST_EVENTS: usize = 1000;

/// The overview of a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Overview {
    /// [`SCHEMA`].
    pub schema: String,
    /// The run in pieces, in order.
    pub pieces: Vec<Piece>,
    /// The first events, in order.
    pub events: Vec<Event>,
    /// Events that are left out because there were too many.
    pub more_events: u64,
    /// The totals of the whole log.
    pub totals: Totals,
}

/// A part of the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Piece {
    /// Its ticks, folded.
    pub folded: Folded,
    /// The sums from the start of the run to its last tick.
    pub sums: Sums,
}

/// Makes an overview, tick by tick.
#[derive(Debug)]
pub struct OverviewBuilder {
    fold: Fold,
    pieces: Vec<Piece>,
    piece_ns: u64,
    events: Vec<Event>,
    more_events: u64,
    /// Tick, time (ns) and lateness (ns) of the tick with the largest lateness.
    worst: Option<(u64, u64, u64)>,
    latencies: Latencies,
}

impl OverviewBuilder {
    /// An overview without ticks.
    pub fn new(facts: FoldFacts) -> Self {
        Self {
            latencies: Latencies::new(facts.bodies.len()),
            fold: Fold::new(facts),
            pieces: Vec::new(),
            piece_ns: PIECE_NS,
            events: Vec::new(),
            more_events: 0,
            worst: None,
        }
    }

    /// Adds a tick.
    pub fn take(&mut self, row: &TickRow) {
        let begins = self
            .pieces
            .last()
            .is_none_or(|piece| row.time_ns / self.piece_ns != piece.folded.from_ns / self.piece_ns);
        if begins {
            self.begin_piece();
        }
        let (events, more) = (&mut self.events, &mut self.more_events);
        if let Some(piece) = self.pieces.last_mut() {
            self.fold.take(row, &mut piece.folded, |event| {
                if events.len() < MOST_EVENTS {
                    events.push(event);
                } else {
                    *more += 1;
                }
            });
            piece.sums.clone_from(self.fold.sums());
        }
        if self
            .worst
            .map_or(row.lateness_ns > 0, |(_, _, most)| row.lateness_ns > most)
        {
            self.worst = Some((row.tick, row.time_ns, row.lateness_ns));
        }
        self.latencies.lateness.record(row.lateness_ns);
        for (age, body) in self.latencies.model_age.iter_mut().zip(&row.bodies) {
            if body.sequence > 0 {
                age.record(body.age_ns);
            }
        }
    }

    fn begin_piece(&mut self) {
        if self.pieces.len() >= MOST_PIECES {
            self.piece_ns = self.piece_ns.saturating_mul(2);
            let pairs = self.pieces.chunks(2).map(|pair| {
                let mut joined = Piece::default();
                for piece in pair {
                    join(&mut joined.folded, &piece.folded);
                    joined.sums.clone_from(&piece.sums);
                }
                joined
            });
            self.pieces = pairs.collect();
        }
        self.pieces.push(Piece::default());
    }

    /// The overview of the ticks so far. `timed` tells whether the lateness was measured, as under the real clock.
    pub fn finish(mut self, timed: bool) -> Overview {
        if let Some((tick, time_ns, lateness_ns)) = self.worst.filter(|_| timed) {
            let late = lateness_ns as f64 * 1e-3;
            let worst = Event {
                kind: EventKind::WorstTick,
                tick,
                time_ns,
                text: format!("worst tick: {late:.1} µs late"),
            };
            let at = self.events.partition_point(|event| event.tick <= tick);
            self.events.insert(at, worst);
        }
        let sums = self.fold.sums();
        let latencies = &self.latencies;
        let summary = |histogram: &runner::latency::LatencyHistogram| histogram.summary().into();
        let totals = Totals {
            lateness: timed.then(|| summary(&latencies.lateness)),
            model_age: latencies.model_age.iter().map(summary).collect(),
            lateness_bins: if timed {
                Bins(latencies.lateness.intervals().collect())
            } else {
                Bins::default()
            },
            ..totals(sums)
        };
        Overview {
            schema: SCHEMA.into(),
            pieces: self.pieces,
            events: self.events,
            more_events: self.more_events,
            totals,
        }
    }
}

/// The totals that follow from the sums alone.
pub fn totals(sums: &Sums) -> Totals {
    Totals {
        ticks: sums.ticks,
        missed: sums.missed,
        longest_miss: sums.longest_miss,
        lost: sums.lost,
        trips: sums.trips,
        stale: sums.stale,
        ..Totals::default()
    }
}

impl Overview {
    /// The overview in the bytes of an attachment; `None` if they are of another version, or contradict themselves.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let overview: Self = serde_json::from_slice(bytes).ok()?;
        let in_order = |pair: &[Piece]| match pair {
            [a, b] => a.folded.to_ns < b.folded.from_ns && a.folded.last < b.folded.first,
            _ => true,
        };
        let sound = overview.schema == SCHEMA
            && overview.pieces.len() <= MOST_PIECES
            && overview.events.len() <= MOST_EVENTS + 1
            && overview.pieces.windows(2).all(in_order)
            && overview.events.is_sorted_by_key(|event| event.tick)
            && overview
                .pieces
                .iter()
                .all(|piece| piece.folded.from_ns <= piece.folded.to_ns && piece.folded.ticks > 0);
        sound.then_some(overview)
    }

    /// The overview as the bytes of an attachment.
    pub fn to_bytes(&self) -> Vec<u8> {
        // Text keys and finite numbers: writing to memory cannot fail.
        serde_json::to_vec(self).unwrap_or_default()
    }
}
