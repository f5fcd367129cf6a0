//! The force-displacement curves of a solution.

use super::result::{BodySolution, Solution};
use crate::plot::LoadCurve;
use crate::scene::spec::{Analysis, Scene};

/// Whether a support of the scene is displaced, so that a solve has a force-displacement curve.
pub fn has_load_curves(scene: &Scene) -> bool {
    let mut supports = scene.bodies.iter().flat_map(|body| &body.supports);
    supports.any(|support| {
        let axes = support.displacement.iter().zip(support.axes);
        axes.into_iter().any(|(along, held)| *along != 0.0 && held)
    })
}

impl Solution {
    /// A curve for each support that is displaced: its force on the body against its displacement.
    ///
    /// A curve begins with the reaction to the weight. Without weight it begins with zero force, if the body has no stress
    /// at rest.
    pub fn load_curves(&self) -> Vec<LoadCurve> {
        let mut curves = Vec::new();
        for body in &self.bodies {
            for (index, displacement) in body.driven.iter().enumerate() {
                if *displacement != [0.0; 3] {
                    curves.push(self.load_curve(body, index, *displacement));
                }
            }
        }
        curves
    }

    fn load_curve(&self, body: &BodySolution, index: usize, displacement: [f64; 3]) -> LoadCurve {
        let rows = body.steps.iter();
        let rows = rows.map(|row| (row.fraction, row.forces.get(index).copied()));
        let settled = body.steps.first().is_some_and(|row| row.stage.is_some());
        let at_rest = self.analysis == Analysis::Static && !settled && body.stress_free;
        let rest = at_rest.then_some((0.0, Some([0.0; 3])));
        let (fractions, forces): (Vec<_>, Vec<_>) = rest
            .into_iter()
            .chain(rows)
            .map(|(fraction, force)| (fraction, force.unwrap_or([f64::NAN; 3])))
            .unzip();
        let name = body.reactions.get(index).map_or("", |r| r.name.as_str());
        let name = match self.bodies.len() {
            1 => name.to_owned(),
            _ => format!("{}, {name}", body.name),
        };
        LoadCurve::of_support(&name, displacement, &fractions, &forces)
    }
}
