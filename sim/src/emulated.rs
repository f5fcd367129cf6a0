//! The driver `emulated`: a device with its protocol, its driver and its timing in virtual time, held by a simulated hand.
//!
//! A device of the driver `sim` is read and written at once. An emulated device is reached by its true driver, through
//! bytes that take their time: counts of its encoders, the delay of its exchange, its boot and its calibration or homing
//! are those of the device. Such a run rehearses a real device before the device is there. The run begins after the
//! operator's part: the hand first homes or calibrates the device, and then follows the motion of the scene.
//!
//! - [`link`]: the connection between a driver and an emulated device. [`fault`]: the faults of the connection.
//! - [`driver`]: the true driver of a device, with its threads in virtual time.
//!
//! A run has no fault; the study of connections has. The parts allocate, so an emulated device belongs to virtual time.

pub mod driver;
pub mod fault;
pub mod link;

use crate::device::LONGEST_MOVE_NS;
use crate::driver::Held;
use crate::protocol::Protocol;
use crate::{Hand, SimDevice, Trajectory};
use devices::falcon::MOST_FORCE;
use devices::{AnyDevice, Driver, Kind, OpenError, Request};
use driver::Driver as Opened;
use fault::{Injected, Kind as Fault};
use link::{Link, World};
use rand_pcg::Pcg64;
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Probe, Vec3, Wrench};

/// Period of the driver's ticks during the opening (ns).
const PERIOD_NS: u64 = 1_000_000;
/// Time in which a Falcon has its firmware (ns).
const BOOT_NS: u64 = 3_000_000_000;

/// The driver of emulated devices. It has no addresses.
#[derive(Clone, Debug)]
pub struct EmulatedDriver {
    held: Vec<Held>,
}

impl EmulatedDriver {
    /// A driver for devices with these hands and protocols, by index in the scene. A device beyond the list is free and
    /// speaks the firmware protocol.
    pub fn new(held: Vec<Held>) -> Self {
        Self { held }
    }
}

impl Driver for EmulatedDriver {
    fn name(&self) -> &'static str {
        "emulated"
    }

    fn kind(&self) -> Kind {
        Kind::Simulated
    }

    fn reaches(&self, _: &str) -> Vec<String> {
        Vec::new()
    }

    fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError> {
        request.no_address()?;
        let refused = |source: Box<dyn std::error::Error + Send + Sync>| OpenError::Refused {
            source,
            allowed: "a device that can be emulated",
        };
        let held = self.held.get(request.index);
        if held.is_some_and(|held| held.start != Vec3::zeros()) {
            let problem =
                "an emulated device is calibrated at its origin: leave `mounting.origin` out";
            return Err(refused(problem.into()));
        }
        let protocol = held.map_or(Protocol::Reports, |held| held.protocol);
        let (opening, duration_ns) = opening(protocol).map_err(|error| refused(error.into()))?;
        let hand = held.and_then(|held| held.hand.clone());
        let hand = hand.unwrap_or_else(|| Hand::new(Trajectory::new_sum(Vec::new())));
        let hand = hand.after(opening, duration_ns as f64 * 1e-9);
        let device = SimDevice::new(*request.model, Some(hand), request.period);
        let device = device.map_err(|error| refused(error.into()))?;
        let stated = request.model.capabilities();
        let most = match protocol {
            Protocol::Falcon => MOST_FORCE,
            _ => f64::INFINITY,
        };
        let capabilities = Capabilities {
            max_force: stated.max_force.min(most),
            ..stated
        };
        Ok(Box::new(Emulated::open(
            protocol,
            device,
            request,
            capabilities,
            duration_ns,
        )))
    }
}

/// The motion of the hand until the device is ready, and its duration (ns).
fn opening(protocol: Protocol) -> Result<(Trajectory, u64), crate::TrajectoryError> {
    let boot = BOOT_NS as f64 * 1e-9;
    let (path, duration_ns) = match protocol {
        // A pull and a push, which pass the references of all legs.
        Protocol::Falcon => (
            vec![
                (boot, Vec3::zeros()),
                (boot + 0.5, Vec3::new(0.0, 0.0, 0.025)),
                (boot + 1.0, Vec3::zeros()),
            ],
            BOOT_NS + 1_500_000_000,
        ),
        _ => (vec![(0.0, Vec3::zeros())], 500_000_000),
    };
    Ok((Trajectory::new_waypoints(&path)?, duration_ns))
}

/// An emulated device behind its driver.
pub struct Emulated {
    link: Link,
    driver: Opened,
    capabilities: Capabilities,
    /// Time of the device now (ns).
    device_ns: u64,
    /// Time of the run at the latest call (ns).
    run_ns: u64,
}

impl Emulated {
    /// Opens the driver of the device, and lets the operator make the device ready.
    fn open(
        protocol: Protocol,
        device: SimDevice,
        request: &Request<'_>,
        capabilities: Capabilities,
        begins_ns: u64,
    ) -> Self {
        let none = Injected {
            kind: Fault::Nothing,
            from_ns: u64::MAX,
            to_ns: u64::MAX,
        };
        // Only a fault draws from the generator.
        let link = Link::new(World::new(protocol, device, none, Pcg64::new(0, 0)));
        let mut driver = Opened::open(protocol, request.model, request.period, &link);
        let mut now_ns = link.now_ns().next_multiple_of(PERIOD_NS);
        let mut calibrates = true;
        while now_ns < begins_ns {
            let _ = driver.read(&link, now_ns);
            driver.write(&link, now_ns, &Wrench::zero());
            if calibrates && now_ns > begins_ns / 2 {
                calibrates = false;
                link.press();
            }
            now_ns += PERIOD_NS;
        }
        Self {
            link,
            driver,
            capabilities,
            device_ns: begins_ns,
            run_ns: 0,
        }
    }

    /// The time of the device at the time `now_ns` of the run (ns). Time does not go back, and in a gap that is longer than
    /// any run has, the device stands still for the rest of the gap.
    fn time_ns(&mut self, now_ns: u64) -> u64 {
        let passed_ns = now_ns.saturating_sub(self.run_ns).min(LONGEST_MOVE_NS);
        self.run_ns = self.run_ns.max(now_ns);
        self.device_ns = self.device_ns.saturating_add(passed_ns);
        self.device_ns
    }
}

impl Device for Emulated {
    fn capabilities(&self) -> Capabilities {
        self.capabilities
    }

    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        let now_ns = self.time_ns(now_ns);
        self.driver.read(&self.link, now_ns)
    }

    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        let now_ns = self.time_ns(now_ns);
        // The driver of the Falcon knows the limit of the torques only.
        let mut wrench = *wrench;
        let (force, most) = (wrench.force.norm(), self.capabilities.max_force);
        if force > most {
            wrench.force *= most / force;
        }
        self.driver.write(&self.link, now_ns, &wrench);
        Ok(())
    }

    fn probe(&self) -> Option<Probe> {
        self.link.probe()
    }

    fn refused_wrenches(&self) -> Option<u64> {
        self.driver.refused_wrenches()
    }
}
