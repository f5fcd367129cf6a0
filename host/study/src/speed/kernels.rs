//! The cost of a step for each kind of element and law: assembled, and by the fast step.
//!
//! Cubes are compressed and a sheet is stretched by a tenth, fast, in steps of 10 ms, on three paths: assembled to
//! 1e-6, frozen to 1e-6, and Newton's method, the reference for the forces of the other two. An incomplete tangent (the
//! warped stiffness of corotational solids) appears in that error only. Afterwards the parts of each step are repeated
//! in the final state of the body.

use super::ceiling::median;
use super::cube::{EDGE, TOP, cube_of};
use super::motion::Motion;
use super::path::{NEWTON, frozen, to};
use super::sheets;
use super::trial::drive;
use crate::{Level, StudyError};
use physics::{Body, HandlePose, Phase, SheetLawName, SolidLaw, Stepper, StepperOptions, Vec3};
use serde::Serialize;

/// One kind of element under one law. Times are processor times per element (s).
#[derive(Clone, Debug, Serialize)]
pub struct KernelRow {
    /// The kind of element.
    pub kind: &'static str,
    /// The law.
    pub law: &'static str,
    /// Elements of the body.
    pub elements: usize,
    /// Assembly of forces and matrix.
    pub assemble: f64,
    /// Forces and tangent of the fast step.
    pub linearize: f64,
    /// Product with the tangent in the fast step.
    pub product: f64,
    /// An assembled step, solved to 1e-6.
    pub assembled_step: f64,
    /// A fast step, solved to 1e-6.
    pub fast_step: f64,
    /// Largest error of the assembled step's force against Newton's method, as a fraction of the largest force.
    pub assembled_error: f64,
    /// The same error of the fast step.
    pub fast_error: f64,
}

/// The laws of solids, with their names.
const SOLIDS: [(SolidLaw, &str); 4] = [
    (SolidLaw::Corotational, "corotational"),
    (SolidLaw::Linear, "linear"),
    (SolidLaw::StVenantKirchhoff, "St. Venant-Kirchhoff"),
    (SolidLaw::StableNeoHookean, "stable neo-Hookean"),
];

/// Length of a step (s).
const STEP: f64 = 0.01;

/// A body that is moved, and the extent of the measurement.
struct Task {
    kind: &'static str,
    law: &'static str,
    body: Body,
    /// The handle that moves.
    tool: usize,
    motion: Motion,
    /// Processor time for each part (s).
    time: f64,
}

pub(super) fn run(
    level: Level,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<KernelRow>, StudyError> {
    let (cells, steps, time) = match level {
        Level::Quick => (4, 15, 0.02),
        Level::Full => (8, 60, 0.2),
    };
    let mut tasks = Vec::new();
    for (quadratic, kind) in [(false, "linear tetrahedra"), (true, "quadratic tetrahedra")] {
        for (law, name) in SOLIDS {
            tasks.push(Task {
                kind,
                law: name,
                // The same number of nodes for both orders.
                body: cube_of(law, if quadratic { cells / 2 } else { cells }, quadratic)?,
                tool: TOP,
                motion: Motion::ramp(Vec3::z() * (-0.1 * EDGE), 0.5, 0.1, STEP).first(steps),
                time,
            });
        }
    }
    for (law, name) in [
        (None, "corotational"),
        (Some(SheetLawName::Corotational), "woven, corotational"),
        (
            Some(SheetLawName::StVenantKirchhoff),
            "woven, St. Venant-Kirchhoff",
        ),
    ] {
        let side = 3 * cells;
        tasks.push(Task {
            kind: "triangles",
            law: name,
            body: match law {
                None => sheets::body(side, side)?,
                Some(law) => sheets::woven(side, side, law)?,
            },
            tool: 1,
            motion: Motion::ramp(Vec3::x() * (0.1 * sheets::SIDE), 0.5, 0.1, STEP).first(steps),
            time,
        });
    }
    let mut rows = Vec::new();
    for (i, task) in tasks.iter().enumerate() {
        progress(i as f64 / tasks.len() as f64);
        rows.push(task.measure()?);
    }
    Ok(rows)
}

impl Task {
    fn measure(&self) -> Result<KernelRow, StudyError> {
        let [newton, assembled, fast] = [NEWTON, to(1e-6), frozen(1e-6)]
            .map(|method| drive(&self.body, self.tool, &self.motion, method));
        let (newton, assembled, fast) = (newton?, assembled?, fast?);
        let (linearize, product, assemble) = self.parts()?;
        let elements = self.body.element_count();
        let each = |time: f64| time / elements as f64;
        Ok(KernelRow {
            kind: self.kind,
            law: self.law,
            elements,
            assemble: each(assemble),
            linearize: each(linearize),
            product: each(product),
            assembled_step: each(assembled.median()),
            fast_step: each(fast.median()),
            assembled_error: assembled.error(&newton),
            fast_error: fast.error(&newton),
        })
    }

    /// Median times (s) of the linearization, of a product and of the assembly, at the end of the motion.
    fn parts(&self) -> Result<(f64, f64, f64), StudyError> {
        let mut body = self.body.clone();
        let options = StepperOptions {
            tolerance: 1e-6,
            sleep_speed: 0.0,
            ..StepperOptions::default()
        };
        let mut stepper = Stepper::<f64>::new(&body, options)?;
        let reports = (0..body.handle_count()).filter_map(|handle| body.handle_report(handle));
        let mut targets: Vec<HandlePose> = reports.map(|report| report.pose).collect();
        let start = targets[self.tool].position;
        for step in 0..self.motion.steps {
            targets[self.tool].position = start + self.motion.after(step);
            stepper.step(&mut body, STEP, &targets, || false)?;
        }
        let mut failed = Ok(());
        let mut repeated = |phase| {
            let (_, time) = median(self.time, || {
                if let Err(error) = stepper.repeat(phase) {
                    failed = Err(error);
                }
            });
            time
        };
        let (linearize, product) = (repeated(Phase::Linearize), repeated(Phase::Product));
        failed?;
        let (_, assemble) = median(self.time, || body.assemble());
        Ok((linearize, product, assemble))
    }
}
