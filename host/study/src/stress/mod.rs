//! Stress studies: tests of couplings, devices and hosts before a person touches them.
//!
//! [`jobs`] runs the many cells of a study on all cores and machines. [`wall`] maps a stiff wall inside the tick.
//! [`faults`] gives the tick input that should never occur. [`hold`] checks that the rendered force is the force
//! of the body. [`scene`] compares the schemes on a scene under hands, rates and faults. `palpate stress` repeats each
//! of them.

mod chance;
pub mod faults;
pub mod hold;
pub mod jobs;
pub mod scene;
pub mod wall;

use crate::StudyError;
use host::scene::spec::Mounting;
use host::scene::{LoadedScene, SceneError};

/// Refuses a scene with a mounted device: the studies compare forces of devices with forces of bodies axis by axis, so
/// the axes of devices must be those of the scene.
///
/// # Errors
/// [`SceneError::Value`], with the device that is mounted.
fn unmounted(loaded: &LoadedScene) -> Result<(), StudyError> {
    let mut devices = loaded.scene.devices.iter();
    let Some(index) = devices.position(|device| device.mounting != Mounting::default()) else {
        return Ok(());
    };
    let field = format!("device[{index}].mounting");
    let allowed = "none in a stress study: it compares forces axis by axis";
    let error: SceneError = loaded.source.error(&field, "a mounting", allowed);
    Err(error.into())
}
