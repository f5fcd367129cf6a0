//! The host's side of the firmware protocol: from a device's report to a state, from a wrench to a report.
//!
//! This module converts the units of a device to SI.
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

use firmware_proto::report::{Condition, Mode, ReportError, StateReport, WrenchSi, axes, status};
use rt_core::{
    Corruption, DeviceError, DeviceState, Freedom, Pose, Rendering, Twist, Vec3, Wrench,
};

pub use firmware_proto::host::DeviceClock;

/// The state in a report, in SI units. If the device senses no rotation (`sensed`), the report's orientation and
/// angular velocity are ignored. Positions and velocities along axes that the device does not sense are ignored, too.
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
        buttons: u32::from(report.condition.buttons),
        device_time_ns,
        rendering: rendering_of(&report.condition),
    }
}

/// The rendering of a device in this condition. A device in a fault, without power, or without a wrench in force
/// renders nothing.
pub fn rendering_of(condition: &Condition) -> Rendering {
    let acting = status::POWERED | status::IN_FORCE;
    match condition.mode {
        Mode::Fault => Rendering::Fault(condition.fault),
        _ if condition.status & acting == acting => Rendering::Commanded,
        _ => Rendering::LetGo,
    }
}

/// The degrees of freedom in the form in which a device names them; see [`axes`].
pub fn axes_of(freedom: Freedom) -> u8 {
    match freedom {
        Freedom::Six => axes::ALL,
        Freedom::Three => axes::TRANSLATIONS,
        Freedom::Along(free) => {
            let bits = free.free().into_iter().zip([axes::X, axes::Y, axes::Z]);
            bits.fold(0, |all, (free, bit)| if free { all | bit } else { all })
        }
    }
}

/// `wrench` (device axes) in the form for a report.
pub fn si_of(wrench: &Wrench) -> WrenchSi {
    WrenchSi {
        force: wrench.force.into(),
        moment: wrench.moment.into(),
    }
}

/// The error of the device for a report that could not be decoded.
pub fn corrupt(error: ReportError) -> DeviceError {
    DeviceError::Corrupt(match error {
        ReportError::Length { .. } => Corruption::Length,
        ReportError::Crc { .. } => Corruption::CheckSum,
        ReportError::Version { .. } => Corruption::Version,
        ReportError::Kind { .. } | ReportError::UnexpectedKind { .. } => Corruption::Kind,
        ReportError::OutOfRange { .. } => Corruption::Range,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_renders_with_power_and_with_a_wrench_in_force_alone() {
        let both = status::POWERED | status::IN_FORCE;
        let rendering = |status, mode| {
            rendering_of(&Condition {
                status,
                mode,
                fault: 7,
                ..Condition::default()
            })
        };
        for (status, rendered) in [
            (both, Rendering::Commanded),
            (0xff, Rendering::Commanded),
            (!both, Rendering::LetGo),
            (0, Rendering::LetGo),
            (status::POWERED, Rendering::LetGo),
            (status::IN_FORCE, Rendering::LetGo),
        ] {
            assert_eq!(rendering(status, Mode::Active), rendered, "{status:#x}");
            // A device in a fault renders nothing, whatever its other statements.
            assert_eq!(rendering(status, Mode::Fault), Rendering::Fault(7));
        }
    }
}
