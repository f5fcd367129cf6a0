//! What a solve gives, for people and (as JSON) for programs.

use crate::bodies::Kind;
use crate::scene::spec::Analysis;
use crate::scene::spec::body::LawName;
use crate::scene::spec::solve::TimeScheme;
use serde::Serialize;

/// Version of the JSON that `--json` writes. A field that changes its meaning changes this.
pub const SCHEMA: &str = "palpate.solve/1";

/// Everything that a solve has to say.
#[derive(Clone, Debug, Serialize)]
pub struct Solution {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Name of the scene.
    pub scene: String,
    /// What was asked.
    pub analysis: Analysis,
    /// How time was discretized, in a dynamic solve.
    pub scheme: Option<TimeScheme>,
    /// By body.
    pub bodies: Vec<BodySolution>,
    /// Why a body was not solved to the end; what is said of it holds where it got to.
    pub failures: Vec<String>,
}

/// One body where its solve ended.
#[derive(Clone, Debug, Serialize)]
pub struct BodySolution {
    /// Its name.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// How stress follows from strain.
    pub law: LawName,
    /// Vertices of an element.
    pub vertices_of_element: usize,
    /// Number of elements.
    pub elements: usize,
    /// Number of vertices.
    pub vertices: usize,
    /// Number of scalars solved for.
    pub unknowns: usize,
    /// Mass (kg).
    pub mass: f64,
    /// Forces of handles and supports on the body.
    pub reactions: Vec<Reaction>,
    /// Weight and loads together (N).
    pub applied: [f64; 3],
    /// The longest displacement (m), at a vertex.
    pub displacement: Extreme,
    /// The largest von Mises stress (Pa), in an element.
    pub von_mises: Extreme,
    /// Elastic energy (J).
    pub elastic_energy: f64,
    /// Kinetic energy (J).
    pub kinetic_energy: f64,
    /// Elements turned inside out.
    pub inverted: usize,
    /// The steps, in their order.
    pub steps: Vec<Row>,
}

/// What a handle or a support does.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reaction {
    /// Its name.
    pub name: String,
    /// `handle`, `support`, or `turned support`.
    pub by: &'static str,
    /// On the body (N); 0 along axes that are free.
    pub force: [f64; 3],
    /// On the body, about the centre of its vertices where it is now (N m); of what holds all three axes as
    /// one rigid piece.
    pub moment: Option<[f64; 3]>,
}

/// A largest value and where it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Extreme {
    /// The value.
    pub value: f64,
    /// Number of the vertex or element, from 0, in the mesh's order.
    pub at: usize,
}

/// One step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Where it ended: time (s), or share of the loads.
    pub at: f64,
    /// Steps that it was taken in.
    pub substeps: usize,
    /// Attempts that were thrown away.
    pub refused: usize,
    /// Newton iterations.
    pub iterations: usize,
    /// Residual left, as a share of the forces that balance.
    pub residual: f64,
    /// Where rounding stopped the solve above its tolerance: what it leaves open of the motion (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub open: Option<f64>,
    /// Elastic energy (J).
    pub elastic_energy: f64,
    /// Kinetic energy (J).
    pub kinetic_energy: f64,
    /// The force (N) of each of [`BodySolution::reactions`].
    pub forces: Vec<[f64; 3]>,
}
