//! The classic passivity controller: a damper that takes back excess energy from the hands.
//!
//! B. Hannaford and J.-H. Ryu, "Time-domain passivity control of haptic interfaces" (2002), in impedance causality. The
//! passivity observer is the account of [`super`], over all hands of the body. `E_0` is the energy stored when the
//! first local model came:
//!
//! ```text
//! E   = E_0 + supplied - raised
//! F_d = -c v      if E < 0, with c v^2 T = -E over all hands, each c at most the damping
//!                 that its device can render
//! ```
//!
//! The controller acts after the fact: energy comes out first, and is taken back in the ticks that follow, as long as
//! hands move. There is no allowance, and the controller does not rely on the devices' own dissipation.

use super::cap::damp;
use super::{Motion, Passivity, Port};
use crate::MAX_HANDLES;
use crate::geometry::{Pose, Twist, Vec6, Wrench};

impl Passivity {
    /// Damps the hands if they have got more energy than they supplied. `handles` names the device on each handle, in
    /// the order of the handles.
    pub(crate) fn restore(
        &mut self,
        handles: impl Iterator<Item = u8>,
        devices: &[(Pose, Twist)],
        wrenches: &mut [Wrench; MAX_HANDLES],
    ) {
        let account = &self.account;
        let observed = account.initial + account.supplied + account.received - account.raised;
        self.account.available = observed;
        let mut ports = [Port::UNKNOWN; MAX_HANDLES];
        let mut motions = [Motion::none(); MAX_HANDLES];
        for ((port, motion), device) in ports.iter_mut().zip(&mut motions).zip(handles) {
            let device = usize::from(device);
            let known = self.hands.get(device).zip(devices.get(device));
            if let Some((hand, (_, twist))) = known {
                *port = hand.port;
                *motion = Motion {
                    step: hand.step,
                    heading: hand.heading,
                    velocity: twist.stacked(),
                };
            }
        }
        if observed < 0.0 {
            let mut damping = [Vec6::zeros(); MAX_HANDLES];
            damp(
                -observed,
                self.config.period,
                [0.0, 1.0],
                ports.iter(),
                &motions,
                &mut damping,
            );
            for (wrench, damping) in wrenches.iter_mut().zip(&damping) {
                *wrench = wrench.plus(&Wrench::from_stacked(damping));
            }
            crate::count_one(&mut self.account.capped);
        }
    }
}
