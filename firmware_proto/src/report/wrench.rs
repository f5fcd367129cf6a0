//! The wrench that a device is commanded to render: a force and a moment on the hand.

use super::units::{FORCE, to_i32, to_si};
use super::wire::{self, get_u8, get_u16, put};
use super::{Field, Kind, LENGTH, ReportError};

/// Bits of the flags byte. Others are zero.
pub mod flags {
    /// Apply the wrench. Without this bit the device lets go, whatever the wrench.
    pub const ENABLE: u8 = 1 << 0;
    /// The host holds the device in a safe state.
    pub const SAFE_HOLD: u8 = 1 << 1;
    /// All bits that this version defines.
    pub const KNOWN: u8 = ENABLE | SAFE_HOLD;
}

/// Offsets of the fields, as in the table in [`super`].
mod at {
    pub(super) const ANSWERS: usize = 8;
    pub(super) const FLAGS: usize = 10;
    pub(super) const GAP: usize = 11;
    pub(super) const FORCE: usize = 12;
    pub(super) const MOMENT: usize = 24;
    pub(super) const RESERVED: usize = 36;
}

/// The wrench on the hand that a device is commanded to render, as it is sent, in the device's base frame.
///
/// ```
/// use firmware_proto::report::{WrenchReport, WrenchSi, flags};
///
/// let si = WrenchSi {
///     force: [1.5, -0.25, 0.0],
///     moment: [0.0, 0.0, 0.01],
/// };
/// let report = WrenchReport::from_si(9, 0xCAFE, 7, &si, flags::ENABLE);
/// let received = WrenchReport::decode(&report.encode()).unwrap();
/// assert_eq!(received.to_si(), si);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WrenchReport {
    /// Number of the report, which wraps; a gap means lost reports.
    pub sequence: u16,
    /// The session; not zero.
    pub session: u32,
    /// Sequence number of the state that the wrench answers.
    pub answers: u16,
    /// Force (µN).
    pub force: [i32; 3],
    /// Moment about the handle's origin (µN·m).
    pub moment: [i32; 3],
    /// Flag bits, see [`flags`].
    pub flags: u8,
}

/// A wrench in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchSi {
    /// Force (N), at most ±2147 N in a report.
    pub force: [f64; 3],
    /// Moment about the handle's origin (N·m), at most ±2147 N·m in a report.
    pub moment: [f64; 3],
}

impl WrenchReport {
    /// The bytes of the report.
    pub fn encode(&self) -> [u8; LENGTH] {
        let mut report = wire::start(Kind::Wrench, self.sequence, self.session);
        put::<{ at::ANSWERS }, 2>(&mut report, self.answers.to_le_bytes());
        wire::put_3_i32::<{ at::FORCE }>(&mut report, self.force);
        wire::put_3_i32::<{ at::MOMENT }>(&mut report, self.moment);
        put::<{ at::FLAGS }, 1>(&mut report, [self.flags]);
        wire::seal(report)
    }

    /// The report in `bytes`.
    ///
    /// # Errors
    /// The first [`ReportError`] found, in the order of the enum's variants.
    pub fn decode(bytes: &[u8]) -> Result<Self, ReportError> {
        let report = wire::check(bytes, Kind::Wrench)?;
        wire::check_session(report)?;
        let flags = get_u8::<{ at::FLAGS }>(report);
        wire::check_bits(Field::Flags, flags::KNOWN, flags)?;
        wire::check_reserved::<{ at::GAP }, { at::FORCE }>(report)?;
        wire::check_reserved::<{ at::RESERVED }, { wire::END }>(report)?;
        Ok(Self {
            sequence: wire::sequence(report),
            session: wire::session(report),
            answers: get_u16::<{ at::ANSWERS }>(report),
            force: wire::get_3_i32::<{ at::FORCE }>(report),
            moment: wire::get_3_i32::<{ at::MOMENT }>(report),
            flags,
        })
    }

    /// A report from a wrench in SI.
    ///
    /// Values are rounded to the nearest µN and µN·m. Values beyond ±2147 N or N·m saturate there. A NaN becomes zero.
    /// These limits do not replace the safety stage, which comes before and has far lower limits.
    pub fn from_si(sequence: u16, session: u32, answers: u16, si: &WrenchSi, flags: u8) -> Self {
        Self {
            sequence,
            session,
            answers,
            force: si.force.map(|f| to_i32(f, FORCE)),
            moment: si.moment.map(|m| to_i32(m, FORCE)),
            flags,
        }
    }

    /// The wrench in SI.
    pub fn to_si(&self) -> WrenchSi {
        WrenchSi {
            force: to_si(self.force, FORCE),
            moment: to_si(self.moment, FORCE),
        }
    }
}
