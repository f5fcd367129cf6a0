//! The elements of a body, and the loads that act on it.

use super::BodyConfig;
use crate::Vec3;
use crate::element::Elements;
use crate::element::bending::{Bending, BentSheet};

/// Elements, mass and loads.
#[derive(Clone, Debug)]
pub(crate) struct Model {
    pub(crate) config: BodyConfig,
    /// One set per kind, over nodes.
    pub(crate) elements: Vec<Box<dyn Elements>>,
    /// The sheet that resists bending, if there is one.
    pub(crate) bent: Option<BentSheet>,
    pub(crate) bending: Option<Bending>,
    /// Positions at rest, by node (m).
    pub(crate) rest: Vec<Vec3>,
    /// Lumped mass by node (kg).
    pub(crate) mass: Vec<f64>,
    /// The mass that gravity acts on (kg). It differs from the lumped mass if elements are quadratic.
    pub(crate) load: Vec<f64>,
    /// Gravity and the external forces that the host sets (N).
    pub(crate) external: Vec<Vec3>,
    /// Fraction of `external` that acts.
    pub(crate) load_factor: f64,
}
