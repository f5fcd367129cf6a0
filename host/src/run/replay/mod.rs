//! Replay: a logged run is run again and compared bit for bit. Device input, local models, times and the limits of the
//! devices come from the log.
//!
//! A replay is a [`Session`] of the scene, with the log in place of devices and host. It does not run the physics, because
//! the models come from the log. So a replay does not depend on the machine that computes it, and a
//! run under the real clock replays as a run under virtual time does. A log whose writer was killed replays up to its
//! last tick.
//!
//! A log is read twice, part by part ([`Recorded`]): first to see whether it has all that a replay needs, then to replay
//! it. A replay therefore takes the memory of a part of the log, however long the log is, and begins no file of its own
//! for a log that cannot be replayed.

mod chain;
mod compare;
mod waiting;

pub use chain::Chain;
pub use compare::{Difference, Field, Value};

use super::devices;
use super::observer::{Observed, Observers};
use super::prepare::{Timing, connect};
use super::session::Session;
use crate::atomic_file::AtomicFileError;
use crate::log::Log;
use crate::log::index::{IndexError, LogIndex};
use crate::record::{ContactStep, ModelRow, PatchRow, TOUCH, TickRow};
use crate::scene::{LoadedScene, Scene, SceneError};
use crate::world::World;
use rt_core::{Capabilities, MAX_BODIES, MAX_HANDLES, TickTime};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::io::{Read, Seek};
use waiting::Waiting;

/// Version of the JSON that `--json` writes.
pub const SCHEMA: &str = "palpate.replay/1";

/// Why a log cannot be replayed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The log cannot be read further.
    #[error(transparent)]
    Log(#[from] IndexError),
    /// Its scene cannot be built.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A file that the replay writes cannot be begun.
    #[error(transparent)]
    File(#[from] AtomicFileError),
    /// The log holds no ticks.
    #[error("the log has no ticks, so a replay is not possible")]
    Empty,
    /// The log begins in the middle of a run.
    #[error(
        "the log begins with tick {0}, in the middle of a run, and a replay begins with the first tick. Give the first file of \
         the run; a run whose first file was deleted to make room cannot be replayed"
    )]
    Middle(u64),
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
    /// The log lacks a patch.
    #[error(
        "the log lacks patch {sequence} of the tool of device {device}, which tick {tick} uses: the log's ring was full, and a \
         run whose patches are not all in the log cannot be replayed"
    )]
    MissingPatch {
        /// The first tick that uses the patch.
        tick: u64,
        /// Index of the device.
        device: usize,
        /// Number of the patch.
        sequence: u64,
    },
}

/// The place of the patches of the first device among the messages that wait: they follow those of the bodies.
const TOOLS: usize = MAX_BODIES;

/// A message that waits for its tick.
enum Message {
    Model(ModelRow),
    Patch(PatchRow),
}

/// A receiver of a part of a log.
pub type Seer<'a> = dyn FnMut(Part<'_>) -> Result<(), ReplayError> + 'a;

/// A part of a log.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a> {
    /// The local models.
    pub models: &'a [ModelRow],
    /// The patches of tools.
    pub patches: &'a [PatchRow],
    /// The contacts.
    pub contacts: &'a [ContactStep],
    /// The ticks.
    pub rows: &'a [TickRow],
}

/// A log that can be replayed.
pub trait Recorded {
    /// The facts that identify the run.
    fn facts(&self) -> &BTreeMap<String, String>;

    /// The limits of the devices as they were driven. A device without limits in the log has those of its profile.
    fn limits(&self) -> &[Capabilities];

    /// The text of the scene, and the files that it names.
    fn scene(&self) -> (&str, &BTreeMap<String, Vec<u8>>);

    /// Whether the log has its end.
    fn is_complete(&self) -> bool;

    /// Number of parts.
    fn parts(&self) -> usize;

    /// Gives `see` a part. No tick precedes, by parts, a model or a patch that it
    /// used, or the contacts of a step that it follows.
    ///
    /// # Errors
    /// [`ReplayError::Log`] if the part cannot be read; the error of `see`.
    fn part(&mut self, number: usize, see: &mut Seer<'_>) -> Result<(), ReplayError>;
}

/// A part is a chunk of the file: half a second, or a megabyte.
impl<R: Read + Seek> Recorded for &mut LogIndex<R> {
    fn facts(&self) -> &BTreeMap<String, String> {
        (**self).facts()
    }

    fn limits(&self) -> &[Capabilities] {
        (**self).limits()
    }

    fn scene(&self) -> (&str, &BTreeMap<String, Vec<u8>>) {
        ((**self).scene(), self.files())
    }

    fn is_complete(&self) -> bool {
        (**self).is_complete()
    }

    fn parts(&self) -> usize {
        self.chunk_count()
    }

    fn part(&mut self, number: usize, see: &mut Seer<'_>) -> Result<(), ReplayError> {
        let chunk = self.read_chunk(number)?;
        see(Part {
            models: chunk.records(),
            patches: chunk.records(),
            contacts: chunk.records(),
            rows: chunk.records(),
        })
    }
}

/// A log in memory has one part.
impl Recorded for &Log {
    fn facts(&self) -> &BTreeMap<String, String> {
        &self.facts
    }

    fn limits(&self) -> &[Capabilities] {
        &self.limits
    }

    fn scene(&self) -> (&str, &BTreeMap<String, Vec<u8>>) {
        (&self.scene, &self.files)
    }

    fn is_complete(&self) -> bool {
        self.complete
    }

    fn parts(&self) -> usize {
        1
    }

    fn part(&mut self, _number: usize, see: &mut Seer<'_>) -> Result<(), ReplayError> {
        see(Part {
            models: &self.models,
            patches: &self.patches,
            contacts: &self.contacts,
            rows: &self.rows,
        })
    }
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
/// [`ReplayError`] if this version does not take the scene, or the log is empty.
pub fn scene_of(mut log: impl Recorded, name: &str) -> Result<LoadedScene, ReplayError> {
    // This check comes first: a log whose writer was killed in its first moments has no scene either.
    let mut empty = true;
    for number in 0..log.parts() {
        log.part(number, &mut |part| {
            empty = part.rows.is_empty();
            Ok(())
        })?;
        if !empty {
            break;
        }
    }
    if empty {
        return Err(ReplayError::Empty);
    }
    let name = format!("{name} (its scene)");
    let (text, files) = log.scene();
    Ok(Scene::load_texts(&name, text, files)?)
}

/// Replays a log on a scene, usually its own ([`scene_of`]). `progress` is given the fraction done.
///
/// # Errors
/// [`ReplayError`] if the log lacks what a replay needs, or the scene cannot be built.
pub fn replay(
    log: impl Recorded,
    loaded: &LoadedScene,
    progress: &mut dyn FnMut(f64),
) -> Result<ReplayReport, ReplayError> {
    let done = replay_watched(log, loaded, &|| Ok(Observers::new()), progress);
    done.map(|(report, _)| report)
}

/// As `replay`. The observers that `begin` makes are given the telemetry of every replayed tick. Nothing is begun for a
/// log that cannot be replayed.
///
/// # Errors
/// As [`replay`]; also the error of `begin`.
pub fn replay_watched(
    mut log: impl Recorded,
    loaded: &LoadedScene,
    begin: &dyn Fn() -> Result<Observers, AtomicFileError>,
    progress: &mut dyn FnMut(f64),
) -> Result<(ReplayReport, Observed), ReplayError> {
    replay_any(&mut log, loaded, begin, progress)
}

fn replay_any(
    log: &mut dyn Recorded,
    loaded: &LoadedScene,
    begin: &dyn Fn() -> Result<Observers, AtomicFileError>,
    progress: &mut dyn FnMut(f64),
) -> Result<(ReplayReport, Observed), ReplayError> {
    let scene = &loaded.scene;
    let parts = log.parts();
    // The log is read twice.
    let mut done = |number: usize| progress(0.5 * number as f64 / parts.max(1) as f64);
    let ticks = check(log, &mut done)?;
    let (feeds, devices) = devices::replayed(loaded, log.limits());
    // At most one model per body and one record wait in the rings at a time. The scene may have fewer devices than the
    // scene of the log.
    let (tick, end, records) = connect(&World::new(loaded)?, devices, MAX_HANDLES, 0.0)?;
    // The times are those of the log.
    let mut session = Session::beside(end, (tick, records), Timing::default());
    let mut report = ReplayReport {
        schema: SCHEMA,
        scene: scene.name.clone(),
        facts: log.facts().clone(),
        complete: log.is_complete(),
        ticks,
        differing: 0,
        first: None,
    };
    let mut observers = begin()?;
    let mut in_use = Vec::new();
    let mut waiting = Waiting::default();
    for number in 0..parts {
        log.part(number, &mut |part| {
            let models = part.models.iter();
            waiting.extend(models.map(|model| (place(model), Message::Model(model.clone()))));
            let patches = part.patches.iter();
            waiting.extend(patches.map(|patch| (place_of(patch), Message::Patch(patch.clone()))));
            let mut contacts = part.contacts.iter().peekable();
            for row in part.rows {
                while let Some(step) = contacts.next_if(|step| step.tick <= row.tick) {
                    observers.touched(&mut step.clone());
                }
                session.host.drain(|_| ());
                for place in taken(row, &mut in_use) {
                    // The link refuses the model if this scene has no such body, and a patch if it has no such tool. The
                    // comparison then reports a difference.
                    let _ = match waiting.take(place) {
                        Some(Message::Model(model)) => session
                            .host
                            .publish(usize::from(model.body), &model.model()),
                        Some(Message::Patch(patch)) => {
                            let device = usize::from(patch.device);
                            session.host.publish_patch(device, &patch.patch())
                        }
                        None => Ok(()),
                    };
                }
                for (feed, reading) in feeds.iter().zip(&row.readings) {
                    // The session holds the device as long as the feed.
                    let _ = feed.send(reading.reading());
                }
                let time = TickTime {
                    now_ns: row.time_ns,
                    lateness_ns: row.lateness_ns,
                };
                let telemetry = session.tick_at(time, row.took_ns);
                session.records(|record| observers.take(record));
                let now = TickRow::from(&telemetry);
                if let Some(difference) = compare::first_difference(row, &now) {
                    report.differing += 1;
                    report.first.get_or_insert(difference);
                }
            }
            // Their tick is in the next part.
            for step in contacts {
                observers.touched(&mut step.clone());
            }
            waiting.bound();
            Ok(())
        })?;
        done(parts + number + 1);
    }
    Ok((report, observers.finish()))
}

/// Checks that the log holds every tick and every model that a tick used. Returns the number of ticks. `done` is given
/// the number of parts that were read.
fn check(log: &mut dyn Recorded, done: &mut dyn FnMut(usize)) -> Result<u64, ReplayError> {
    let mut expected = 0;
    let mut in_use = Vec::new();
    let mut waiting = Waiting::default();
    for number in 0..log.parts() {
        log.part(number, &mut |part| {
            waiting.extend(part.models.iter().map(|model| (place(model), ())));
            waiting.extend(part.patches.iter().map(|patch| (place_of(patch), ())));
            for row in part.rows {
                if expected == 0 && row.tick > 0 {
                    return Err(ReplayError::Middle(row.tick));
                }
                if row.tick != expected {
                    return Err(ReplayError::MissingTick {
                        expected,
                        found: row.tick,
                    });
                }
                expected += 1;
                for (place, sequence) in taken(row, &mut in_use) {
                    if waiting.take((place, sequence)).is_none() {
                        let tick = row.tick;
                        return Err(match place.checked_sub(TOOLS) {
                            None => ReplayError::MissingModel {
                                tick,
                                body: place,
                                sequence,
                            },
                            Some(device) => ReplayError::MissingPatch {
                                tick,
                                device,
                                sequence,
                            },
                        });
                    }
                }
            }
            waiting.bound();
            Ok(())
        })?;
        done(number + 1);
    }
    if expected == 0 {
        return Err(ReplayError::Empty);
    }
    Ok(expected)
}

/// Body and number of a model.
fn place(model: &ModelRow) -> (usize, u64) {
    (usize::from(model.body), model.head.sequence)
}

/// Place and number of a patch.
fn place_of(patch: &PatchRow) -> (usize, u64) {
    (TOOLS + usize::from(patch.device), patch.sequence)
}

/// The models and patches that a tick began to use, by place: those whose numbers differ from the numbers `in_use` before the
/// tick.
fn taken(row: &TickRow, in_use: &mut Vec<u64>) -> Vec<(usize, u64)> {
    let bodies = row.bodies.iter().map(|body| body.sequence).enumerate();
    let devices = row.touch.as_chunks::<TOUCH>().0.iter();
    let tools = devices.map(|[device, ..]| TOOLS + *device as usize);
    let now = bodies.chain(tools.zip(row.patches.iter().copied()));
    let mut taken = Vec::new();
    for (place, sequence) in now {
        if in_use.len() <= place {
            in_use.resize(place + 1, 0);
        }
        if std::mem::replace(&mut in_use[place], sequence) != sequence {
            taken.push((place, sequence));
        }
    }
    taken
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
