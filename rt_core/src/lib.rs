//! All that runs inside the haptic tick: the control law.
//!
//! Principles, which the tests hold this crate to:
//!
//! - A tick is a **pure function** of the device states, the newest local models and the controller's own
//!   state. The same code runs under the real clock and under virtual time.
//! - It never allocates, locks, waits, formats text or makes a system call. Threads, priorities, rings and
//!   histograms live beside it, in the crate `runner`.
//! - It never panics: no indexing, no unwrapping, no integer arithmetic that can overflow.
//! - It knows neither scenes nor meshes nor wire formats. What the physics has to say arrives as a [`LocalModel`].
//! - Units are SI. World axes are the scene's; a device's own axes end in its [`device_frame::DeviceFrame`].
//!
//! Read [`controller`] first: it is the order of a tick. Then [`local_model`] (what the host publishes),
//! [`coupling`] (how it becomes a force) and [`safety`] (what may leave for the device).
#![no_std]
#![forbid(unsafe_code)]
// The fence, with the lists in `clippy.toml`. It stops what can be seen in the source; that nothing is
// left in the linked law is proved by `tests/tests/no_panic.rs`. Tests may do all of it.
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

mod channel;
pub mod clutch;
pub mod controller;
pub mod coupling;
pub mod device;
pub mod device_frame;
pub mod geometry;
mod limits;
pub mod local_model;
pub mod passivity;

pub mod record;
pub mod safety;
pub mod scheme;
pub mod velocity;

pub use controller::{Controller, ControllerConfig, cycle};
pub use device::{Capabilities, Corruption, Device, DeviceError, DeviceState, Freedom, Probe};
pub use geometry::{Mat6, Pose, Twist, Vec3, Vec6, Wrench};
pub use local_model::{HandleReference, LocalModel};
pub use passivity::{EnergyAccount, PassivityConfig, Port, Withheld};
pub use record::{Telemetry, TickRecord};
pub use scheme::Scheme;

/// Most devices that one loop serves (two people with two hands each).
pub const MAX_DEVICES: usize = 4;
/// Most handles on one connected body.
pub const MAX_HANDLES: usize = 4;
/// Most connected bodies that are felt at the same time.
pub const MAX_BODIES: usize = 4;

/// Counts one more. A counter that has reached its end stays there.
fn count_one(counter: &mut u64) {
    *counter = counter.saturating_add(1);
}
