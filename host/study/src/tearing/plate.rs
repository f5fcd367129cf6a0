//! A plate with a slit or a notch under even tractions: the run behind the parts `path` and `notches`.
//!
//! The plate lies flat. The tractions on its border are those of an even stress and grow slowly from well below the load
//! at which the tear has to start, until every tip has made two edges. Strains are a thousandth, so the exact load is that
//! of linear elasticity.

use super::patterns::{Pattern, Rectangle, Slit, Triangles};
use super::rig::Rig;
use super::specimen::{Stuff, driving, flat_sheet, side, surface};
use crate::StudyError;
use physics::body::load::edge_traction;
use physics::tear::TearLaw;
use physics::{BodyConfig, Starts, Vec3};

/// The soft sheet of the plates. About a slit of 25 mm its tear starts at a strain of 0.001.
pub(super) const SOFT: Stuff = Stuff {
    young: 4e6,
    poisson: 0.3,
    thickness: 5e-4,
    density: 1000.0,
    strength: 1e9,
    toughness: 0.2,
};

/// The length of a step (s): several times that of a vibration of the plate, so that implicit Euler follows the load.
const STEP: f64 = 0.01;
/// The load of the first steps over the exact one, and their number; and by how much it grows in a step from then on.
const FIRST: f64 = 0.8;
const STEPS: u32 = 20;
const GROWTH: f64 = 2.5e-3;
/// The load at which a run ends, over the exact one.
const LONGEST: f64 = 1.6;

/// A plate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plate<'a> {
    /// Length along x and width along y (m).
    pub(super) size: [f64; 2],
    /// The slit, or the notch.
    pub(super) slit: Slit,
    /// The triangles, and the length of their edges (m).
    pub(super) triangles: &'a Triangles,
    pub(super) spacing: f64,
    /// The stress (Pa): along x, shear, along y.
    pub(super) stress: [f64; 3],
}

/// How the tear of a plate started.
#[derive(Clone, Debug)]
pub(super) struct Started {
    /// The name of the mesh, and the number of its triangles.
    pub(super) mesh: String,
    pub(super) triangles: usize,
    /// The load at the first edge, over the stress of the plate.
    pub(super) load: f64,
    /// For each tip the kink that its stress intensities asked for when the first tip went on (rad), and the directions of
    /// its first two edges (rad). All are counted counterclockwise from the direction of the slit.
    pub(super) tips: Vec<(f64, [f64; 2])>,
}

impl Plate<'_> {
    /// Loads the plate until its tear has started.
    pub(super) fn start(&self) -> Result<Started, StudyError> {
        let [length, width] = self.size;
        let rectangle = Rectangle {
            length,
            width,
            triangles: (2.0 * length * width / (self.spacing * self.spacing)).round() as usize,
            pattern: Pattern::default(),
            slits: &[self.slit],
            marks: &[],
        };
        let (name, made) = self.triangles.mesh(rectangle)?;
        let mesh = &made.mesh;
        let surface = surface(mesh)?;
        let config = BodyConfig {
            gravity: Vec3::zeros(),
            mass_damping: 2.0,
            stiffness_damping: 5e-4,
            ..BodyConfig::default()
        };
        let mut body = flat_sheet(mesh, &SOFT, config, &[])?;
        // Three guided directions at the border leave no rigid motion. They give no force, because the load is balanced.
        let corner = |sign: f64| {
            let at = Vec3::new(0.5 * sign * length, -0.5 * width, 0.0);
            let near = |position: &Vec3| (position - at).norm() < 1e-9;
            mesh.positions.iter().position(near).unwrap_or_default() as u32
        };
        body.add_support(&[corner(-1.0)], [true, true, false])?;
        body.add_support(&[corner(1.0)], [false, true, false])?;
        let sides = ["left", "right", "bottom", "top"];
        let outer: Vec<u32> = (sides.iter())
            .flat_map(|name| side(&made, name).to_vec())
            .collect();
        let [xx, xy, yy] = self.stress.map(|stress| stress * SOFT.thickness);
        let (forces, _) = edge_traction(mesh, &outer, |_, normal| {
            Vec3::new(
                xx * normal.x + xy * normal.y,
                xy * normal.x + yy * normal.y,
                0.0,
            )
        })?;
        body.set_external_forces(&forces)?;
        body.set_load_factor(0.0)?;
        let material = SOFT.tear(TearLaw::Toughness);
        let mut rig = Rig::with(body, SOFT.tears(Starts::Tips), &made.tips, STEP)?;
        let mut first: Option<(f64, Vec<f64>)> = None;
        let mut load = 0.0;
        while load < LONGEST {
            load += if load < FIRST {
                FIRST / f64::from(STEPS)
            } else {
                GROWTH
            };
            rig.body.set_load_factor(load)?;
            rig.step(&[])?;
            let before: Vec<Vec3> = rig.body.positions().take(mesh.positions.len()).collect();
            if rig.tear().opened == 0 {
                continue;
            }
            if first.is_none() {
                let kinks = made.tips.iter().map(|&tip| {
                    let (_, intensity) = driving(&surface, tip, &before, &material, |_| false)?;
                    Ok(intensity.kink())
                });
                first = Some((load, kinks.collect::<Result<_, StudyError>>()?));
            }
            let edges = made.tips.iter().map(|&tip| self.first_edges(&rig, tip));
            let edges: Option<Vec<_>> = edges.collect();
            if let (Some((load, kinks)), Some(edges)) = (&first, edges) {
                return Ok(Started {
                    mesh: name,
                    triangles: mesh.triangles.len(),
                    load: *load,
                    tips: kinks.iter().copied().zip(edges).collect(),
                });
            }
        }
        Err(StudyError::Rests)
    }

    /// The directions of the first two edges from a tip (rad), counterclockwise from that of the slit; `None` before the tear
    /// has them.
    fn first_edges(&self, rig: &Rig, tip: u32) -> Option<[f64; 2]> {
        let rest = rig.body.rest_positions();
        let middle = [0, 1].map(|axis| 0.5 * (self.slit.from[axis] + self.slit.to[axis]));
        let at = rest.get(tip as usize)?;
        let ahead = libm::atan2(at.y - middle[1], at.x - middle[0]);
        let mut from = tip;
        let mut found = [0.0; 2];
        for turn in &mut found {
            let grown = rig
                .tearing
                .grown()
                .iter()
                .find(|grown| grown.from == from)?;
            let [next, _] = grown.tips;
            let along = rest.get(next as usize)? - rest.get(from as usize)?;
            let angle = libm::atan2(along.y, along.x) - ahead;
            *turn = libm::atan2(libm::sin(angle), libm::cos(angle));
            from = next;
        }
        Some(found)
    }
}
