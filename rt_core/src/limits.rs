//! What no hand can do. A reading beyond these limits is a reading gone wrong.

/// No hand moves a device faster (m/s); a tap ends a tenth as fast.
pub(crate) const LARGEST_SPEED: f64 = 20.0;

/// Nor does any hand turn a device faster (rad/s).
pub(crate) const LARGEST_ANGULAR_RATE: f64 = 200.0;

/// No device reaches further (m).
pub(crate) const LARGEST_REACH: f64 = 10.0;
