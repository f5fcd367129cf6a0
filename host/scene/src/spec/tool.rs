//! `[[tool]]`: what a device moves, and touches bodies with.

use super::Obstacle;
use super::contact::ShapeName;
use crate::check;
use serde::Deserialize;

/// `[[tool]]`: a sphere that a device moves. It touches bodies, and the hand feels them.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tool {
    /// Name, unique among bodies, obstacles and tools.
    pub name: String,
    /// The device that moves the tool. A device has at most one tool, and no handle beside it.
    pub device: String,
    /// Radius (m).
    #[serde(deserialize_with = "check::positive")]
    pub radius: f64,
    /// Where the centre is at rest (m).
    #[serde(deserialize_with = "check::finite3")]
    pub position: [f64; 3],
    /// Coefficient of friction against bodies. Default: that of obstacles.
    #[serde(default, deserialize_with = "check::optional_not_negative")]
    pub friction: Option<f64>,
}

impl Tool {
    /// The obstacle that the tool is to bodies.
    pub(crate) fn obstacle(&self) -> Obstacle {
        Obstacle {
            name: self.name.clone(),
            shape: Some(ShapeName::Sphere),
            radius: Some(self.radius),
            length: None,
            size: None,
            mesh: None,
            position: Some(self.position),
            rotation: None,
            poses: None,
            friction: self.friction,
        }
    }
}
