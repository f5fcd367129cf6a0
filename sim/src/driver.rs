//! The driver `sim` opens simulated devices, each with the hand that holds it.

use crate::delayed::Delayed;
use crate::device::SimDevice;
use crate::firmware::Wired;
use crate::hand::Hand;
use crate::protocol::Protocol;
use devices::{AnyDevice, Driver, Kind, OpenError, Request};
use rt_core::Vec3;

/// The hand, the wire and the start of a simulated device.
#[derive(Clone, Debug)]
pub struct Held {
    /// The hand that holds the device; the device is free if there is none.
    pub hand: Option<Hand>,
    /// Whether the states and wrenches of the device pass through the reports of the firmware protocol.
    pub wired: bool,
    /// Position at which the device and the hand start (m, device axes).
    pub start: Vec3,
    /// The protocol that an emulated device speaks.
    pub protocol: Protocol,
}

/// The driver of simulated devices. It has no addresses, because hands and wires are given to `Simulated::new`.
#[derive(Clone, Debug)]
pub struct Simulated {
    held: Vec<Held>,
}

impl Simulated {
    /// A driver for devices with these hands and wires, by index in the scene. A device beyond the list is free and has
    /// no wire.
    pub fn new(held: Vec<Held>) -> Self {
        Self { held }
    }
}

impl Driver for Simulated {
    fn name(&self) -> &'static str {
        "sim"
    }

    fn kind(&self) -> Kind {
        Kind::Simulated
    }

    fn reaches(&self, _: &str) -> Vec<String> {
        Vec::new()
    }

    fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError> {
        request.no_address()?;
        let held = self.held.get(request.index);
        let hand = held.and_then(|held| held.hand.clone());
        let start = held.map_or_else(Vec3::zeros, |held| held.start);
        let device = SimDevice::new(*request.model, hand, request.period);
        match device.and_then(|device| device.starting_at(start)) {
            Ok(device) => {
                let wired = held.is_some_and(|held| held.wired);
                let delay = request.model.output_delay;
                // A device without a delay needs no wrenches on their way.
                Ok(match (wired, delay > 0.0) {
                    (true, true) => Box::new(Wired::new(Delayed::new(device, delay))),
                    (true, false) => Box::new(Wired::new(device)),
                    (false, true) => Box::new(Delayed::new(device, delay)),
                    (false, false) => Box::new(device),
                })
            }
            Err(error) => Err(OpenError::Refused {
                source: Box::new(error),
                allowed: "a valid device model",
            }),
        }
    }
}
