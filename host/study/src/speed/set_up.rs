//! What a frozen path takes beside its steps: memory, and time before them and beside them.

use super::clock::cpu_time;
use super::path::Method;
use crate::StudyError;
use physics::{Body, Part, Real, Stepper, StepperOptions};
use serde::Serialize;

/// What one stepper takes.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SetUp {
    /// Memory that it holds (bytes).
    pub bytes: usize,
    /// Until it can step (s): its memory, and the first factor.
    pub time: f64,
    /// A new factor (s).
    pub refresh: f64,
}

fn measure<T: Real>(body: &Body, h: f64, options: StepperOptions) -> Result<SetUp, StudyError> {
    let start = cpu_time();
    let mut stepper = Stepper::<T>::new(body, options)?;
    stepper.prepare(body, h)?;
    let ready = cpu_time();
    stepper.repeat(Part::Refresh)?;
    Ok(SetUp {
        bytes: stepper.bytes(),
        time: ready - start,
        refresh: cpu_time() - ready,
    })
}

/// What `method` takes for steps of `h` seconds; nothing where it is not a frozen one.
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
