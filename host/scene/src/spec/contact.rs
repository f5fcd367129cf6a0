//! `[[obstacle]]` and `[[contact]]`: what bodies may touch, and how.

use crate::check;
use physics::Vec3;
use physics::contact::shape::Shape;
use serde::{Deserialize, Serialize};

use super::Rotation;

/// Coefficient of friction if the scene gives none.
pub const FRICTION: f64 = 0.3;

/// `[[obstacle]]`: a thing that bodies touch and that no body moves. It has a `shape` or a `mesh`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Obstacle {
    /// Name, unique among bodies and obstacles.
    pub name: String,
    /// The shape of the obstacle.
    #[serde(default, deserialize_with = "check::optional_word")]
    pub shape: Option<ShapeName>,
    /// `sphere`, `capsule`, `cylinder`: radius (m).
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub radius: Option<f64>,
    /// `capsule`, `cylinder`: length along the z axis (m); of a capsule, without its round ends.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub length: Option<f64>,
    /// `box`: the lengths of its edges (m).
    #[serde(default, deserialize_with = "check::optional_positive3")]
    pub size: Option<[f64; 3]>,
    /// Instead of a shape: a closed mesh.
    #[serde(default, deserialize_with = "check::optional_table")]
    pub mesh: Option<ObstacleMesh>,
    /// Where the origin of the shape or the mesh lies in the world (m). Default: the origin of the world.
    #[serde(default, deserialize_with = "check::optional_finite3")]
    pub position: Option<[f64; 3]>,
    /// How the obstacle is turned about its origin, before it is moved to `position`. Default: not at all.
    #[serde(default, deserialize_with = "check::optional_table")]
    pub rotation: Option<Rotation>,
    /// Instead of `position` and `rotation`: a table of poses, its path relative to the scene file (CSV: time, x, y, z, qw,
    /// qx, qy, qz).
    #[serde(default)]
    pub poses: Option<String>,
    /// Coefficient of friction against bodies. Default: [`FRICTION`].
    #[serde(default, deserialize_with = "check::optional_not_negative")]
    pub friction: Option<f64>,
}

/// `obstacle.mesh`: a closed mesh of a file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObstacleMesh {
    /// The mesh file, its path relative to the scene file. With `frame_rate`, the `#` in it stand for the digits of the
    /// number of a frame.
    pub file: String,
    /// Metres per unit of the file.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub scale: Option<f64>,
    /// The distance within which doubled vertices are merged (m), after the scale.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub merge: Option<f64>,
    /// Frames per second of a mesh that is animated vertex by vertex (Hz).
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub frame_rate: Option<f64>,
}

/// `obstacle.shape`: the names of the shapes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ShapeName {
    /// The half space below `z = 0`.
    Plane,
    /// A sphere.
    Sphere,
    /// All points near a segment of the z axis.
    Capsule,
    /// A cylinder about the z axis, with flat ends.
    Cylinder,
    /// A box along the axes.
    Box,
}

impl ShapeName {
    /// The name in a scene.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plane => "plane",
            Self::Sphere => "sphere",
            Self::Capsule => "capsule",
            Self::Cylinder => "cylinder",
            Self::Box => "box",
        }
    }

    /// Whether the shape has a radius, a length and a size.
    pub(crate) fn sizes(self) -> [bool; 3] {
        match self {
            Self::Plane => [false; 3],
            Self::Sphere => [true, false, false],
            Self::Capsule | Self::Cylinder => [true, true, false],
            Self::Box => [false, false, true],
        }
    }
}

impl Obstacle {
    /// The shape, in axes of its own; `None` for a mesh. The consistency of the scene was checked: each shape has its
    /// sizes.
    pub fn shape(&self) -> Option<Shape> {
        let (radius, half) = (
            self.radius.unwrap_or_default(),
            self.length.unwrap_or_default() / 2.0,
        );
        Some(match self.shape? {
            ShapeName::Plane => Shape::Plane,
            ShapeName::Sphere => Shape::sphere(radius),
            ShapeName::Capsule => Shape::capsule(half, radius),
            ShapeName::Cylinder => Shape::Cylinder { half, radius },
            ShapeName::Box => Shape::Box {
                half: Vec3::from(self.size.unwrap_or_default()) / 2.0,
            },
        })
    }
}

/// `[[contact]]`: two bodies that may touch, or the friction of a pair that does.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// The names of two bodies, or of a body and an obstacle. A body that is named twice is its contact with itself.
    #[serde(deserialize_with = "check::names2")]
    pub between: [String; 2],
    /// Coefficient of friction. Default: that of the obstacle, otherwise [`FRICTION`].
    #[serde(default, deserialize_with = "check::optional_not_negative")]
    pub friction: Option<f64>,
    /// The distance at which the two touch (m). Default: the sum of half their thicknesses.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub thickness: Option<f64>,
}
