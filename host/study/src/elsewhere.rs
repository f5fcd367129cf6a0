//! Figures of other programs, with which the studies compare. They are in `data/`, with their sources.

use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::LazyLock;

/// Times of other programs for a step.
pub static SPEED: LazyLock<Speed> = LazyLock::new(|| read(include_str!("../data/speed.toml")));

/// Results of an independent program.
pub(crate) static ACCURACY: LazyLock<Accuracy> =
    LazyLock::new(|| read(include_str!("../data/accuracy.toml")));

/// A data file of this crate.
fn read<'a, T: Deserialize<'a>>(text: &'a str) -> T {
    toml::from_str(text).expect("the crate's own data files are sound")
}

/// Times of other programs.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Speed {
    /// Time of the calibration on the machine on which the figures that can be scaled were taken (s).
    pub calibration: f64,
    /// Whole steps of the pressed cube.
    pub cube: Vec<Steps>,
    /// Whole steps of sheets.
    pub sheets: Vec<Steps>,
}

/// Times of one program with one setting.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Steps {
    /// The program and its setting.
    pub setting: String,
    /// Whether the times are 99th percentiles, and not medians.
    #[serde(default)]
    pub p99: bool,
    /// Whether the times were taken on the machine of the calibration, so that they can be scaled.
    #[serde(default = "yes")]
    pub scalable: bool,
    /// Tetrahedra or triangles.
    elements: Vec<usize>,
    /// Time of a whole step for each number of elements (ms).
    milliseconds: Vec<f64>,
}

fn yes() -> bool {
    true
}

impl Steps {
    /// Each number of elements with the time of a whole step (s).
    pub fn times(&self) -> impl Iterator<Item = (usize, f64)> {
        let seconds = self.milliseconds.iter().map(|time| 1e-3 * time);
        self.elements.iter().copied().zip(seconds)
    }
}

/// Forces and stresses of an independent program on the meshes of the accuracy study.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Accuracy {
    pub(crate) cube: Cube,
    pub(crate) strip: Strip,
    /// Largest stress of each family of plates with a hole, relative to the applied stress, from the coarsest mesh on.
    pub(crate) kirsch: BTreeMap<String, Vec<f64>>,
}

/// Forces (N) of the bonded cube, compressed by a tenth.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Cube {
    /// Cells along an edge of each mesh of linear tetrahedra.
    pub(crate) cells: Vec<u32>,
    /// Forces on these meshes under the linear law.
    pub(crate) linear: Vec<f64>,
    /// Forces on these meshes under the corotational law.
    pub(crate) corotational: Vec<f64>,
    /// Force of quadratic tetrahedra under the linear law, extrapolated.
    pub(crate) converged_linear: f64,
    /// Force of quadratic tetrahedra under the corotational law, extrapolated.
    pub(crate) converged_corotational: f64,
}

/// Forces (N) of the strip.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Strip {
    /// Force of the corotational strip with clamped ends.
    pub(crate) clamped: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_figure_has_its_mesh() {
        for steps in SPEED.cube.iter().chain(&SPEED.sheets) {
            assert_eq!(
                steps.elements.len(),
                steps.milliseconds.len(),
                "{}",
                steps.setting
            );
        }
        let cube = &ACCURACY.cube;
        assert_eq!(cube.cells.len(), cube.linear.len());
        assert_eq!(cube.cells.len(), cube.corotational.len());
    }
}
