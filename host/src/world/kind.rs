//! The kinds of bodies.

use crate::scene::spec::body::{Body, WeaveFields};
use physics::mesh::Mesh;

/// The kind of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Isotropic triangles.
    Sheet,
    /// Orthotropic triangles.
    Woven,
    /// Tetrahedra.
    Solid,
    /// Bars.
    Thread,
}

impl Kind {
    /// The kind of a body with this mesh.
    pub(super) fn of(body: &Body, mesh: &Mesh) -> Self {
        match (mesh, &body.material.weave) {
            (Mesh::Thread(_), _) => Self::Thread,
            (Mesh::Solid(_), _) => Self::Solid,
            (Mesh::Sheet(_), Some(_)) => Self::Woven,
            (Mesh::Sheet(_), None) => Self::Sheet,
        }
    }
}

/// Factor on the bending stiffness of a body; 0 for a body without a bending model.
pub fn bending(body: &Body, kind: Kind) -> f64 {
    match kind {
        Kind::Woven if !body.material.weave.is_some_and(bends) => 0.0,
        Kind::Sheet | Kind::Woven => body.bending.unwrap_or(1.0),
        Kind::Solid | Kind::Thread => 0.0,
    }
}

/// Whether a weave resists bending.
pub(super) fn bends(weave: WeaveFields) -> bool {
    weave.bending_warp > 0.0 || weave.bending_weft > 0.0 || weave.bending_twist > 0.0
}
