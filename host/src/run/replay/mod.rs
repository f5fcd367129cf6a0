//! Replay: a logged run is run again and compared bit for bit. Device input, local models and times come from the
//! log.
//!
//! A replay runs the tick: the same [`TickLoop`] on the controller that the scene describes. It does not run the
//! physics, because the models come from the log. So a replay does not depend on the machine that computes it, and a
//! run under the real clock replays as a run under virtual time does. A log whose writer was killed replays up to its
//! last tick.

mod compare;

pub use compare::{Difference, Field, Part, Value};

use super::observer::{Observed, Observers};
use super::{devices, setup};
use crate::atomic_file::AtomicFileError;
use crate::log::{Log, LoggedReading, ModelRow, TickRow};
use crate::scene::{LoadedScene, Scene, SceneError};
use rt_core::{Controller, TickTime};
use runner::link::{LinkConfig, LogRecord, link};
use runner::tick_loop::TickLoop;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

/// Version of the JSON that `--json` writes.
pub const SCHEMA: &str = "palpate.replay/1";

/// Why a log cannot be replayed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// Its scene cannot be built.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A file that the replay writes cannot be begun.
    #[error(transparent)]
    File(#[from] AtomicFileError),
    /// The log holds no ticks.
    #[error("the log has no ticks, so a replay is not possible")]
    Empty,
    /// The log lacks a tick.
    #[error(
        "the log lacks tick {expected} and continues with tick {found}: the log's ring was full, and a run whose \
         readings are not all in the log cannot be replayed"
    )]
    MissingTick {
        /// The tick that is missing.
        expected: u64,
        /// The tick that the log holds next.
        found: u64,
    },
    /// The log lacks a model.
    #[error(
        "the log lacks model {sequence} of body {body}, which tick {tick} uses: the log's ring was full, and a run \
         whose models are not all in the log cannot be replayed"
    )]
    MissingModel {
        /// The first tick that uses the model.
        tick: u64,
        /// Index of the body.
        body: usize,
        /// Number of the model.
        sequence: u64,
    },
}

/// The result of a replay.
#[derive(Clone, Debug, Serialize)]
pub struct ReplayReport {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Name of the scene.
    pub scene: String,
    /// The facts that the log states about its run: clock, seed, version and others.
    pub facts: BTreeMap<String, String>,
    /// Whether the log is complete. Of an incomplete log, the ticks that it holds were replayed.
    pub complete: bool,
    /// Ticks replayed.
    pub ticks: u64,
    /// Ticks that differ in any field.
    pub differing: u64,
    /// The first differing field of the first differing tick.
    pub first: Option<Difference>,
}

impl ReplayReport {
    /// Whether every bit of every tick is as logged.
    pub fn is_exact(&self) -> bool {
        self.differing == 0
    }
}

/// The scene that a log contains.
///
/// # Errors
/// [`ReplayError`] where this version does not take the scene, or the log is empty.
pub fn scene_of(log: &Log, name: &str) -> Result<LoadedScene, ReplayError> {
    // This check comes first: a log whose writer was killed in its first moments has no scene either.
    if log.rows.is_empty() {
        return Err(ReplayError::Empty);
    }
    let name = format!("{name} (its scene)");
    Ok(Scene::load_texts(&name, &log.scene, &log.files)?)
}

/// Replays a log on a scene, usually its own ([`scene_of`]). `progress` is given the fraction done.
///
/// # Errors
/// [`ReplayError`] where the log lacks what a replay needs, or the scene cannot be built.
pub fn replay(
    log: &Log,
    loaded: &LoadedScene,
    progress: impl FnMut(f64),
) -> Result<ReplayReport, ReplayError> {
    let done = replay_watched(log, loaded, || Ok(Observers::new()), progress);
    done.map(|(report, _)| report)
}

/// As `replay`. The observers that `begin` makes are given the telemetry of every replayed tick. Nothing is begun for a
/// log that cannot be replayed.
///
/// # Errors
/// As [`replay`]; also the error of `begin`.
pub fn replay_watched(
    log: &Log,
    loaded: &LoadedScene,
    begin: impl FnOnce() -> Result<Observers, AtomicFileError>,
    mut progress: impl FnMut(f64),
) -> Result<(ReplayReport, Observed), ReplayError> {
    let scene = &loaded.scene;
    let models = check(log)?;
    let readings = (0..scene.devices.len()).map(|index| {
        let readings = log.rows.iter().filter_map(|row| row.readings.get(index));
        readings.map(LoggedReading::reading).collect()
    });
    let devices = devices::replayed(loaded, readings.collect())?;
    let config = setup::controller(loaded, &devices)?;
    // At most one model per body and one record wait in the rings at a time.
    let (end, mut host, _) = link(&LinkConfig {
        bodies: scene.bodies.len(),
        stall: 0.0,
        ..LinkConfig::new(scene.realtime.rate, scene.host.publish_rate)
    });
    let mut tick = TickLoop::new(Controller::new(&config), devices, end);

    let mut report = ReplayReport {
        schema: SCHEMA,
        scene: scene.name.clone(),
        facts: log.facts.clone(),
        complete: log.complete,
        ticks: log.rows.len() as u64,
        differing: 0,
        first: None,
    };
    let mut observers = begin()?;
    let mut in_use = Vec::new();
    for (row, number) in log.rows.iter().zip(0_u64..) {
        for (body, sequence) in taken(row, &mut in_use) {
            if let Some(model) = models.get(&(body, sequence)) {
                // The link refuses the model if this scene has no such body. The comparison then reports a
                // difference.
                let _ = host.publish(body, &model.model());
            }
        }
        let telemetry = tick.timed(
            TickTime {
                now_ns: row.time_ns,
                lateness_ns: row.lateness_ns,
            },
            || row.took_ns,
        );
        observers.take(LogRecord::Tick(&telemetry));
        let now = TickRow::from(&telemetry);
        host.drain(|_| ());
        if let Some(difference) = compare::first_difference(row, &now) {
            report.differing += 1;
            report.first.get_or_insert(difference);
        }
        if number % 256 == 0 {
            progress(number as f64 / report.ticks as f64);
        }
    }
    Ok((report, observers.finish()))
}

/// Checks that the log holds every tick and every model that a tick used. Returns the models by body and number.
fn check(log: &Log) -> Result<BTreeMap<(usize, u64), &ModelRow>, ReplayError> {
    if log.rows.is_empty() {
        return Err(ReplayError::Empty);
    }
    let models: BTreeMap<_, _> = log
        .models
        .iter()
        .map(|model| ((usize::from(model.body), model.sequence), model))
        .collect();
    let mut in_use = Vec::new();
    for (row, expected) in log.rows.iter().zip(0..) {
        if row.tick != expected {
            return Err(ReplayError::MissingTick {
                expected,
                found: row.tick,
            });
        }
        for (body, sequence) in taken(row, &mut in_use) {
            if !models.contains_key(&(body, sequence)) {
                return Err(ReplayError::MissingModel {
                    tick: row.tick,
                    body,
                    sequence,
                });
            }
        }
    }
    Ok(models)
}

/// The models that a tick began to use, by body: those whose numbers differ from the numbers `in_use` before the
/// tick.
fn taken(row: &TickRow, in_use: &mut Vec<u64>) -> Vec<(usize, u64)> {
    in_use.resize(row.bodies.len(), 0);
    let bodies = row.bodies.iter().zip(in_use).enumerate();
    bodies
        .filter(|(_, (now, before))| now.sequence != **before)
        .map(|(body, (now, before))| {
            *before = now.sequence;
            (body, now.sequence)
        })
        .collect()
}

impl fmt::Display for ReplayReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let fact = |name: &str| self.facts.get(name).map_or("unknown", String::as_str);
        writeln!(
            f,
            "{}: replay of a run under the {} clock, seed {}, by version {} on {}",
            self.scene,
            fact("clock"),
            fact("seed"),
            fact("version"),
            fact("instructions")
        )?;
        if !self.complete {
            writeln!(
                f,
                "  note       the log has no end, because its writer was killed; the replay covers the ticks of the log"
            )?;
        }
        match &self.first {
            None => writeln!(f, "  {} ticks reproduced exactly", self.ticks),
            Some(first) => writeln!(
                f,
                "  {first}\n  {} of {} ticks differ",
                self.differing, self.ticks
            ),
        }
    }
}
