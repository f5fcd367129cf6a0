//! One body on one path through one motion: times, iterations and the force on the hand.

use super::Row;
use super::clock::{Times, cpu_time};
use super::motion::Motion;
use super::path::Method;
use crate::StudyError;
use physics::{Body, HandlePose, Vec3};

/// A body and its motion.
pub(super) struct Scene {
    /// The name in files.
    pub(super) name: &'static str,
    /// The title for readers.
    pub(super) title: String,
    pub(super) body: Body,
    /// The handle that moves. The other handles stay.
    pub(super) tool: usize,
    pub(super) motion: Motion,
    /// Unit direction along which the final force is given.
    pub(super) along: Vec3,
}

/// The recording of a motion.
pub(super) struct Course {
    /// Time of each step in which the hand moves (s).
    pub(super) times: Vec<f64>,
    /// Force on the hand after each step (N).
    pub(super) forces: Vec<Vec3>,
    iterations: Vec<usize>,
    residual: f64,
}

/// Moves handle number `tool` of `body` through `motion`.
pub(super) fn drive(
    body: &Body,
    tool: usize,
    motion: &Motion,
    method: Method,
) -> Result<Course, StudyError> {
    let mut body = body.clone();
    let mut stepper = method.stepper(&mut body, motion.step)?;
    let mut targets: Vec<HandlePose> = (0..body.handle_count())
        .filter_map(|handle| body.handle_report(handle))
        .map(|report| report.pose)
        .collect();
    let start = targets[tool].position;
    let mut course = Course {
        times: Vec::with_capacity(motion.timed),
        forces: Vec::with_capacity(motion.steps),
        iterations: Vec::with_capacity(motion.steps),
        residual: 0.0,
    };
    for step in 0..motion.steps {
        targets[tool].position = start + motion.after(step);
        let before = cpu_time();
        let outcome = stepper.step(&mut body, motion.step, &targets)?;
        if step < motion.timed {
            course.times.push(cpu_time() - before);
        }
        stepper.between(motion.step)?;
        course.iterations.push(outcome.iterations);
        course.residual = course.residual.max(outcome.residual);
        let report = body.handle_report(tool);
        course
            .forces
            .push(report.map_or(Vec3::zeros(), |report| report.wrench_on_hand.force));
    }
    Ok(course)
}

impl Course {
    /// The largest difference between the forces of the two courses, as a fraction of the largest force of `other`.
    pub(super) fn error(&self, other: &Self) -> f64 {
        let pairs = self.forces.iter().zip(&other.forces);
        let most = pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        let largest = other.forces.iter().map(Vec3::norm).fold(0.0, f64::max);
        most / largest
    }

    /// Force on the hand at the end (N).
    pub(super) fn last(&self) -> Vec3 {
        self.forces.last().copied().unwrap_or_default()
    }

    /// Median time of a step (s).
    pub(super) fn median(&self) -> f64 {
        Times::of(self.times.clone()).median
    }

    /// Sum of the iterations of all steps.
    pub(super) fn iterations(&self) -> usize {
        self.iterations.iter().sum()
    }
}

impl Scene {
    /// Moves the body through the motion of the scene.
    pub(super) fn drive(&self, method: Method) -> Result<Course, StudyError> {
        drive(&self.body, self.tool, &self.motion, method)
    }

    /// A row of the table: `course`, taken on the path called `path`, compared with the tight solution of the same
    /// equation, and with Newton's method if that path ran.
    pub(super) fn row(
        &self,
        path: &'static str,
        course: &Course,
        tight: &Course,
        converged: Option<&Course>,
    ) -> Row {
        Row {
            scene: self.name,
            title: self.title.clone(),
            elements: self.body.element_count(),
            unknowns: self.body.unknown_count(),
            step: self.motion.step,
            path,
            times: Times::of(course.times.clone()),
            mean_iterations: course.iterations() as f64 / course.iterations.len().max(1) as f64,
            most_iterations: course.iterations.iter().copied().max().unwrap_or(0),
            residual: course.residual,
            force: course.last().dot(&self.along).abs(),
            solver_error: course.error(tight),
            step_error: converged.map(|converged| course.error(converged)),
        }
    }
}
