//! The beginning of every state of a device: its time, the wrench in force, its buttons, its mode.

use super::wire::{self, get_u8, get_u16, get_u32, put};
use super::{Field, LENGTH, ReportError};

/// Bits of the status byte. Others are zero.
pub mod status {
    /// The encoders have found their reference: positions are absolute.
    pub const CALIBRATED: u8 = 1 << 0;
    /// The amplifiers are on: the hand feels the commanded wrench.
    pub const POWERED: u8 = 1 << 1;
    /// The device has received no wrench for too long and has let go by itself. The next wrench in force clears the bit.
    pub const WATCHDOG: u8 = 1 << 2;
    /// The wrench in force exceeds the present limit of the device, for example because its motors are hot.
    pub const LIMITED: u8 = 1 << 3;
    /// The wrench whose number the state names is in force. Without this bit, no wrench is in force.
    pub const IN_FORCE: u8 = 1 << 4;
    /// All bits that this version defines.
    pub const KNOWN: u8 = CALIBRATED | POWERED | WATCHDOG | LIMITED | IN_FORCE;
}

/// Numbers of faults. Numbers from 128 on are the device's own.
pub mod fault {
    use core::num::NonZeroU8;

    /// The emergency stop was pressed.
    pub const EMERGENCY_STOP: NonZeroU8 = number(1);
    /// An amplifier failed.
    pub const AMPLIFIER: NonZeroU8 = number(2);
    /// An encoder failed.
    pub const ENCODER: NonZeroU8 = number(3);
    /// A motor or an amplifier is too hot.
    pub const TEMPERATURE: NonZeroU8 = number(4);
    /// The supply voltage is out of range.
    pub const SUPPLY: NonZeroU8 = number(5);
    /// The reference of the encoders was not found.
    pub const HOMING: NonZeroU8 = number(6);

    /// The name of a fault; `None` for a number of the device's own.
    pub fn name(number: u8) -> Option<&'static str> {
        let names = [
            (EMERGENCY_STOP, "emergency stop"),
            (AMPLIFIER, "amplifier"),
            (ENCODER, "encoder"),
            (TEMPERATURE, "temperature"),
            (SUPPLY, "supply voltage"),
            (HOMING, "reference of the encoders not found"),
        ];
        let mut known = names.into_iter();
        known.find_map(|(known, name)| (known.get() == number).then_some(name))
    }

    const fn number(number: u8) -> NonZeroU8 {
        match NonZeroU8::new(number) {
            Some(number) => number,
            None => NonZeroU8::MAX,
        }
    }
}

/// The mode of a device; see [`crate::device`] for the transitions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// The device starts. No force.
    #[default]
    Boot = 0,
    /// The encoders search their reference. No force of the host.
    Homing = 1,
    /// Positions are absolute. No force.
    Idle = 2,
    /// The host's wrench is in force.
    Active = 3,
    /// The device has found a fault. No force until the device is reset.
    Fault = 4,
}

impl Mode {
    /// The mode of a number; `None` if this version has no such mode.
    pub fn of(number: u8) -> Option<Self> {
        const ALL: [Mode; 5] = [
            Mode::Boot,
            Mode::Homing,
            Mode::Idle,
            Mode::Active,
            Mode::Fault,
        ];
        ALL.into_iter().find(|&mode| mode as u8 == number)
    }
}

/// Offsets of the fields, as in the table in [`super`].
mod at {
    pub(super) const TIME: usize = 8;
    pub(super) const SINCE: usize = 12;
    pub(super) const WRENCH: usize = 16;
    pub(super) const BUTTONS: usize = 18;
    pub(super) const STATUS: usize = 20;
    pub(super) const MODE: usize = 21;
    pub(super) const REFUSED: usize = 22;
    pub(super) const FAULT: usize = 23;
}

/// The condition of a device at the time of a state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Condition {
    /// Time at which the device read its encoders (µs of its own clock); wraps after 71.6 minutes.
    pub time_us: u32,
    /// Time at which the present wrench came into force, or at which the last wrench went out of force (µs of the same
    /// clock).
    pub since_us: u32,
    /// Sequence number of the wrench in force; without meaning unless [`status::IN_FORCE`] is set.
    pub wrench: u16,
    /// Pressed buttons; bit 0 is the first button.
    pub buttons: u16,
    /// Status bits, see [`status`].
    pub status: u8,
    /// The mode of the device.
    pub mode: Mode,
    /// Number of reports that the device has refused since it started; wraps.
    pub refused: u8,
    /// The number of the fault, see [`fault`]; zero in every other mode than [`Mode::Fault`].
    pub fault: u8,
}

impl Condition {
    /// The sequence number of the wrench in force, if a wrench is in force.
    pub fn in_force(&self) -> Option<u16> {
        (self.status & status::IN_FORCE != 0).then_some(self.wrench)
    }

    pub(super) fn read(report: &[u8; LENGTH]) -> Result<Self, ReportError> {
        let status = get_u8::<{ at::STATUS }>(report);
        wire::check_bits(Field::Status, status::KNOWN, status)?;
        let number = get_u8::<{ at::MODE }>(report);
        let Some(mode) = Mode::of(number) else {
            return Err(ReportError::OutOfRange {
                field: Field::Mode,
                least: 0,
                most: Mode::Fault as u64,
                found: number.into(),
            });
        };
        let fault = get_u8::<{ at::FAULT }>(report);
        let (least, most) = match mode {
            Mode::Fault => (1, u8::MAX.into()),
            _ => (0, 0),
        };
        wire::check_range(Field::Fault, least, most, fault)?;
        Ok(Self {
            time_us: get_u32::<{ at::TIME }>(report),
            since_us: get_u32::<{ at::SINCE }>(report),
            wrench: get_u16::<{ at::WRENCH }>(report),
            buttons: get_u16::<{ at::BUTTONS }>(report),
            status,
            mode,
            refused: get_u8::<{ at::REFUSED }>(report),
            fault,
        })
    }

    pub(super) fn write(&self, report: &mut [u8; LENGTH]) {
        put::<{ at::TIME }, 4>(report, self.time_us.to_le_bytes());
        put::<{ at::SINCE }, 4>(report, self.since_us.to_le_bytes());
        put::<{ at::WRENCH }, 2>(report, self.wrench.to_le_bytes());
        put::<{ at::BUTTONS }, 2>(report, self.buttons.to_le_bytes());
        put::<{ at::STATUS }, 1>(report, [self.status]);
        put::<{ at::MODE }, 1>(report, [self.mode as u8]);
        put::<{ at::REFUSED }, 1>(report, [self.refused]);
        put::<{ at::FAULT }, 1>(report, [self.fault]);
    }
}
