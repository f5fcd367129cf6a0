//! Warnings about round obstacles that fit between the vertices of a body.
//!
//! A capsule and a cylinder meet the vertices of a body, and not its edges. The surface of a coarse body falls around
//! an obstacle that is narrower than an edge is long. Spheres and the triangles of a box or of a mesh meet edges, too.

use super::Built;
use super::contact::{ContactPair, Contacts, Thing};
use super::shapes::round;
use crate::scene::LoadedScene;
use crate::scene::plausible::Warning;
use physics::Vec3;
use physics::contact::Obstacle;
use physics::contact::obstacle::Geometry;
use physics::contact::shape::Shape;
use physics::mesh::Mesh;

/// The warnings of a scene with these bodies and obstacles.
pub(super) fn warnings(
    loaded: &LoadedScene,
    bodies: &[Built],
    obstacles: &[Obstacle],
    contacts: &Contacts,
) -> Vec<Warning> {
    let each = contacts.pairs.iter();
    let warn = |pair: &ContactPair| {
        let [Thing::Body(body), Thing::Obstacle(number)] = pair.between else {
            return None;
        };
        let width = 2.0 * (narrowest(obstacles[number].geometry())? + pair.distance);
        let longest = longest(&bodies[body].mesh);
        let scene = &loaded.scene;
        (width < longest).then(|| Warning {
            location: loaded.source.location(&scene.field_of_obstacle(number)),
            found: format!(
                "an obstacle {:?} that is {} m wide at its surface of contact, and edges of body {:?} of up to {} m",
                scene.obstacles[number].name,
                round(width),
                scene.bodies[body].name,
                round(longest)
            ),
            usual: "an obstacle that is wider than these edges are long".to_owned(),
            advice: "this shape meets the vertices of the body alone and can pass between them: make the mesh of the body \
                     finer, or give the obstacle as shape = \"mesh\""
                .to_owned(),
        })
    };
    each.filter_map(warn).collect()
}

/// The smallest radius of a round shape (m); `None` for a shape that meets edges.
fn narrowest(geometry: &Geometry) -> Option<f64> {
    match geometry {
        Geometry::Shape(Shape::Cylinder { radius, half }) => Some(radius.min(*half)),
        Geometry::Shape(Shape::Plane | Shape::Rounded(_) | Shape::Box { .. })
        | Geometry::Mesh(_) => None,
    }
}

/// The length (m) of the longest edge of a body's surface at rest.
fn longest(mesh: &Mesh) -> f64 {
    let x = mesh.positions();
    let length = |a: u32, b: u32| Vec3::norm(&(x[a as usize] - x[b as usize]));
    let of_triangle = |[a, b, c]: &[u32; 3]| length(*a, *b).max(length(*b, *c)).max(length(*c, *a));
    let lengths: Vec<f64> = match mesh {
        Mesh::Thread(mesh) => mesh.lines.iter().map(|[a, b]| length(*a, *b)).collect(),
        Mesh::Sheet(mesh) => mesh.triangles.iter().map(of_triangle).collect(),
        Mesh::Solid(mesh) => mesh.boundary().iter().map(of_triangle).collect(),
    };
    lengths.into_iter().fold(0.0, f64::max)
}
