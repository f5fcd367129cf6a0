//! Finds the events that ticks show: a limit of the last stage begins to act, a model becomes too old, or a tool goes beyond what its patch has.

use super::TickView;
use rt_core::MAX_DEVICES;

/// A change from one tick to the next: the index of the device or of the body, and the new state in words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Change {
    /// A limit of the last stage of a device began to act.
    Trip(usize, &'static str),
    /// The model of a body became too old.
    Stale(usize, &'static str),
    /// The tool of a device went beyond the surface that its patch has.
    Beyond(usize),
}

/// The states of the last tick.
#[derive(Clone, Debug, Default)]
pub(super) struct Watch {
    limits: Vec<Option<&'static str>>,
    old: Vec<bool>,
    /// By device.
    beyond: [bool; MAX_DEVICES],
}

impl Watch {
    /// The changes in this tick.
    pub(super) fn take(&mut self, tick: &TickView<'_>) -> Vec<Change> {
        let mut changes = Vec::new();
        self.limits.resize(tick.devices.len(), None);
        self.old.resize(tick.bodies.len(), false);
        for (index, (device, before)) in tick.devices.iter().zip(&mut self.limits).enumerate() {
            let now = device.safety.words();
            if let Some(words) = now
                && *before != now
            {
                changes.push(Change::Trip(index, words));
            }
            *before = now;
        }
        for (index, (body, before)) in tick.bodies.iter().zip(&mut self.old).enumerate() {
            let now = body.state.words();
            if let Some(words) = now
                && !*before
            {
                changes.push(Change::Stale(index, words));
            }
            *before = now.is_some();
        }
        for (device, (tool, before)) in tick.tools.iter().zip(&mut self.beyond).enumerate() {
            let now = tool.is_some_and(|tool| tool.is_beyond());
            if now && !*before {
                changes.push(Change::Beyond(device));
            }
            *before = now;
        }
        changes
    }
}
