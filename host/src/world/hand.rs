//! Builds a simulated hand from the hand of a scene.

use crate::scene::spec::{self, TaskName};
use crate::scene::{LoadedScene, SceneError};
use rt_core::Vec3;
use sim::hand::Press;
use sim::trajectory::{Sine, TrajectoryError};
use sim::{Hand, Task, TaskError, Trace, Trajectory, Tremor};
use std::fmt::Display;

/// Time over which a hand's sinusoids fade in (s).
const FADE_IN: f64 = 0.5;

/// The error of a part of the hand that holds the device number `index`.
fn refuse(loaded: &LoadedScene, index: usize, part: &str, error: &dyn Display) -> SceneError {
    let field = format!("device[{index}].hand.{part}");
    loaded.source.problem(&field, error.to_string())
}

/// The seed of the hand that holds the device number `index`. Each hand has its own tremor and variation: the device's number makes the
/// seed distinct. The hands beyond the fourth are told apart by the highest bits, so that the others keep their motions.
fn own_seed(index: usize, seed: u64) -> u64 {
    let (low, high) = (index as u64 % 4, index as u64 / 4);
    seed.wrapping_mul(4).wrapping_add(low) ^ (high << 62)
}

/// Along minimum-jerk segments through rows of time, x, y, z.
fn along(rows: &[[f64; 4]]) -> Result<Trajectory, TrajectoryError> {
    let points = rows.iter().map(|[t, x, y, z]| (*t, Vec3::new(*x, *y, *z)));
    Trajectory::new_waypoints(&points.collect::<Vec<_>>())
}

/// The displacements (m) and the turns (rotation vectors, rad) to which the hand that holds the device number `index` aims, in device axes;
/// `None` if the scene gives the device no hand.
///
/// # Errors
/// [`SceneError`], naming the file, line and field that no hand can follow.
pub(super) fn aims(
    loaded: &LoadedScene,
    index: usize,
    seed: u64,
) -> Result<Option<[Trajectory; 2]>, SceneError> {
    let Some(spec) = &loaded.scene.devices[index].hand else {
        return Ok(None);
    };
    let refuse = |part: &str, e: &dyn Display| refuse(loaded, index, part, e);
    let mut parts = Vec::new();
    if let Some(name) = spec.task {
        // Hands that move together use the run's seed alone.
        let seed = match name {
            TaskName::MoveTogether => seed,
            _ => own_seed(index, seed),
        };
        let path = task(spec, name).trajectory(seed);
        parts.push(path.map_err(|e| refuse(wrong_field(&e), &e))?);
    }
    if !spec.waypoints.is_empty() {
        parts.push(along(&spec.waypoints).map_err(|e| refuse("waypoints", &e))?);
    }
    if !spec.sines.is_empty() {
        let sines: Vec<_> = spec
            .sines
            .iter()
            .map(|s| Sine {
                amplitude: Vec3::from(s.amplitude),
                frequency: s.frequency,
                phase: s.phase,
            })
            .collect();
        parts.push(Trajectory::new_sines(&sines, FADE_IN).map_err(|e| refuse("sines", &e))?);
    }
    if let Some(Some(samples)) = loaded.recordings.get(index) {
        let samples: Vec<_> = samples.iter().map(|(t, p)| (*t, Vec3::from(*p))).collect();
        parts.push(Trajectory::new_recorded(&samples).map_err(|e| refuse("recording", &e))?);
    }
    let turns = if spec.turns.is_empty() {
        Trajectory::still()
    } else {
        along(&spec.turns).map_err(|e| refuse("turns", &e))?
    };
    Ok(Some([Trajectory::new_sum(parts), turns]))
}

/// The hand that holds the device number `index`; `None` if the scene gives the device no hand.
///
/// # Errors
/// As [`aims`]; also a tremor that no hand has.
pub(crate) fn build(
    loaded: &LoadedScene,
    index: usize,
    seed: u64,
) -> Result<Option<Hand>, SceneError> {
    let aims = aims(loaded, index, seed)?;
    let (Some(spec), Some([path, turns])) = (&loaded.scene.devices[index].hand, aims) else {
        return Ok(None);
    };
    let presses = spec.presses.iter().map(|press| Press {
        // The scene counts buttons from one, up to sixteen.
        button: press.button.saturating_sub(1) as u8,
        from: press.from,
        to: press.to,
    });
    let traces = spec.traces.iter().map(|trace| Trace {
        from: trace.from,
        to: trace.to,
        direction: trace.direction.into(),
        heading: trace.heading.into(),
        force: trace.force,
        speed: trace.speed,
    });
    let mut hand = Hand::new(path)
        .with_presses(presses.collect())
        .with_traces(traces.collect())
        .with_arm(spec.arm())
        .with_wrist(spec.wrist());
    if !spec.turns.is_empty() {
        hand = hand.with_turns(turns);
    }
    if spec.tremor > 0.0 {
        let tremor = Tremor::new(spec.tremor, own_seed(index, seed));
        let tremor = tremor.map_err(|e| refuse(loaded, index, "tremor", &e))?;
        return Ok(Some(hand.with_tremor(tremor)));
    }
    Ok(Some(hand))
}

/// The task with the scene's numbers in place of the usual ones.
fn task(spec: &spec::Hand, name: TaskName) -> Task {
    // The consistency of the scene was checked before: a task has a direction.
    let direction = Vec3::from(spec.direction.unwrap_or_default());
    let usual = Task::new(name.kind(), direction);
    Task {
        depth: spec.depth.unwrap_or(usual.depth),
        speed: spec.speed.unwrap_or(usual.speed),
        pause: spec.pause.unwrap_or(usual.pause),
        width: spec.width.unwrap_or(usual.width),
        frequency: spec.frequency.unwrap_or(usual.frequency),
        variation: spec.variation.unwrap_or(usual.variation),
        ..usual
    }
}

/// The field that a task's error concerns.
fn wrong_field(error: &TaskError) -> &'static str {
    match error {
        TaskError::Direction { .. } => "direction",
        TaskError::Number { field, .. } => field,
        TaskError::TooFast { .. } => "speed",
        TaskError::Trajectory(_) => "task",
    }
}
