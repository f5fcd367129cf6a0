//! Stress studies: what a coupling, a device and a host are taken to before a person touches them.
//!
//! [`jobs`] runs their many cells on all cores and machines, [`wall`] maps a stiff wall inside the tick,
//! [`faults`] gives the tick what nobody should, [`hold`] asks whether what is felt is the body.
//! Each can be run again with `palpate stress`.

mod chance;
pub mod faults;
pub mod hold;
pub mod jobs;
pub mod scene;
pub mod wall;
