//! The state that a device reports: its pose, its velocities and its buttons.

use super::units::{ANGULAR_VELOCITY, POSITION, QUATERNION, VELOCITY, to_i16, to_i32, to_si};
use super::wire::{self, get, put};
use super::{Field, Kind, LENGTH, ReportError};

/// Bits of the status byte. Others are sent as zero and ignored when received.
pub mod status {
    /// The encoders have found their reference: positions are absolute.
    pub const CALIBRATED: u8 = 1 << 0;
    /// The amplifiers are on: the hand feels the commanded wrench.
    pub const POWERED: u8 = 1 << 1;
    /// The device has received no wrench for too long and has let go by itself.
    pub const WATCHDOG: u8 = 1 << 2;
    /// The commanded wrench exceeds what the device can give, or what it may give.
    pub const LIMITED: u8 = 1 << 3;
    /// The device has found a fault of its own and gives no force until it is restarted.
    pub const FAULT: u8 = 1 << 7;
}

/// Offsets of the fields, as in the table in [`super`].
mod at {
    pub(super) const TIME: usize = 4;
    pub(super) const POSITION: usize = 8;
    pub(super) const ORIENTATION: usize = 20;
    pub(super) const VELOCITY: usize = 28;
    pub(super) const ANGULAR_VELOCITY: usize = 40;
    pub(super) const BUTTONS: usize = 46;
    pub(super) const STATUS: usize = 48;
    pub(super) const RESERVED: usize = 49;
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
/// use firmware_proto::report::{ReportError, StateReport, StateSi, status};
///
/// let si = StateSi {
///     position: [0.01, -0.02, 0.0],
///     orientation: [1.0, 0.0, 0.0, 0.0],
///     velocity: [0.05, 0.0, 0.0],
///     angular_velocity: [0.0; 3],
/// };
/// let report = StateReport::from_si(7, 1234, &si, 0, status::CALIBRATED | status::POWERED);
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
    /// Time at which the device read its encoders (µs of its own clock); wraps after 71.6 minutes.
    pub time_us: u32,
    /// Position (0.1 µm).
    pub position: [i32; 3],
    /// Orientation: quaternion w, x, y, z. Its length is within 1 % of 32767, which represents 1.
    pub orientation: [i16; 4],
    /// Linear velocity (µm/s).
    pub velocity: [i32; 3],
    /// Angular velocity (mrad/s).
    pub angular_velocity: [i16; 3],
    /// Pressed buttons; bit 0 is the first button.
    pub buttons: u16,
    /// Status bits, see [`status`].
    pub status: u8,
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

/// The bytes of a checked report, read field by field.
#[derive(Clone, Copy, Debug)]
pub struct StateView<'a> {
    report: &'a [u8; LENGTH],
}

impl<'a> StateView<'a> {
    /// Checks `bytes` as a whole. Afterwards, no access can fail.
    ///
    /// # Errors
    /// The first [`ReportError`] found, in the order of the enum's variants.
    pub fn new(bytes: &'a [u8]) -> Result<Self, ReportError> {
        let view = Self {
            report: wire::check(bytes, Kind::State)?,
        };
        let (least, most) = ORIENTATION_LENGTH;
        let found = view
            .orientation()
            .map(|q| u64::from(q.unsigned_abs()).pow(2))
            .iter()
            .sum();
        if !(least..=most).contains(&found) {
            let field = Field::OrientationLength;
            return Err(ReportError::OutOfRange {
                field,
                least,
                most,
                found,
            });
        }
        wire::check_reserved::<{ at::RESERVED }>(view.report)?;
        Ok(view)
    }

    /// As [`StateReport::sequence`].
    pub fn sequence(&self) -> u16 {
        wire::sequence(self.report)
    }

    /// As [`StateReport::time_us`].
    pub fn time_us(&self) -> u32 {
        u32::from_le_bytes(get::<{ at::TIME }, 4>(self.report))
    }

    /// As [`StateReport::position`].
    pub fn position(&self) -> [i32; 3] {
        wire::get_3_i32::<{ at::POSITION }>(self.report)
    }

    /// As [`StateReport::orientation`].
    pub fn orientation(&self) -> [i16; 4] {
        wire::get_4_i16::<{ at::ORIENTATION }>(self.report)
    }

    /// As [`StateReport::velocity`].
    pub fn velocity(&self) -> [i32; 3] {
        wire::get_3_i32::<{ at::VELOCITY }>(self.report)
    }

    /// As [`StateReport::angular_velocity`].
    pub fn angular_velocity(&self) -> [i16; 3] {
        wire::get_3_i16::<{ at::ANGULAR_VELOCITY }>(self.report)
    }

    /// As [`StateReport::buttons`].
    pub fn buttons(&self) -> u16 {
        u16::from_le_bytes(get::<{ at::BUTTONS }, 2>(self.report))
    }

    /// As [`StateReport::status`].
    pub fn status(&self) -> u8 {
        let [status] = get::<{ at::STATUS }, 1>(self.report);
        status
    }
}

impl From<StateView<'_>> for StateReport {
    fn from(view: StateView<'_>) -> Self {
        Self {
            sequence: view.sequence(),
            time_us: view.time_us(),
            position: view.position(),
            orientation: view.orientation(),
            velocity: view.velocity(),
            angular_velocity: view.angular_velocity(),
            buttons: view.buttons(),
            status: view.status(),
        }
    }
}

impl StateReport {
    /// The bytes of the report.
    ///
    /// Any values can be encoded, but [`decode`](Self::decode) refuses an orientation whose length is not within 1 % of
    /// 32767.
    pub fn encode(&self) -> [u8; LENGTH] {
        let mut report = wire::start(Kind::State, self.sequence);
        put::<{ at::TIME }, 4>(&mut report, self.time_us.to_le_bytes());
        wire::put_3_i32::<{ at::POSITION }>(&mut report, self.position);
        wire::put_4_i16::<{ at::ORIENTATION }>(&mut report, self.orientation);
        wire::put_3_i32::<{ at::VELOCITY }>(&mut report, self.velocity);
        wire::put_3_i16::<{ at::ANGULAR_VELOCITY }>(&mut report, self.angular_velocity);
        put::<{ at::BUTTONS }, 2>(&mut report, self.buttons.to_le_bytes());
        put::<{ at::STATUS }, 1>(&mut report, [self.status]);
        wire::seal(report)
    }

    /// The report in `bytes`.
    ///
    /// # Errors
    /// The first [`ReportError`] found, in the order of the enum's variants.
    pub fn decode(bytes: &[u8]) -> Result<Self, ReportError> {
        StateView::new(bytes).map(Self::from)
    }

    /// A report from values in SI.
    ///
    /// Values are rounded to the nearest unit of the report. Values beyond the range saturate at its ends (position
    /// ±214 m, velocity ±2147 m/s, angular velocity ±32.7 rad/s). A NaN becomes zero.
    pub fn from_si(sequence: u16, time_us: u32, si: &StateSi, buttons: u16, status: u8) -> Self {
        Self {
            sequence,
            time_us,
            position: si.position.map(|x| to_i32(x, POSITION)),
            orientation: si.orientation.map(|q| to_i16(q, QUATERNION)),
            velocity: si.velocity.map(|v| to_i32(v, VELOCITY)),
            angular_velocity: si.angular_velocity.map(|w| to_i16(w, ANGULAR_VELOCITY)),
            buttons,
            status,
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

#[cfg(test)]
#[path = "state_tests.rs"]
mod tests;
