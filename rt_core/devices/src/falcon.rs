//! The Novint Falcon, a device of three degrees of freedom behind an FTDI chip on USB.
//!
//! - [`geometry`]: from encoder counts to a position, and from a force to torques.
//! - [`packet`]: the bytes of the firmware, and the limits of packets in a stream.
//! - [`boot`]: the upload of the firmware, whose file the user provides.
//! - [`connect`]: finds, opens and boots the device that a scene names.
//! - [`driver`]: a Falcon as an [`Exchange`](crate::Exchange).
//!
//! Lengths, bytes and steps are those of libnifalcon (BSD); its code is not used.

pub mod boot;
pub mod connect;
pub mod driver;
pub mod geometry;
pub mod packet;

pub use boot::{BootError, Firmware, FirmwareError, Tries};
pub use connect::{FalconDriver, MOST_FORCE};
pub use driver::{Counts, Falcon, FalconError, Settings};
