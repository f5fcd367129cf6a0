//! WoodenHaptics (Forsslund), an open device of plywood with capstan drives, over HID.
//!
//! The device sends six encoder counters and a flag, and takes three motor currents and a command, in 14 bytes each way.
//! The device answers each report of the host with one of its own, and turns its motors off half a second after the
//! last report. The reports have no sequence number, no time and no check sum, so wraps, repeats and jumps are the task
//! of the driver.
//!
//! - [`geometry`]: the parameters of a device, and its kinematics.
//! - [`report`]: the bytes, both ways.
//! - [`counters`]: counters of 16 bits, extended beyond their range, and the jumps that no hand can cause.
//! - [`velocity`]: the velocity of the handle from its positions.
//! - [`connect`]: finds and opens the device that a scene names.
//! - [`driver`]: the protocol of the driver, an [`Exchange`](crate::Exchange) over any transport.
//!
//! The protocol and the kinematics are those of the makers' published library and firmware (haptikfabrikenapi, commit
//! b8d6c94). This module uses only facts from them. The kinematics of Polhem's later devices are not published.
#![cfg_attr(
    not(test),
    deny(
        clippy::arithmetic_side_effects,
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used,
    )
)]

pub mod connect;
pub mod counters;
pub mod driver;
pub mod geometry;
pub mod report;
pub mod velocity;

pub use connect::WoodenHapticsDriver;
pub use driver::{CalibrationError, Counts, WoodenHaptics, WoodenHapticsConfig};
pub use geometry::{Geometry, GeometryError, Kinematics};
pub use report::{CurrentReport, EncoderReport, Form, LengthError};
