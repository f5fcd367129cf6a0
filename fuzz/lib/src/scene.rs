//! The texts of a scene: what is refused is refused in one line. Each function returns one if the text is accepted.

use crate::is_one_line;
use host::scene::{Scene, poses, recording};
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

/// A recorded motion of a hand, or the poses of an obstacle. What is accepted has ascending times and finite numbers.
///
/// # Panics
/// If a reader breaks the rule.
pub fn recording(text: &str) -> usize {
    match poses::parse(text, "obstacle.csv") {
        Ok(rows) => {
            assert!(rows.windows(2).all(|pair| pair[0].time < pair[1].time));
            for row in &rows {
                assert!(row.pose.to_matrix().iter().all(|x| x.is_finite()));
            }
            return 1;
        }
        Err(error) => is_one_line(&error),
    }
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
