//! Section `smooth`: the force of hands that tear a cloth, whatever the damping and the length of the steps.
//!
//! The cloth is that of the scene `tear_cloth`: two hands hold it close beside a notch in its border and move apart. It lies
//! flat. The force falls slowly as the arms beside the tear grow longer. The difference from this trend is the ripple that a
//! hand feels. The mean force is taken between two distances of the hands. Between two lengths of the tear it would depend on
//! how long the last edges take, at the smallest force; a median would be the force at one place of one edge.

use super::patterns::{Pattern, Rectangle, Slit, Triangles};
use super::rig::Rig;
use super::specimen::{Stuff, flat_sheet, hand};
use crate::{Level, StudyError};
use physics::{BodyConfig, HandlePose, Starts, Vec3};
use serde::Serialize;

/// Side of the cloth, and length of its notch (m).
const SIDE: f64 = 0.2;
const NOTCH: f64 = 0.05;
/// The depth to which a hand holds the cloth, and the distances from the notch between which it does (m).
const DEPTH: f64 = 0.017;
const GRIP: [f64; 2] = [0.013, 0.03];
/// The speed of a hand (m/s), and the time in which it is reached (s).
const SPEED: f64 = 0.018;
const RAMP: f64 = 0.1;
/// How far the hands are apart where the force is measured (m): the tear then goes from about a tenth to
/// nine tenths of its way.
const PLATEAU: [f64; 2] = [0.02, 0.075];
/// The part of its way that a tear has gone at the end at least; otherwise it rests.
const GONE: f64 = 0.8;
/// The degree of the smooth curve: it follows the fall of the force, and no wave as short as the 24 edges of the way.
const DEGREE: i32 = 5;
/// The number of points of a course.
const POINTS: usize = 200;

/// The cloth of the scene.
const CLOTH: Stuff = Stuff {
    young: 8e6,
    poisson: 0.3,
    thickness: 5e-4,
    density: 400.0,
    strength: 8e5,
    toughness: 4000.0,
};

/// One cloth.
#[derive(Clone, Debug)]
struct Case {
    triangles: Triangles,
    /// The length of an edge along the tear (m).
    edge: f64,
    /// Steps in a second (Hz).
    rate: f64,
    /// Stiffness damping (s).
    damping: f64,
}

/// The force over one tear.
#[derive(Clone, Debug, Serialize)]
pub struct Smooth {
    /// The name of the mesh.
    pub mesh: String,
    /// The length of an edge along the tear (m).
    pub edge: f64,
    /// Steps in a second (Hz).
    pub rate: f64,
    /// Stiffness damping (s).
    pub damping: f64,
    /// The mean of the force of a hand while the tear goes from a tenth to nine tenths of its way (N); missing if the
    /// tear rests.
    pub plateau: Option<f64>,
    /// The deviation of this force from a smooth curve over the displacement, relative to its mean; missing if the tear
    /// rests.
    pub ripple: Option<f64>,
    /// How far the hands have moved apart (m), and the force of a hand (N), step by step.
    pub course: Vec<[f64; 2]>,
}

impl Case {
    fn run(&self) -> Result<Smooth, StudyError> {
        let mouth = -0.5 * SIDE;
        let rectangle = Rectangle {
            length: SIDE,
            width: SIDE,
            triangles: (2.0 * (SIDE / self.edge).powi(2)).round() as usize,
            pattern: Pattern::default(),
            slits: &[Slit {
                from: [mouth, 0.0],
                to: [mouth + NOTCH, 0.0],
            }],
            marks: &[],
        };
        let (mesh, made) = self.triangles.mesh(rectangle)?;
        let hands = [1.0, -1.0].map(|sign| {
            let is_held = |at: &Vec3| {
                let beside = sign * at.y;
                at.x < mouth + DEPTH && (GRIP[0]..=GRIP[1] + 1e-9).contains(&beside)
            };
            let all = (0_u32..).zip(&made.mesh.positions);
            hand(
                all.filter(|(_, at)| is_held(at))
                    .map(|(at, _)| at)
                    .collect(),
            )
        });
        let config = BodyConfig {
            gravity: Vec3::zeros(),
            mass_damping: 0.5,
            stiffness_damping: self.damping,
            ..BodyConfig::default()
        };
        let body = flat_sheet(&made.mesh, &CLOTH, config, &hands)?;
        let step = 1.0 / self.rate;
        let mut rig = Rig::with(body, CLOTH.tears(Starts::Tips), &made.tips, step)?;
        let (mut time, mut out) = (0.0, 0.0);
        let mut course = Vec::new();
        while 2.0 * out < PLATEAU[1] {
            time += step;
            out += SPEED * step * (time / RAMP).min(1.0);
            rig.step(&[out, -out].map(|y| HandlePose::at(Vec3::y() * y)))?;
            rig.tear();
            course.push([2.0 * out, 0.5 * (rig.force(1).y - rig.force(0).y)]);
        }
        let plateau = course.partition_point(|[opening, _]| *opening < PLATEAU[0]);
        let plateau = &course[plateau..];
        let way = (SIDE - NOTCH) * CLOTH.thickness;
        let has_torn = rig.tearing.report().area > GONE * way;
        let every = course.len().div_ceil(POINTS).max(1);
        Ok(Smooth {
            mesh,
            edge: self.edge,
            rate: self.rate,
            damping: self.damping,
            plateau: has_torn.then(|| mean(plateau)),
            ripple: has_torn.then(|| ripple(plateau)),
            course: course.into_iter().step_by(every).collect(),
        })
    }
}

/// The mean of the second coordinates.
fn mean(points: &[[f64; 2]]) -> f64 {
    points.iter().map(|[_, value]| value).sum::<f64>() / points.len() as f64
}

/// The deviation of the second coordinates from the polynomial of the degree [`DEGREE`] over the first ones that is nearest,
/// over their mean.
fn ripple(points: &[[f64; 2]]) -> f64 {
    let count = points.len() as f64;
    let (Some([first, _]), Some([last, _])) = (points.first(), points.last()) else {
        return f64::NAN;
    };
    // From -1 to 1.
    let along = points
        .iter()
        .map(|[x, _]| 2.0 * (x - first) / (last - first) - 1.0);
    let mut rest: Vec<f64> = points.iter().map(|[_, force]| *force).collect();
    // Each power is freed of the ones before it (Gram and Schmidt), and the force of each of them.
    let mut powers: Vec<Vec<f64>> = Vec::new();
    for power in 0..=DEGREE {
        let mut own: Vec<f64> = along.clone().map(|x| x.powi(power)).collect();
        for other in &powers {
            take_off(&mut own, other);
        }
        take_off(&mut rest, &own);
        powers.push(own);
    }
    let squares = rest.iter().map(|rest| rest * rest).sum::<f64>();
    (squares / count).sqrt() / mean(points)
}

/// Takes the part along `other` off a vector.
fn take_off(vector: &mut [f64], other: &[f64]) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let part = dot(vector, other) / dot(other, other);
    for (own, other) in vector.iter_mut().zip(other) {
        *own -= part * other;
    }
}

/// The cases of a level: squares with edges of 5 mm at every rate and damping; finer edges and a mesh by Gmsh (4.15.2,
/// algorithm 6; coarser away from the tear) at one rate. At the quick level squares with edges
/// of 6.25 mm at one rate.
fn cases(level: Level) -> Vec<Case> {
    let crossed = Triangles::Pattern(Pattern::Crossed);
    let frontal = include_str!("../../meshes/frontal_cloth.obj");
    let frontal = Triangles::Obj("Frontal".to_owned(), frontal.to_owned());
    let meshes = [
        (
            crossed.clone(),
            level.choose(6.25e-3, 5e-3),
            &[250.0, 125.0, 500.0, 1000.0][..],
        ),
        (crossed, 2.5e-3, &[250.0]),
        (frontal, 5e-3, &[250.0, 1000.0]),
    ];
    let mut cases = Vec::new();
    for (triangles, edge, rates) in level.take(&meshes, 1) {
        for &rate in level.take(rates, 1) {
            for damping in level.ends(&[0.0, 5e-4, 2e-3]) {
                cases.push(Case {
                    triangles: triangles.clone(),
                    edge: *edge,
                    rate,
                    damping,
                });
            }
        }
    }
    cases
}

/// Tears the cloths.
///
/// # Errors
/// [`StudyError`].
pub fn run(level: Level, progress: &dyn Fn(f64)) -> Result<Vec<Smooth>, StudyError> {
    let cases = cases(level);
    let mut found = Vec::new();
    for case in &cases {
        found.push(case.run()?);
        progress(found.len() as f64 / cases.len() as f64);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_curve_is_no_ripple_and_a_wave_on_it_is() {
        let points = |wave: f64| -> Vec<[f64; 2]> {
            let point = |k: i32| {
                let x = 0.01 * f64::from(k);
                let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
                [x, 4.0 - x + 0.5 * x * x + wave * sign]
            };
            (0..100).map(point).collect()
        };
        assert!(ripple(&points(0.0)) < 1e-12);
        // The mean of the parabola is 3.67; a wave of alternating signs is orthogonal to it but for the ends.
        assert!((ripple(&points(0.0367)) - 0.01).abs() < 2e-4);
        assert!((mean(&[[0.0, 3.0], [0.0, 1.0], [0.0, 5.0]]) - 3.0).abs() < 1e-12);
    }
}
