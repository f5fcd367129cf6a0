//! What a device is asked to do: a force and a moment on the hand.

use super::units::{FORCE, to_i32, to_si};
use super::wire::{self, get, put};
use super::{Kind, LENGTH, ReportError};

/// Bits of the flags byte. Others are sent as zero and ignored when received.
pub mod flags {
    /// Apply the wrench. Without it the device lets go, whatever the wrench.
    pub const ENABLE: u8 = 1 << 0;
    /// The host is holding the device in a safe state.
    pub const SAFE_HOLD: u8 = 1 << 1;
}

/// Where the fields stand; the table in [`super`] says the same in words.
mod at {
    pub(super) const FORCE: usize = 4;
    pub(super) const MOMENT: usize = 16;
    pub(super) const FLAGS: usize = 28;
    pub(super) const RESERVED: usize = 29;
}

/// The wrench that a device is asked to apply to the hand, as it is sent, in the device's base frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WrenchReport {
    /// Plus one each report, wraps; a gap is a lost report.
    pub sequence: u16,
    /// Force (µN).
    pub force: [i32; 3],
    /// Moment about the handle's origin (µN·m).
    pub moment: [i32; 3],
    /// See [`flags`].
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

/// The bytes of a report that has been checked, read field by field.
#[derive(Clone, Copy, Debug)]
pub struct WrenchView<'a> {
    report: &'a [u8; LENGTH],
}

impl<'a> WrenchView<'a> {
    /// Checks `bytes` whole; after it, no access can fail.
    ///
    /// # Errors
    /// The first [`ReportError`] found, in the order of the enum's variants.
    pub fn new(bytes: &'a [u8]) -> Result<Self, ReportError> {
        let report = wire::check(bytes, Kind::Wrench)?;
        wire::check_reserved::<{ at::RESERVED }>(report)?;
        Ok(Self { report })
    }

    /// As [`WrenchReport::sequence`].
    pub fn sequence(&self) -> u16 {
        wire::sequence(self.report)
    }

    /// As [`WrenchReport::force`].
    pub fn force(&self) -> [i32; 3] {
        wire::get_3_i32::<{ at::FORCE }>(self.report)
    }

    /// As [`WrenchReport::moment`].
    pub fn moment(&self) -> [i32; 3] {
        wire::get_3_i32::<{ at::MOMENT }>(self.report)
    }

    /// As [`WrenchReport::flags`].
    pub fn flags(&self) -> u8 {
        let [flags] = get::<{ at::FLAGS }, 1>(self.report);
        flags
    }
}

impl From<WrenchView<'_>> for WrenchReport {
    fn from(view: WrenchView<'_>) -> Self {
        Self {
            sequence: view.sequence(),
            force: view.force(),
            moment: view.moment(),
            flags: view.flags(),
        }
    }
}

impl WrenchReport {
    /// The report's bytes.
    pub fn encode(&self) -> [u8; LENGTH] {
        let mut report = wire::start(Kind::Wrench, self.sequence);
        wire::put_3_i32::<{ at::FORCE }>(&mut report, self.force);
        wire::put_3_i32::<{ at::MOMENT }>(&mut report, self.moment);
        put::<{ at::FLAGS }, 1>(&mut report, [self.flags]);
        wire::seal(report)
    }

    /// The report that `bytes` hold.
    ///
    /// # Errors
    /// The first [`ReportError`] found, in the order of the enum's variants.
    pub fn decode(bytes: &[u8]) -> Result<Self, ReportError> {
        WrenchView::new(bytes).map(Self::from)
    }

    /// A report from SI.
    ///
    /// Values are rounded to the nearest µN and µN·m. Those beyond ±2147 N or N·m saturate there;
    /// not-a-number becomes zero. Neither stands in for the safety stage, which comes before and whose
    /// limits are far lower.
    pub fn from_si(sequence: u16, si: &WrenchSi, flags: u8) -> Self {
        Self {
            sequence,
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

#[cfg(test)]
#[path = "wrench_tests.rs"]
mod tests;
