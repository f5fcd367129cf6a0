//! A link with latency: the host's end of the rings, under virtual time.

use rt_core::{LocalModel, TickRecord};
use runner::link::HostEnd;

/// The host's end of a link on which a model arrives some time after it was sent.
#[derive(Debug)]
pub struct LateLink {
    end: HostEnd,
    /// The models that have not arrived, in the order of sending.
    under_way: Vec<Sent>,
    /// Room for further models.
    room: Vec<Box<LocalModel>>,
}

/// A model that has not arrived.
#[derive(Debug)]
struct Sent {
    arrival_ns: u64,
    body: usize,
    /// The model in its used part.
    model: Box<LocalModel>,
}

impl LateLink {
    /// A link whose host's end is `end`, with room for `models` models that have not arrived.
    pub fn new(end: HostEnd, models: usize) -> Self {
        Self {
            end,
            under_way: Vec::with_capacity(models),
            room: (0..models).map(|_| Box::new(LocalModel::empty())).collect(),
        }
    }

    /// Gives `see` every tick record that has arrived, oldest first.
    pub fn drain(&mut self, see: impl FnMut(&TickRecord)) {
        self.end.drain(see);
    }

    /// Sends a model of `body` that arrives at `arrival_ns`.
    pub fn send(&mut self, arrival_ns: u64, body: usize, model: &LocalModel) {
        let free = self.room.pop();
        let mut copy = free.unwrap_or_else(|| Box::new(LocalModel::empty()));
        copy.copy_used_from(model);
        self.under_way.push(Sent {
            arrival_ns,
            body,
            model: copy,
        });
    }

    /// Gives the tick, and `see`, the models that have arrived by `now_ns`, in the order of sending. Only the used part
    /// of a model is that of the model that was sent.
    pub fn deliver(&mut self, now_ns: u64, mut see: impl FnMut(usize, &LocalModel)) {
        let arrived = |sent: &mut Sent| sent.arrival_ns <= now_ns;
        for Sent { body, model, .. } in self.under_way.extract_if(.., arrived) {
            // The link counts a full ring.
            let _ = self.end.publish(body, &*model);
            see(body, &model);
            self.room.push(model);
        }
    }

    /// The host's end alone. Models that have not arrived are lost.
    pub(crate) fn into_end(self) -> HostEnd {
        self.end
    }
}
