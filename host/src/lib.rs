//! What a run is made of: scenes, bodies, the host loop, logs and plots.
//!
//! The program `palpate` is in `program`, the studies are in `study`.
//!
//! - [`scene`]: TOML files that say what a run is made of.
//! - [`bodies`]: from a scene's bodies to the physics.
//! - [`engine`]: the host loop's work, where physics and tick are joined.
//! - [`run`]: a scene from beginning to end, under virtual or real time.
//! - [`solve`]: a scene without devices: equilibrium or motion.
//! - [`log`], [`plot`]: what a run leaves behind.
#![forbid(unsafe_code)]

pub mod atomic_file;
pub mod bodies;
pub mod engine;
pub mod log;
pub mod plot;
pub mod run;
pub mod scene;
pub mod solve;
