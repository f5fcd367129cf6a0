//! Elements ten thousand times longer than thick.

use super::materials::EXCESS;
use super::specimen::{Isotropic, Kind, Shape, quiet};
use super::trial::Trial;
use super::{Job, Outcome, Plan};
use crate::{Level, StudyError};
use physics::Vec3;

/// Thickness over length.
const THIN: f64 = 1e-4;

/// How the mesh gets its slivers.
#[derive(Clone, Copy)]
enum Sliver {
    /// The whole body is flattened: along z, or a sheet along y.
    Flat,
    /// The whole body is stretched along x.
    Needle,
    /// One inner vertex lies almost at its neighbour.
    Pinched,
}

impl Sliver {
    fn name(self) -> &'static str {
        match self {
            Self::Flat => "flattened to 1e-4",
            Self::Needle => "needles of 1e4",
            Self::Pinched => "a vertex within 1e-4 of its neighbour",
        }
    }

    fn shape(self, kind: Kind) -> Result<Shape, StudyError> {
        let straight = match kind {
            Kind::Quadratic(law) => Kind::Linear(law),
            other => other,
        };
        let mut shape = straight.mesh(2)?;
        let sheet = matches!(shape, Shape::Sheet(_));
        let scale = match self {
            Self::Flat if sheet => Vec3::new(1.0, THIN, 1.0),
            Self::Flat => Vec3::new(1.0, 1.0, THIN),
            Self::Needle => Vec3::new(1.0, THIN, THIN),
            Self::Pinched => Vec3::repeat(1.0),
        };
        let middle = shape.positions().len() / 2;
        for x in shape.positions_mut() {
            x.component_mul_assign(&scale);
        }
        if let Self::Pinched = self {
            // Vertices are numbered along x first: the next vertex is the neighbour along x.
            let x = shape.positions_mut();
            let neighbour = x[middle + 1];
            x[middle] = neighbour + (x[middle] - neighbour) * THIN;
        }
        Ok(kind.elevated(shape))
    }
}

pub(super) fn plan(level: Level) -> Plan {
    let mut jobs = Vec::new();
    for (kind, method) in Kind::solved() {
        for sliver in [Sliver::Flat, Sliver::Needle, Sliver::Pinched] {
            for h in level.ends(&[1e-4, 1e-3, 1e-2, 1e-1]) {
                let steps = level.choose(5, 50);
                let name = format!("{}, h {h} s", sliver.name());
                jobs.push(Job::new(name, (kind, method), steps, move || {
                    let shape = sliver.shape(kind)?;
                    let material = Isotropic::new(1e5, 0.3);
                    let mut body = kind.build(&shape, |_| material, quiet(), &[])?;
                    // Along every axis, the strains are those of a body that is not thin.
                    let extent = extent(shape.positions());
                    let kick = shape.waves(0.01 * material.sound());
                    let kick: Vec<Vec3> = kick.iter().map(|v| v.component_mul(&extent)).collect();
                    body.set_velocities(&kick)?;
                    let mut trial = Trial::new(body, method)?;
                    Ok(Outcome::of_energy(&mut trial, kind, method, |trial| {
                        trial.run(h, steps, &[]);
                    }))
                }));
            }
        }
    }
    Plan {
        name: "slivers",
        stress: "elements 1e4 times longer than thick; free bodies kicked at strains of 0.01",
        figure: EXCESS,
        unit: "",
        jobs,
    }
}

/// Size along each axis, but at least the thickness of a sheet.
fn extent(x: &[Vec3]) -> Vec3 {
    let size = |axis: usize| {
        let along = || x.iter().map(|x| x[axis]);
        along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
    };
    Vec3::from_fn(|axis, _| size(axis).max(THIN))
}
