//! Common parts of the end-to-end tests and benchmarks.

pub mod law;

use host::run::setup::{Setup, setup};
use host::scene::{LoadedScene, Scene};
use host::world::World;

/// The built-in scene.
///
/// # Panics
/// If the scene does not load; another test reports this in detail.
pub fn default_scene() -> LoadedScene {
    Scene::embedded_default().expect("the built-in scene loads")
}

/// The setup of a run of the built-in scene.
///
/// # Panics
/// If the scene cannot be built.
pub fn default_setup(duration: f64) -> Setup {
    setup(&World::new(&default_scene()).unwrap(), duration, 1)
        .expect("the built-in scene can be built")
}
