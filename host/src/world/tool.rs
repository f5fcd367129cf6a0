//! The shapes of tools, and where they start: none begins inside an obstacle.

use super::obstacle::surface;
use super::shapes::round;
use crate::scene::{LoadedScene, SceneError};
use nalgebra::{Isometry3, Point3};
use physics::Vec3;
use physics::contact::Obstacle;
use physics::contact::obstacle::{Geometry, Motion};
use physics::contact::rounded::{Rounded, hull_of};
use physics::contact::shape::Shape;
use physics::contact::start::winding;
use physics::contact::vicinity::{Vicinity, nearest_point};
use rt_core::hull::{Hull, MAX_CORNERS};
use std::sync::Arc;

/// The winding number above which a point is inside.
const INSIDE: f64 = 0.5;
/// The fraction of the radius of a tool by which a vertex of its mesh may lie outside of its hull.
const OUTSIDE: f64 = 0.05;
/// The largest distance of a vertex from the centre of a tool (m).
const LARGEST: f64 = 10.0;

/// The hull of the tool `index`, in axes of the scene about the centre of the tool.
///
/// # Errors
/// [`SceneError`] at the field of the mesh, for a file that is no mesh, and for a hull of too many corners, or beside its origin.
fn hull(loaded: &LoadedScene, index: usize) -> Result<Hull, SceneError> {
    let tool = &loaded.scene.tools[index];
    let field = format!("tool[{index}].mesh.file");
    let files = &loaded.obstacles[loaded.scene.given_obstacles().len() + index];
    let scale = tool.mesh.as_ref().and_then(|mesh| mesh.scale);
    let vertices = match files.frames.first() {
        Some(file) => surface(loaded, &field, file, scale.unwrap_or(1.0))?.0,
        None => Vec::new(),
    };
    let largest = vertices.iter().map(Vec3::norm).fold(0.0, f64::max);
    if largest > LARGEST {
        let found = format!("a vertex {} m away from the origin", round(largest));
        let allowed = format!("{LARGEST} m at most, by `scale`");
        return Err(loaded.source.error(&field, found, allowed));
    }
    let hull = hull_of(&tool.corners(&vertices), OUTSIDE * tool.radius).map_err(|outside| {
        let found = format!(
            "a vertex that lies {} m outside of a hull of {MAX_CORNERS} corners",
            round(outside)
        );
        let allowed = format!(
            "a mesh whose convex hull has fewer corners, or a larger radius: {} m would do",
            round(outside / OUTSIDE)
        );
        loaded.source.error(&field, found, allowed)
    })?;
    // Which side of a sheet a tool is on, and whether it is inside of an obstacle, is asked of its centre.
    let beside = hull.nearest_to(&Vec3::zeros()).point.norm();
    if beside > tool.radius {
        let found = format!("a hull {} m beside its origin", round(beside));
        let allowed = "a mesh around its origin, which is the centre of the tool";
        return Err(loaded.source.error(&field, found, allowed));
    }
    Ok(hull)
}

/// The obstacle that the tool `index` is to bodies.
///
/// # Errors
/// As [`hull`].
pub(super) fn build(loaded: &LoadedScene, index: usize) -> Result<Obstacle, SceneError> {
    let tool = &loaded.scene.tools[index];
    let hull = hull(loaded, index)?;
    let [x, y, z] = tool.position;
    let shape = Shape::Rounded(Arc::new(Rounded::new(&hull, tool.radius)));
    let stands = Motion::Still(Isometry3::translation(x, y, z));
    Obstacle::new(Geometry::Shape(shape), stands).map_err(|error| {
        let allowed = "a tool that can move";
        (loaded.source).error(&format!("tool[{index}]"), error.to_string(), allowed)
    })
}

/// Refuses a tool that begins inside an obstacle. Bodies are checked with the other contacts.
///
/// # Errors
/// [`SceneError`] at the first fault.
pub(super) fn check_start(loaded: &LoadedScene, obstacles: &[Obstacle]) -> Result<(), SceneError> {
    let scene = &loaded.scene;
    let shapes = obstacles[scene.given_obstacles().len()..].iter();
    let shapes = shapes.filter_map(Obstacle::rounded);
    for (index, (tool, shape)) in scene.tools.iter().zip(shapes).enumerate() {
        let centre = Vec3::from(tool.position);
        for (given, obstacle) in scene.given_obstacles().iter().zip(obstacles) {
            let distance = distance(obstacle, shape.hull(), &centre);
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

/// The signed distance of a hull from the surface of an obstacle at the start (m).
fn distance(obstacle: &Obstacle, hull: &Hull, centre: &Vec3) -> f64 {
    if let Geometry::Shape(shape) = obstacle.geometry() {
        let pose = obstacle.pose(0.0);
        let nearest = Point3::from(nearest_point(shape, &pose, hull, centre));
        return (shape.nearest(&pose.inverse_transform_point(&nearest).coords)).distance;
    }
    let mut vicinity = Vicinity::default();
    vicinity.find(obstacle, 0.0, hull, centre, [f64::INFINITY, 0.0]);
    let triangles: Vec<[u32; 3]> = vicinity.triangles().iter().map(|of| of.1).collect();
    let nearest = vicinity.triangles().iter().map(|of| of.0);
    let nearest = nearest.fold(f64::INFINITY, f64::min);
    if winding(&triangles, vicinity.corners(), centre) > INSIDE {
        -nearest
    } else {
        nearest
    }
}
