//! What the user runs: scenes, the host loop, logs, plots, and the program `palpate`.
//!
//! - [`scene`]: TOML files that say what a run is made of.
//! - [`engine`]: the host loop's work, where physics and tick are joined.
//! - [`run`]: a scene from beginning to end, under virtual or real time.
//! - [`log`], [`plot`]: what a run leaves behind.
//! - [`study`]: experiments whose figures the book quotes.
//! - [`cli`]: one file a command.
#![forbid(unsafe_code)]

pub mod atomic_file;
pub mod cli;
pub mod engine;
pub mod log;
pub mod plot;
pub mod run;
pub mod scene;
pub mod study;
