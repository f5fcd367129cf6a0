//! The curves of the last seconds, as frames bring them.

use host::live::Folded;
use std::collections::VecDeque;

/// The folded ticks of the last seconds, oldest first.
#[derive(Clone, Debug)]
pub struct History {
    pieces: VecDeque<Folded>,
    span_ns: u64,
}

impl History {
    /// A history that keeps `seconds` of the run's own time.
    pub fn new(seconds: f64) -> Self {
        Self {
            pieces: VecDeque::new(),
            span_ns: (seconds * 1e9) as u64,
        }
    }

    /// Adds the ticks of a frame, and forgets what is older than the span. A piece that lies before the last one begins
    /// the history anew: somebody jumped back in a log.
    pub fn push(&mut self, folded: &Folded) {
        if folded.ticks == 0 {
            return;
        }
        if self
            .pieces
            .back()
            .is_some_and(|last| folded.to_ns < last.to_ns)
        {
            self.pieces.clear();
        }
        self.pieces.push_back(folded.clone());
        let oldest = folded.to_ns.saturating_sub(self.span_ns);
        while self
            .pieces
            .front()
            .is_some_and(|piece| piece.to_ns < oldest)
        {
            self.pieces.pop_front();
        }
    }

    /// Replaces the history.
    pub fn replace(&mut self, pieces: Vec<Folded>) {
        self.pieces = pieces.into();
    }

    /// The pieces, oldest first.
    pub fn pieces(&self) -> impl DoubleEndedIterator<Item = &Folded> {
        self.pieces.iter()
    }
}
