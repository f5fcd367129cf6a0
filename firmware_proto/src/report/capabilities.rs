//! The capabilities of a device: its answer to a hello.

use super::hello::check_watchdog;
use super::wire::{self, get, get_u8, get_u16, get_u32, put};
use super::{ENCODERS, Field, Kind, LENGTH, ReportError};

/// Bits of the axes of a device's handle.
pub mod axes {
    /// Translation along x.
    pub const X: u8 = 1 << 0;
    /// Translation along y.
    pub const Y: u8 = 1 << 1;
    /// Translation along z.
    pub const Z: u8 = 1 << 2;
    /// Rotation about x.
    pub const RX: u8 = 1 << 3;
    /// Rotation about y.
    pub const RY: u8 = 1 << 4;
    /// Rotation about z.
    pub const RZ: u8 = 1 << 5;
    /// The three translations.
    pub const TRANSLATIONS: u8 = X | Y | Z;
    /// All six axes.
    pub const ALL: u8 = TRANSLATIONS | RX | RY | RZ;
}

/// Offsets of the fields, as in the table in [`super`].
mod at {
    pub(super) const HELLO: usize = 8;
    pub(super) const SENSED: usize = 10;
    pub(super) const ACTUATED: usize = 11;
    pub(super) const MAJOR: usize = 12;
    pub(super) const MINOR: usize = 13;
    pub(super) const PATCH: usize = 14;
    pub(super) const MAX_FORCE: usize = 16;
    pub(super) const MAX_MOMENT: usize = 20;
    pub(super) const RADIUS: usize = 24;
    pub(super) const STEP: usize = 28;
    pub(super) const LEAST_RATE: usize = 32;
    pub(super) const MOST_RATE: usize = 34;
    pub(super) const WATCHDOG: usize = 36;
    pub(super) const HELLO_TIME: usize = 40;
    pub(super) const SENDS: usize = 44;
    pub(super) const ENCODERS: usize = 45;
    pub(super) const MODEL: usize = 46;
}

/// The version of a device's firmware.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FirmwareVersion {
    /// Incompatible changes.
    pub major: u8,
    /// Additions.
    pub minor: u8,
    /// Corrections.
    pub patch: u16,
}

/// The form of a device's states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sends {
    /// Poses: [`StateReport`](super::StateReport).
    #[default]
    Poses,
    /// The counts of `encoders` encoders, 1 to 8: [`EncodersReport`](super::EncodersReport).
    Counts {
        /// The number of encoders.
        encoders: u8,
    },
}

impl Sends {
    /// The kind of report, and the number of encoders.
    fn numbers(self) -> (u8, u8) {
        match self {
            Self::Poses => (Kind::State as u8, 0),
            Self::Counts { encoders } => (Kind::Encoders as u8, encoders),
        }
    }
}

/// The properties of a device that do not change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Model {
    /// The axes of the handle that the device senses, see [`axes`]; not zero.
    pub sensed: u8,
    /// The axes of the handle that the device actuates, see [`axes`].
    pub actuated: u8,
    /// The version of the firmware.
    pub firmware: FirmwareVersion,
    /// The largest force (µN).
    pub max_force: u32,
    /// The largest moment (µN·m).
    pub max_moment: u32,
    /// The radius of the workspace (0.1 µm).
    pub workspace_radius: u32,
    /// The smallest displacement that the device reports (nm).
    pub position_step_nm: u32,
    /// The least and the greatest rate of states (Hz), at least 1.
    pub rate: [u16; 2],
    /// The form of the states.
    pub sends: Sends,
    /// The name of the model: printable ASCII, at least one byte, zeros behind the last.
    pub name: [u8; 16],
}

/// The capabilities of a device, as they are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CapabilitiesReport {
    /// Number of the report, which wraps; a gap means lost reports.
    pub sequence: u16,
    /// The session that the hello opened.
    pub session: u32,
    /// Sequence number of the hello that this report answers.
    pub hello: u16,
    /// Time at which the hello came (µs of the device's clock).
    pub hello_time_us: u32,
    /// The watchdog in force (µs).
    pub watchdog_us: u32,
    /// The properties of the device.
    pub model: Model,
}

impl CapabilitiesReport {
    /// The bytes of the report.
    pub fn encode(&self) -> [u8; LENGTH] {
        let model = &self.model;
        let mut report = wire::start(Kind::Capabilities, self.sequence, self.session);
        put::<{ at::HELLO }, 2>(&mut report, self.hello.to_le_bytes());
        put::<{ at::SENSED }, 1>(&mut report, [model.sensed]);
        put::<{ at::ACTUATED }, 1>(&mut report, [model.actuated]);
        put::<{ at::MAJOR }, 1>(&mut report, [model.firmware.major]);
        put::<{ at::MINOR }, 1>(&mut report, [model.firmware.minor]);
        put::<{ at::PATCH }, 2>(&mut report, model.firmware.patch.to_le_bytes());
        put::<{ at::MAX_FORCE }, 4>(&mut report, model.max_force.to_le_bytes());
        put::<{ at::MAX_MOMENT }, 4>(&mut report, model.max_moment.to_le_bytes());
        put::<{ at::RADIUS }, 4>(&mut report, model.workspace_radius.to_le_bytes());
        put::<{ at::STEP }, 4>(&mut report, model.position_step_nm.to_le_bytes());
        let [least, most] = model.rate;
        put::<{ at::LEAST_RATE }, 2>(&mut report, least.to_le_bytes());
        put::<{ at::MOST_RATE }, 2>(&mut report, most.to_le_bytes());
        put::<{ at::WATCHDOG }, 4>(&mut report, self.watchdog_us.to_le_bytes());
        put::<{ at::HELLO_TIME }, 4>(&mut report, self.hello_time_us.to_le_bytes());
        let (sends, encoders) = model.sends.numbers();
        put::<{ at::SENDS }, 1>(&mut report, [sends]);
        put::<{ at::ENCODERS }, 1>(&mut report, [encoders]);
        put::<{ at::MODEL }, 16>(&mut report, model.name);
        wire::seal(report)
    }

    /// The report in `bytes`.
    ///
    /// # Errors
    /// The first [`ReportError`] found, in the order of the enum's variants.
    pub fn decode(bytes: &[u8]) -> Result<Self, ReportError> {
        let report = wire::check(bytes, Kind::Capabilities)?;
        wire::check_session(report)?;
        let model = model(report)?;
        let watchdog_us = get_u32::<{ at::WATCHDOG }>(report);
        check_watchdog(watchdog_us)?;
        Ok(Self {
            sequence: wire::sequence(report),
            session: wire::session(report),
            hello: get_u16::<{ at::HELLO }>(report),
            hello_time_us: get_u32::<{ at::HELLO_TIME }>(report),
            watchdog_us,
            model,
        })
    }
}

fn model(report: &[u8; LENGTH]) -> Result<Model, ReportError> {
    let sensed = get_u8::<{ at::SENSED }>(report);
    wire::check_range(Field::Axes, 1, axes::ALL.into(), sensed)?;
    let actuated = get_u8::<{ at::ACTUATED }>(report);
    wire::check_bits(Field::Axes, axes::ALL, actuated)?;
    let least = get_u16::<{ at::LEAST_RATE }>(report);
    let most = get_u16::<{ at::MOST_RATE }>(report);
    wire::check_range(Field::Rate, 1, u16::MAX.into(), least)?;
    wire::check_range(Field::Rate, least.into(), u16::MAX.into(), most)?;
    let name = get::<{ at::MODEL }, 16>(report);
    check_name(&name)?;
    Ok(Model {
        sensed,
        actuated,
        firmware: FirmwareVersion {
            major: get_u8::<{ at::MAJOR }>(report),
            minor: get_u8::<{ at::MINOR }>(report),
            patch: get_u16::<{ at::PATCH }>(report),
        },
        max_force: get_u32::<{ at::MAX_FORCE }>(report),
        max_moment: get_u32::<{ at::MAX_MOMENT }>(report),
        workspace_radius: get_u32::<{ at::RADIUS }>(report),
        position_step_nm: get_u32::<{ at::STEP }>(report),
        rate: [least, most],
        sends: sends(report)?,
        name,
    })
}

fn sends(report: &[u8; LENGTH]) -> Result<Sends, ReportError> {
    let (least, most) = (Kind::State as u8, Kind::Encoders as u8);
    let kind = get_u8::<{ at::SENDS }>(report);
    let encoders = get_u8::<{ at::ENCODERS }>(report);
    wire::check_range(Field::Sends, least.into(), most.into(), kind)?;
    if kind == Kind::State as u8 {
        wire::check_range(Field::Encoders, 0, 0, encoders)?;
        return Ok(Sends::Poses);
    }
    wire::check_range(Field::Encoders, 1, ENCODERS as u64, encoders)?;
    Ok(Sends::Counts { encoders })
}

/// Checks that a name has a byte, that its bytes are printable, and that only zeros follow the first zero.
fn check_name(name: &[u8; 16]) -> Result<(), ReportError> {
    let length = name.iter().take_while(|&&byte| byte != 0).count();
    let printable = |index, byte: u8| match index {
        0 => matches!(byte, b' '..=b'~'),
        _ if index < length => matches!(byte, b' '..=b'~'),
        _ => byte == 0,
    };
    let bytes = name.iter().enumerate();
    let wrong = bytes.filter(|&(index, &byte)| !printable(index, byte));
    wire::check_range(Field::Name, 0, 0, wrong.count() as u64)
}
