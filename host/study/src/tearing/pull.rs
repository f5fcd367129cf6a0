//! A notched sheet that two hands tear in its plane: the run behind the parts `mesh`, `energy` and `meshes`.
//!
//! The sheet hangs flat from two hands, which hold its left border beside a notch and move apart at a constant speed. The
//! run takes realtime steps of a millisecond in virtual time. The hands are slow (below a thousandth of the wave speed),
//! so the tear grows as far as the hands move.

use super::patterns::{Pattern, Rectangle, Slit};
use super::rig::{Rig, STEP};
use super::specimen::{Stuff, flat_sheet, hand, side};
use crate::StudyError;
use physics::mesh::TriMesh;
use physics::motion::stepper::Ledger;
use physics::tear::TearLaw;
use physics::{Body, BodyConfig, HandlePose, TearReport, Vec3};
use serde::Serialize;

/// Length and width of the sheet (m), the length of its notch (m), and the length of border that each hand holds (m). The
/// two arms beside the notch bend in the plane, so that the driving force falls fast as the tear grows.
pub(super) const LENGTH: f64 = 0.16;
pub(super) const WIDTH: f64 = 0.08;
pub(super) const NOTCH: f64 = 0.03;
const GRIP: f64 = 0.016;
/// Speed of each hand (m/s), and the time in which it is reached (s).
const SPEED: f64 = 0.04;
const RAMP: f64 = 0.1;

/// What is torn, and how.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pull {
    pub(super) stuff: Stuff,
    pub(super) pattern: Pattern,
    pub(super) triangles: usize,
    pub(super) law: TearLaw,
    /// Gravity along the notch (m/s²).
    pub(super) gravity: f64,
    pub(super) snapping: f64,
    /// The run ends when the tear has this length (m), or has no tip any more, or at `longest` (s).
    pub(super) length: f64,
    pub(super) longest: f64,
}

/// A sample: the state after a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sample {
    /// How far the hands have moved apart (m).
    pub(super) opening: f64,
    /// The force of each hand along its motion (N).
    pub(super) force: [f64; 2],
    /// The length of the tear without the notch (m).
    pub(super) torn: f64,
    /// The work of hands and supports so far (J).
    pub(super) supplied: f64,
    /// Kinetic and elastic energy and energy of the weight, from the start (J).
    pub(super) stored: f64,
}

/// A run.
#[derive(Debug)]
pub(super) struct Torn {
    pub(super) samples: Vec<Sample>,
    pub(super) report: TearReport,
    /// The account of all steps.
    pub(super) ledger: Ledger,
    /// Work of the pairs that have not let go at the end (J), and the energy that they are still to take.
    pub(super) pending: f64,
    /// Triangles of the sheet at the start and at the end, and the smallest angles (degrees).
    pub(super) triangles: [usize; 2],
    pub(super) angles: [f64; 2],
    /// The largest changes across an edit: mass (relative), area (relative), momentum (relative to mass times the
    /// largest speed).
    pub(super) edits: EditErrors,
    /// How far the middle of the tear is from the line of the notch at most (m), along the first `length`.
    pub(super) strayed: f64,
    pub(super) spacing: f64,
    /// Mean and largest number of iterations of a step.
    pub(super) iterations: [f64; 2],
}

/// The largest errors of the edits of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct EditErrors {
    /// Change of the mass, relative.
    pub mass: f64,
    /// Change of the area at rest, relative.
    pub area: f64,
    /// Change of the momentum, relative to the mass times the largest speed.
    pub momentum: f64,
    /// Number of inverted triangles, at rest and in space.
    pub inverted: usize,
}

impl Torn {
    /// The moment at which the tear has grown to `length` (m) first.
    pub(super) fn at(&self, length: f64) -> Option<&Sample> {
        self.samples.iter().find(|sample| sample.torn >= length)
    }
}

/// Whether the triangles at a vertex lie above the x-axis.
pub(super) fn is_above(mesh: &TriMesh, vertex: u32) -> bool {
    let about = mesh
        .triangles
        .iter()
        .filter(|corners| corners.contains(&vertex));
    let heights = about
        .flatten()
        .map(|&corner| mesh.positions[corner as usize].y);
    heights.sum::<f64>() > 0.0
}

impl Pull {
    /// The mesh, with the tip of the notch.
    pub(super) fn mesh(&self) -> Result<super::Patterned, StudyError> {
        let slit = Slit {
            from: [-0.5 * LENGTH, 0.0],
            to: [-0.5 * LENGTH + NOTCH, 0.0],
        };
        let rectangle = Rectangle {
            length: LENGTH,
            width: WIDTH,
            triangles: self.triangles,
            pattern: self.pattern,
            slits: &[slit],
            marks: &[[-0.5 * LENGTH, GRIP], [-0.5 * LENGTH, -GRIP]],
        };
        rectangle.mesh()
    }

    /// Tears the sheet.
    pub(super) fn run(&self) -> Result<Torn, StudyError> {
        let made = self.mesh()?;
        let mesh = &made.mesh;
        let near = |vertex: &&u32| mesh.positions[**vertex as usize].y.abs() < GRIP + 1e-9;
        let hands = [true, false].map(|above| {
            let held = side(&made, "left").iter().filter(near).copied();
            hand(held.filter(|&at| is_above(mesh, at) == above).collect())
        });
        let config = BodyConfig {
            gravity: Vec3::x() * self.gravity,
            mass_damping: 2.0,
            stiffness_damping: 2e-4,
            ..BodyConfig::default()
        };
        let body = flat_sheet(mesh, &self.stuff, config, &hands)?;
        let material = self.stuff.tear(self.law);
        let mut rig = Rig::new(body, material, self.snapping, &made.tips)?;
        let surface_of = |body: &Body| {
            body.surface().map_or([0.0; 3], |surface| {
                let area: f64 = (0..surface.triangle_count() as u32)
                    .map(|t| surface.area(t))
                    .sum();
                [
                    area,
                    surface.smallest_angle().to_degrees(),
                    surface.triangle_count() as f64,
                ]
            })
        };
        let first = surface_of(&rig.body);
        let mass = rig.body.total_mass();
        let mut torn = Torn {
            samples: Vec::new(),
            report: *rig.tearing.report(),
            ledger: Ledger::default(),
            pending: 0.0,
            triangles: [first[2] as usize; 2],
            angles: [first[1]; 2],
            edits: EditErrors::default(),
            strayed: 0.0,
            spacing: made.spacing,
            iterations: [0.0; 2],
        };
        let mut opening = 0.0;
        let steps = (self.longest / STEP) as u32;
        for step in 1..=steps {
            let time = STEP * f64::from(step);
            let speed = SPEED * (time / RAMP).min(1.0);
            opening += speed * STEP;
            let targets = [1.0, -1.0].map(|sign| HandlePose::at(Vec3::y() * (sign * opening)));
            let report = rig.step(&targets)?;
            torn.iterations[0] += report.iterations as f64;
            torn.iterations[1] = torn.iterations[1].max(report.iterations as f64);
            let force = [-rig.force(0).y, rig.force(1).y];
            let momentum = rig.body.momentum();
            let edits = torn.report.opened;
            torn.report = rig.tear();
            if torn.report.opened > edits {
                let fastest = rig.body.velocities().map(|v| v.norm()).fold(0.0, f64::max);
                let change = (rig.body.momentum() - momentum).norm() / (mass * fastest);
                torn.edits.momentum = torn.edits.momentum.max(change);
                let [area, angle, _] = surface_of(&rig.body);
                torn.edits.area = torn.edits.area.max((area / first[0] - 1.0).abs());
                torn.edits.mass = torn
                    .edits
                    .mass
                    .max((rig.body.total_mass() / mass - 1.0).abs());
                torn.angles[1] = torn.angles[1].min(angle);
                torn.edits.inverted = torn.edits.inverted.max(rig.body.inverted_count());
            }
            torn.samples.push(Sample {
                opening: 2.0 * opening,
                force,
                torn: torn.report.area / self.stuff.thickness,
                supplied: rig.ledger.supplied,
                stored: rig.stored(),
            });
            let length = torn.report.area / self.stuff.thickness;
            if (length >= self.length || torn.report.tips == 0) && rig.stepper.pairs().is_empty() {
                break;
            }
            if length >= 1.2 * self.length + 3.0 * made.spacing {
                break;
            }
        }
        torn.pending = rig.stepper.pending();
        torn.ledger = rig.ledger;
        torn.iterations[0] /= torn.samples.len().max(1) as f64;
        let last = surface_of(&rig.body);
        torn.triangles[1] = last[2] as usize;
        torn.strayed = strayed(&rig.body, self.length);
        Ok(torn)
    }
}

/// How far the vertices that tears have added lie from the x-axis at rest, within `length` (m) of the notch.
fn strayed(body: &Body, length: f64) -> f64 {
    let Some(surface) = body.surface() else {
        return 0.0;
    };
    let rest = body.rest_positions();
    let origins = surface.origins().iter().enumerate();
    let torn =
        origins.filter(|(_, origin)| matches!(origin, physics::topology::Origin::Twin { .. }));
    let places = torn.filter_map(|(vertex, _)| rest.get(vertex));
    let within = places.filter(|at| at.x < -0.5 * LENGTH + NOTCH + length);
    within.map(|at| at.y.abs()).fold(0.0, f64::max)
}
