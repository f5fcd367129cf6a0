//! The coupling under `capped`: the part of a model that the devices can render, the wrenches of the model in parts,
//! and the cap on these wrenches.
//!
//! A held force lags by half a tick, and by the ticks of the device's delay. The stiffness therefore resists a fraction
//! of each step ([`Lead`]) as a damper would. The drift of the model acts within the lag, too. The stiffness of a model
//! is that of a step of the host, and inertia and dampers raise this stiffness. Without the drift, the lead would
//! resist a motion by more than the body does. The drift acts for the fraction [`DRIFT`] of the lag.
//!
//! **A single count back** tells nothing of a velocity: a tremor on the edge of a count produces it, too. An estimate
//! of the velocity is late by some ticks, so a damper that answers that count would meet the next count and push it
//! along. A light device on a stiff body would never come to rest. As long as such a count is the last step along an
//! axis, neither dampers nor the lead act along that axis.

use super::Coupling;
use crate::MAX_HANDLES;
use crate::geometry::{Pose, Twist, Vec6, Wrench};
use crate::local_model::{Lead, Parts};
use crate::passivity::{Motion, Port};

/// Fraction of the lag for which the drift acts in advance. The whole lag would be right for a model without age: at 1
/// kHz without latency, a motion at 4 Hz then feels 1.1 ms K of viscosity, and 1.9 ms K with half the lag; 0.4 ms K
/// would be exact. But the drift of an old model is that of a former motion. A host whose models are 10 ms old shakes
/// with the whole lag.
const DRIFT: f64 = 0.5;

impl Coupling {
    /// Bounds the pending model by what the devices can render: its damping, and the fraction of the stiffness that
    /// acts as damping.
    pub(super) fn bound(&mut self) {
        let config = self.passivity.config();
        let port = |device: u8| config.ports.get(usize::from(device));
        let most = |device| port(device).map_or([f64::INFINITY; 2], Port::most);
        self.pending.bound_damping(most);
        self.pending.bound_touch(most);
        // A held force lags by half a tick, and by the delay of the device.
        let late = 0.5 + config.delay as f64;
        let found = self.pending.own_stiffness();
        let mut lead = [[0.0; 2]; MAX_HANDLES];
        for ((lead, found), handle) in lead.iter_mut().zip(&found).zip(self.pending.handles()) {
            for ((lead, found), most) in lead.iter_mut().zip(found).zip(most(handle.device)) {
                *lead = late.min(most / (found * config.period).max(f64::MIN_POSITIVE));
            }
        }
        self.lead = lead;
    }

    /// The model's wrenches in parts, blended as the whole model is. Dampers act along the axes for which `onward` is
    /// one, and along no axis for which `onward` is zero.
    pub(super) fn parts(
        &self,
        devices: &[(Pose, Twist)],
        lead: &[Lead; MAX_HANDLES],
        onward: &[Vec6; MAX_HANDLES],
    ) -> Parts {
        let mut deviations = self.to.deviations(devices);
        for (deviation, onward) in deviations.iter_mut().zip(onward) {
            deviation.velocity.component_mul_assign(onward);
        }
        let mut parts = self.to.parts(&deviations, lead, self.ahead);
        if self.blend < 1.0 {
            let mut from = self.from.parts(&deviations, lead, self.ahead);
            from.mix(&parts, self.blend, usize::from(self.to.head.handle_count));
            parts = from;
        }
        parts
    }

    /// The wrenches under the energy cap.
    pub(super) fn capped(&mut self, devices: &[(Pose, Twist)]) -> [Wrench; MAX_HANDLES] {
        let mut motions = [Motion::none(); MAX_HANDLES];
        let mut lead = [Lead::none(); MAX_HANDLES];
        let mut onward = [Vec6::repeat(1.0); MAX_HANDLES];
        let handles = self.to.handles().zip(&self.lead);
        for ((handle, [linear, angular]), at) in handles.zip(0..MAX_HANDLES) {
            let device = usize::from(handle.device);
            let known = self.passivity.hand(device).zip(devices.get(device));
            let (Some((hand, (_, twist))), Some(motion), Some(lead), Some(onward)) = (
                known,
                motions.get_mut(at),
                lead.get_mut(at),
                onward.get_mut(at),
            ) else {
                continue;
            };
            *motion = Motion {
                step: hand.step,
                heading: hand.heading,
                velocity: twist.stacked(),
            };
            // A hand that made one count in several ticks moved slowly: the lag of the spring is smaller by that
            // factor.
            let linear = linear / hand.pace;
            *onward = Vec6::new(hand.onward.x, hand.onward.y, hand.onward.z, 1.0, 1.0, 1.0);
            let lag = Vec6::new(linear, linear, linear, *angular, *angular, *angular);
            let lag = lag.component_mul(onward);
            let time = DRIFT * self.config.period;
            let drifts = |step, lag| if step == 0.0 { 0.0 } else { lag * time };
            *lead = Lead {
                step: hand.step.component_mul(&lag),
                time: hand.step.zip_map(&lag, drifts),
            };
        }
        let mut parts = self.parts(devices, &lead, &onward);
        if self.is_torn() {
            let stored = self.stored_by_piece(devices);
            self.passivity.note_stored(stored.iter().sum());
            if self.slips.matter() || self.passivity.is_unpaid() {
                self.ask_for_slips(&parts.elastic, &stored, true);
            }
            let Parts {
                elastic, viscous, ..
            } = &mut parts;
            (self.passivity).cap_by_piece(&self.to, &motions, &stored, elastic, viscous);
        } else {
            if !parts.stored.is_finite() {
                // An energy that overflowed exceeds any energy that the hands can have supplied.
                parts.stored = f64::MAX;
            }
            self.passivity.note_stored(parts.stored);
            if self.slips.matter() || self.passivity.is_unpaid() {
                let mut stored = [0.0; MAX_HANDLES];
                let [whole, ..] = &mut stored;
                *whole = parts.stored;
                self.ask_for_slips(&parts.elastic, &stored, false);
            }
            self.passivity.cap(
                self.to.handles().map(|handle| handle.device),
                &motions,
                parts.stored,
                &mut parts.elastic,
                &mut parts.viscous,
            );
        }
        let mut wrenches = [Wrench::zero(); MAX_HANDLES];
        let each = wrenches.iter_mut().zip(&self.weights);
        let parts = parts.elastic.iter().zip(&parts.viscous);
        let used = usize::from(self.to.head.handle_count);
        for ((wrench, weight), (elastic, viscous)) in each.zip(parts).take(used) {
            *wrench = Wrench::from_stacked(&(elastic + viscous));
            wrench.force += weight;
        }
        wrenches
    }
}
