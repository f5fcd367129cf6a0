//! A link that takes its time: the host's end of the rings, under virtual time.

use rt_core::{LocalModel, TickRecord};
use runner::link::HostEnd;

/// The host's end of a link on which models are under way for a while.
#[derive(Debug)]
pub struct LateLink {
    end: HostEnd,
    /// Arrival (ns), body and model, in the order in which they were sent.
    under_way: Vec<(u64, usize, LocalModel)>,
}

impl LateLink {
    /// The link whose host's end is `end`; so many models are expected to be under way at once.
    pub fn new(end: HostEnd, models: usize) -> Self {
        Self {
            end,
            under_way: Vec::with_capacity(models),
        }
    }

    /// Gives `see` every tick's record that has come, oldest first.
    pub fn drain(&mut self, see: impl FnMut(&TickRecord)) {
        self.end.drain(see);
    }

    /// Sends a model of `body` that arrives at `arrival_ns`.
    pub fn send(&mut self, arrival_ns: u64, body: usize, model: &LocalModel) {
        self.under_way.push((arrival_ns, body, *model));
    }

    /// Hands over to the tick what has arrived by `now_ns`, and gives it to `see`, in the order in which it was sent.
    pub fn deliver(&mut self, now_ns: u64, mut see: impl FnMut(usize, &LocalModel)) {
        let end = &mut self.end;
        self.under_way.retain(|(arrival_ns, body, model)| {
            let arrived = *arrival_ns <= now_ns;
            if arrived {
                // A full ring is counted by the link.
                let _ = end.publish(*body, model);
                see(*body, model);
            }
            !arrived
        });
    }

    /// The host's end alone; what is under way is lost.
    pub(crate) fn into_end(self) -> HostEnd {
        self.end
    }
}
