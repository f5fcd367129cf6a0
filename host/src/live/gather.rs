//! Folds ticks into frames.

use super::Range;
use super::frame::{BodyState, Folded, FoldedHand, Frame, Hand};
use crate::scene::Scene;
use rt_core::Telemetry;

/// Folds ticks into frames.
pub struct Gatherer {
    frame: Frame,
}

impl Gatherer {
    /// A gatherer.
    pub fn new(scene: &Scene) -> Self {
        let _ = scene;
        Self {
            frame: Frame::default(),
        }
    }

    /// Takes a tick.
    pub fn take(&mut self, telemetry: &Telemetry) {
        let folded = &mut self.frame.folded;
        if folded.ticks == 0 {
            (folded.first, folded.from_ns) = (telemetry.tick, telemetry.time_ns);
        }
        (folded.last, folded.to_ns) = (telemetry.tick, telemetry.time_ns);
        folded.ticks += 1;
        folded
            .hands
            .resize_with(telemetry.devices().count(), FoldedHand::default);
        for (hand, device) in folded.hands.iter_mut().zip(telemetry.devices()) {
            hand.force_norm
                .merge(&Range::of(device.wrench.force.norm()));
        }
        self.frame.hands = telemetry.devices().map(|_| Hand::default()).collect();
        self.frame.bodies = telemetry.bodies().map(|_| BodyState::default()).collect();
        self.frame.time_ns = telemetry.time_ns;
        self.frame.totals.ticks += 1;
    }

    /// The frame since the last call.
    pub fn frame(&mut self) -> Frame {
        let frame = self.frame.clone();
        self.frame.number += 1;
        self.frame.folded = Folded::default();
        frame
    }
}
