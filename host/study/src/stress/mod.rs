//! Stress studies: tests of couplings, devices and hosts before a person touches them. `palpate stress` repeats each.
//!
//! [`Study`] is what every study has, and [`STUDIES`] is their list. [`jobs`] runs the many cells of a study on all cores and
//! machines. [`devices`] are the devices of a study. [`wall`] maps a stiff wall inside the tick. [`faults`] gives the tick
//! input that should never occur. [`connections`] cuts, floods and corrupts the connection of a device. [`hold`] checks that
//! the rendered force is the force of the body. [`scene`] compares the schemes on a scene under hands, rates and faults.
//! [`tearing`] tears random sheets. [`contact`] runs random worlds in which bodies touch. [`endings`] ends commands that hold a device. [`seeds`] compares results of several seeds.

pub mod connections;
pub mod contact;
pub mod devices;
pub mod endings;
pub mod faults;
pub mod hold;
pub mod jobs;
pub mod scene;
pub mod seeds;
pub mod specimen;
mod study;
pub mod tearing;
pub mod wall;

pub use study::{Done, Entry, Found, Quantity, Study, Verdict};

/// The studies.
pub const STUDIES: &[Entry] = &[
    Entry::of::<wall::Study>(),
    Entry::of::<faults::Study>(),
    Entry::of::<connections::Study>(),
    Entry::of::<hold::Holds>(),
    Entry::of::<scene::Trials>(),
    Entry::of::<tearing::Study>(),
    Entry::of::<contact::Study>(),
    Entry::of::<endings::Study>(),
];
