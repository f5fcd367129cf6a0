//! The host's greeting: it opens a session.

use super::wire::{self, get_u8, get_u32, put};
use super::{Field, Kind, LENGTH, ReportError, VERSION};

/// The watchdog of a device, unless the host asks for another (µs).
pub const WATCHDOG_US: u32 = 10_000;
/// The shortest watchdog that a host may ask for (µs).
pub const WATCHDOG_LEAST_US: u32 = 2_000;
/// The longest watchdog that a host may ask for (µs).
pub const WATCHDOG_MOST_US: u32 = 100_000;

/// Offsets of the fields, as in the table in [`super`].
mod at {
    pub(super) const NEWEST: usize = 8;
    pub(super) const GAP: usize = 9;
    pub(super) const WATCHDOG: usize = 12;
    pub(super) const RESERVED: usize = 16;
}

/// The host's greeting. It has the same bytes in every version from 2 on.
///
/// Byte 0 of a hello is the oldest version that the host speaks, so a device that speaks any common version can read
/// the hello. The device answers in the newest version that both speak, and all later reports are of that version.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HelloReport {
    /// Number of the report, which wraps.
    pub sequence: u16,
    /// The session that the host opens, or continues; not zero. A host draws another number at each start.
    pub session: u32,
    /// The newest version that the host speaks, at least [`VERSION`].
    pub newest: u8,
    /// The watchdog that the host wants (µs), [`WATCHDOG_LEAST_US`] to [`WATCHDOG_MOST_US`]; zero for
    /// [`WATCHDOG_US`].
    pub watchdog_us: u32,
}

impl HelloReport {
    /// The bytes of the report.
    pub fn encode(&self) -> [u8; LENGTH] {
        let mut report = wire::start(Kind::Hello, self.sequence, self.session);
        put::<{ at::NEWEST }, 1>(&mut report, [self.newest]);
        put::<{ at::WATCHDOG }, 4>(&mut report, self.watchdog_us.to_le_bytes());
        wire::seal(report)
    }

    /// The report in `bytes`.
    ///
    /// # Errors
    /// The first [`ReportError`] found, in the order of the enum's variants.
    pub fn decode(bytes: &[u8]) -> Result<Self, ReportError> {
        let report = wire::check(bytes, Kind::Hello)?;
        wire::check_session(report)?;
        let newest = get_u8::<{ at::NEWEST }>(report);
        wire::check_range(Field::Newest, VERSION.into(), u8::MAX.into(), newest)?;
        let watchdog_us = get_u32::<{ at::WATCHDOG }>(report);
        if watchdog_us != 0 {
            check_watchdog(watchdog_us)?;
        }
        wire::check_reserved::<{ at::GAP }, { at::WATCHDOG }>(report)?;
        wire::check_reserved::<{ at::RESERVED }, { wire::END }>(report)?;
        Ok(Self {
            sequence: wire::sequence(report),
            session: wire::session(report),
            newest,
            watchdog_us,
        })
    }
}

/// Checks that a watchdog is in range.
pub(super) fn check_watchdog(watchdog_us: u32) -> Result<(), ReportError> {
    let (least, most) = (WATCHDOG_LEAST_US.into(), WATCHDOG_MOST_US.into());
    wire::check_range(Field::Watchdog, least, most, watchdog_us)
}
