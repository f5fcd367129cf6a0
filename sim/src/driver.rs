//! The driver `simulated`: opens simulated devices in the hands that hold them.

use crate::device::SimDevice;
use crate::firmware::Wired;
use crate::hand::Hand;
use devices::{AnyDevice, Driver, Kind, OpenError, Request};

/// How a simulated device is held and reached.
#[derive(Clone, Debug)]
pub struct Held {
    /// The hand that holds it; nobody does where there is none.
    pub hand: Option<Hand>,
    /// Whether its states and wrenches pass through the reports of the firmware protocol.
    pub wired: bool,
}

/// Simulated devices. It has no settings: hands and wires are given with the driver.
#[derive(Clone, Debug)]
pub struct Simulated {
    held: Vec<Held>,
}

impl Simulated {
    /// For devices that are held so, by their places in the scene; a device beyond them is free and without a wire.
    pub fn new(held: Vec<Held>) -> Self {
        Self { held }
    }
}

impl Driver for Simulated {
    fn name(&self) -> &'static str {
        "simulated"
    }

    fn kind(&self) -> Kind {
        Kind::Simulated
    }

    fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError> {
        request.settings.only(&[])?;
        let held = self.held.get(request.index);
        let hand = held.and_then(|held| held.hand.clone());
        match SimDevice::new(*request.model, hand, request.period) {
            Ok(device) if held.is_some_and(|held| held.wired) => Ok(Box::new(Wired::new(device))),
            Ok(device) => Ok(Box::new(device)),
            Err(error) => Err(OpenError::Refused {
                source: Box::new(error),
                allowed: "a sound device",
            }),
        }
    }
}
