//! Section `strength`: strips without a notch.
//!
//! A strip that two hands pull by its ends carries the strength times its section and parts, whatever its toughness.
//! The strip lies flat, and tears may start anywhere. Without contraction across the pull the stress is even. With it
//! the stress is larger at the corners of the grips, which keep the ends as wide as they are: a brittle strip tears
//! from there at a smaller load.

use super::patterns::{Pattern, Rectangle};
use super::rig::Rig;
use super::specimen::{Stuff, flat_sheet, hand, side};
use crate::{Level, StudyError};
use physics::{BodyConfig, HandlePose, Starts, Vec3};
use serde::Serialize;

/// The length of a strip (m).
const LENGTH: f64 = 0.08;
/// The edges of a mesh (m).
const EDGE: f64 = 2.5e-3;
/// The speed of each hand (m/s), and the longest run (s).
const SPEED: f64 = 0.005;
const LONGEST: f64 = 6.0;
/// The length of a step (s).
const STEP: f64 = 4e-3;
/// The part of the largest force below which a strip has parted.
const PARTED: f64 = 0.02;

/// A soft sheet that stretches by 15 % before it tears.
const SOFT: Stuff = Stuff {
    young: 2e6,
    poisson: 0.3,
    thickness: 5e-4,
    density: 900.0,
    strength: 3e5,
    toughness: 300.0,
};

/// One strip.
#[derive(Clone, Debug, Serialize)]
pub struct Strip {
    /// How the triangles lie.
    pub pattern: String,
    /// Poisson's ratio.
    pub poisson: f64,
    /// The width of the strip (m).
    pub width: f64,
    /// Toughness (J/m^2).
    pub toughness: f64,
    /// The largest force (N), relative to the strength times the section.
    pub peak: f64,
    /// Whether the strip has parted: the hands feel nothing any more.
    pub parted: bool,
    /// The number of tears that started at the strength.
    pub tears: u64,
    /// The torn area, relative to the section of the strip.
    pub torn: f64,
}

impl Strip {
    /// The relative error of the largest force.
    pub fn error(&self) -> f64 {
        self.peak - 1.0
    }
}

/// Pulls strips of three widths and four toughnesses on two patterns with and without contraction; at the quick level, of one width
/// and two toughnesses on one pattern.
///
/// # Errors
/// [`StudyError`].
pub fn run(level: Level, progress: &dyn Fn(f64)) -> Result<Vec<Strip>, StudyError> {
    let patterns = [Pattern::Scattered(1), Pattern::Crossed];
    let patterns = level.take(&patterns, 1);
    let widths = level.take(&[0.01, 0.02, 0.04], 1);
    let toughnesses = match level {
        Level::Quick => &[30.0, 2000.0][..],
        Level::Full => &[30.0, 100.0, 300.0, 2000.0],
    };
    let whole = 2.0 * (patterns.len() * widths.len() * toughnesses.len()) as f64;
    let mut strips = Vec::new();
    for &pattern in patterns {
        for poisson in [0.0, SOFT.poisson] {
            for &width in widths {
                for &toughness in toughnesses {
                    strips.push(strip(pattern, poisson, width, toughness)?);
                    progress(strips.len() as f64 / whole);
                }
            }
        }
    }
    Ok(strips)
}

fn strip(pattern: Pattern, poisson: f64, width: f64, toughness: f64) -> Result<Strip, StudyError> {
    let rectangle = Rectangle {
        length: LENGTH,
        width,
        triangles: (2.0 * LENGTH * width / (EDGE * EDGE)).round() as usize,
        pattern,
        slits: &[],
        marks: &[],
    };
    let made = rectangle.mesh()?;
    let stuff = Stuff {
        poisson,
        toughness,
        ..SOFT
    };
    let hands = ["left", "right"].map(|name| hand(side(&made, name).to_vec()));
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        mass_damping: 1.0,
        stiffness_damping: 5e-4,
        ..BodyConfig::default()
    };
    let body = flat_sheet(&made.mesh, &stuff, config, &hands)?;
    let mut rig = Rig::with(body, stuff.tears(Starts::Anywhere), &[], STEP)?;
    let section = width * stuff.thickness;
    let (mut peak, mut parted) = (0.0_f64, false);
    let (mut time, mut torn) = (0.0, *rig.tearing.report());
    while time < LONGEST && !parted {
        time += STEP;
        let out = SPEED * time;
        rig.step(&[-out, out].map(|x| HandlePose::at(Vec3::x() * x)))?;
        torn = rig.tear();
        let force = 0.5 * (rig.force(0).x - rig.force(1).x);
        peak = peak.max(force);
        parted = torn.parted > 0 && force < PARTED * peak;
    }
    Ok(Strip {
        pattern: pattern.name(),
        poisson,
        width,
        toughness,
        peak: peak / (stuff.strength * section),
        parted,
        tears: torn.started,
        torn: torn.area / section,
    })
}
