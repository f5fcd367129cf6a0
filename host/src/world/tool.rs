//! The start of tools: none begins inside an obstacle.

use super::shapes::round;
use crate::scene::{LoadedScene, SceneError};
use nalgebra::Point3;
use physics::Vec3;
use physics::contact::Obstacle;
use physics::contact::obstacle::Geometry;
use physics::contact::start::winding;
use physics::contact::vicinity::Vicinity;

/// The winding number above which a point is inside.
const INSIDE: f64 = 0.5;

/// Refuses a tool that begins inside an obstacle. Bodies are checked with the other contacts.
///
/// # Errors
/// [`SceneError`] at the first fault.
pub(super) fn check_start(loaded: &LoadedScene, obstacles: &[Obstacle]) -> Result<(), SceneError> {
    let scene = &loaded.scene;
    for (index, tool) in scene.tools.iter().enumerate() {
        let centre = Vec3::from(tool.position);
        for (given, obstacle) in scene.given_obstacles().iter().zip(obstacles) {
            let distance = distance(obstacle, &centre);
            if distance < tool.radius {
                return Err(loaded.source.error(
                    &format!("tool[{index}].position"),
                    format!(
                        "{} m inside obstacle {:?}",
                        round(tool.radius - distance),
                        given.name
                    ),
                    "a place outside all bodies and obstacles",
                ));
            }
        }
    }
    Ok(())
}

/// The signed distance of a point from the surface of an obstacle at the start (m).
fn distance(obstacle: &Obstacle, p: &Vec3) -> f64 {
    if let Geometry::Shape(shape) = obstacle.geometry() {
        let own = obstacle
            .pose(0.0)
            .inverse_transform_point(&Point3::from(*p));
        return shape.nearest(&own.coords).distance;
    }
    let mut vicinity = Vicinity::default();
    vicinity.find(obstacle, 0.0, p, f64::INFINITY, 0.0);
    let triangles: Vec<[u32; 3]> = vicinity.triangles().iter().map(|of| of.1).collect();
    let nearest = vicinity.triangles().iter().map(|of| of.0);
    let nearest = nearest.fold(f64::INFINITY, f64::min);
    if winding(&triangles, vicinity.corners(), p) > INSIDE {
        -nearest
    } else {
        nearest
    }
}
