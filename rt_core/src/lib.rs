//! The control law: everything that runs inside the haptic tick.
//!
//! The tests hold this crate to these principles:
//!
//! - A tick is a **pure function** of the readings of the devices, the newest local models, the time by the clock and the
//!   controller's own state. The same code runs under the real clock and under virtual time.
//! - A tick never allocates, locks, waits, formats text or makes a system call. Threads, priorities, rings and
//!   histograms are in the crate `runner`.
//! - A tick never panics: the law has no indexing, no unwrapping and no integer arithmetic that can overflow.
//! - The crate knows neither scenes, meshes nor wire formats. The physics publishes its results as a [`LocalModel`].
//! - Units are SI. World axes are the scene's; a device's own axes end in its [`device_frame::DeviceFrame`].
//!
//! Read [`controller`] first: it gives the order of a tick. Then read [`local_model`] (the publications of the host),
//! [`coupling`] (from a model to a force), [`tool`] (from a surface to a force) and [`safety`] (the limits of a command).
#![no_std]
#![forbid(unsafe_code)]
// The lints of the control law; `clippy.toml` lists what they forbid. The lints see only the source.
// `tests/tests/no_panic.rs` proves that no panic is left in the linked law. Tests are exempt from the lints.
#![cfg_attr(
    not(test),
    deny(
        clippy::arithmetic_side_effects,
        clippy::disallowed_macros,
        clippy::disallowed_methods,
        clippy::disallowed_types,
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::panic_in_result_fn,
        clippy::string_slice,
        clippy::todo,
        clippy::unimplemented,
        clippy::unreachable,
        clippy::unwrap_in_result,
        clippy::unwrap_used,
    )
)]
#![cfg_attr(
    test,
    allow(
        clippy::disallowed_macros,
        clippy::disallowed_methods,
        clippy::disallowed_types
    )
)]

extern crate alloc;

mod channel;
pub mod clutch;
pub mod controller;
pub mod coupling;
pub mod device;
pub mod device_frame;
pub mod engage;
pub mod geometry;
pub mod heat;
pub mod held_back;
pub mod hull;
mod limits;
pub mod local_model;
mod nearest;
pub mod passivity;
pub mod publication;
pub mod record;
pub mod safety;
pub mod scheme;
mod slip;
pub mod square_wave;
pub mod tool;
mod trust;
pub mod velocity;

pub use controller::{Controller, ControllerConfig, TickTime, cycle, cycle_timed};
pub use device::{
    Axes, Capabilities, Corruption, Device, DeviceError, DeviceState, Freedom, Probe, Reading,
    Rendering,
};
pub use geometry::{Mat6, Pose, Twist, Vec3, Vec6, Wrench};
pub use held_back::{HeldBack, HeldBackByBody, HeldBackByDevice};
pub use local_model::{HandleReference, LocalModel, PieceEnergy, TearLimit};
pub use passivity::{EnergyAccount, PassivityConfig, Port, Withheld};
pub use record::{Telemetry, TickRecord};
pub use scheme::Scheme;

/// Largest number of devices that one loop serves (four people with two hands each).
pub const MAX_DEVICES: usize = 8;
/// Largest number of handles on one connected body.
pub const MAX_HANDLES: usize = 8;
/// Largest number of connected bodies that the tick renders at the same time: one for each device.
pub const MAX_BODIES: usize = 8;

/// Increments a counter. The counter saturates at its largest value.
fn count_one(counter: &mut u64) {
    *counter = counter.saturating_add(1);
}
