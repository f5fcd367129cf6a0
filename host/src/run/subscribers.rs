//! The subscribers to the host steps of a run. No subscriber changes the state of the run.

use super::contacts::ContactSender;
use super::tears::TearSender;
use crate::engine::Engine;
use crate::snapshot::Subscriber;
use std::time::Instant;

/// The subscribers of a run. By default there are none.
#[derive(Default)]
pub struct Subscribers {
    /// Who takes snapshots of the bodies: the frames on disk, the log, the viewers.
    pub snapshots: Vec<Subscriber>,
    /// Passes on the edits of tears; `None` if no body tears.
    pub tears: Option<TearSender>,
    /// Passes on the contacts; `None` if nothing touches.
    pub contacts: Option<ContactSender>,
}

impl Subscribers {
    /// Tells every subscriber of the step of `engine` that was due at `time_ns`. `skipped` is the number of steps that the
    /// host left out so far.
    pub(super) fn after_step(&mut self, time_ns: u64, skipped: u64, engine: &Engine) {
        if let Some(tears) = &mut self.tears {
            tears.after_step(time_ns, engine.stats().steps, engine.bodies());
        }
        if let Some((sender, contact)) = self.contacts.as_mut().zip(engine.contact()) {
            sender.after_step(time_ns, engine.stats().steps, contact.contacts());
        }
        if self.snapshots.is_empty() {
            return;
        }
        let now = Instant::now();
        for subscriber in &mut self.snapshots {
            subscriber.after_step(now, time_ns, skipped, engine);
        }
    }
}
