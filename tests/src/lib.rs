//! What the end-to-end tests and benchmarks share.

pub mod law;

use host::run::setup::{Setup, setup};
use host::scene::{LoadedScene, Scene};

/// The scene that the program carries with it.
///
/// # Panics
/// If it does not load, which another test says better.
pub fn default_scene() -> LoadedScene {
    Scene::embedded_default().expect("the built-in scene loads")
}

/// Everything for a run of the built-in scene.
///
/// # Panics
/// If it cannot be built.
pub fn default_setup(duration: f64) -> Setup {
    setup(&default_scene(), duration, 1).expect("the built-in scene can be built")
}
