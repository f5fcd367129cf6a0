//! The conversion of the counts of a device's encoders to the pose of its handle.

use super::wire::{self, get, get_i32s, get_u8, get_u16, put, put_i32s};
use super::{ENCODERS, Field, Kind, LENGTH, ReportError};

/// The largest number of parameters of a kinematics.
pub const PARAMETERS: usize = 12;

/// Numbers of kinematics, each with its parameters. Lengths are in 0.1 µm. Numbers from 0x8000 on are the device's own.
pub mod kinematics {
    /// Joint k is the translation along axis k. No parameters.
    pub const CARTESIAN: u16 = 0;
    /// A handle on a lever that turns about one axis. Parameter: the length of the lever.
    pub const PADDLE: u16 = 1;
    /// The arm of WoodenHaptics: parameters La, Lb, Lc, and the origin x, y, z.
    pub const WOODEN_HAPTICS: u16 = 2;
    /// Stamper's delta (Novint Falcon): parameters a, b, c, d, e, f, r, s.
    pub const DELTA: u16 = 3;
}

/// The number of the last encoder.
const LAST_ENCODER: u64 = ENCODERS as u64 - 1;

/// Offsets of the fields, as in the tables in [`super`].
mod at {
    pub(super) const KINEMATICS: usize = 8;
    pub(super) const NUMBER: usize = 10;
    pub(super) const GAP: usize = 11;
    pub(super) const PARAMETERS: usize = 12;
    pub(super) const RESERVED: usize = 60;

    pub(super) const ENCODER: usize = 8;
    pub(super) const QUANTITY: usize = 9;
    pub(super) const JOINT_GAP: usize = 10;
    pub(super) const SCALE: usize = 12;
    pub(super) const OFFSET: usize = 20;
    pub(super) const JOINT_RESERVED: usize = 24;
}

/// The kinematics of a device that sends counts, as it is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GeometryReport {
    /// Number of the report, which wraps; a gap means lost reports.
    pub sequence: u16,
    /// The session.
    pub session: u32,
    /// The kinematics, see [`kinematics`].
    pub kinematics: u16,
    /// The number of parameters, 0 to 12.
    pub number: u8,
    /// The parameters (0.1 µm or 0.1 µrad); zero from `number` on.
    pub parameters: [i32; PARAMETERS],
}

impl GeometryReport {
    /// The bytes of the report.
    pub fn encode(&self) -> [u8; LENGTH] {
        let mut report = wire::start(Kind::Geometry, self.sequence, self.session);
        put::<{ at::KINEMATICS }, 2>(&mut report, self.kinematics.to_le_bytes());
        put::<{ at::NUMBER }, 1>(&mut report, [self.number]);
        put_i32s::<{ at::PARAMETERS }, PARAMETERS>(&mut report, self.parameters);
        wire::seal(report)
    }

    /// The report in `bytes`.
    ///
    /// # Errors
    /// The first [`ReportError`] found, in the order of the enum's variants.
    pub fn decode(bytes: &[u8]) -> Result<Self, ReportError> {
        let report = wire::check(bytes, Kind::Geometry)?;
        wire::check_session(report)?;
        let number = get_u8::<{ at::NUMBER }>(report);
        wire::check_range(Field::Parameters, 0, PARAMETERS as u64, number)?;
        let parameters = get_i32s::<{ at::PARAMETERS }, PARAMETERS>(report);
        wire::check_unused(&parameters, number)?;
        wire::check_reserved::<{ at::GAP }, { at::PARAMETERS }>(report)?;
        wire::check_reserved::<{ at::RESERVED }, { wire::END }>(report)?;
        Ok(Self {
            sequence: wire::sequence(report),
            session: wire::session(report),
            kinematics: get_u16::<{ at::KINEMATICS }>(report),
            number,
            parameters,
        })
    }
}

/// The quantity that an encoder measures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Quantity {
    /// An angle (rad).
    #[default]
    Angle = 0,
    /// A length (m).
    Length = 1,
}

/// The conversion of the counts of one encoder to an angle or a length, as it is sent.
///
/// The quantity is `offset * 1e-7 + count / (scale * 1e-6)` in rad or m.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JointReport {
    /// Number of the report, which wraps; a gap means lost reports.
    pub sequence: u16,
    /// The session.
    pub session: u32,
    /// The encoder, 0 to 7.
    pub encoder: u8,
    /// The quantity that the encoder measures.
    pub quantity: Quantity,
    /// Counts per rad or m (0.000001); negative if the count falls as the quantity grows, never zero.
    pub scale: i64,
    /// The angle or length at count zero (0.1 µrad or 0.1 µm).
    pub offset: i32,
}

impl JointReport {
    /// The bytes of the report.
    pub fn encode(&self) -> [u8; LENGTH] {
        let mut report = wire::start(Kind::Joint, self.sequence, self.session);
        put::<{ at::ENCODER }, 1>(&mut report, [self.encoder]);
        put::<{ at::QUANTITY }, 1>(&mut report, [self.quantity as u8]);
        put::<{ at::SCALE }, 8>(&mut report, self.scale.to_le_bytes());
        put::<{ at::OFFSET }, 4>(&mut report, self.offset.to_le_bytes());
        wire::seal(report)
    }

    /// The report in `bytes`.
    ///
    /// # Errors
    /// The first [`ReportError`] found, in the order of the enum's variants.
    pub fn decode(bytes: &[u8]) -> Result<Self, ReportError> {
        let report = wire::check(bytes, Kind::Joint)?;
        wire::check_session(report)?;
        let encoder = get_u8::<{ at::ENCODER }>(report);
        wire::check_range(Field::Encoder, 0, LAST_ENCODER, encoder)?;
        let quantity = match get_u8::<{ at::QUANTITY }>(report) {
            0 => Quantity::Angle,
            1 => Quantity::Length,
            found => {
                return Err(ReportError::OutOfRange {
                    field: Field::Quantity,
                    least: 0,
                    most: 1,
                    found: found.into(),
                });
            }
        };
        let scale = i64::from_le_bytes(get::<{ at::SCALE }, 8>(report));
        wire::check_range(Field::Scale, 1, u64::MAX, scale.unsigned_abs())?;
        wire::check_reserved::<{ at::JOINT_GAP }, { at::SCALE }>(report)?;
        wire::check_reserved::<{ at::JOINT_RESERVED }, { wire::END }>(report)?;
        Ok(Self {
            sequence: wire::sequence(report),
            session: wire::session(report),
            encoder,
            quantity,
            scale,
            offset: i32::from_le_bytes(get::<{ at::OFFSET }, 4>(report)),
        })
    }
}
