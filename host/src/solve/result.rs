//! The result of a solve, for people and (as JSON) for programs.

use crate::scene::spec::Analysis;
use crate::scene::spec::body::LawName;
use crate::scene::spec::solve::TimeScheme;
use crate::world::Kind;
use serde::Serialize;

/// Version of the JSON that `--json` writes. A change of the meaning of a field changes the version.
pub const SCHEMA: &str = "palpate.solve/1";

/// The result of a solve.
#[derive(Clone, Debug, Serialize)]
pub struct Solution {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Name of the scene.
    pub scene: String,
    /// Values of the scene that few scenes mean, with the likely causes.
    pub warnings: Vec<String>,
    /// The kind of analysis.
    pub analysis: Analysis,
    /// The time discretization of a dynamic solve.
    pub scheme: Option<TimeScheme>,
    /// The solution of each body.
    pub bodies: Vec<BodySolution>,
    /// By pair that may touch; missing if nothing may.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub contacts: Vec<PairSolution>,
    /// For each body that was not solved to the end, the reason.
    pub failures: Vec<String>,
}

/// The state of one body at the end of its solve.
#[derive(Clone, Debug, Serialize)]
pub struct BodySolution {
    /// Name of the body.
    pub name: String,
    /// Kind of the body.
    pub kind: Kind,
    /// The material law.
    pub law: LawName,
    /// Number of vertices of an element.
    pub vertices_of_element: usize,
    /// Number of elements.
    pub elements: usize,
    /// Number of vertices.
    pub vertices: usize,
    /// Number of scalar unknowns.
    pub unknowns: usize,
    /// Mass (kg).
    pub mass: f64,
    /// Forces of handles and supports on the body.
    pub reactions: Vec<Reaction>,
    /// Sum of weight and loads (N).
    pub applied: [f64; 3],
    /// The longest displacement (m), at a vertex.
    pub displacement: Extreme,
    /// The largest von Mises stress (Pa), in an element.
    pub von_mises: Extreme,
    /// Elastic energy (J).
    pub elastic_energy: f64,
    /// Kinetic energy (J).
    pub kinetic_energy: f64,
    /// Number of inverted elements.
    pub inverted: usize,
    /// The displacement of each of `reactions` at the end of the ramp (m); zero for handles.
    #[serde(skip)]
    pub driven: Vec<[f64; 3]>,
    /// Whether the body has no stress at rest: it is not cut out of a flat pattern.
    #[serde(skip)]
    pub stress_free: bool,
    /// The steps, in their order.
    pub steps: Vec<Row>,
}

/// The contacts of a pair.
#[derive(Clone, Debug, Serialize)]
pub struct PairSolution {
    /// Names of both.
    pub between: [String; 2],
    /// Sums after each step.
    pub steps: Vec<PairRow>,
}

/// Sums after a step.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PairRow {
    /// Time (s), or fraction of the loads.
    pub at: f64,
    /// Contacts with a force.
    pub count: usize,
    /// Sum of normal forces (N).
    pub normal: f64,
    /// Sum of friction forces (N).
    pub friction: f64,
    /// Force on the first (N).
    pub force: [f64; 3],
    /// Largest depth (m).
    pub depth: f64,
}

/// The force and the moment of a handle or a support on the body.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reaction {
    /// Name of the handle or the support.
    pub name: String,
    /// `handle`, `support`, or `turned support`.
    pub by: &'static str,
    /// Force on the body (N); 0 along free axes.
    pub force: [f64; 3],
    /// Moment on the body about the present centre of the held vertices, of a grasp about its origin (N m). Only handles
    /// and turned supports have one.
    pub moment: Option<[f64; 3]>,
}

/// A largest value and its place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Extreme {
    /// The value, in the unit of the quantity: displacement (m), stress (Pa).
    pub value: f64,
    /// Number of the vertex or element, from 0, in the mesh's order.
    pub at: usize,
}

/// One step of a solve.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// `weight` for the step in which the body settles under its weight, before displacements and loads grow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stage: Option<&'static str>,
    /// End of the step: time (s), or fraction of the displacements and loads.
    pub at: f64,
    /// Number of substeps.
    pub substeps: usize,
    /// Number of refused attempts.
    pub refused: usize,
    /// Newton iterations.
    pub iterations: usize,
    /// Final residual, relative to the forces that balance; 0 if nothing loads or moves the body and the residual is
    /// only rounding.
    pub residual: f64,
    /// The largest motion of a node that rounding leaves undetermined (m), if rounding stopped the solve above its
    /// tolerance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub open: Option<f64>,
    /// Fraction of the displacements and loads (of the weight, less one, in the stage `weight`) at which the body snapped to
    /// another balance in this step of a static solve, if it did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub snapped: Option<f64>,
    /// Elastic energy (J).
    pub elastic_energy: f64,
    /// Kinetic energy (J).
    pub kinetic_energy: f64,
    /// The force (N) of each of [`BodySolution::reactions`].
    pub forces: Vec<[f64; 3]>,
    /// The moment (N m) of each of [`BodySolution::reactions`], if it has one.
    #[serde(skip)]
    pub moments: Vec<Option<[f64; 3]>>,
    /// Fraction of the displacements and loads that act.
    #[serde(skip)]
    pub fraction: f64,
    /// The longest displacement (m), at a vertex.
    #[serde(skip)]
    pub displacement: Extreme,
    /// The largest von Mises stress (Pa), in an element.
    #[serde(skip)]
    pub von_mises: Extreme,
}
