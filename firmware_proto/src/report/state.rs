//! The state that a device reports: its condition, its pose and its velocities.

use super::units::{ANGULAR_VELOCITY, POSITION, QUATERNION, VELOCITY, to_i16, to_i32, to_si};
use super::wire;
use super::{Condition, Field, Kind, LENGTH, ReportError};

/// Offsets of the fields, as in the table in [`super`].
mod at {
    pub(super) const POSITION: usize = 24;
    pub(super) const ORIENTATION: usize = 36;
    pub(super) const VELOCITY: usize = 44;
    pub(super) const ANGULAR_VELOCITY: usize = 56;
}

/// The range of the squared length of an orientation's four numbers: a length within 1 % of 32767. Rounding changes the
/// length of a unit quaternion by less than 0.01 %.
const ORIENTATION_LENGTH: (u64, u64) = {
    let one = 32767 * 32767;
    (one * 99 * 99 / 10_000, one * 101 * 101 / 10_000)
};

/// The state of a device as it is sent. Angles and lengths are in the device's base frame.
///
/// ```
/// use firmware_proto::report::{Condition, Mode, ReportError, StateReport, StateSi, status};
///
/// let si = StateSi {
///     position: [0.01, -0.02, 0.0],
///     orientation: [1.0, 0.0, 0.0, 0.0],
///     velocity: [0.05, 0.0, 0.0],
///     angular_velocity: [0.0; 3],
/// };
/// let condition = Condition {
///     time_us: 1234,
///     status: status::CALIBRATED | status::POWERED,
///     mode: Mode::Idle,
///     ..Condition::default()
/// };
/// let report = StateReport::from_si(7, 0xCAFE, condition, &si);
/// let mut bytes = report.encode();
/// assert_eq!(StateReport::decode(&bytes), Ok(report));
/// assert_eq!(report.to_si(), si);
///
/// // A bit that flips in transit is found.
/// bytes[20] ^= 4;
/// assert!(matches!(StateReport::decode(&bytes), Err(ReportError::Crc { .. })));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StateReport {
    /// Number of the report, which wraps; a gap means lost reports.
    pub sequence: u16,
    /// The session; zero before the first hello.
    pub session: u32,
    /// Time, wrench in force, buttons and mode.
    pub condition: Condition,
    /// Position (0.1 µm).
    pub position: [i32; 3],
    /// Orientation: quaternion w, x, y, z. Its length is within 1 % of 32767, which represents 1.
    pub orientation: [i16; 4],
    /// Linear velocity (µm/s).
    pub velocity: [i32; 3],
    /// Angular velocity (mrad/s).
    pub angular_velocity: [i16; 3],
}

/// Pose and velocities of a device, in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateSi {
    /// Position (m), at most ±214 m in a report.
    pub position: [f64; 3],
    /// Orientation: unit quaternion w, x, y, z. From a report, its length is within 1 % of 1: normalize it before use.
    pub orientation: [f64; 4],
    /// Linear velocity (m/s), at most ±2147 m/s in a report.
    pub velocity: [f64; 3],
    /// Angular velocity (rad/s), at most ±32.7 rad/s in a report.
    pub angular_velocity: [f64; 3],
}

impl StateReport {
    /// The bytes of the report.
    ///
    /// Any values can be encoded, but [`decode`](Self::decode) refuses an orientation whose length is not within 1 % of
    /// 32767.
    pub fn encode(&self) -> [u8; LENGTH] {
        let mut report = wire::start(Kind::State, self.sequence, self.session);
        self.condition.write(&mut report);
        wire::put_3_i32::<{ at::POSITION }>(&mut report, self.position);
        wire::put_4_i16::<{ at::ORIENTATION }>(&mut report, self.orientation);
        wire::put_3_i32::<{ at::VELOCITY }>(&mut report, self.velocity);
        wire::put_3_i16::<{ at::ANGULAR_VELOCITY }>(&mut report, self.angular_velocity);
        wire::seal(report)
    }

    /// The report in `bytes`.
    ///
    /// # Errors
    /// The first [`ReportError`] found, in the order of the enum's variants.
    pub fn decode(bytes: &[u8]) -> Result<Self, ReportError> {
        let report = wire::check(bytes, Kind::State)?;
        let condition = Condition::read(report)?;
        let orientation = wire::get_4_i16::<{ at::ORIENTATION }>(report);
        let squares = orientation.map(|q| u64::from(q.unsigned_abs()).pow(2));
        let (least, most) = ORIENTATION_LENGTH;
        let length: u64 = squares.iter().sum();
        wire::check_range(Field::OrientationLength, least, most, length)?;
        Ok(Self {
            sequence: wire::sequence(report),
            session: wire::session(report),
            condition,
            position: wire::get_3_i32::<{ at::POSITION }>(report),
            orientation,
            velocity: wire::get_3_i32::<{ at::VELOCITY }>(report),
            angular_velocity: wire::get_3_i16::<{ at::ANGULAR_VELOCITY }>(report),
        })
    }

    /// A report from values in SI.
    ///
    /// Values are rounded to the nearest unit of the report. Values beyond the range saturate at its ends (position
    /// ±214 m, velocity ±2147 m/s, angular velocity ±32.7 rad/s). A NaN becomes zero.
    pub fn from_si(sequence: u16, session: u32, condition: Condition, si: &StateSi) -> Self {
        Self {
            sequence,
            session,
            condition,
            position: si.position.map(|x| to_i32(x, POSITION)),
            orientation: si.orientation.map(|q| to_i16(q, QUATERNION)),
            velocity: si.velocity.map(|v| to_i32(v, VELOCITY)),
            angular_velocity: si.angular_velocity.map(|w| to_i16(w, ANGULAR_VELOCITY)),
        }
    }

    /// Pose and velocities of the device, in SI.
    pub fn to_si(&self) -> StateSi {
        StateSi {
            position: to_si(self.position, POSITION),
            orientation: to_si(self.orientation, QUATERNION),
            velocity: to_si(self.velocity, VELOCITY),
            angular_velocity: to_si(self.angular_velocity, ANGULAR_VELOCITY),
        }
    }
}
