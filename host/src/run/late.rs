//! A link with latency: the host's end of the rings, under virtual time.

use rt_core::tool::Patch;
use rt_core::{LocalModel, TickRecord};
use runner::link::HostEnd;

/// The host's end of a link on which a message arrives some time after it was sent.
#[derive(Debug)]
pub struct LateLink {
    end: HostEnd,
    models: Sent<LocalModel>,
    patches: Sent<Patch>,
}

/// Messages of a kind that have not arrived.
#[derive(Debug)]
struct Sent<M> {
    /// In the order of sending: the time of arrival (ns), the body or the device, and the message in its used part.
    under_way: Vec<(u64, usize, Box<M>)>,
    /// Room for further messages.
    room: Vec<Box<M>>,
}

impl<M> Sent<M> {
    /// Sends a message, which `copy` writes.
    fn send(&mut self, arrival_ns: u64, to: usize, new: fn() -> M, copy: impl FnOnce(&mut M)) {
        let mut message = self.room.pop().unwrap_or_else(|| Box::new(new()));
        copy(&mut message);
        self.under_way.push((arrival_ns, to, message));
    }

    /// Gives `see` the messages that have arrived by `now_ns`, in the order of sending.
    fn deliver(&mut self, now_ns: u64, mut see: impl FnMut(usize, &M)) {
        let arrived = |sent: &mut (u64, usize, Box<M>)| sent.0 <= now_ns;
        for (_, to, message) in self.under_way.extract_if(.., arrived) {
            see(to, &message);
            self.room.push(message);
        }
    }
}

impl LateLink {
    /// A link whose host's end is `end`, with room for `models` models that have not arrived.
    pub fn new(end: HostEnd, models: usize) -> Self {
        Self {
            end,
            models: Sent {
                under_way: Vec::with_capacity(models),
                room: (0..models).map(|_| Box::new(LocalModel::empty())).collect(),
            },
            patches: Sent {
                under_way: Vec::new(),
                room: Vec::new(),
            },
        }
    }

    /// Gives `see` every tick record that has arrived, oldest first.
    pub fn drain(&mut self, see: impl FnMut(&TickRecord)) {
        self.end.drain(see);
    }

    /// Sends a model of `body` that arrives at `arrival_ns`.
    pub fn send(&mut self, arrival_ns: u64, body: usize, model: &LocalModel) {
        let copy = |room: &mut LocalModel| room.copy_used_from(model);
        (self.models).send(arrival_ns, body, LocalModel::empty, copy);
    }

    /// Sends a patch for the tool of a device that arrives at `arrival_ns`.
    pub fn send_patch(&mut self, arrival_ns: u64, device: usize, patch: &Patch) {
        let copy = |room: &mut Patch| room.copy_used_from(patch);
        (self.patches).send(arrival_ns, device, Patch::empty, copy);
    }

    /// Gives the tick the messages that have arrived by `now_ns`, in the order of sending, and `see` the models. Only the used
    /// part of a model is that of the model that was sent.
    pub fn deliver(&mut self, now_ns: u64, mut see: impl FnMut(usize, &LocalModel)) {
        let end = &mut self.end;
        // The link counts a full ring.
        self.models.deliver(now_ns, |body, model| {
            let _ = end.publish(body, model);
            see(body, model);
        });
        self.patches.deliver(now_ns, |device, patch| {
            let _ = end.publish_patch(device, patch);
        });
    }

    /// The host's end alone. Messages that have not arrived are lost.
    pub(crate) fn into_end(self) -> HostEnd {
        self.end
    }
}
