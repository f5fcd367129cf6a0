//! The limits of a hand. A reading beyond these limits is a fault of the device.

/// No hand moves a device faster (m/s). A tap ends at a tenth of this speed.
pub(crate) const LARGEST_SPEED: f64 = 20.0;

/// No hand turns a device faster (rad/s).
pub(crate) const LARGEST_ANGULAR_RATE: f64 = 200.0;

/// No device reaches farther (m).
pub(crate) const LARGEST_REACH: f64 = 10.0;
