//! An emulated Falcon in the hand of an operator who homes it.
//!
//! A Falcon has no state and no force before its axes have passed their references. To home it, a person pulls the grip
//! out and pushes it in once. The operator of this module homes the device soon after a host has asked for homing, and
//! again if the device has lost its references.

use super::Emulator;
use super::falcon::Falcon;
use crate::{Trajectory, TrajectoryError};
use devices::ftdi::{PACKET, SetupPacket};
use rt_core::Vec3;

/// Time from the request for homing until the hand moves (s).
const NOTICE: f64 = 0.3;
/// Time of the way out, and of the way in (s).
const WAY: f64 = 0.5;
/// Length of the way (m), along the axis towards the user. The references are 10 mm out of the middle.
const REACH: f64 = 0.025;
/// Time after the way in at which an operator tries again (s).
const AGAIN: f64 = 1.0;

/// A Falcon and its operator.
#[derive(Clone, Debug)]
pub struct Operated {
    falcon: Falcon,
    /// The time of the hand (s) before which the operator does not home the device again.
    busy_s: f64,
    /// Whether the hand has its own motion, which begins when the device is homed.
    moves: bool,
}

impl Operated {
    /// The Falcon in the hand of an operator. A free device is never homed.
    pub fn new(falcon: Falcon) -> Self {
        Self {
            falcon,
            busy_s: 0.0,
            moves: false,
        }
    }

    /// The same Falcon, whose hand moves by itself once it has homed the device.
    #[must_use]
    pub fn then_moving(mut self) -> Self {
        self.falcon.device_mut().hold_hand();
        self.moves = true;
        self
    }

    /// The Falcon.
    pub fn falcon(&self) -> &Falcon {
        &self.falcon
    }

    /// The Falcon, for its faults and its power supply.
    pub fn falcon_mut(&mut self) -> &mut Falcon {
        &mut self.falcon
    }

    /// Takes a request on the control pipe.
    ///
    /// # Errors
    /// The error number of the system for a request that the chip does not know.
    pub fn control(&mut self, setup: SetupPacket, now_ns: u64) -> Result<(), i32> {
        self.falcon.control(setup, now_ns)
    }

    /// Lets the operator look at the device, and home it if it asks for homing.
    fn attend(&mut self) {
        let now = self.falcon.device().moved_s();
        let homed = self.falcon.homed() == [true; 3];
        if self.moves && homed && now >= self.busy_s - AGAIN {
            self.falcon.device_mut().begin_hand();
        }
        let asks = self.falcon.is_homing() && !homed;
        if !asks || now < self.busy_s {
            return;
        }
        let start = now + NOTICE;
        if self.moves {
            self.falcon.device_mut().hold_hand();
        }
        if let Ok(path) = way(start) {
            self.falcon.device_mut().guide(path);
        }
        self.busy_s = start + 2.0 * WAY + AGAIN;
    }
}

/// The way out and in, from `start` (s) on.
fn way(start: f64) -> Result<Trajectory, TrajectoryError> {
    let out = Vec3::new(0.0, 0.0, REACH);
    Trajectory::new_waypoints(&[
        (start, Vec3::zeros()),
        (start + WAY, out),
        (start + 2.0 * WAY, Vec3::zeros()),
    ])
}

impl Emulator for Operated {
    fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        self.falcon.receive(bytes, now_ns);
        self.attend();
    }

    fn send(&mut self, now_ns: u64, report: &mut [u8; PACKET]) -> Option<usize> {
        let sent = self.falcon.send(now_ns, report);
        self.attend();
        sent
    }
}
