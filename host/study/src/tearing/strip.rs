//! Section `mesh`: the strain at which a long clamped strip starts to tear.
//!
//! A strip, held flat, is clamped along both long sides and cut along its middle from one end to its centre. Far behind
//! the tip the strip is slack, far ahead it is stretched evenly. Its energy release rate is therefore exactly the energy
//! of the stretched part, `E e² H / (2 (1 - nu²))` (Rivlin and Thomas, "Rupture of rubber", 1953). Here the strip is in
//! equilibrium at strains about the expected one, and the strain at which `G` is the toughness is found by the secant
//! method.

use super::patterns::{Pattern, Rectangle, Slit};
use super::specimen::{CLOTH, driving, exact, hold_flat, side, surface};
use crate::{Level, StudyError};
use physics::tear::TearLaw;
use physics::{Body, Equilibrium, EquilibriumOptions, Vec3};
use serde::Serialize;

/// Length and height of the strip (m).
const LENGTH: f64 = 0.24;
const HEIGHT: f64 = 0.06;

/// The start of one strip.
#[derive(Clone, Debug, Serialize)]
pub struct Start {
    /// How the triangles lie.
    pub pattern: String,
    /// Number of triangles.
    pub triangles: usize,
    /// The exact strain, relative to the height.
    pub exact: f64,
    /// The strain found, relative to the height.
    pub found: f64,
}

impl Start {
    /// The relative error of the strain.
    pub fn error(&self) -> f64 {
        self.found / self.exact - 1.0
    }
}

/// The starts on all patterns at `sizes`.
///
/// # Errors
/// [`StudyError`].
pub fn run(level: Level, sizes: &[usize]) -> Result<Vec<Start>, StudyError> {
    let mut starts = Vec::new();
    for pattern in level.ends(&Pattern::ALL) {
        for &triangles in level.take(sizes, 2) {
            starts.push(start(pattern, triangles)?);
        }
    }
    Ok(starts)
}

fn start(pattern: Pattern, triangles: usize) -> Result<Start, StudyError> {
    let slit = Slit {
        from: [-0.5 * LENGTH, 0.0],
        to: [0.0, 0.0],
    };
    let rectangle = Rectangle {
        length: LENGTH,
        width: HEIGHT,
        triangles,
        pattern,
        slits: &[slit],
        marks: &[],
    };
    let made = rectangle.mesh()?;
    let surface = surface(&made.mesh)?;
    let mut body = Body::sheet(&made.mesh, &[CLOTH.elastic()], exact(), &[])?;
    hold_flat(&mut body, &[])?;
    let sides = ["bottom", "top"].map(|name| side(&made, name).to_vec());
    body.add_support(&sides[0], [true; 3])?;
    let top = body.add_support(&sides[1], [true; 3])?;
    let held = |vertex: u32| sides.iter().any(|side| side.contains(&vertex));
    let material = CLOTH.tear(TearLaw::Toughness);
    let mut equilibrium = Equilibrium::new(&body, EquilibriumOptions::default())?;
    let exact = CLOTH.strip_strain(HEIGHT);
    // The rate is nearly the square of the strain, so its root is nearly linear.
    let mut found = exact;
    for _ in 0..4 {
        body.set_support(top, Vec3::y() * (found * HEIGHT))?;
        equilibrium.solve(&mut body, &[], 1.0)?;
        let x: Vec<Vec3> = body.positions().collect();
        let (driving, _) = driving(&surface, made.tips[0], &x, &material, held)?;
        found *= (CLOTH.toughness / driving.rate()).sqrt();
    }
    Ok(Start {
        pattern: pattern.name(),
        triangles: made.mesh.triangles.len(),
        exact,
        found,
    })
}
