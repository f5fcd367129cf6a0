//! The coupling under `capped`: what of a model the devices can render, its wrenches in parts, and the cap over them.
//!
//! A held force lags by half a tick, and by the ticks by which a device is late: a share of each step (`lead`) is rendered
//! by the stiffness as a damper would.

use super::Coupling;
use crate::geometry::{Pose, Twist, Vec6, Wrench};
use crate::local_model::{LocalModel, Parts};
use crate::passivity::{Motion, Port};
use crate::{MAX_DEVICES, MAX_HANDLES};

impl Coupling {
    /// What of a model the devices can render: its damping bounded, and how much of the stiffness acts as one.
    pub(super) fn bound(&mut self, model: &mut LocalModel) {
        let config = self.passivity.config();
        let port = |device: u8| config.ports.get(usize::from(device));
        let most = |device| port(device).map_or([f64::INFINITY; 2], Port::most);
        model.bound_damping(most);
        // A held force lags by half a tick, and by what the device is late.
        let late = 0.5 + config.delay as f64;
        let found = model.own_stiffness();
        let mut lead = [[0.0; 2]; MAX_HANDLES];
        for ((lead, found), handle) in lead.iter_mut().zip(&found).zip(model.handles()) {
            for ((lead, found), most) in lead.iter_mut().zip(found).zip(most(handle.device)) {
                *lead = late.min(most / (found * config.period).max(f64::MIN_POSITIVE));
            }
        }
        self.lead = lead;
    }

    /// The model's wrenches in parts, blended as the whole is.
    pub(super) fn parts(&self, devices: &[(Pose, Twist)], lead: &[Vec6; MAX_HANDLES]) -> Parts {
        let deviations = self.to.deviations(devices);
        let mut parts = self.to.parts(&deviations, lead, self.ahead);
        if self.share < 1.0 {
            let mut from = self.from.parts(&deviations, lead, self.ahead);
            from.mix(&parts, self.share);
            parts = from;
        }
        parts
    }

    /// The wrenches under the cap of energy, where the devices made `steps` since the last tick.
    pub(super) fn capped(
        &mut self,
        devices: &[(Pose, Twist)],
        steps: &[Vec6; MAX_DEVICES],
    ) -> [Wrench; MAX_HANDLES] {
        let mut motions = [Motion::none(); MAX_HANDLES];
        let mut lead = [Vec6::zeros(); MAX_HANDLES];
        let each = motions.iter_mut().zip(&mut lead).zip(&self.lead);
        for (((motion, lead), share), handle) in each.zip(self.to.handles()) {
            let device = usize::from(handle.device);
            let (Some(step), Some((_, twist))) = (steps.get(device), devices.get(device)) else {
                continue;
            };
            *motion = Motion {
                step: *step,
                heading: self.passivity.heading(device),
                velocity: twist.stacked(),
            };
            let [linear, angular] = *share;
            // A hand that made one count in many ticks went on slowly: what the spring lags by is that much less.
            let linear = linear / self.passivity.pace(device);
            *lead = step.component_mul(&Vec6::new(
                linear, linear, linear, angular, angular, angular,
            ));
        }
        let mut parts = self.parts(devices, &lead);
        if !parts.stored.is_finite() {
            // An energy that overflowed is more than anyone has put in.
            parts.stored = f64::MAX;
        }
        self.passivity.note_stored(parts.stored);
        self.passivity.cap(
            self.to.handles().map(|handle| handle.device),
            &motions,
            parts.stored,
            &mut parts.elastic,
            &mut parts.viscous,
        );
        let mut wrenches = [Wrench::zero(); MAX_HANDLES];
        let each = parts.elastic.iter().zip(&parts.viscous);
        let handles = self.to.handles();
        for ((wrench, (elastic, viscous)), handle) in wrenches.iter_mut().zip(each).zip(handles) {
            *wrench = Wrench::from_stacked(&(elastic + viscous));
            wrench.force += handle.weight;
        }
        wrenches
    }
}
