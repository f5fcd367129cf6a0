//! Section `running`: the displacement at which a tear runs through a long clamped strip.
//!
//! The energy release rate of the strip of part `mesh` does not depend on the length of its tear, so the tear runs through
//! the whole strip at the displacement at which it starts, `d0` (Rivlin and Thomas, "Rupture of rubber", 1953), whatever
//! the mesh, the damping and the length of the steps. The strip is pulled so slowly that it takes the tear a small part of
//! the time that the displacement takes to grow by a hundredth.

use super::patterns::{Pattern, Patterned, Rectangle, Slit, Triangles};
use super::rig::Rig;
use super::specimen::{Stuff, hold_flat, side};
use crate::{Level, StudyError};
use physics::tear::TearLaw;
use physics::{
    Body, BodyConfig, Border, Freedom, HandlePose, HandleSpec, Starts, TearOptions, Vec3,
};
use serde::Serialize;

/// Length and height of the strip, and the length of its notch (m).
const LENGTH: f64 = 0.2;
const HEIGHT: f64 = 0.04;
const NOTCH: f64 = 0.07;
/// The displacement up to which the strip is pulled in a second, and the speed from then on, in parts of `d0`.
const FIRST: f64 = 0.99;
const SPEED: f64 = 0.03;
/// The displacement at which a run ends, in parts of `d0`.
const LONGEST: f64 = 1.5;
/// The parts of the strip ahead of the notch at which the displacement is taken.
pub const TORN: [f64; 4] = [0.1, 0.3, 0.6, 0.9];

/// A soft sheet of 0.5 mm.
const SOFT: Stuff = Stuff {
    young: 4e6,
    poisson: 0.3,
    thickness: 5e-4,
    density: 1000.0,
    strength: 1e9,
    toughness: 500.0,
};

/// The meshes by Gmsh (4.15.2, algorithms 6 and 5), whose edges have a sixth or a tenth of the height of the strip.
pub fn by_gmsh(across: usize) -> [Triangles; 2] {
    let [frontal, delaunay] = if across < 10 {
        [
            include_str!("../../meshes/frontal_6.obj"),
            include_str!("../../meshes/delaunay_6.obj"),
        ]
    } else {
        [
            include_str!("../../meshes/frontal_10.obj"),
            include_str!("../../meshes/delaunay_10.obj"),
        ]
    };
    [("Frontal", frontal), ("Delaunay", delaunay)]
        .map(|(name, text)| Triangles::Obj(name.to_owned(), text.to_owned()))
}

/// One strip.
#[derive(Clone, Debug)]
pub struct Case {
    /// How the triangles lie.
    pub triangles: Triangles,
    /// Number of edges across the strip.
    pub across: usize,
    /// Steps in a second (Hz).
    pub rate: f64,
    /// Stiffness damping (s).
    pub damping: f64,
    /// Toughness (J/m^2).
    pub toughness: f64,
}

/// How the tear ran through one strip.
#[derive(Clone, Debug, Serialize)]
pub struct Run {
    /// The name of the mesh.
    pub mesh: String,
    /// Number of edges across the strip.
    pub across: usize,
    /// Steps in a second (Hz).
    pub rate: f64,
    /// Stiffness damping (s).
    pub damping: f64,
    /// Toughness (J/m^2).
    pub toughness: f64,
    /// The displacement at the first edge, relative to `d0`.
    pub start: Option<f64>,
    /// The displacements at which a tenth, three, six and nine tenths of the strip were torn, relative to `d0`; missing
    /// if the tear did not come so far.
    pub displacement: [Option<f64>; 4],
    /// The energy that was supplied and not stored between the first and the last of them, relative to `G_c t` times the
    /// torn area.
    pub work: Option<f64>,
}

impl Case {
    /// The name of the mesh, and the mesh with its notch.
    fn mesh(&self) -> Result<(String, Patterned), StudyError> {
        let (from, to) = ([-0.5 * LENGTH, 0.0], [NOTCH - 0.5 * LENGTH, 0.0]);
        let spacing = HEIGHT / self.across as f64;
        let slits = [Slit { from, to }];
        let rectangle = Rectangle {
            length: LENGTH,
            width: HEIGHT,
            triangles: (2.0 * LENGTH * HEIGHT / (spacing * spacing)).round() as usize,
            pattern: Pattern::default(),
            slits: &slits,
            marks: &[],
        };
        self.triangles.mesh(rectangle)
    }

    /// Tears the strip.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn run(&self) -> Result<Run, StudyError> {
        let (name, made) = self.mesh()?;
        let stuff = Stuff {
            toughness: self.toughness,
            ..SOFT
        };
        let clamp = |name: &str| HandleSpec {
            vertices: side(&made, name).to_vec(),
            origin: Vec3::zeros(),
            freedom: Freedom::Translation,
            border: Border::Hinged,
        };
        let config = BodyConfig {
            gravity: Vec3::zeros(),
            mass_damping: 2.0,
            stiffness_damping: self.damping,
            ..BodyConfig::default()
        };
        let clamps = [clamp("bottom"), clamp("top")];
        let held: Vec<u32> = (clamps.iter())
            .flat_map(|clamp| clamp.vertices.clone())
            .collect();
        let mut body = Body::sheet(&made.mesh, &[stuff.elastic()], config, &clamps)?;
        hold_flat(&mut body, &held)?;
        let options = TearOptions {
            material: stuff.tear(TearLaw::Toughness),
            starts: Starts::Tips,
            snapping: 0.3,
            skips: true,
        };
        let step = 1.0 / self.rate;
        let mut rig = Rig::with(body, options, &made.tips, step)?;
        let whole = LENGTH - NOTCH;
        let exact = HEIGHT * stuff.strip_strain(HEIGHT);
        let mut run = Run {
            mesh: name,
            across: self.across,
            rate: self.rate,
            damping: self.damping,
            toughness: self.toughness,
            start: None,
            displacement: [None; 4],
            work: None,
        };
        let mut first = None;
        let (mut time, mut part) = (0.0, 0.0);
        while part < LONGEST && run.displacement[3].is_none() {
            time += step;
            part = if time < 1.0 {
                FIRST * time * time * (3.0 - 2.0 * time)
            } else {
                FIRST + SPEED * (time - 1.0)
            };
            let up = Vec3::y() * (0.5 * part * exact);
            rig.step(&[HandlePose::at(-up), HandlePose::at(up)])?;
            let torn = rig.tear().area / stuff.thickness;
            if torn > 0.0 {
                run.start = run.start.or(Some(part));
            }
            let now = (torn, rig.ledger.supplied - rig.stored());
            for (displacement, least) in run.displacement.iter_mut().zip(TORN) {
                if torn >= least * whole {
                    *displacement = displacement.or(Some(part));
                }
            }
            if run.displacement[0].is_some() {
                let (from, spent) = *first.get_or_insert(now);
                if torn > from {
                    let due = stuff.toughness * stuff.thickness * (torn - from);
                    run.work = Some((now.1 - spent) / due);
                }
            }
        }
        Ok(run)
    }
}

/// The meshes with this number of edges across the strip.
fn meshes(across: usize) -> Vec<Triangles> {
    let patterns = Pattern::ALL.map(Triangles::Pattern);
    let mut all = patterns.to_vec();
    if across <= 10 {
        all.extend(by_gmsh(across));
    }
    all
}

/// The cases of a level: every mesh, size, rate and damping; at the quick level one size, and the extremes of rate and damping.
fn cases(level: Level) -> Vec<Case> {
    let mut cases = Vec::new();
    for &across in level.take(&[6, 10, 20], 1) {
        for triangles in meshes(across) {
            for &rate in level.take(&[1000.0, 125.0, 250.0, 60.0], 2) {
                for &damping in level.take(&[2e-3, 0.0, 5e-4], 2) {
                    cases.push(Case {
                        triangles: triangles.clone(),
                        across,
                        rate,
                        damping,
                        toughness: 500.0,
                    });
                }
            }
        }
    }
    cases
}

/// Tears the strips.
///
/// # Errors
/// [`StudyError`].
pub fn run(level: Level, progress: &dyn Fn(f64)) -> Result<Vec<Run>, StudyError> {
    let cases = cases(level);
    let count = cases.len() as f64;
    let mut runs = Vec::new();
    for case in &cases {
        runs.push(case.run()?);
        progress(runs.len() as f64 / count);
    }
    Ok(runs)
}
