//! What the user runs: scenes, the host loop, logs, plots, and the program `palpate`.
//!
//! - [`scene`]: TOML files that say what a run is made of.
//! - [`bodies`]: from a scene's bodies to the physics.
//! - [`engine`]: the host loop's work, where physics and tick are joined.
//! - [`run`]: a scene from beginning to end, under virtual or real time.
//! - [`solve`]: a scene without devices: equilibrium or motion.
//! - [`log`], [`plot`]: what a run leaves behind.
//! - [`study`]: experiments whose figures the book quotes.
//! - [`cli`]: one file a command.
#![forbid(unsafe_code)]

pub mod atomic_file;
pub mod bodies;
pub mod cli;
pub mod engine;
pub mod log;
pub mod plot;
pub mod run;
pub mod scene;
pub mod solve;
pub mod study;
