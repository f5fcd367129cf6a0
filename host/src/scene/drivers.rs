//! The drivers that a scene can name.

use devices::falcon::FalconDriver;
use devices::plugin::Plugins;
use devices::woodenhaptics::WoodenHapticsDriver;
use devices::{Hid, Registry};
use sim::{Held, Simulated};
use std::path::Path;

/// The drivers, where `held` holds the simulated devices, by index in the scene, and files are relative to `folder`.
/// Names need neither.
pub(crate) fn drivers(held: Vec<Held>, folder: &Path) -> Registry {
    Registry::new()
        .with(Simulated::new(held))
        .with(Hid)
        .with(WoodenHapticsDriver)
        .with(FalconDriver)
        .with(Plugins::new(folder))
}
