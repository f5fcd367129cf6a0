//! The growth of a step's time with the mesh: the compressed cube in finer and finer cells.

use super::Told;
use super::cube::{EDGE, Stiffness, TOP, cube};
use super::motion::Motion;
use super::path;
use super::set_up::{SetUp, set_up};
use super::trial::drive;
use crate::{Level, StudyError};
use physics::Vec3;
use serde::Serialize;

/// One mesh.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Size {
    /// Tetrahedra.
    pub elements: usize,
    /// Unknown coordinates.
    pub unknowns: usize,
    /// Median time of a step (s).
    pub median: f64,
    /// Mean number of iterations in a step.
    pub iterations: f64,
    /// Time of a step per tetrahedron and iteration (s).
    pub per_element_and_iteration: f64,
    /// Memory and time besides the steps, for frozen paths.
    pub set_up: Option<SetUp>,
}

/// One path on meshes of growing size.
#[derive(Clone, Debug, Serialize)]
pub struct Scaling {
    /// The path.
    pub path: &'static str,
    /// The meshes, from coarse to fine.
    pub sizes: Vec<Size>,
    /// Exponent of the number of tetrahedra in the time of a step, fitted by least squares.
    pub exponent: f64,
    /// The same exponent for one iteration: 1 if memory is as fast for large meshes as for small ones.
    pub exponent_of_iteration: f64,
}

/// Steps of each mesh: the start of a compression by 10 % in 1.5 s.
const STEPS: usize = 15;

/// Each path on each mesh. `tell` is given the fraction done, and each mesh.
pub(super) fn run(
    level: Level,
    tell: &mut dyn FnMut(Told<'_>),
) -> Result<Vec<Scaling>, StudyError> {
    // 6, 20, 64 and 197 thousand tetrahedra; quickly 1 and 3 thousand. The time grows with the exponent 1.3.
    let meshes: &[(u32, f64)] = match level {
        Level::Quick => &[(6, 0.25), (8, 0.75)],
        Level::Full => &[(10, 0.01), (15, 0.04), (22, 0.2), (32, 0.75)],
    };
    let paths = path::ALL
        .into_iter()
        .chain([path::INCOMPLETE])
        // Complete factors of fine meshes in three dimensions take gigabytes.
        .filter(|path| path.method != path::NEWTON);
    let mut all: Vec<Scaling> = paths
        .clone()
        .map(|path| Scaling {
            path: path.name,
            sizes: Vec::new(),
            exponent: f64::NAN,
            exponent_of_iteration: f64::NAN,
        })
        .collect();
    let mut done = 0.0;
    for &(n, fraction) in meshes {
        tell(Told::Fraction(done));
        let body = cube(n, false, Stiffness::Uniform)?;
        let elements = body.element_count();
        let h = 0.01;
        let motion = Motion::ramp(Vec3::z() * (-0.1 * EDGE), 1.5, 0.0, h).first(STEPS);
        for (path, scaling) in paths.clone().zip(&mut all) {
            let course = drive(&body, TOP, &motion, path.method)?;
            let (median, iterations) = (course.median(), course.iterations() as f64 / STEPS as f64);
            let size = Size {
                elements,
                unknowns: body.unknown_count(),
                median,
                iterations,
                per_element_and_iteration: median / (elements as f64 * iterations.max(1.0)),
                set_up: set_up(path.method, &body, h)?,
            };
            tell(Told::Size(path.name, &size));
            scaling.sizes.push(size);
        }
        done += fraction;
    }
    for scaling in &mut all {
        scaling.exponent = exponent(&scaling.sizes, |size| size.median);
        scaling.exponent_of_iteration =
            exponent(&scaling.sizes, |size| size.median / size.iterations);
    }
    Ok(all)
}

/// Slope of the logarithm of `time` over the logarithm of the number of tetrahedra.
fn exponent(sizes: &[Size], time: impl Fn(&Size) -> f64) -> f64 {
    let points = || {
        sizes
            .iter()
            .map(|size| (libm::log(size.elements as f64), libm::log(time(size))))
    };
    let count = sizes.len() as f64;
    let (sum_x, sum_y) = points().fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
    let (mean_x, mean_y) = (sum_x / count, sum_y / count);
    let (top, bottom) = points().fold((0.0, 0.0), |(top, bottom), (x, y)| {
        (
            top + (x - mean_x) * (y - mean_y),
            bottom + (x - mean_x) * (x - mean_x),
        )
    });
    top / bottom
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponent_is_that_of_a_power() {
        let size = |elements: usize| Size {
            elements,
            unknowns: 0,
            median: 1e-7 * libm::pow(elements as f64, 1.25),
            iterations: 3.0,
            per_element_and_iteration: 0.0,
            set_up: None,
        };
        let sizes = [1000, 5000, 70_000].map(size);
        // Rounding of logarithms near 10.
        assert!((exponent(&sizes, |size| size.median) - 1.25).abs() < 1e-13);
    }
}
