//! The counts of a device's encoders: the alternative to a pose, for a device that leaves its kinematics to the host.

use super::wire::{self, get_i32s, get_u8, put, put_i32s};
use super::{Condition, Field, Kind, LENGTH, ReportError};

/// The largest number of encoders.
pub const ENCODERS: usize = 8;

/// Offsets of the fields, as in the table in [`super`].
mod at {
    pub(super) const COUNTS: usize = 24;
    pub(super) const NUMBER: usize = 56;
    pub(super) const RESERVED: usize = 57;
}

/// The counts of a device's encoders as they are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncodersReport {
    /// Number of the report, which wraps; a gap means lost reports.
    pub sequence: u16,
    /// The session; zero before the first hello.
    pub session: u32,
    /// Time, wrench in force, buttons and mode.
    pub condition: Condition,
    /// The counts; zero from `number` on.
    pub counts: [i32; ENCODERS],
    /// The number of encoders, 1 to 8.
    pub number: u8,
}

impl EncodersReport {
    /// The bytes of the report.
    pub fn encode(&self) -> [u8; LENGTH] {
        let mut report = wire::start(Kind::Encoders, self.sequence, self.session);
        self.condition.write(&mut report);
        put_i32s::<{ at::COUNTS }, ENCODERS>(&mut report, self.counts);
        put::<{ at::NUMBER }, 1>(&mut report, [self.number]);
        wire::seal(report)
    }

    /// The report in `bytes`.
    ///
    /// # Errors
    /// The first [`ReportError`] found, in the order of the enum's variants.
    pub fn decode(bytes: &[u8]) -> Result<Self, ReportError> {
        let report = wire::check(bytes, Kind::Encoders)?;
        let condition = Condition::read(report)?;
        let counts = get_i32s::<{ at::COUNTS }, ENCODERS>(report);
        let number = get_u8::<{ at::NUMBER }>(report);
        wire::check_range(Field::Encoders, 1, ENCODERS as u64, number)?;
        wire::check_unused(&counts, number)?;
        wire::check_reserved::<{ at::RESERVED }, { wire::END }>(report)?;
        Ok(Self {
            sequence: wire::sequence(report),
            session: wire::session(report),
            condition,
            counts,
            number,
        })
    }
}
