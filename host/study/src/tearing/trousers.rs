//! Part `mesh`: the force of a trousers test.
//!
//! A strip that is cut along its middle has two legs. The hands hold their ends and pull them apart, up and down, until
//! the legs are one line. From then on each length of tear lengthens both legs. The energy of the hands covers the tear and
//! the stretching of the legs (Rivlin and Thomas, "Rupture of rubber", 1953), with `l` the stretch of a leg, `b` its
//! width and `W` its energy density:
//!
//! ```text
//! F = (G_c t + 2 b t W) / (2 l)        F = b t dW/dl
//! ```
//!
//! The legs bend beside the tip, and the bend moves with the tip. It takes no energy while it moves, so the formula holds
//! for any stiffness against bending. The strip is rubber of 2 mm as in the standard of such tests (ISO 34-1), whose bend
//! spans several triangles. A limp sheet folds within one edge. Its legs go slack after each edge and flutter, and the
//! force is larger than that of the formula by what is lost so: by 15 % at 720 triangles, by 4 % at half the speed.

use super::patterns::{Pattern, Rectangle, Slit};
use super::rig::{Rig, STEP};
use super::specimen::{RUBBER, side};
use crate::{Level, StudyError};
use physics::tear::TearLaw;
use physics::{Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Vec3};
use serde::Serialize;

/// Length and width of the strip (m), and the length of the cut (m).
const LENGTH: f64 = 0.15;
const WIDTH: f64 = 0.06;
const CUT: f64 = 0.06;
/// Time in which the legs are turned (s), and the speed of each hand afterwards (m/s).
const TURN: f64 = 0.8;
const SPEED: f64 = 0.02;
/// The part of a leg by which its end is nearer to the tip when the leg has been turned: the bend cuts a corner.
const CORNER: f64 = 0.15;
/// The lengths of the tear (m) between which the force is averaged.
const FROM: f64 = 0.009;
const TO: f64 = 0.03;
/// The longest run (s).
const LONGEST: f64 = 4.0;

/// The force of one trousers test.
#[derive(Clone, Debug, Serialize)]
pub struct Trousers {
    /// How the triangles lie.
    pub pattern: String,
    /// Number of triangles.
    pub triangles: usize,
    /// The force of the formula (N).
    pub exact: f64,
    /// The mean force of a hand (N).
    pub found: f64,
}

impl Trousers {
    /// The relative error of the force.
    pub fn error(&self) -> f64 {
        self.found / self.exact - 1.0
    }
}

/// The force of the formula (N), for legs whose tension grows linearly with their strain.
fn exact() -> f64 {
    // W = E e² / 2 and F = E b t e give 2 e + e² = G_c / (E b) with l = 1 + e.
    let leg = 0.5 * WIDTH;
    let strain = (1.0 + RUBBER.toughness / (RUBBER.young * leg)).sqrt() - 1.0;
    RUBBER.young * leg * RUBBER.thickness * strain
}

/// The tests of all patterns on one size; at the quick level, of one pattern.
///
/// # Errors
/// [`StudyError`].
pub fn run(level: Level) -> Result<Vec<Trousers>, StudyError> {
    let patterns = level.take(&Pattern::ALL, 1).iter();
    patterns
        .map(|&pattern| test(pattern, level.choose(700, 1400)))
        .collect()
}

fn test(pattern: Pattern, triangles: usize) -> Result<Trousers, StudyError> {
    let slit = Slit {
        from: [-0.5 * LENGTH, 0.0],
        to: [CUT - 0.5 * LENGTH, 0.0],
    };
    let rectangle = Rectangle {
        length: LENGTH,
        width: WIDTH,
        triangles,
        pattern,
        slits: &[slit],
        marks: &[],
    };
    let made = rectangle.mesh()?;
    let mesh = &made.mesh;
    let leg = |above: bool| HandleSpec {
        vertices: side(&made, "left")
            .iter()
            .copied()
            .filter(|&vertex| super::pull::is_above(mesh, vertex) == above)
            .collect(),
        origin: Vec3::zeros(),
        freedom: Freedom::Translation,
        border: Border::Hinged,
    };
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        mass_damping: 2.0,
        stiffness_damping: 5e-4,
        bending: 1.0,
        ..BodyConfig::default()
    };
    let body = Body::sheet(mesh, &[RUBBER.elastic()], config, &[leg(true), leg(false)])?;
    let mut rig = Rig::new(body, RUBBER.tear(TearLaw::Toughness), 0.3, &made.tips)?;
    let mut first = None;
    let mut time = 0.0;
    while time < LONGEST {
        time += STEP;
        // The end of a leg goes a quarter of a turn about the tip, and then straight on.
        let turned = (time / TURN).min(1.0);
        let angle = turned * core::f64::consts::FRAC_PI_2;
        let reach = CUT * (1.0 - CORNER * turned);
        let along = CUT - reach * libm::cos(angle);
        let up = reach * libm::sin(angle) + SPEED * (time - TURN).max(0.0);
        let targets = [1.0, -1.0].map(|sign| HandlePose::at(Vec3::new(along, 0.0, sign * up)));
        rig.step(&targets)?;
        let torn = rig.tear().area / RUBBER.thickness;
        let now = (2.0 * up, rig.ledger.supplied);
        if torn >= FROM && first.is_none() {
            first = Some(now);
        }
        if torn >= TO {
            let Some((opening, supplied)) = first else {
                break;
            };
            return Ok(Trousers {
                pattern: pattern.name(),
                triangles: mesh.triangles.len(),
                exact: exact(),
                found: (now.1 - supplied) / (now.0 - opening),
            });
        }
    }
    Err(StudyError::Rests)
}
