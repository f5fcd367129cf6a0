//! A link with latency: the host's end of the rings, under virtual time.

use rt_core::{LocalModel, TickRecord};
use runner::link::HostEnd;

/// The host's end of a link on which a model arrives some time after it was sent.
#[derive(Debug)]
pub struct LateLink {
    end: HostEnd,
    /// Time of arrival (ns), body and model, in the order of sending.
    under_way: Vec<(u64, usize, LocalModel)>,
}

impl LateLink {
    /// A link whose host's end is `end`, with room for `models` models that have not arrived.
    pub fn new(end: HostEnd, models: usize) -> Self {
        Self {
            end,
            under_way: Vec::with_capacity(models),
        }
    }

    /// Gives `see` every tick record that has arrived, oldest first.
    pub fn drain(&mut self, see: impl FnMut(&TickRecord)) {
        self.end.drain(see);
    }

    /// Sends a model of `body` that arrives at `arrival_ns`.
    pub fn send(&mut self, arrival_ns: u64, body: usize, model: &LocalModel) {
        self.under_way.push((arrival_ns, body, *model));
    }

    /// Gives the tick, and `see`, the models that have arrived by `now_ns`, in the order of sending.
    pub fn deliver(&mut self, now_ns: u64, mut see: impl FnMut(usize, &LocalModel)) {
        let end = &mut self.end;
        self.under_way.retain(|(arrival_ns, body, model)| {
            let arrived = *arrival_ns <= now_ns;
            if arrived {
                // The link counts a full ring.
                let _ = end.publish(*body, model);
                see(*body, model);
            }
            !arrived
        });
    }

    /// The host's end alone. Models that have not arrived are lost.
    pub(crate) fn into_end(self) -> HostEnd {
        self.end
    }
}
