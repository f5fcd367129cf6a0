//! Common parts of the end-to-end tests and benchmarks.

pub mod law;

use host::run::prepare::{Options, Prepared};
use host::scene::{LoadedScene, Scene};
use host::world::World;

/// The built-in scene.
///
/// # Panics
/// If the scene does not load; another test reports this in detail.
pub fn default_scene() -> LoadedScene {
    Scene::embedded_default().expect("the built-in scene loads")
}

/// A session of the built-in scene before its first tick.
///
/// # Panics
/// If the scene cannot be built.
pub fn default_session(duration: f64) -> Prepared {
    Prepared::new(
        &World::new(&default_scene()).unwrap(),
        &Options::new(duration, 1),
    )
    .expect("the built-in scene can be built")
}
