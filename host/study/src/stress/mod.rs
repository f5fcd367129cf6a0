//! Stress studies: tests of couplings, devices and hosts before a person touches them. `palpate stress` repeats each.
//!
//! [`jobs`] runs the many cells of a study on all cores and machines. [`devices`] are the devices of a study. [`wall`]
//! maps a stiff wall inside the tick. [`faults`] gives the tick input that should never occur. [`connections`] cuts,
//! floods and corrupts the connection of a device. [`hold`] checks that the rendered force is the force of the body.
//! [`seeds`] compares results of several seeds. [`scene`] compares the schemes on a scene under hands, rates and faults.
//! [`tearing`] tears random sheets.

pub(crate) mod chance;
pub mod connections;
pub mod devices;
pub mod faults;
pub mod hold;
pub mod jobs;
pub mod scene;
pub mod seeds;
pub mod specimen;
pub mod tearing;
pub mod wall;
