//! A device behind its real wire: every state and every wrench passes through the 64 bytes of its report.
//!
//! The simulation thus includes the firmware protocol and its resolution. The errors are half a unit of the report
//! each: 0.05 µm for each coordinate of a position, 0.5 µm/s for a velocity, 0.5 µN for a force, 0.5 µN m for a moment,
//! 0.5 mrad/s for an angular velocity. The error of a rotation is at most 0.07 mrad. The device's clock counts whole
//! microseconds, and there are sixteen buttons.
//!
//! The wire is ideal: no report is lost or late, so the simulation needs neither the greeting nor the device's
//! watchdog. `firmware_proto::device` has both, and a test puts it behind the driver `hid`.

use devices::wire::{DeviceClock, corrupt, si_of, state_of};
use firmware_proto::report::{
    Condition, LENGTH, Mode, ReportError, StateReport, StateSi, WrenchReport, flags, status,
};
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Probe, Rendering, Vec3, Wrench};

/// The session of a device behind its ideal wire.
pub const SESSION: u32 = 1;

/// A device behind the bytes of its reports.
///
/// ```
/// use rt_core::Device;
/// use sim::{DeviceModel, SimDevice, Wired};
///
/// let model = DeviceModel::named("touch").unwrap();
/// let mut device = Wired::new(SimDevice::new(model, None, 1e-3).unwrap());
/// device.read(0).unwrap();
/// // The report has the time in whole microseconds.
/// let state = device.read(1_000_700).unwrap();
/// assert_eq!(state.device_time_ns, 1_000_000);
/// ```
#[derive(Clone, Debug)]
pub struct Wired<D> {
    device: D,
    clock: DeviceClock,
    states: u16,
    wrenches: u16,
}

impl<D: Device> Wired<D> {
    /// Puts `device` behind its wire.
    pub fn new(device: D) -> Self {
        Self {
            device,
            clock: DeviceClock::default(),
            states: 0,
            wrenches: 0,
        }
    }

    /// The device behind the wire.
    pub fn device(&self) -> &D {
        &self.device
    }
}

impl<D: Device> Device for Wired<D> {
    fn capabilities(&self) -> Capabilities {
        self.device.capabilities()
    }

    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        let state = self.device.read(now_ns)?;
        let bytes = state_bytes(&state, self.states);
        self.states = self.states.wrapping_add(1);
        let report = StateReport::decode(&bytes).map_err(corrupt)?;
        let time_ns = self.clock.advance(report.condition.time_us);
        Ok(state_of(&report, self.capabilities().sensed, time_ns))
    }

    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        // The wrench answers the last state.
        let answers = self.states.wrapping_sub(1);
        let report = WrenchReport::from_si(
            self.wrenches,
            SESSION,
            answers,
            &si_of(wrench),
            flags::ENABLE,
        );
        let bytes = report.encode();
        self.wrenches = self.wrenches.wrapping_add(1);
        let wrench = wrench_from_bytes(&bytes).map_err(corrupt)?;
        self.device.write(now_ns, &wrench)
    }

    fn probe(&self) -> Option<Probe> {
        self.device.probe()
    }

    fn refused_wrenches(&self) -> Option<u64> {
        self.device.refused_wrenches()
    }
}

/// The report that a device sends for `state`. Numbers beyond the report's range saturate at its ends, NaN becomes
/// zero, and buttons beyond the sixteenth are not sent.
pub fn state_bytes(state: &DeviceState, sequence: u16) -> [u8; LENGTH] {
    StateReport::from_si(sequence, SESSION, condition(state), &state_si(state)).encode()
}

/// Pose and velocities of a state, in the form for a report.
pub(crate) fn state_si(state: &DeviceState) -> StateSi {
    let q = &state.pose.rotation;
    StateSi {
        position: state.pose.position.into(),
        orientation: [q.w, q.i, q.j, q.k],
        velocity: state.twist.linear.into(),
        angular_velocity: state.twist.angular.into(),
    }
}

/// The condition of a simulated device. A fault without a number gets the last of the device's own numbers.
fn condition(state: &DeviceState) -> Condition {
    let time_us = (state.device_time_ns / 1000) as u32;
    let on = status::CALIBRATED | status::POWERED;
    let (mode, status, fault) = match state.rendering {
        Rendering::Commanded => (Mode::Active, on | status::IN_FORCE, 0),
        Rendering::LetGo => (Mode::Idle, on, 0),
        Rendering::Fault(0) => (Mode::Fault, on, u8::MAX),
        Rendering::Fault(fault) => (Mode::Fault, on, fault),
    };
    Condition {
        time_us,
        since_us: time_us,
        buttons: state.buttons as u16,
        status,
        mode,
        fault,
        ..Condition::default()
    }
}

/// The wrench in a report to a device; zero if the report does not enable the wrench.
///
/// # Errors
/// The [`ReportError`] for which the bytes are not a valid report of a wrench.
pub fn wrench_from_bytes(bytes: &[u8]) -> Result<Wrench, ReportError> {
    let report = WrenchReport::decode(bytes)?;
    if report.flags & flags::ENABLE == 0 {
        return Ok(Wrench::zero());
    }
    let si = report.to_si();
    Ok(Wrench {
        force: Vec3::from(si.force),
        moment: Vec3::from(si.moment),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DeviceModel, Hand, SimDevice, Trajectory, Tremor};
    use devices::scripted::{Scripted, small};
    use firmware_proto::report::WrenchSi;
    use nalgebra::UnitQuaternion;
    use proptest::prelude::*;
    use rt_core::{Freedom, Pose, Twist};
    use std::cell::Cell;
    use std::rc::Rc;

    /// A device that returns a given state, behind its wire, and the last wrench that it received.
    fn wired(state: DeviceState) -> (Wired<impl Device>, Rc<Cell<Wrench>>) {
        let written = Rc::new(Cell::new(Wrench::zero()));
        let keep = Rc::clone(&written);
        let read = move |device_time_ns| {
            Ok(DeviceState {
                device_time_ns,
                ..state
            })
        };
        let write = move |_, wrench: &Wrench| {
            keep.set(*wrench);
            Ok(())
        };
        let device = Scripted::new(small(Freedom::Six), read, write);
        (Wired::new(device), written)
    }

    #[test]
    fn the_clock_counts_on_where_the_counter_wraps() {
        let (mut device, _) = wired(DeviceState::resting());
        let turn_ns = (1_u64 << 32) * 1000;
        for now in (0..20).map(|k| k * turn_ns / 3 + 123_456) {
            let time = device.read(now).unwrap().device_time_ns;
            // The time is in whole microseconds, rounded down.
            assert_eq!(time, now / 1000 * 1000);
        }
        // The clock of a restarted device continues from its last time, and never goes back.
        let mut clock = DeviceClock::default();
        assert_eq!([5, 3, 7].map(|us| clock.advance(us)), [5000, 5000, 9000]);
    }

    #[test]
    fn an_unrotated_device_stays_exactly_unrotated() {
        let state = wired(DeviceState::resting()).0.read(0).unwrap();
        assert_eq!(state, DeviceState::resting());
    }

    #[test]
    fn the_wire_carries_what_the_device_renders() {
        for rendering in [Rendering::Commanded, Rendering::LetGo, Rendering::Fault(3)] {
            let state = DeviceState {
                rendering,
                ..DeviceState::resting()
            };
            assert_eq!(wired(state).0.read(0), Ok(state));
        }
    }

    #[test]
    fn a_simulated_device_is_the_same_behind_its_wire_but_for_the_report() {
        let tremor = Tremor::new(1e-4, 9).unwrap();
        let hand = Hand::new(Trajectory::still()).with_tremor(tremor);
        let mut bare =
            SimDevice::new(DeviceModel::named("touch").unwrap(), Some(hand), 1e-3).unwrap();
        let mut wired = Wired::new(bare.clone());
        for tick in 0..1000 {
            let now = tick * 1_000_000;
            let (a, b) = (bare.read(now).unwrap(), wired.read(now).unwrap());
            // The tolerances are half of 0.1 µm and half of 1 µm/s, plus a relative margin for rounding.
            assert!((a.pose.position - b.pose.position).amax() <= 0.5e-7 * (1.0 + 1e-9));
            assert!((a.twist.linear - b.twist.linear).amax() <= 0.5e-6 * (1.0 + 1e-9));
            assert_eq!(a.device_time_ns, b.device_time_ns);
            // A force of whole micronewtons passes exactly, so both devices continue alike.
            let wrench = Wrench {
                force: Vec3::new(0.5, -1.25, 0.0),
                moment: Vec3::zeros(),
            };
            bare.write(now, &wrench).unwrap();
            wired.write(now, &wrench).unwrap();
            assert_eq!(bare.position(), wired.device().position());
        }
    }

    #[test]
    fn a_wrench_that_is_not_enabled_is_none() {
        let si = WrenchSi {
            force: [1.0; 3],
            moment: [1.0; 3],
        };
        let bytes = WrenchReport::from_si(0, SESSION, 0, &si, 0).encode();
        assert_eq!(wrench_from_bytes(&bytes), Ok(Wrench::zero()));
        assert!(wrench_from_bytes(bytes.get(1..).unwrap()).is_err());
    }

    fn vector(most: f64) -> impl Strategy<Value = Vec3> {
        let x = move || -most..most;
        (x(), x(), x()).prop_map(|(x, y, z)| Vec3::new(x, y, z))
    }

    proptest! {
        #[test]
        fn the_wire_costs_half_a_unit_of_the_report(
            position in vector(0.5), turn in vector(1.8), linear in vector(5.0),
            angular in vector(30.0), force in vector(40.0), moment in vector(2.0),
            buttons in 0..1_u32 << 16,
        ) {
            let state = DeviceState {
                pose: Pose { position, rotation: UnitQuaternion::from_scaled_axis(turn) },
                twist: Twist { linear, angular },
                buttons,
                device_time_ns: 0,
                rendering: Rendering::Commanded,
            };
            let (mut device, written) = wired(state);
            let seen = device.read(0).unwrap();
            // Half of 0.1 µm, 1 µm/s, 1 mrad/s and 1 µN, and a margin for rounding at 1e8 units.
            let within = |a: &Vec3, b: &Vec3, unit: f64| (a - b).amax() <= 0.5 * unit * (1.0 + 1e-6);
            prop_assert!(within(&seen.pose.position, &position, 1e-7));
            prop_assert!(within(&seen.twist.linear, &linear, 1e-6));
            prop_assert!(within(&seen.twist.angular, &angular, 1e-3));
            // Each of the four numbers errs by half of 1 / 32767, so the quaternion errs by 1 / 32767, which is half of
            // the angle. Normalization adds at most the same error.
            prop_assert!(seen.pose.rotation.angle_to(&state.pose.rotation) <= 2.0 / 32767.0 * 1.01);
            prop_assert_eq!(seen.buttons, buttons);
            device.write(0, &Wrench { force, moment }).unwrap();
            let received = written.get();
            prop_assert!(within(&received.force, &force, 1e-6));
            prop_assert!(within(&received.moment, &moment, 1e-6));
        }
    }
}
