//! Error against processor time: the cost and the benefit of a finer setting, mesh or time step.

use super::cube::{EDGE, Stiffness, TOP, cube, cube_damped, press, tremor};
use super::motion::{Motion, Path};
use super::path::{self, Method};
use super::trial::{Course, drive};
use crate::elsewhere::ACCURACY;
use crate::{Level, StudyError};
use physics::{TimeScheme, Vec3};
use serde::Serialize;

/// The quantity that varies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Varied {
    /// The solver's tolerance or budget: the error of the force against the same equation solved tightly, over the time
    /// of a step.
    Solver,
    /// The mesh: the error of the force against the converged force, over the time of a step.
    Mesh,
    /// The time step: the error of the force against far shorter steps, over the time for a simulated second.
    TimeStep,
}

/// One setting.
#[derive(Clone, Debug, Serialize)]
pub struct Setting {
    /// The name of the setting.
    pub name: String,
    /// Processor time (s), of a step or of a simulated second: the median over the repetitions.
    pub cpu: f64,
    /// The shortest and the longest processor time of a repetition (s).
    pub cpu_range: [f64; 2],
    /// Error of the force, as a fraction of the largest force.
    pub error: f64,
}

/// The settings of one kind, from coarse to fine.
#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    /// The quantity that varies.
    pub varied: Varied,
    /// The kind.
    pub name: &'static str,
    /// The settings, from coarse to fine.
    pub settings: Vec<Setting>,
}

pub(super) fn run(level: Level, progress: &mut dyn FnMut(f64)) -> Result<Vec<Curve>, StudyError> {
    let mut curves = Vec::new();
    progress(0.0);
    curves.extend(solvers(level)?);
    progress(0.2);
    curves.extend(meshes(level)?);
    progress(0.5);
    curves.extend(time_steps(level)?);
    Ok(curves)
}

/// Repetitions of each setting of the solver, whose times differ by less than the noise of one. An odd number has a median.
const REPETITIONS: usize = 5;

fn solvers(level: Level) -> Result<Vec<Curve>, StudyError> {
    let (n, steps) = match level {
        Level::Quick => (4, 100),
        Level::Full => (10, 300),
    };
    let scene = tremor(n, steps)?;
    let tolerances = [1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8];
    let budgets = [1, 2, 5, 10, 20, 40];
    let families = [
        (
            "assembled, to a tolerance",
            tolerances
                .map(|tolerance| (format!("{tolerance:.0e}"), path::to(tolerance)))
                .to_vec(),
        ),
        (
            "assembled, N iterations",
            budgets
                .map(|budget| (budget.to_string(), path::iterations(budget)))
                .to_vec(),
        ),
    ];
    let frozen = tolerances.map(|tolerance| (format!("{tolerance:.0e}"), path::frozen(tolerance)));
    let single = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5]
        .map(|tolerance| (format!("{tolerance:.0e}"), path::single(tolerance, 100)));
    let once = [1, 2, 3, 4].map(|budget| (budget.to_string(), path::single(0.0, budget)));
    let families = families.into_iter().chain([
        ("frozen, to a tolerance", frozen.to_vec()),
        ("frozen, single precision, to a tolerance", single.to_vec()),
        ("frozen, single precision, N iterations", once.to_vec()),
    ]);
    let mut curves = Vec::new();
    for (name, methods) in families {
        let Some((_, first)) = methods.first() else {
            continue;
        };
        let tight = scene.drive(first.tight())?;
        let mut settings: Vec<(String, f64, Vec<f64>)> = Vec::new();
        // In turns, so that a slower processor for a while slows no setting down in all repetitions.
        for repetition in 0..REPETITIONS {
            for (k, (setting, method)) in methods.iter().enumerate() {
                let course = scene.drive(*method)?;
                if repetition == 0 {
                    settings.push((setting.clone(), course.error(&tight), Vec::new()));
                }
                settings[k].2.push(course.median());
            }
        }
        let settings = settings.into_iter().map(|(name, error, mut times)| {
            times.sort_by(f64::total_cmp);
            Setting {
                name,
                cpu: times[REPETITIONS / 2],
                cpu_range: [times[0], times[REPETITIONS - 1]],
                error,
            }
        });
        let settings = settings.collect();
        curves.push(Curve {
            varied: Varied::Solver,
            name,
            settings,
        });
    }
    Ok(curves)
}

fn meshes(level: Level) -> Result<Vec<Curve>, StudyError> {
    let converged = ACCURACY.cube.converged_corotational;
    let mut curves = Vec::new();
    for (name, quadratic, meshes) in [
        (
            "linear tetrahedra",
            false,
            level.take(&[2, 4, 6, 8, 10, 14, 20], 3),
        ),
        (
            "quadratic tetrahedra",
            true,
            level.take(&[1, 2, 3, 4, 6, 8], 3),
        ),
    ] {
        let mut settings = Vec::new();
        for &n in meshes {
            let motion = press(1, 0.5)?.motion;
            let body = cube(n, quadratic, Stiffness::Uniform)?;
            let course = drive(&body, TOP, &motion, path::frozen(1e-6))?;
            settings.push(Setting {
                name: format!("{n}^3"),
                cpu: course.median(),
                cpu_range: [course.median(); 2],
                error: (course.last().z.abs() / converged - 1.0).abs(),
            });
        }
        curves.push(Curve {
            varied: Varied::Mesh,
            name,
            settings,
        });
    }
    Ok(curves)
}

/// Simulated time (s), and the time between the compared forces: no step is longer.
const DURATION: f64 = 0.4;
const SAMPLE: f64 = 0.02;

fn time_steps(level: Level) -> Result<Vec<Curve>, StudyError> {
    let n = match level {
        Level::Quick => 3,
        Level::Full => 6,
    };
    // Steps between two samples.
    let divisions = level.take(&[2, 5, 10, 20, 40], 2);
    let finest = match level {
        Level::Quick => 20,
        Level::Full => 160,
    };
    let second = Method::Newton {
        scheme: TimeScheme::TrBdf2,
        tolerance: 1e-9,
    };
    let exact = swing(n, finest, second)?;
    let mut curves = Vec::new();
    for (name, method) in [
        ("implicit Euler, one linearization", path::frozen(1e-6)),
        ("implicit Euler, Newton's method", path::NEWTON),
        ("TR-BDF2, Newton's method", second),
    ] {
        let mut settings = Vec::new();
        for &division in divisions {
            let course = swing(n, division, method)?;
            let (found, expected) = (samples(&course, division), samples(&exact, finest));
            let pairs = found.iter().zip(&expected);
            let most = pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
            let largest = expected.iter().map(Vec3::norm).fold(0.0, f64::max);
            let time = course.median() * division as f64 / SAMPLE;
            settings.push(Setting {
                name: format!("{} ms", 1e3 * SAMPLE / division as f64),
                cpu: time,
                cpu_range: [time; 2],
                error: most / largest,
            });
        }
        curves.push(Curve {
            varied: Varied::TimeStep,
            name,
            settings,
        });
    }
    Ok(curves)
}

/// The cube, displaced sideways and back by 4 mm at 5 Hz, from rest, with `division` steps between two samples. The
/// stiffness damping is small, because a large one would hide the numerical damping of the scheme.
fn swing(n: u32, division: usize, method: Method) -> Result<Course, StudyError> {
    let steps = libm::round(DURATION / SAMPLE) as usize * division;
    let motion = Motion {
        step: SAMPLE / division as f64,
        steps,
        timed: steps,
        path: Path::Swing {
            to: Vec3::x() * (0.04 * EDGE),
            frequency: 5.0,
        },
    };
    drive(
        &cube_damped(n, false, Stiffness::Uniform, 0.002)?,
        TOP,
        &motion,
        method,
    )
}

fn samples(course: &Course, division: usize) -> Vec<Vec3> {
    let forces = course.forces.iter().skip(division - 1);
    forces.step_by(division).copied().collect()
}
