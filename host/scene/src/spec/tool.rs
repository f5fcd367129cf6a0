//! `[[tool]]`: what a device moves, and touches bodies with.

use super::contact::ObstacleMesh;
use super::{Obstacle, Rotation, button_mask};
use crate::check;
use physics::Vec3;
use serde::{Deserialize, Serialize};

/// `[[tool]]`: a rounded thing that a device moves. It touches bodies, and the hand feels them. It keeps its attitude.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tool {
    /// Name, unique among bodies, obstacles and tools.
    pub name: String,
    /// The device that moves the tool. A device has at most one tool, and no handle beside it.
    pub device: String,
    /// The shape. Default: a sphere.
    #[serde(default, deserialize_with = "check::word")]
    pub shape: ToolShape,
    /// Radius (m) of a sphere or a capsule, and of the edges and corners of another shape.
    #[serde(deserialize_with = "check::positive")]
    pub radius: f64,
    /// `capsule`: length along the z axis, without the round ends (m). `plate`: length along the x axis (m).
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub length: Option<f64>,
    /// `plate`: width along the y axis (m). Twice the radius is its thickness.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub width: Option<f64>,
    /// `box`: the lengths of its sides (m).
    #[serde(default, deserialize_with = "check::optional_positive3")]
    pub size: Option<[f64; 3]>,
    /// `hull`: a mesh around its origin. The tool has all points within the radius of the mesh's convex hull.
    #[serde(default, deserialize_with = "check::optional_table")]
    pub mesh: Option<HullMesh>,
    /// Where the centre is at rest (m); of a hull, the origin of its mesh.
    #[serde(deserialize_with = "check::finite3")]
    pub position: [f64; 3],
    /// How the shape is turned about its centre. Default: not at all.
    #[serde(default, deserialize_with = "check::optional_table")]
    pub rotation: Option<Rotation>,
    /// Coefficient of friction against bodies. Default: that of obstacles.
    #[serde(default, deserialize_with = "check::optional_not_negative")]
    pub friction: Option<f64>,
    /// The button of the device with which the hand takes hold of what the tool touches, counted from one: as long as the button is down,
    /// nothing that the tool touches parts from it or slips.
    #[serde(default, deserialize_with = "check::optional_button")]
    pub take_button: Option<usize>,
}

/// `tool.shape`: the names of the shapes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ToolShape {
    /// A sphere.
    #[default]
    Sphere,
    /// All points near a segment of the z axis.
    Capsule,
    /// A flat plate across the z axis, with round edges.
    Plate,
    /// A box along the axes, with round edges.
    Box,
    /// The convex hull of a mesh, with round edges.
    Hull,
}

/// `tool.mesh`: the vertices of a mesh file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HullMesh {
    /// The mesh file, its path relative to the scene file.
    pub file: String,
    /// Metres per unit of the file.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub scale: Option<f64>,
}

impl ToolShape {
    /// The name in a scene.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Capsule => "capsule",
            Self::Plate => "plate",
            Self::Box => "box",
            Self::Hull => "hull",
        }
    }

    /// Whether the shape has a length, a width, a size and a mesh.
    pub(crate) fn sizes(self) -> [bool; 4] {
        match self {
            Self::Sphere => [false; 4],
            Self::Capsule => [true, false, false, false],
            Self::Plate => [true, true, false, false],
            Self::Box => [false, false, true, false],
            Self::Hull => [false, false, false, true],
        }
    }
}

impl Tool {
    /// The sides of a plate or a box (m), with its round edges; `None` for another shape.
    pub(crate) fn sides(&self) -> Option<[f64; 3]> {
        match self.shape {
            ToolShape::Sphere | ToolShape::Capsule | ToolShape::Hull => None,
            ToolShape::Plate => Some([self.length?, self.width?, 2.0 * self.radius]),
            ToolShape::Box => self.size,
        }
    }

    /// The points whose hull the radius rounds, about the centre, in axes of the scene (m); of a hull, those of its mesh, which are
    /// `vertices`.
    pub fn corners(&self, vertices: &[Vec3]) -> Vec<Vec3> {
        let half_length = Vec3::z() * (0.5 * self.length.unwrap_or_default());
        let corners = match (self.shape, self.sides()) {
            (ToolShape::Capsule, _) => vec![half_length, -half_length],
            (ToolShape::Hull, _) => vertices.to_vec(),
            (_, Some(sides)) => {
                let half = Vec3::from(sides).map(|side| (0.5 * side - self.radius).max(0.0));
                let corners = (0..8).map(|corner| {
                    Vec3::from_fn(|axis, _| f64::from(2 * (corner >> axis & 1) - 1) * half[axis])
                });
                corners.collect()
            }
            (_, None) => vec![Vec3::zeros()],
        };
        let turn = self.rotation.map(Rotation::quaternion);
        let turned = |p: Vec3| turn.map_or(p, |turn| turn * p);
        corners.into_iter().map(turned).collect()
    }

    /// The mask of the button with which the hand takes hold; zero without one.
    pub fn take_buttons(&self) -> u32 {
        button_mask(self.take_button)
    }

    /// The obstacle that the tool is to bodies. Its shape is that of the tool.
    pub(crate) fn obstacle(&self) -> Obstacle {
        Obstacle {
            name: self.name.clone(),
            shape: None,
            radius: Some(self.radius),
            length: self.length,
            size: self.size,
            mesh: self.mesh.as_ref().map(|mesh| ObstacleMesh {
                file: mesh.file.clone(),
                scale: mesh.scale,
                merge: None,
                frame_rate: None,
            }),
            position: Some(self.position),
            rotation: None,
            poses: None,
            friction: self.friction,
        }
    }
}
