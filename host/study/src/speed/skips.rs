//! Work that is skipped on purpose, compared with the complete work: local models whose shapes are renewed a few at a
//! time, and bodies that sleep.

use super::clock::{Times, cpu_time};
use super::cube::{Stiffness, TOP, cube};
use super::motion::{Motion, Path};
use crate::{Level, StudyError};
use physics::linear::dense::Square;
use physics::{Body, Condenser, HandlePose, ShapeOptions, Shapes, Stepper, StepperOptions, Vec3};
use serde::Serialize;

/// One kind of skipped work.
#[derive(Clone, Debug, Serialize)]
pub struct Skip {
    /// Description for readers.
    #[serde(rename = "what")]
    pub description: String,
    /// Tetrahedra.
    pub elements: usize,
    /// Processor time of the complete work (s).
    pub whole: f64,
    /// Processor time of the reduced work (s).
    pub skipped: f64,
    /// Largest error, as a fraction: of the stiffness of a local model, or of the largest force.
    pub error: f64,
}

/// Length of a step, and publication period of the local models (s).
const STEP: f64 = 1e-3;

pub(super) fn run(level: Level) -> Result<Vec<Skip>, StudyError> {
    let n = match level {
        Level::Quick => 6,
        Level::Full => 10,
    };
    let mut skips = Vec::new();
    for at_a_time in [6, 3, 1] {
        skips.push(shapes(n, at_a_time)?);
    }
    skips.push(sleep(n)?);
    Ok(skips)
}

fn poses(body: &Body) -> Vec<HandlePose> {
    let handles = 0..body.handle_count();
    handles
        .filter_map(|handle| body.handle_report(handle))
        .map(|report| report.pose)
        .collect()
}

/// Local models of a cube whose top trembles while it is pressed and sheared, compared with a factorization for each
/// model.
fn shapes(n: u32, at_a_time: usize) -> Result<Skip, StudyError> {
    let mut body = cube(n, false, Stiffness::Uniform)?;
    let motion = Motion {
        step: STEP,
        steps: 200,
        timed: 200,
        path: Path::Tremor {
            to: Vec3::new(0.02, 0.0, -0.005),
            duration: 0.2,
            amplitude: Vec3::repeat(5e-4),
            frequency: 10.0,
        },
    };
    let mut stepper = Stepper::<f64>::new(&body, StepperOptions::default())?;
    stepper.prepare(&body, STEP)?;
    let mut condenser = Condenser::new(&body)?;
    let few = ShapeOptions {
        at_a_time,
        ..ShapeOptions::default()
    };
    let all = ShapeOptions {
        tolerance: 1e-10,
        ..ShapeOptions::default()
    };
    let mut exact = Stepper::<f64>::new(&body, StepperOptions::default())?;
    let (mut shapes, mut exact_shapes) = (Shapes::default(), Shapes::default());
    let mut twin = body.clone();
    let mut targets = poses(&body);
    let start = targets[TOP].position;
    let (mut times, mut whole, mut error) = (Vec::new(), Vec::new(), 0.0_f64);
    for step in 0..motion.steps {
        targets[TOP].position = start + motion.after(step);
        stepper.step(&mut body, STEP, &targets, || false)?;
        exact.step(&mut twin, STEP, &targets, || false)?;
        let before = cpu_time();
        let (found, _) = shapes.condense(&mut stepper, &body, STEP, &few)?;
        times.push(cpu_time() - before);
        let (right, _) = exact_shapes.condense(&mut exact, &twin, STEP, &all)?;
        error = error.max(distance(&found.stiffness, &right.stiffness));
        if step % 20 == 0 {
            let before = cpu_time();
            body.assemble();
            condenser.condense(&body, STEP)?;
            whole.push(cpu_time() - before);
        }
    }
    Ok(Skip {
        description: format!("local model, {at_a_time} of 6 shapes renewed at a time"),
        elements: body.element_count(),
        whole: Times::of(whole).median,
        skipped: Times::of(times).median,
        error,
    })
}

/// The largest difference, as a fraction of the largest entry.
fn distance(a: &Square, b: &Square) -> f64 {
    let entries = (0..a.size()).flat_map(|i| (0..a.size()).map(move |j| (i, j)));
    let (mut difference, mut largest) = (0.0_f64, f64::MIN_POSITIVE);
    for at in entries {
        difference = difference.max((a[at] - b[at]).abs());
        largest = largest.max(b[at].abs());
    }
    difference / largest
}

/// A cube that is pressed and then at rest, compared with a cube that never sleeps.
fn sleep(n: u32) -> Result<Skip, StudyError> {
    let h = 0.01;
    let mut sleeper = cube(n, false, Stiffness::Uniform)?;
    let mut waker = sleeper.clone();
    let never = StepperOptions {
        sleep_speed: 0.0,
        ..StepperOptions::default()
    };
    let mut sleeping = Stepper::<f64>::new(&sleeper, StepperOptions::default())?;
    let mut awake = Stepper::<f64>::new(&waker, never)?;
    let mut targets = poses(&sleeper);
    let top = targets[TOP].position;
    let (mut times, mut whole) = (Vec::new(), Vec::new());
    let (mut error, mut largest) = (0.0_f64, 0.0_f64);
    for step in 0..1500_u32 {
        targets[TOP].position = top - Vec3::z() * (1e-4 * f64::from(step.min(100)));
        let before = cpu_time();
        let asleep = sleeping.step(&mut sleeper, h, &targets, || false)?.asleep;
        let between = cpu_time();
        awake.step(&mut waker, h, &targets, || false)?;
        if asleep {
            times.push(between - before);
            whole.push(cpu_time() - between);
        }
        let force = |body: &Body| {
            let report = body.handle_report(TOP);
            report.map_or_else(Vec3::zeros, |report| report.wrench_on_hand.force)
        };
        error = error.max((force(&sleeper) - force(&waker)).norm());
        largest = largest.max(force(&waker).norm());
    }
    Ok(Skip {
        description: "step of a body at rest, asleep".to_owned(),
        elements: sleeper.element_count(),
        whole: Times::of(whole).median,
        skipped: Times::of(times).median,
        error: error / largest,
    })
}
