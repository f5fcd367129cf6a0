//! The drivers that a scene can name.

use devices::falcon::FalconDriver;
use devices::plugin::Plugins;
use devices::serial::{Tcp, Tty};
use devices::woodenhaptics::WoodenHapticsDriver;
use devices::{Hid, Registry};
use sim::{EmulatedDriver, Held, Simulated};
use std::path::Path;

/// The drivers, if `held` holds the simulated devices, by index in the scene, and files are relative to `folder`.
/// Names need neither.
pub fn drivers(held: Vec<Held>, folder: &Path) -> Registry {
    let simulated = Registry::new()
        .with(Simulated::new(held.clone()))
        .with(EmulatedDriver::new(held));
    with_real(simulated, folder)
}

/// The drivers of real devices alone, for commands without a scene. Files are relative to `folder`.
pub fn real_drivers(folder: &Path) -> Registry {
    with_real(Registry::new(), folder)
}

fn with_real(registry: Registry, folder: &Path) -> Registry {
    registry
        .with(Hid)
        .with(Tty)
        .with(Tcp)
        .with(WoodenHapticsDriver)
        .with(FalconDriver)
        .with(Plugins::new(folder))
}
