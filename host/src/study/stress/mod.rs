//! Stress studies: what a coupling, a device and a host are taken to before a person touches them.
//!
//! [`jobs`] runs their many cells on all cores and machines, [`wall`] maps a stiff wall inside the tick.
//! Each can be run again with `palpate stress`.

pub mod jobs;
pub mod scene;
pub mod wall;
