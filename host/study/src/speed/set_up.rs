//! The cost of a frozen path in addition to its steps: its memory, the time before the steps, and the time beside them.

use super::clock::cpu_time;
use super::path::Method;
use crate::StudyError;
use physics::{Body, Phase, Precision, Stepper, StepperOptions};
use serde::Serialize;

/// The cost of one stepper.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SetUp {
    /// Memory (bytes).
    pub bytes: usize,
    /// Time until the first step (s): for the memory and the first factor.
    pub time: f64,
    /// Time of a new factor (s).
    pub refresh: f64,
}

fn measure<T: Precision>(
    body: &Body,
    h: f64,
    options: StepperOptions,
) -> Result<SetUp, StudyError> {
    let start = cpu_time();
    let mut stepper = Stepper::<T>::new(body, options)?;
    stepper.prepare(body, h)?;
    let ready = cpu_time();
    stepper.repeat(Phase::Refresh)?;
    Ok(SetUp {
        bytes: stepper.bytes(),
        time: ready - start,
        refresh: cpu_time() - ready,
    })
}

/// The cost of `method` for steps of `h` seconds; none if the method is not a frozen one.
pub(super) fn set_up(method: Method, body: &Body, h: f64) -> Result<Option<SetUp>, StudyError> {
    let Method::Frozen {
        preconditioner,
        single,
        ..
    } = method
    else {
        return Ok(None);
    };
    let options = StepperOptions {
        preconditioner,
        ..StepperOptions::default()
    };
    Ok(Some(if single {
        measure::<f32>(body, h, options)?
    } else {
        measure::<f64>(body, h, options)?
    }))
}
