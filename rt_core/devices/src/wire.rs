//! The host's side of the firmware protocol: from a device's report to a state, from a wrench to a report.
//!
//! The units of a device are converted to SI here.
#![cfg_attr(
    not(test),
    deny(
        clippy::arithmetic_side_effects,
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used,
    )
)]

use firmware_proto::report::{ReportError, StateReport, WrenchReport, WrenchSi, flags};
use rt_core::{Corruption, DeviceError, DeviceState, Freedom, Pose, Twist, Vec3, Wrench};

/// A device's own clock, continued beyond the range of its 32-bit counter, which wraps every 71 minutes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceClock {
    last: Option<u32>,
    time_us: u64,
}

impl DeviceClock {
    /// Takes the counter of the next report (us); returns the device's time (ns). The time starts at the first counter
    /// and never decreases. After a counter that jumps back (the device was restarted), time continues from there.
    ///
    /// ```
    /// let mut clock = devices::wire::DeviceClock::default();
    /// assert_eq!(clock.advance(u32::MAX - 499), (u64::from(u32::MAX) - 499) * 1000);
    /// assert_eq!(clock.advance(500), (u64::from(u32::MAX) + 501) * 1000); // wrapped, 1 ms later
    /// ```
    pub fn advance(&mut self, counter_us: u32) -> u64 {
        let step = match self.last {
            None => counter_us,
            Some(last) => match counter_us.wrapping_sub(last) {
                // A difference of more than half the range means that the counter went back.
                step if step > u32::MAX / 2 => 0,
                step => step,
            },
        };
        self.last = Some(counter_us);
        self.time_us = self.time_us.saturating_add(u64::from(step));
        self.time_us.saturating_mul(1000)
    }
}

/// The state in a report, in SI units. Where the device senses no rotation (`sensed`), the report's orientation and
/// angular velocity are ignored; so are positions and velocities along axes that the device does not sense.
pub fn state_of(report: &StateReport, sensed: Freedom, device_time_ns: u64) -> DeviceState {
    let si = report.to_si();
    let mut pose = Pose::at(sensed.part(&Vec3::from(si.position)));
    let mut twist = Twist {
        linear: sensed.part(&Vec3::from(si.velocity)),
        angular: Vec3::zeros(),
    };
    if sensed.turns() {
        let [w, x, y, z] = si.orientation;
        let rotation = pose.rotation.as_mut_unchecked();
        (rotation.w, rotation.i, rotation.j, rotation.k) = (w, x, y, z);
        // The report's own check bounds the error of the length by one per cent.
        pose.rotation.renormalize();
        twist.angular = Vec3::from(si.angular_velocity);
    }
    DeviceState {
        pose,
        twist,
        buttons: u32::from(report.buttons),
        device_time_ns,
    }
}

/// The report that commands `wrench` (device axes). Numbers beyond the report's range saturate at its ends, and a NaN
/// becomes zero.
pub fn report_of(wrench: &Wrench, sequence: u16) -> WrenchReport {
    let si = WrenchSi {
        force: wrench.force.into(),
        moment: wrench.moment.into(),
    };
    WrenchReport::from_si(sequence, &si, flags::ENABLE)
}

/// The error of the device for a report that could not be decoded.
pub fn corrupt(error: ReportError) -> DeviceError {
    DeviceError::Corrupt(match error {
        ReportError::Length { .. } => Corruption::Length,
        ReportError::Crc { .. } => Corruption::CheckSum,
        ReportError::Version { .. } => Corruption::Version,
        ReportError::Kind { .. } => Corruption::Kind,
        ReportError::OutOfRange { .. } => Corruption::Range,
    })
}
