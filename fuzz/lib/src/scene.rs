//! The texts of a scene: what is refused is refused in one line. Each function returns one if the text is accepted.

use crate::is_one_line;
use host::scene::{Scene, recording};
use sim::DeviceFile;

/// A scene.
///
/// # Panics
/// If an error has several lines.
pub fn scene(text: &str) -> usize {
    let read = Scene::parse(text, "scene.toml");
    read.map_err(|error| is_one_line(&error)).map_or(0, |_| 1)
}

/// The file of a device.
///
/// # Panics
/// If an error has several lines.
pub fn device(text: &str) -> usize {
    let read = DeviceFile::parse(text);
    read.map_err(|error| is_one_line(&error)).map_or(0, |_| 1)
}

/// A recorded motion. What is accepted has ascending times and finite numbers.
///
/// # Panics
/// If the reader breaks the rule.
pub fn recording(text: &str) -> usize {
    match recording::parse(text, "hand.csv") {
        Ok(rows) => {
            assert!(rows.windows(2).all(|pair| pair[0].0 < pair[1].0));
            assert!(
                rows.iter()
                    .all(|(_, place)| place.iter().all(|x| x.is_finite()))
            );
            1
        }
        Err(error) => {
            is_one_line(&error);
            0
        }
    }
}
