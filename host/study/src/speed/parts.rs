//! The parts of the fast step's time: each part alone, compared with the least time that its bytes and operations would
//! take on this machine.
//!
//! The cube is compressed and the sheet is stretched for some steps. Then each part is repeated in the final state of
//! the body. A part that moves its bytes as fast as this machine reads a block of the same size is limited by memory. A
//! part that computes as fast as the machine multiplies and adds without fusing is limited by arithmetic. A part that
//! does neither is limited by gathering, by the latency of its results, or by short loops.

use super::ceiling::{bandwidth, median, peak};
use super::clock::{Times, cpu_time};
use super::cube::{EDGE, Stiffness, TOP, cube};
use super::motion::Motion;
use super::sheets;
use crate::{Level, StudyError};
use physics::{Body, Cost, HandlePose, Phase, Precision, Stepper, StepperOptions, Vec3};
use serde::Serialize;

/// The phases of a step, with the names of the parts of its time.
const PHASES: [(Phase, &str); 5] = [
    (Phase::Linearize, "linearize"),
    (Phase::Product, "product"),
    (Phase::Precondition, "precondition"),
    (Phase::Vectors, "vectors"),
    (Phase::Refresh, "refresh"),
];

/// Length of a step (s).
const STEP: f64 = 0.01;

/// One part of a step, or a whole one.
#[derive(Clone, Debug, Serialize)]
pub struct Timed {
    /// `cube` or `sheet`.
    pub body: &'static str,
    /// Tetrahedra or triangles.
    pub elements: usize,
    /// Precision of the step: `f64` or `f32`. In both, the panels of the preconditioner are in `f32` and the
    /// factorization is in `f64`.
    pub precision: &'static str,
    /// `linearize`, `product`, `precondition`, `vectors`, `refresh` or `step`.
    pub part: &'static str,
    /// Number of repetitions.
    pub count: usize,
    /// Median of the processor time (s).
    pub median: f64,
    /// Mean number of times that a step repeats the part. A refresh is not a part of the step.
    pub per_step: f64,
    /// Bytes that the part must read and write.
    pub bytes: usize,
    /// Size of the memory that contains these bytes (bytes).
    pub touched: usize,
    /// Operations on floating-point numbers.
    pub flops: usize,
    /// Speed of the memory (bytes/s).
    pub bytes_per_second: f64,
    /// Operations a second (1/s).
    pub flops_per_second: f64,
    /// Speed (bytes/s) at which this machine reads from a block of size `touched`.
    pub bandwidth: f64,
    /// Operations a second (1/s) of this machine in registers, without fusing; for a whole step, in the precisions of its
    /// parts.
    pub peak: f64,
    /// `bytes_per_second` as a fraction of `bandwidth`.
    #[serde(rename = "share_of_bandwidth")]
    pub fraction_of_bandwidth: f64,
    /// `flops_per_second` as a fraction of `peak`.
    #[serde(rename = "share_of_peak")]
    pub fraction_of_peak: f64,
}

/// Memory of a body and of its stepper.
#[derive(Clone, Debug, Serialize)]
pub struct Memory {
    /// `cube` or `sheet`.
    pub body: &'static str,
    /// Tetrahedra or triangles.
    pub elements: usize,
    /// Precision of the step.
    pub precision: &'static str,
    /// Memory of the stepper (bytes), including its refresher.
    pub stepper_bytes: usize,
    /// Memory of the refresher (bytes).
    pub refresher_bytes: usize,
    /// Memory of the body (bytes).
    pub body_bytes: usize,
    /// Memory of the stepper per element (bytes).
    pub stepper_per_element: f64,
    /// Memory of the body per element (bytes).
    pub body_per_element: f64,
}

/// The results.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Parts {
    /// Each part of each body's step.
    pub timed: Vec<Timed>,
    /// Memory of each body and stepper.
    pub memory: Vec<Memory>,
}

/// A body that is moved, and the extent of the measurement.
struct Task {
    name: &'static str,
    body: Body,
    /// The handle that moves.
    tool: usize,
    motion: Motion,
    /// Processor time for each part (s).
    time: f64,
}

/// The limits of the machine, in operations a second.
#[derive(Clone, Copy)]
struct Peaks {
    single: f64,
    double: f64,
}

impl Peaks {
    fn of(self, precision: &str) -> f64 {
        if precision == "f32" {
            self.single
        } else {
            self.double
        }
    }
}

pub(super) fn run(level: Level, progress: &mut dyn FnMut(f64)) -> Result<Parts, StudyError> {
    let (cells, steps, time) = match level {
        Level::Quick => (6, 20, 0.02),
        Level::Full => (10, 150, 0.4),
    };
    let pressed = Task {
        name: "cube",
        body: cube(cells, false, Stiffness::Uniform)?,
        tool: TOP,
        motion: Motion::ramp(Vec3::z() * (-0.1 * EDGE), 1.5, 0.0, STEP).first(steps),
        time,
    };
    let pulled = Task {
        name: "sheet",
        body: sheets::body(26, 27)?,
        tool: 1,
        motion: Motion::ramp(Vec3::x() * (0.05 * sheets::SIDE), 3.0, 0.0, STEP).first(steps),
        time,
    };
    let peaks = Peaks {
        single: peak::<f32>(time),
        double: peak::<f64>(time),
    };
    let mut found = Parts::default();
    for (i, task) in [pressed, pulled].iter().enumerate() {
        progress(0.5 * i as f64);
        // As on the paths: a strict tolerance in double precision, a loose one in single precision.
        task.measure::<f64>("f64", 1e-6, peaks, &mut found)?;
        task.measure::<f32>("f32", 1e-3, peaks, &mut found)?;
    }
    Ok(found)
}

impl Task {
    /// Adds the parts of the step in `precision`, solved to `tolerance`, to `found`.
    fn measure<T: Precision>(
        &self,
        precision: &'static str,
        tolerance: f64,
        peaks: Peaks,
        found: &mut Parts,
    ) -> Result<(), StudyError> {
        let mut body = self.body.clone();
        let options = StepperOptions {
            tolerance,
            refresh: false,
            sleep_speed: 0.0,
            ..StepperOptions::default()
        };
        let mut stepper = Stepper::<T>::new(&body, options)?;
        stepper.prepare(&body, STEP)?;
        found
            .memory
            .push(memory(self.name, precision, &body, &stepper));
        let (step, iterations) = self.steps(&mut body, &mut stepper)?;
        let first = found.timed.len();
        for (phase, name) in PHASES {
            let Some(cost) = stepper.cost(phase) else {
                continue;
            };
            let mut outcome = Ok(());
            let (count, time) = median(self.time, || outcome = stepper.repeat(phase));
            outcome?;
            let per_step = match phase {
                Phase::Linearize => 1.0,
                // One product is that of the initial guess.
                Phase::Product => iterations + 1.0,
                Phase::Precondition | Phase::Vectors => iterations,
                Phase::Refresh => 0.0,
            };
            let numbers = match phase {
                Phase::Precondition => "f32",
                Phase::Refresh => "f64",
                _ => precision,
            };
            found.timed.push(Timed {
                body: self.name,
                elements: body.element_count(),
                precision,
                part: name,
                count,
                per_step,
                ..rates(
                    &cost,
                    time,
                    bandwidth(cost.touched, self.time),
                    peaks.of(numbers),
                )
            });
        }
        let whole = Timed {
            body: self.name,
            elements: body.element_count(),
            precision,
            part: "step",
            count: self.motion.steps,
            per_step: 1.0,
            ..whole(&found.timed[first..], step, self.time)
        };
        found.timed.push(whole);
        Ok(())
    }

    /// Takes all steps. Returns the median of their times (s) and the mean number of iterations.
    fn steps<T: Precision>(
        &self,
        body: &mut Body,
        stepper: &mut Stepper<T>,
    ) -> Result<(f64, f64), StudyError> {
        let reports = (0..body.handle_count()).filter_map(|handle| body.handle_report(handle));
        let mut targets: Vec<HandlePose> = reports.map(|report| report.pose).collect();
        let start = targets[self.tool].position;
        let (mut times, mut iterations) = (Vec::new(), 0);
        for step in 0..self.motion.steps {
            targets[self.tool].position = start + self.motion.after(step);
            let before = cpu_time();
            let report = stepper.step(body, STEP, &targets, || false)?;
            times.push(cpu_time() - before);
            iterations += report.iterations;
            // In a run, another thread does this work.
            if let Some(mut refresher) = stepper.lend() {
                refresher.work()?;
                stepper.give_back(refresher);
            }
        }
        let mean = iterations as f64 / self.motion.steps as f64;
        Ok((Times::of(times).median, mean))
    }
}

/// The rates of a part with `cost` that takes `time` (s), on a machine of this `bandwidth` and `peak`. The names are
/// empty.
fn rates(cost: &Cost, time: f64, bandwidth: f64, peak: f64) -> Timed {
    let bytes = cost.read + cost.written;
    let bytes_per_second = bytes as f64 / time;
    let flops_per_second = cost.flops as f64 / time;
    Timed {
        body: "",
        elements: 0,
        precision: "",
        part: "",
        count: 0,
        median: time,
        per_step: 0.0,
        bytes,
        touched: cost.touched,
        flops: cost.flops,
        bytes_per_second,
        flops_per_second,
        bandwidth,
        peak,
        fraction_of_bandwidth: bytes_per_second / bandwidth,
        fraction_of_peak: flops_per_second / peak,
    }
}

/// A whole step that took `step` (s), composed of its parts. Other work that the step does once for each node appears
/// in the time only.
fn whole(parts: &[Timed], step: f64, time: f64) -> Timed {
    let sum = |of: fn(&Timed) -> f64| {
        parts
            .iter()
            .map(|part| part.per_step * of(part))
            .sum::<f64>()
    };
    let flops = sum(|part| part.flops as f64);
    let in_step = parts.iter().filter(|part| part.per_step > 0.0);
    let cost = Cost {
        read: sum(|part| part.bytes as f64) as usize,
        written: 0,
        touched: in_step.map(|part| part.touched).sum(),
        flops: flops as usize,
    };
    let peak = flops / sum(|part| part.flops as f64 / part.peak);
    rates(&cost, step, bandwidth(cost.touched, time), peak)
}

fn memory<T: Precision>(
    name: &'static str,
    precision: &'static str,
    body: &Body,
    stepper: &Stepper<T>,
) -> Memory {
    let (elements, body_bytes, stepper_bytes) =
        (body.element_count(), body.bytes(), stepper.bytes());
    Memory {
        body: name,
        elements,
        precision,
        stepper_bytes,
        refresher_bytes: stepper.refresher_bytes(),
        body_bytes,
        stepper_per_element: stepper_bytes as f64 / elements as f64,
        body_per_element: body_bytes as f64 / elements as f64,
    }
}
