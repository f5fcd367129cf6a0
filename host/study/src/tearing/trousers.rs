//! Section `trousers`: the force of a trousers test.
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
//! for any stiffness against bending. The strip is rubber of 2 mm as in the standard of such tests (ISO 34-1), and of 1 and
//! 0.5 mm. The load is unchanged by half a turn about the axis of the strip, so the tear follows the axis.

use super::patterns::{Pattern, Rectangle, Slit, Triangles};
use super::rig::Rig;
use super::specimen::{RUBBER, Stuff, side};
use crate::{Level, StudyError};
use physics::tear::TearLaw;
use physics::{
    Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Starts, TearOptions, Vec3,
};
use serde::Serialize;

/// Length and width of the strip (m), and the length of the cut (m).
const LENGTH: f64 = 0.15;
const WIDTH: f64 = 0.06;
const CUT: f64 = 0.06;
/// Time in which the legs are turned (s), and the speed of each hand afterwards (m/s).
const TURN: f64 = 0.8;
const SPEED: f64 = 0.02;
/// The length by which a turn of the leg brings its end nearer to the tip, because the bend cuts a corner.
const CORNER: f64 = 0.15;
/// The lengths of the tear (m) between which the force is averaged.
const FROM: f64 = 0.009;
const TO: f64 = 0.06;
/// The longest run (s).
const LONGEST: f64 = 6.0;

/// The force of one trousers test.
#[derive(Clone, Debug, Serialize)]
pub struct Trousers {
    /// How the triangles lie.
    pub pattern: String,
    /// Number of triangles.
    pub triangles: usize,
    /// Thickness (m).
    pub thickness: f64,
    /// The force of the formula (N).
    pub exact: f64,
    /// The mean force of a hand (N), and the deviation of the force from its mean (N); missing if the tear does not come to
    /// 60 mm.
    pub force: Option<[f64; 2]>,
    /// How far the tip is to the left of the axis after 60 mm, or at the end (m).
    pub drift: f64,
}

impl Trousers {
    /// The mean force over that of the formula, and its deviation over its mean.
    pub fn relative(&self) -> Option<[f64; 2]> {
        let [mean, deviation] = self.force?;
        Some([mean / self.exact, deviation / mean])
    }
}

/// One trousers test.
#[derive(Clone, Debug)]
pub struct Case {
    /// How the triangles lie.
    pub triangles: Triangles,
    /// The number of triangles to aim at in a pattern.
    pub count: usize,
    /// Thickness (m).
    pub thickness: f64,
    /// Steps in a second (Hz).
    pub rate: f64,
    /// 1, or -1 if the hands are swapped.
    pub up: f64,
}

/// The force of the formula (N), for legs whose tension grows linearly with their strain.
fn exact(thickness: f64) -> f64 {
    // W = E e² / 2 and F = E b t e give 2 e + e² = G_c / (E b) with l = 1 + e.
    let leg = 0.5 * WIDTH;
    let strain = (1.0 + RUBBER.toughness / (RUBBER.young * leg)).sqrt() - 1.0;
    RUBBER.young * leg * thickness * strain
}

/// Edges of 3.7 mm on all patterns, and two meshes by Gmsh (4.15.2, algorithms 6 and 5) with edges of 4 mm.
fn meshes() -> Vec<Triangles> {
    let patterns = Pattern::ALL.into_iter();
    let patterns = patterns.chain([Pattern::Scattered(2)]);
    let by_gmsh = [
        ("Frontal", include_str!("../../meshes/frontal_trousers.obj")),
        (
            "Delaunay",
            include_str!("../../meshes/delaunay_trousers.obj"),
        ),
    ];
    let by_gmsh = by_gmsh.map(|(name, text)| Triangles::Obj(name.to_owned(), text.to_owned()));
    patterns.map(Triangles::Pattern).chain(by_gmsh).collect()
}

/// The tests on all meshes in three thicknesses; at the quick level, of one mesh in one thickness.
///
/// # Errors
/// [`StudyError`].
pub fn run(level: Level, progress: &dyn Fn(f64)) -> Result<Vec<Trousers>, StudyError> {
    let meshes = meshes();
    let meshes = level.take(&meshes, 1);
    let thicknesses = level.take(&[2e-3, 1e-3, 5e-4], 1);
    let count = (meshes.len() * thicknesses.len()) as f64;
    let mut found = Vec::new();
    for triangles in meshes {
        for &thickness in thicknesses {
            let case = Case {
                triangles: triangles.clone(),
                count: level.choose(700, 1400),
                thickness,
                rate: 250.0,
                up: 1.0,
            };
            found.push(case.run()?);
            progress(found.len() as f64 / count);
        }
    }
    Ok(found)
}

impl Case {
    /// Tears the strip.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn run(&self) -> Result<Trousers, StudyError> {
        let slit = Slit {
            from: [-0.5 * LENGTH, 0.0],
            to: [CUT - 0.5 * LENGTH, 0.0],
        };
        let (name, made) = self.triangles.mesh(Rectangle {
            length: LENGTH,
            width: WIDTH,
            triangles: self.count,
            pattern: Pattern::Turned(0.0),
            slits: &[slit],
            marks: &[],
        })?;
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
        let stuff = Stuff {
            thickness: self.thickness,
            ..RUBBER
        };
        let body = Body::sheet(mesh, &[stuff.elastic()], config, &[leg(true), leg(false)])?;
        let options = TearOptions {
            material: stuff.tear(TearLaw::Toughness),
            starts: Starts::Tips,
            snapping: 0.3,
            skips: true,
        };
        let step = 1.0 / self.rate;
        let mut rig = Rig::with(body, options, &made.tips, step)?;
        let mut found = Trousers {
            pattern: name,
            triangles: mesh.triangles.len(),
            thickness: self.thickness,
            exact: exact(self.thickness),
            force: None,
            drift: 0.0,
        };
        let mut first = None;
        let mut forces = Vec::new();
        let mut time = 0.0;
        while time < LONGEST {
            time += step;
            // The end of a leg goes a quarter of a turn about the tip, and then straight on.
            let turned = (time / TURN).min(1.0);
            let angle = turned * core::f64::consts::FRAC_PI_2;
            let reach = CUT * (1.0 - CORNER * turned);
            let along = CUT - reach * libm::cos(angle);
            let up = reach * libm::sin(angle) + SPEED * (time - TURN).max(0.0);
            let targets =
                [self.up, -self.up].map(|sign| HandlePose::at(Vec3::new(along, 0.0, sign * up)));
            rig.step(&targets)?;
            let told = rig.tear();
            let torn = told.area / self.thickness;
            let now = (2.0 * up, rig.ledger.supplied);
            if torn >= FROM {
                first = first.or(Some(now));
                forces.push(0.5 * (rig.force(1).z - rig.force(0).z) * self.up);
            }
            if let Some(tip) = rig.tearing.tips().first() {
                let rest = rig.body.rest_positions().get(tip.vertex as usize);
                found.drift = rest.map_or(found.drift, |rest| rest.y);
            }
            if torn >= TO
                && let Some((opening, supplied)) = first
            {
                let count = forces.len() as f64;
                let mean = forces.iter().sum::<f64>() / count;
                let squares = forces.iter().map(|force| (force - mean).powi(2));
                let ripple = (squares.sum::<f64>() / count).sqrt();
                found.force = Some([(now.1 - supplied) / (now.0 - opening), ripple]);
                break;
            }
        }
        Ok(found)
    }
}
