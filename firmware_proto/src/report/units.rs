//! Conversions between a report's integers and SI.
//!
//! Values are scaled and rounded to the nearest integer, halves away from zero. Values too large for the integer
//! saturate at its ends, and a NaN becomes zero.

/// One metre in a report's positions (0.1 µm).
pub(super) const POSITION: f64 = 1e7;
/// One metre per second in a report's velocities (µm/s).
pub(super) const VELOCITY: f64 = 1e6;
/// One radian per second in a report's angular velocities (mrad/s).
pub(super) const ANGULAR_VELOCITY: f64 = 1e3;
/// One newton, or newton metre, in a report (µN, µN·m).
pub(super) const FORCE: f64 = 1e6;
/// The number 1 in a report's quaternions. Not 2^15, so that the identity is exact.
pub(super) const QUATERNION: f64 = 32767.0;

pub(super) fn to_i32(value: f64, scale: f64) -> i32 {
    // The conversion saturates, and turns a NaN into zero.
    rounded(value * scale) as i32
}

pub(super) fn to_i16(value: f64, scale: f64) -> i16 {
    // As above.
    rounded(value * scale) as i16
}

/// Rounds a value whose fraction is truncated afterwards: `f64::round` needs the standard library.
fn rounded(value: f64) -> f64 {
    value + 0.5_f64.copysign(value)
}

/// Divides by the scale. A multiplication by the inverse would not give the number closest to the decimal one.
pub(super) fn to_si<const N: usize>(numbers: [impl Into<f64>; N], scale: f64) -> [f64; N] {
    numbers.map(|number| number.into() / scale)
}
