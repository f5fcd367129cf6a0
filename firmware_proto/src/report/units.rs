//! Between a report's integers and SI.
//!
//! Into a report: scaled, rounded to the nearest, halves away from zero. What is too large for the integer
//! saturates at its ends, and what is not a number becomes zero.

/// What one metre is in a report's positions (0.1 µm).
pub(super) const POSITION: f64 = 1e7;
/// What one metre per second is in a report's velocities (µm/s).
pub(super) const VELOCITY: f64 = 1e6;
/// What one radian per second is in a report's angular velocities (mrad/s).
pub(super) const ANGULAR_VELOCITY: f64 = 1e3;
/// What one newton, or newton metre, is in a report (µN, µN·m).
pub(super) const FORCE: f64 = 1e6;
/// What 1 is in a report's quaternions. Not 2^15, so that the identity is exact.
pub(super) const QUATERNION: f64 = 32767.0;

pub(super) fn to_i32(value: f64, scale: f64) -> i32 {
    // The conversion saturates and gives zero for not-a-number.
    rounded(value * scale) as i32
}

pub(super) fn to_i16(value: f64, scale: f64) -> i16 {
    // As above.
    rounded(value * scale) as i16
}

/// Ready to be cut off at the point: `f64::round` needs the standard library.
fn rounded(value: f64) -> f64 {
    value + 0.5_f64.copysign(value)
}

/// Divided, not multiplied by the inverse: the result is then the closest to the decimal number.
pub(super) fn to_si<const N: usize>(numbers: [impl Into<f64>; N], scale: f64) -> [f64; N] {
    numbers.map(|number| number.into() / scale)
}
