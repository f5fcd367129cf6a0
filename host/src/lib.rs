//! The parts of a run: scenes, bodies, the host loop, logs and plots.
//!
//! The program `palpate` is in `program`, the studies are in `study`.
//!
//! - [`scene`]: TOML files that describe a run; a crate of its own.
//! - [`world`]: a scene, built once: the bodies of the physics, the grasps of the devices, and their mountings.
//! - [`engine`]: the work of the host loop. It joins physics and tick.
//! - [`snapshot`]: the positions of the bodies after a step, for viewers, logs and files.
//! - [`run`]: runs a scene from beginning to end, under virtual or real time.
//! - [`solve`]: solves a scene without devices for equilibrium or motion.
//! - [`live`]: a run as viewers see it.
//! - [`log`]: the record of a run; [`plot`]: its pictures, a crate of its own.
#![forbid(unsafe_code)]

pub mod engine;
pub mod live;
pub mod log;
pub mod machine;
pub mod preparation;
pub mod record;
pub mod run;
pub mod snapshot;
pub mod solve;
pub mod table;
pub mod world;

pub use devices::input;
pub use plot::atomic_file;
pub use {plot, scene};
